"""The midrib in the chart: mid-way between the margins at every station, from the middle of the base to the tip."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.ndimage
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.core.places import tell_place
from o3dleaf.leaf.chart.axis.ends import long_axis, slice_axis, symmetry_axis
from o3dleaf.leaf.chart.axis.sections import (
    cut_across,
    fill_bays,
    leave_along,
    normals_of,
    outline_of,
    reached,
    resample,
    smooth_curve,
    triangulate_inside,
    within,
)
from o3dleaf.leaf.chart.carry import carry
from o3dleaf.leaf.chart.flattening.geodesics import Ways
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet, rim_first
from o3dleaf.leaf.chart.flattening.stretch import chart_areas

STATIONS_PER_WIDTH = 8
STATIONS = (40, 600)
"""Of the curve, least and most; eight a width show every bend that a blade's margins can have."""
STIFFNESS = {2: 16.0, 3: 64.0}
"""Of the curve, against the middles of sections an eighth of a width apart: it follows what is longer than a width or
two, and neither teeth nor lobes. By the order of the differences that are kept small."""
BENDS = 5.0
"""Square of the length over the area from which a blade's own bend is known well enough to go on at its ends."""
ROUNDS = 16
LONGER = 1.1
"""Times the first axis that the curve may get; beyond, it winds about a fork of the blade, and what was is kept."""
AT_REST = 0.003
"""Share of the width that the curve may still move when it has come to rest."""
FROM_END = (0.75, 1.25)
"""Own lengths from the curve's ends between which a section comes to count: of the end's own outline it shows less and
less. Were it all or nothing, the curve could go back and forth between two sets of sections."""
ALONG = (np.cos(np.pi / 4), np.cos(np.pi / 8))
"""Cosines of the angles to the curve between which the outline, where a section ends, comes to be a margin: from 45
degrees on it runs more across than along."""
WIDER = 1.25
"""Times the other end's that the width about a fifth of the length inside is at the base, or else the mean to the end;
less is a tie, and the base is the lower end. Nearer to the ends the width is that of a cut, a bite or a tip."""
NOTCH = 0.01
"""Share of the blade's area that is cut out of one end for it to be the base: the sinus of a heart, a concave cut."""
TRUST = 24
"""Power of a section's length over that of its neighbors with which it counts: where a tenth of the width is missing,
a twelfth; where a quarter is, a thousandth."""
BRIDGED = 3.0
"""Widths along the blade over which a margin that is eaten or hidden is bridged."""


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


@single_threaded_blas()
def find_midline(
    vertices: FloatArray,
    triangles: IntArray,
    chart: FloatArray,
    *,
    base: FloatArray | None = None,
    junction: FloatArray | None = None,
) -> Midline:
    """Return the midrib of a blade in its chart.

    An axis is moved, station by station, to the middle between the margins until it rests, and goes on to the outline
    at either end: to the middle of a cut base, into a sharp tip. Bays that the blade's widest circle cannot enter are
    filled for it, and a stretch that is narrower than what is before and behind it is bridged: what is eaten or hidden
    of a margin does not move the midrib.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
        The sheet without its petiole.
    chart : (n, 2) ndarray
    base : (3,) ndarray, optional
        A point of the world near the base.
    junction : (2,) ndarray, optional
        The middle of the cut at which a petiole was taken off, in the chart: the base, exactly.
    """
    rim = rim_first(require_sheet(vertices, triangles))[0]
    margin = outline_of(chart, rim)
    outline = fill_bays(margin)
    ways = Ways(*triangulate_inside(outline))
    area = np.abs(chart_areas(ways.vertices, ways.triangles))
    if junction is not None:
        curve, fixed = _from_start(outline, ways, area, junction), True
    else:
        curve, fixed = _unknown_base(outline, ways, area), False
    curve = _settle(outline, curve, fixed=fixed)
    if fixed:
        notes = ["the base is where the petiole was cut off"]
    else:
        curve, note = _from_base(vertices, chart, margin, curve, base)
        notes = [note]
    curve = resample(within(margin, curve), len(curve))
    _, widths = cut_across(margin, curve, normals_of(curve))
    return Midline(curve, widths, curve[0], curve[-1], tuple(notes))


