"""The points about the end of a stalk in its own frame: along it, across it in the blade's plane, and above that."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray

FLAT, TUBE = 12.0, 8.0
"""Square of the width of a strip, and of the diameter of a tube or half of one, over the variance of points across."""
HALF_TUBE = 0.43
"""Standard deviation of half a tube's points above over that across; of a whole one 1, of a strip 0."""
BEFORE, CLEAR = 4.0, 0.3
"""Widths before the end of a stalk between which its points tell its direction and width."""
ASIDE = 0.75
"""Widths from the middle of a stalk within which a point may be its own."""
FEWEST = 8
"""Points of a stalk that its direction is found from, at least."""


class StalkPoints(NamedTuple):
    """Points about the end of a stalk.

    Attributes
    ----------
    at, aside, above : (n,) ndarrays
        Along the stalk towards the blade, across it, and above the plane of both.
    detour : (n,) ndarray
        How much longer their way from the stalk's end is than the straight one along it: a point beside it that was
        come to through the blade has more than its distance from the middle.
    spacing, noise : float
        1/√(points per unit area) and the standard deviation across the surface.
    """

    at: FloatArray
    aside: FloatArray
    above: FloatArray
    detour: FloatArray
    spacing: float
    noise: float

    def of(self, some: BoolArray) -> "StalkPoints":
        """Return some of the points."""
        return self._replace(at=self.at[some], aside=self.aside[some], above=self.above[some], detour=self.detour[some])


class StalkLine(NamedTuple):
    """The straight line along the middle of a stalk's last piece, and that piece.

    Attributes
    ----------
    aside, above : (2,) ndarrays
        Slope and intercept.
    width : float
        Straight across, without the noise.
    piece : (n,) ndarray of bool
        Which of the points make it.
    """

    aside: FloatArray
    above: FloatArray
    width: float
    piece: BoolArray

    def straightened(self, points: StalkPoints) -> StalkPoints:
        """Return the points with the line as their first axis."""
        return points._replace(
            aside=points.aside - np.polyval(self.aside, points.at),
            above=points.above - np.polyval(self.above, points.at),
        )


def line_along(points: StalkPoints, end: float, width: float) -> StalkLine | None:
    """Return the line of a stalk before its `end`, about `width` wide; None if too few points show it."""
    first = max(float(points.at.min()) + width / 2, end - BEFORE * width)
    before = (points.at > first) & (points.at < end - CLEAR * width)
    piece = before & (np.abs(points.aside) <= ASIDE * width)
    for _ in range(2):
        if piece.sum() < FEWEST:
            return None
        at = points.at[piece]
        aside, above = np.polyfit(at, points.aside[piece], 1), np.polyfit(at, points.above[piece], 1)
        off = points.aside - np.polyval(aside, points.at)
        piece = before & (np.abs(off) <= ASIDE * width)
    if piece.sum() < FEWEST:
        return None
    across, over = off[piece].var() - points.noise**2, (points.above - np.polyval(above, points.at))[piece].var()
    if not across > 0:
        return None
    curled = min(float(np.sqrt(max(over - points.noise**2, 0.0) / across)) / HALF_TUBE, 1.0)
    return StalkLine(aside, above, float(np.sqrt((FLAT + curled * (TUBE - FLAT)) * across)), piece)
