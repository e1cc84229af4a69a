"""Lobes of a leaf: other ends of it that look as a stalk does. A leaf has one stalk, and lobes several alike."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.leaf.chart.stalk.point_ways import PointWays
from o3dleaf.leaf.chart.stalk.sections import sections_along

OTHERS = 2
"""Ends that look like the stalk from which on it is a lobe itself: a palmate leaf has three and more. One is no sign:
many a blade ends in a tip that is as narrow as its stalk for a while."""
OUTER = 0.5
"""Of the stalk's length, over which an end is compared with it."""
COMMON = 0.5
"""Of its distance, that an end has its way in common with others, at most. From the base of one finger the ways to all
others begin alike; two places of one round margin have more in common: a broad blade's side and its tip 0.7."""
WIDTHS, DEPTHS = 2.0, 0.25
"""Times wider or narrower that what is alike is at most, and how far its depths over widths differ."""


class Profile(NamedTuple):
    """Of a stretch from an end of a leaf: the median width of its sections, and their median depth over that."""

    width: float
    curled: float

    def resembles(self, other: "Profile") -> bool:
        """Return whether another stretch could be one of several lobes together with this."""
        alike = self.width <= WIDTHS * other.width and other.width <= WIDTHS * self.width
        return alike and abs(self.curled - other.curled) <= DEPTHS


def is_one_of_several(ways: PointWays, stalk: BoolArray, distance: FloatArray, noise: float) -> bool:
    """Return whether a stalk that was found has its like among the other ends of the leaf.

    Parameters
    ----------
    ways : PointWays
        Of n points.
    stalk : (n,) ndarray of bool
        The points of what would be cut off.
    distance : (n,) ndarray
        From its end.
    noise : float
        Standard deviation of the points across the surface.
    """
    rest = np.flatnonzero(~stalk)
    if not stalk.any() or not len(rest):
        return False
    length = float(distance[stalk].max())
    own = _profile(ways, distance, length, noise)
    base = int(rest[distance[rest].argmin()])
    alike = 0
    for end, away in ways.ends_from(base, COMMON, stalk):
        if away < OUTER * length:
            break
        alike += _profile(ways, ways.from_point(end), length, noise).resembles(own)
        if alike >= OTHERS:
            return True
    return False


def _profile(ways: PointWays, distance: FloatArray, length: float, noise: float) -> Profile:
    """Return the profile of the outer part of a stretch of such a length, at `distance` (n,) from its end."""
    near = distance <= OUTER * length
    sections = sections_along(ways.points[near], ways.cells[near], distance[near], noise)
    width = float(np.median(sections.width))
    depth = float(np.median(sections.depth))
    return Profile(width, depth / max(width, np.finfo(float).tiny))