def midline_through(vertices: FloatArray, triangles: IntArray, chart: FloatArray, midrib: FloatArray) -> Midline:
    """Return the midrib in the chart through given points (k, 3) of the world, from base to tip.

    Its widths are the blade's mean width, its ends the first and the last point.
    """
    curve = carry(vertices, triangles, chart, midrib)
    length = float(reached(curve)[-1])
    if not length > 0:
        raise InputError("midrib: its points have one place on the blade; give points along it, from base to tip")
    widths = np.full(len(curve), float(np.abs(chart_areas(chart, triangles)).sum()) / length)
    return Midline(curve, widths, curve[0], curve[-1], ("the midrib is the one that was given",))


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
    """Return the curve at rest mid-way between the margins, to its ends; its first end stays if `fixed`."""
    count = _stations(outline, curve)
    curve = resample(curve, count)
    longest = LONGER * reached(curve)[-1]
    for _ in range(ROUNDS):
        moved = _recenter(outline, curve, fixed=fixed)
        if reached(moved)[-1] > longest or not shapely.LineString(moved).is_simple:
            break
        count = _stations(outline, moved)
        moved, before = resample(moved, count), resample(curve, count)
        curve = moved
        if np.linalg.norm(moved - before, axis=1).max() <= AT_REST * outline.area / reached(curve)[-1]:
            break
    # Once: a curve that followed these sections again would turn into the corner of an oblique cut, as into a tip.
    moved = _recenter(outline, curve, fixed=fixed, to_ends=True)
    return resample(moved, len(curve)) if shapely.LineString(moved).is_simple else curve


def _stations(outline: Any, curve: FloatArray) -> int:
    """Return how many stations the curve should have."""
    length = reached(curve)[-1]
    return int(np.clip(STATIONS_PER_WIDTH * length * length / outline.area, *STATIONS))


def _recenter(outline: Any, curve: FloatArray, *, fixed: bool, to_ends: bool = False) -> FloatArray:
    """Return the curve through the middles of its sections, smoothed, and on to the outline at its ends.

    Sections nearer to an end than about their length show that end's own outline, not the margins; there the curve
    goes on as it bends before. `to_ends` those count, too, that end on margins, as before a cut base or at a tip.
    """
    middles, widths = cut_across(outline, curve, normals_of(curve))
    margins = _end_on_margins(outline, curve, middles, widths) if to_ends else 0.0
    at = reached(curve)
    # Half a width a round: from a first axis on the margin to the middle, and not into another lobe.
    move = middles - curve
    far = np.linalg.norm(move, axis=1) / (outline.area / at[-1] / 2)
    middles = curve + move / np.maximum(far, 1)[:, np.newaxis]
    left = np.minimum(at, at[-1] - at)
    apart = left / np.maximum(widths, np.finfo(float).tiny)
    held = np.maximum(np.interp(apart, FROM_END, (0.0, 1.0)), margins) * (widths > 0)
    if held.sum() < 8:
        held = (left >= 0.25 * at[-1]) & (widths > 0)
    if held.sum() < 3:
        return curve
    weights = held * _trust(outline, widths, at[-1])
    if fixed:
        middles[0], weights[0] = curve[0], 1e3
    # What is kept beyond the ends' own outline: the direction and, of a long blade, the bend.
    order = 3 if at[-1] ** 2 >= BENDS * outline.area else 2
    smooth = smooth_curve(middles, weights, _stiffness(outline, at[-1], len(curve), order), order)
    end = leave_along(outline, smooth[-2], smooth[-1] - smooth[-2])
    start = curve[0] if fixed else leave_along(outline, smooth[1], smooth[0] - smooth[1])
    return within(outline, np.concatenate([start[np.newaxis], smooth[1:-1], end[np.newaxis]]))


