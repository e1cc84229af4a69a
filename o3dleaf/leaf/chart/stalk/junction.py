"""The junction of stalk and blade: the likeliest end of what is as wide as the stalk, and lies as its points do."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.leaf.chart.stalk.kink_cost import REACH, inside_cost, outside_cost
from o3dleaf.leaf.chart.stalk.stalk_points import BEFORE, StalkLine, StalkPoints, line_along
from o3dleaf.leaf.chart.stalk.stretches import StalkStretch
from o3dleaf.surface.cloud.surfels import thinned

STRETCH = 3.0
"""Widths of the stalk before the junction whose middles tell its direction, at most."""
SURE = 0.6
"""Widths before the end of the narrow stretch up to which it is stalk at first sight: what follows may have widened."""
INSIDE = 2.0
"""Widths past the narrow stretch in which the blade shows which way is across."""
AROUND = 4.0
"""Widths past the narrow stretch that are looked at, at most."""
HALF_SLAB = 0.75
"""Spacings on either side of a section, whose points it has: two or three on a stalk as wide as two spacings."""
FINE = 0.25
"""Spacings between sections."""
GAP = 3.0
"""Spacings between neighbors in a section beyond which it ends: a lobe beside the stalk is not part of it."""
WIDENED = 1.5
"""Times the stalk's width from which at first sight the blade has begun."""
SEARCHED = 1.5
"""Widths to either side of the first sight within which the end is looked for."""
STEP = (0.125, 1 / 48)
"""Between the ends that are tried: in spacings and in widths, the larger."""
ACROSS = 16
"""Spacings across a stalk that are enough: of closer points some are left out."""
ROUNDS = 3
"""Of finding the end anew, with the stalk as long as the end before has it."""


class Junction(NamedTuple):
    """The end of a stalk.

    Attributes
    ----------
    place : (3,) ndarray
        The middle of the section where the blade begins.
    along : (3,) ndarray
        Unit direction of the stalk there, towards the blade.
    width : float
        Of the stalk, straight across it.
    """

    place: FloatArray
    along: FloatArray
    width: float

    def reach(self, points: FloatArray, distance: FloatArray) -> float:
        """Return the distance at which the blade begins, for (n, 3) points at `distance` (n,) from the stalk's end."""
        away = np.linalg.norm(points - self.place, axis=1)
        return float(np.median(distance[away <= max(self.width, float(away.min()))]))

    def outside(self, points: FloatArray, distance: FloatArray) -> BoolArray:
        """Return which (n,) points, at `distance` (n,) from its end, are stalk, or lie outside it.

        They are those before the plane across it, but lobes of the blade that reach back beside it.
        """
        before = (points - self.place) @ self.along < 0
        return np.asarray(before & (distance <= self.reach(points, distance) + self.width / 2))


class _Frame(NamedTuple):
    origin: FloatArray
    axes: FloatArray


def find_junction(
    points: FloatArray, distance: FloatArray, stretch: StalkStretch, spacing: float, noise: float
) -> Junction | None:
    """Return where a stalk widens into the blade; None if too few points show it.

    Parameters
    ----------
    points : (n, 3) ndarray
    distance : (n,) ndarray
        Along the leaf from the stalk's end; not finite where there is no way.
    stretch : StalkStretch
        Of the stalk, roughly.
    spacing, noise : float
        1/√(points per unit area) and the standard deviation across the surface.
    """
    first = max(stretch.first + stretch.width / 2, stretch.last - (BEFORE + SURE) * stretch.width)
    near = np.flatnonzero((distance >= first) & (distance <= stretch.last + AROUND * stretch.width))
    fewer = max(1, int((stretch.width / (ACROSS * spacing)) ** 2))
    near = near[thinned(len(near), fewer)]
    spacing = spacing * float(np.sqrt(fewer))
    frame = _frame(points[near], distance[near], stretch)
    if frame is None:
        return None
    at, aside, above = frame.axes @ (points[near] - frame.origin).T
    local = StalkPoints(at, aside, above, distance[near] - stretch.last - at, spacing, noise)
    sure = float(local.at[distance[near] <= stretch.last - SURE * stretch.width].max())
    seen = _first_sight(local, sure)
    if seen is None:
        return None
    end, line = _settle(local, *seen)
    if line is None:
        return Junction(frame.origin + end * frame.axes[0], frame.axes[0], seen[1])
    middle = np.array([end, np.polyval(line.aside, end), np.polyval(line.above, end)])
    along = np.array([1.0, line.aside[0], line.above[0]]) @ frame.axes
    return Junction(frame.origin + middle @ frame.axes, along / np.linalg.norm(along), line.width)


