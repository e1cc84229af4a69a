"""The midrib in the chart: mid-way between the margins at every station, from the middle of the base to the tip."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.chart.axis.ends import long_axis, slice_axis, symmetry_axis
from o3dleaf.leaf.chart.axis.sections import (
    cut_across,
    end_width,
    fill_bays,
    leave_along,
    normals_of,
    outline_of,
    reached,
    resample,
    smooth_curve,
    within,
)
from o3dleaf.leaf.chart.flattening.geodesics import Ways
from o3dleaf.leaf.chart.flattening.sheet_shape import place_of, require_sheet, rim_first
from o3dleaf.leaf.chart.flattening.stretch import chart_areas

STATIONS_PER_WIDTH = 8
STATIONS = (40, 600)
"""Of the curve, least and most; eight a width show every bend that a blade's margins can have."""
STIFFNESS = 16.0
"""Of the curve, against the middles of sections an eighth of a width apart: it follows what is longer than a width or
two, and neither teeth nor lobes."""
ROUNDS = 16
AT_REST = 0.003
"""Share of the width that the curve may still move when it has come to rest."""
WIDER = 1.25
"""Times the other that an end's fifth is wide to be the base by that; less is a tie, and the lower end is the base."""


@dataclass(frozen=True, eq=False)
class Midline:
    """The midrib of a blade in its chart.

    Attributes
    ----------
    curve : (k, 2) ndarray
        Points at equal steps from base to tip.
    widths : (k,) ndarray
        Lengths of the sections across it, from margin to margin, holes counted in.
    base, tip : (2,) ndarray
        Its ends, on the outline.
    notes : tuple of str
        How base and tip were told apart.
    """

    curve: FloatArray
    widths: FloatArray
    base: FloatArray
    tip: FloatArray
    notes: tuple[str, ...] = field(default=())

    @property
    def length(self) -> float:
        """Length of the curve."""
        return float(reached(self.curve)[-1])

    @property
    def width(self) -> float:
        """Width of the blade where it is widest, single stations apart."""
        return float(np.quantile(self.widths, 0.95))


def find_midline(
    vertices: FloatArray,
    triangles: IntArray,
    chart: FloatArray,
    *,
    base: FloatArray | None = None,
    junction: FloatArray | None = None,
) -> Midline:
    """Return the midrib of a blade in its chart.

    An axis is moved, station by station, to the middle between the margins until it rests, and goes on straight to the
    outline at either end: to the middle of a cut base, into a sharp tip.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
        The sheet without its petiole.
    chart : (n, 2) ndarray
    base : (3,) ndarray, optional
        A point of the world near the base.
    junction : (3,) ndarray, optional
        The middle of the section at which a petiole was cut off: the base, exactly.
    """
    rim = rim_first(require_sheet(vertices, triangles))[0]
    margin, ways = outline_of(chart, rim), Ways(chart, triangles)
    outline = fill_bays(margin)
    area = np.abs(chart_areas(chart, triangles))
    if junction is not None:
        start = _on_rim(vertices, chart, rim, junction)
        curve, fixed = _from_start(outline, ways, area, start), True
    else:
        curve, fixed = _unknown_base(outline, ways, area), False
    curve = _settle(outline, curve, fixed=fixed)
    if fixed:
        notes = ["the base is where the petiole was cut off"]
    else:
        curve, note = _from_base(vertices, chart, outline, curve, base)
        notes = [note]
    curve = resample(within(margin, curve), len(curve))
    _, widths = cut_across(margin, curve, normals_of(curve))
    return Midline(curve, widths, curve[0], curve[-1], tuple(notes))


def _on_rim(vertices: FloatArray, chart: FloatArray, rim: IntArray, point: FloatArray) -> FloatArray:
    """Return the place in the chart of the rim's vertex nearest to a point of the world."""
    return np.asarray(chart[rim[np.argmin(np.linalg.norm(vertices[rim] - point, axis=1))]])