def _end_on_margins(outline: Any, curve: FloatArray, middles: FloatArray, widths: FloatArray) -> FloatArray:
    """Return how far (k,) sections end on two margins, that run along the curve a station before and behind; 1: all."""
    ring, normals, step = outline.exterior, normals_of(curve), reached(curve)[-1] / (len(curve) - 1)
    cosines = []
    for side in (-0.5, 0.5):
        at = shapely.line_locate_point(ring, shapely.points(middles + side * widths[:, np.newaxis] * normals))
        ends = (shapely.line_interpolate_point(ring, (at + off) % ring.length) for off in (-step, step))
        behind, before = map(shapely.get_coordinates, ends)
        x, y = (before - behind).T
        length = np.maximum(np.hypot(x, y), np.finfo(float).tiny)
        cosines.append(np.abs(x * normals[:, 1] - y * normals[:, 0]) / length)
    return np.asarray(np.interp(np.minimum(*cosines), ALONG, (0.0, 1.0)))


def _trust(outline: Any, widths: FloatArray, length: float) -> FloatArray:
    """Return the (k,) weights of sections: small where they are shorter than those before and after them."""
    span = 1 + round(BRIDGED * outline.area / length / (length / (len(widths) - 1)))
    # With nothing outside the ends a taper is its own closing, as a cut is.
    usual = scipy.ndimage.grey_closing(np.pad(widths, span), size=span)[span:-span]
    return np.asarray(np.maximum((widths / np.maximum(usual, np.finfo(float).tiny)) ** TRUST, 1e-4))


def _stiffness(outline: Any, length: float, count: int, order: int) -> float:
    """Return the stiffness for stations whose step is not an eighth of the mean width."""
    per_width = outline.area / length / (length / (count - 1))
    return float(STIFFNESS[order] * (per_width / STATIONS_PER_WIDTH) ** (2 * order))


def _from_base(
    vertices: FloatArray, chart: FloatArray, margin: Any, curve: FloatArray, hint: FloatArray | None
) -> tuple[FloatArray, str]:
    """Return the curve in the order that begins at the base, and how that was told."""
    ends = [vertices[np.argmin(np.linalg.norm(chart - end, axis=1))] for end in (curve[0], curve[-1])]
    if hint is not None:
        first, second = (float(np.linalg.norm(end - hint)) for end in ends)
        why = "the base is the end nearer to the point given"
    else:
        first, second, why = _by_shape(margin, curve, float(ends[0][2]), float(ends[1][2]))
    turned = first > second
    return (curve[::-1].copy() if turned else curve), f"{why}, at {tell_place(ends[int(turned)], vertices)}"


def _by_shape(margin: Any, curve: FloatArray, first: float, second: float) -> tuple[float, float, str]:
    """Return how little either end looks like the base, and by what: width, a notch, width to the end, height."""
    outline = fill_bays(margin)
    _, widths = cut_across(outline, curve, normals_of(curve))
    fifth = max(1, len(widths) // 5)
    inside = slice(round(0.15 * len(widths)), round(0.25 * len(widths)) + 1)
    width = float(np.median(widths[inside])), float(np.median(widths[::-1][inside]))
    filled = np.maximum(widths - cut_across(margin, curve, normals_of(curve))[1], 0)
    notch = tuple(float(each[:fifth].sum() / widths.sum()) for each in (filled, filled[::-1]))
    mean = float(widths[:fifth].mean()), float(widths[-fifth:].mean())
    if max(width) >= WIDER * min(width):
        return width[1], width[0], "the base is the wider end"
    if max(notch) >= NOTCH and max(notch) >= 3 * min(notch):
        return notch[1], notch[0], "the base is the end that is notched or cut out"
    if max(mean) >= WIDER * min(mean):
        return mean[1], mean[0], "the base is the end that stays wide"
    return first, second, "the base is the lower end: both are about as wide"
