"""The petiole or stem stub of a sheet, found by its cross-section: long, narrow against the blade, and not tapering."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, triangle_areas
from o3dleaf.leaf.chart.flattening.geodesics import Ways
from o3dleaf.leaf.chart.flattening.sheet_shape import place_of

NARROW = 0.25
"""Of the blade's width, that a petiole's cross-section is at most: blades do not wait that narrow for long."""
SLENDER, SLENDER_NECK = 2.5, 4.0
"""Times its width that a petiole is long; and a neck with something wider outside it, a stub of the stem."""
STEADY = 0.5
"""Width of its outer third over that of its inner third: 0.2 for a tip that tapers straight, 1 for a stalk."""
FLARE = 1.5
"""Times its median width that a petiole may be wide where the blade begins."""
LARGEST_STUB = 0.25
"""Share of the whole area that may lie outside a neck; more is a blade by itself."""
LONG, LONG_IF_ROUND = 0.75, 0.25
"""Times the blade's width that a petiole is long if it is flat, and if its cross-section is curled: flat and shorter
ones are shreds of a margin."""
ROUND = 0.75
"""Length of the mean normal over a stretch as long as wide that counts as curled: 1 flat, 0.64 half a tube, 0 all."""
BINS = (24, 240)
"""Stations of the profile of widths, least and most: ten a blade's width, as far as that goes."""


@dataclass(frozen=True)
class Petiole:
    """A petiole or stem stub that was found on a sheet; lengths in the sheet's unit.

    Attributes
    ----------
    length : float
        From its end to the junction with the blade, on the surface.
    width : float
        Median length of its cross-section, around it as far as the surface goes.
    area : float
    end, junction : (3,) tuple of float
        Its outer end, and the middle of the section where the blade begins, in world coordinates.
    """

    length: float
    width: float
    area: float
    end: tuple[float, float, float]
    junction: tuple[float, float, float]

    def __str__(self) -> str:
        return (
            f"petiole: {self.length:.3g} long and {self.width:.2g} wide, from {place_of(np.array(self.end))} "
            f"to the blade at {place_of(np.array(self.junction))}"
        )


def find_petiole(vertices: FloatArray, triangles: IntArray) -> tuple[BoolArray, Petiole | None]:
    """Return which (m,) triangles are blade, and the petiole or None.

    The lengths of the circles about one end of the leaf are its widths; a petiole is a stretch of them that is
    narrow against the widest, long against itself, and does not taper to the end as a tip does.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
        One sheet with a boundary, of some thousand triangles.
    """
    blade, found = np.ones(len(triangles), dtype=bool), None
    ways = Ways(vertices, triangles)
    for end in ways.far_ends():
        distance = ways.from_vertex(end)
        cut = _junction(vertices, triangles, distance)
        if cut is None:
            continue
        outside = distance[triangles].mean(axis=1) < cut[0]
        petiole = _measure(vertices, triangles, distance, cut, end)
        if found is None or petiole.length / petiole.width > found.length / found.width:
            blade, found = ~outside, petiole
    return blade, found


def width_profile(
    vertices: FloatArray, triangles: IntArray, distance: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stations (k,) of a distance, lengths (k,) of its level lines there and areas (k,) up to each.

    The length of a level line is the derivative of the area within it, where the distance's gradient is one.
    """
    area, reach = triangle_areas(vertices, triangles), float(distance.max())
    width = area.sum() / reach
    count = int(np.clip(10 * reach / width, *BINS))
    corners = distance[triangles]
    # Each triangle spread over three inner points: fewer steps between bins than its middle alone makes.
    samples = (corners.sum(axis=1, keepdims=True) + 3 * corners) / 6
    spread = np.repeat(area[:, np.newaxis] / 3, 3, axis=1)
    held, edges = np.histogram(samples, bins=count, range=(0.0, reach), weights=spread)
    length = held / np.diff(edges)
    padded = np.pad(length, 2, mode="edge")
    smooth = np.convolve(padded, np.array([1, 4, 6, 4, 1]) / 16, mode="valid")
    return (edges[1:] + edges[:-1]) / 2, smooth, np.cumsum(held)


def _junction(vertices: FloatArray, triangles: IntArray, distance: FloatArray) -> tuple[float, float] | None:
    """Return the distance from an end at which a petiole there meets the blade, and its width; None without one."""
    stations, width, area = width_profile(vertices, triangles, distance)
    step = stations[1] - stations[0]
    narrow = width <= NARROW * np.quantile(width, 0.95)
    # The outermost narrow stretch that counts: from the end, or with no more than a stub outside it.
    change = np.flatnonzero(np.diff(np.concatenate([[False], narrow, [False]])))
    for first, last in zip(change[::2], change[1::2], strict=True):
        outside = area[first - 1] if first else 0.0
        if outside > LARGEST_STUB * area[-1] or area[last - 1] > 0.5 * area[-1]:
            break
        stretch = width[first:last]
        usual = float(np.median(stretch))
        steady = np.flatnonzero(stretch <= FLARE * usual)
        stretch = stretch[: int(steady[-1]) + 1]
        length = len(stretch) * step
        third = max(1, len(stretch) // 3)
        is_steady = bool(first) or stretch[:third].mean() >= STEADY * stretch[-third:].mean()
        slender = length >= (SLENDER_NECK if first else SLENDER) * usual
        widest = float(np.quantile(width, 0.95))
        if not (is_steady and slender and length >= LONG_IF_ROUND * widest):
            continue
        reach = first * step + length
        if length >= LONG * widest or _flatness(vertices, triangles, distance, reach, usual) < ROUND:
            return reach, usual
    return None


def _flatness(vertices: FloatArray, triangles: IntArray, distance: FloatArray, reach: float, width: float) -> float:
    """Return the length of the mean unit normal over pieces of a stalk that are as long as wide."""
    middle = distance[triangles].mean(axis=1)
    outside = middle < reach
    first, second, third = (vertices[triangles[outside, corner]] for corner in range(3))
    normal = np.cross(second - first, third - first) / 2
    piece = (middle[outside] / width).astype(np.int64)
    whole = np.stack([np.bincount(piece, weights=normal[:, axis]) for axis in range(3)], axis=1)
    return float(np.linalg.norm(whole, axis=1).sum() / np.linalg.norm(normal, axis=1).sum())


def _measure(
    vertices: FloatArray, triangles: IntArray, distance: FloatArray, cut: tuple[float, float], end: int
) -> Petiole:
    """Return the record of a petiole that is cut off at a distance from its end."""
    outside = distance[triangles].mean(axis=1) < cut[0]
    used = np.unique(triangles[outside])
    near = used[np.argsort(np.abs(distance[used] - cut[0]), kind="stable")[: max(3, len(used) // 50)]]
    x, y, z = vertices[near].mean(axis=0)
    a, b, c = vertices[end]
    area = float(triangle_areas(vertices, triangles[outside]).sum())
    return Petiole(float(cut[0]), cut[1], area, (float(a), float(b), float(c)), (float(x), float(y), float(z)))