def _from_start(outline: Any, ways: Ways, area: FloatArray, start: FloatArray) -> FloatArray:
    """Return the first axis of a blade whose base is known."""
    nearest = int(np.argmin(np.linalg.norm(ways.vertices - start, axis=1)))
    far = float(ways.from_vertex(nearest).max())
    if far**2 >= 2 * area.sum():
        return slice_axis(ways, area, nearest)
    return symmetry_axis(outline, start)


def _unknown_base(outline: Any, ways: Ways, area: FloatArray) -> FloatArray:
    """Return the first axis of a blade whose ends are known by its shape alone."""
    axis = long_axis(ways, area)
    return symmetry_axis(outline) if axis is None else axis


def _settle(outline: Any, curve: FloatArray, *, fixed: bool) -> FloatArray:
    """Return the curve at rest mid-way between the margins; its first end stays if `fixed`."""
    count = _stations(outline, curve)
    curve = resample(curve, count)
    for _ in range(ROUNDS):
        moved = _recenter(outline, curve, fixed=fixed)
        count = _stations(outline, moved)
        moved, before = resample(moved, count), resample(curve, count)
        curve = moved
        if np.linalg.norm(moved - before, axis=1).max() <= AT_REST * outline.area / reached(curve)[-1]:
            break
    return curve


def _stations(outline: Any, curve: FloatArray) -> int:
    """Return how many stations the curve should have."""
    length = reached(curve)[-1]
    return int(np.clip(STATIONS_PER_WIDTH * length * length / outline.area, *STATIONS))


def _recenter(outline: Any, curve: FloatArray, *, fixed: bool) -> FloatArray:
    """Return the curve through the middles of its sections, smoothed, and straight on to the outline at its ends.

    Sections nearer to an end than half their length show that end's own outline, not the margins.
    """
    middles, widths = cut_across(outline, curve, normals_of(curve))
    at = reached(curve)
    left = np.minimum(at, at[-1] - at)
    held = (left >= widths / 2) & (widths > 0)
    if held.sum() < 4:
        held = (left >= 0.25 * at[-1]) & (widths > 0)
    if held.sum() < 2:
        return curve
    first, last = np.flatnonzero(held)[[0, -1]]
    inner = slice(first, last + 1)
    targets, weights = middles[inner], held[inner].astype(np.float64)
    if fixed:
        targets, weights = np.concatenate([curve[:first], middles[inner]]), np.pad(weights, (first, 0))
        targets[0], weights[0] = curve[0], 1e3
    if len(targets) < 3:
        return curve
    smooth = smooth_curve(targets, weights, _stiffness(outline, at[-1], len(curve)))
    reach = max(2, min(len(smooth) - 1, STATIONS_PER_WIDTH // 2))
    end = leave_along(outline, smooth[-1], smooth[-1] - smooth[-1 - reach])
    if fixed:
        smooth[0] = curve[0]
        return np.concatenate([smooth, end[np.newaxis]])
    start = leave_along(outline, smooth[0], smooth[0] - smooth[reach])
    return np.concatenate([start[np.newaxis], smooth, end[np.newaxis]])


def _stiffness(outline: Any, length: float, count: int) -> float:
    """Return the stiffness for stations whose step is not an eighth of the mean width."""
    per_width = outline.area / length / (length / (count - 1))
    return float(STIFFNESS * (per_width / STATIONS_PER_WIDTH) ** 4)


def _from_base(
    vertices: FloatArray, chart: FloatArray, outline: Any, curve: FloatArray, hint: FloatArray | None
) -> tuple[FloatArray, str]:
    """Return the curve in the order that begins at the base, and how that was told."""
    ends = [vertices[np.argmin(np.linalg.norm(chart - end, axis=1))] for end in (curve[0], curve[-1])]
    if hint is not None:
        first, second = (float(np.linalg.norm(end - hint)) for end in ends)
        why = "the base is the end nearer to the point given"
    else:
        second, first = end_width(outline, curve), end_width(outline, curve[::-1])
        why = "the base is the wider end"
        if max(first, second) < WIDER * min(first, second):
            first, second = ends[0][2], ends[1][2]
            why = "the base is the lower end: both are about as wide"
    turned = first > second
    return (curve[::-1].copy() if turned else curve), f"{why}, at {place_of(ends[int(turned)])}"