def _frame(points: FloatArray, distance: FloatArray, stretch: StalkStretch) -> _Frame | None:
    """Return the frame at the end of a stretch: along its middles, and across as the blade lies after it."""
    clear = (distance >= stretch.last - STRETCH * stretch.width) & (distance <= stretch.last - SURE * stretch.width)
    inside = (distance > stretch.last) & (distance <= stretch.last + INSIDE * stretch.width)
    if clear.sum() < 4 or inside.sum() < 4:
        return None
    terms = np.column_stack([np.ones(clear.sum()), distance[clear] - stretch.last])
    origin, slope = np.linalg.lstsq(terms, points[clear], rcond=None)[0]
    along = slope / np.linalg.norm(slope)
    off = points[inside] - points[inside].mean(axis=0)
    off -= np.outer(off @ along, along)
    across = np.linalg.eigh(off.T @ off)[1][:, 2]
    return _Frame(origin, np.stack([along, across, np.cross(along, across)]))


def _first_sight(points: StalkPoints, sure: float) -> tuple[float, float] | None:
    """Return about where sections become wider than before `sure`, and how wide they were; None if they do not."""
    places = np.arange(points.at.min(), points.at.max(), FINE * points.spacing)
    widths = np.array([_section_width(points, place) for place in places])
    known = np.isfinite(widths)
    places, widths = places[known], widths[known]
    if not (places <= sure).any():
        return None
    width = float(np.median(widths[places <= sure]))
    wide = np.flatnonzero((widths > WIDENED * width) & (places > sure))
    return (float(places[wide[0]]) - width / 4, width) if len(wide) else None


def _section_width(points: StalkPoints, place: float) -> float:
    """Return the width of the section at a place, of what hangs together about its middle; NaN for too few points."""
    row = np.sort(points.aside[np.abs(points.at - place) <= HALF_SLAB * points.spacing])
    parts = np.split(row, np.flatnonzero(np.diff(row) > GAP * points.spacing) + 1)
    middle = min(parts, key=lambda part: float(np.abs(part).min(initial=np.inf)))
    return float(np.ptp(middle)) if len(middle) > 2 else np.nan


def _settle(points: StalkPoints, end: float, width: float) -> tuple[float, StalkLine | None]:
    """Return the likeliest end near one at first sight, and the stalk's line; none where its points do not show it."""
    first, found = end, None
    for _ in range(ROUNDS):
        line = line_along(points, end, width)
        if line is None or not width / WIDENED <= line.width <= WIDENED * width:
            return (end, found) if found is not None else (first, None)
        before, end = end, _likeliest(line.straightened(points), line, end)
        end = float(np.clip(end, first - SEARCHED * width, first + SEARCHED * width))
        found = line
        if abs(end - before) <= STEP[0] * points.spacing:
            break
    return end, found


def _likeliest(points: StalkPoints, line: StalkLine, end: float) -> float:
    """Return the likeliest end of a stalk about `end`, of points with its line as their first axis."""
    width, spacing = line.width, points.spacing
    limits = float(points.at[line.piece].min()), end + REACH * width
    step = max(STEP[0] * spacing, STEP[1] * width)
    places = np.arange(end - SEARCHED * width, end + SEARCHED * width, step)
    # What was come to through the blade is a lobe beside the stalk.
    detour = points.detour - np.median(points.detour[line.piece])
    whole = (detour <= np.abs(points.aside) + width / 2 + spacing) | line.piece
    held = whole & (points.at >= limits[0]) & (points.at < limits[1])
    rest = points.of(held)
    lines = line._replace(piece=line.piece[held])
    cost = inside_cost(points, line, places, limits, whole)
    for left in (False, True):
        cost = cost + outside_cost(rest, lines, places, limits[1], left=left)
    return float(places[np.argmin(cost)])
