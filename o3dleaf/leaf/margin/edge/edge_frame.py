"""A closed curve with the points near it, as its likelihood is asked for: nodes, normals, distances, stiffness."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.edge.edge_score import SHUT_OUT, BlurredEdge, blurred
from o3dleaf.leaf.margin.edge.least_distance import excess_beside
from o3dleaf.leaf.margin.edge.third_differences import SHIFTS, ThirdDifferences
from o3dleaf.leaf.margin.margin_curve import MAX_NOISE, Spacing, resample
from o3dleaf.leaf.margin.sample_lines import SampleLines
from o3dleaf.leaf.margin.sample_spacing import BoolArray

NODE_STEP = 0.5
"""Step of the nodes, in local spacings: a third of the least bandwidth."""
INSIDE, OUTSIDE = 6.0, 3.0
"""Blurs from the curve within which points are used: farther in they carry no information, farther out they are
strays."""
NARROW = 0.5
"""Spacings of half the width of a tip, below which its points belong to neither side."""
BESIDE = 1.0
"""Spacings from what was filled within which the curve runs over it."""
SMOOTH_NORMALS = 3.0
"""Width of the Gaussian, in spacings, by which the directions to move in are smoothed."""


@dataclass(frozen=True)
class EdgeSample:
    """What an edge is fitted to.

    Attributes
    ----------
    local : Spacing
        The points, with their spacing.
    noise : float
        Their deviation in the plane; it counts up to `MAX_NOISE` spacings.
    randomness : float
        A lattice, 0, has rows along its edge, and its points are not independent.
    filled : shapely.Geometry
        The gaps of the sample that were filled: where the edge runs over them, it stays.
    excess : float
        Points more than the density for each spacing of edge (`edge_excess`).
    thinned_to : float
        The distance that the sample was thinned to (`least_distance`); 0: it was not.
    lines : SampleLines, optional
        Those that the points lie on.
    """

    local: Spacing
    noise: float
    randomness: float
    filled: shapely.Geometry
    excess: float = 0.0
    thinned_to: float = 0.0
    lines: SampleLines | None = None

    def seen(self, spacing: FloatArray) -> BlurredEdge:
        """Return what the edge is seen through where spacings are (n,), with more points along it than inside."""
        noise = np.minimum(self.noise / spacing, MAX_NOISE)
        if self.thinned_to > 0:
            return blurred(noise, excess_beside(self.thinned_to / spacing), SHUT_OUT)
        return blurred(noise, self.excess)

    def share(self, frame: "EdgeFrame") -> FloatArray:
        """Return the share (n,) of the way to the curve of greatest likelihood that is gone.

        All of it for averages of voxels and thinned samples; nothing along lines, of which the points are not
        independent.
        """
        whole = np.full(len(frame.curve), 1.0 if self.excess > 0 or self.thinned_to > 0 else self.randomness)
        if self.lines is None:
            return whole
        return whole * self.lines.ended(frame.curve, frame.normals @ np.array([[0.0, 1.0], [-1.0, 0.0]]))


class EdgeFrame(NamedTuple):
    """A curve with the points near it.

    `curve`, `normals` (n, 2); local `spacing`, `noise` in spacings, `half_width` of the tip, `length` of margin of each
    node across its normal, `curvature` over spacings, 0 at tips, positive where the leaf is convex (n,); whether points
    are used there (`observed`), and whether it runs over a `gap` that was filled; the nearest `node` (m,) of each point
    and how far `across` (m,) it lies, in spacings; third `differences` of what moves, and of the curve itself (`bend`,
    n); the rows of tips.
    """

    curve: FloatArray
    normals: FloatArray
    spacing: FloatArray
    noise: FloatArray
    half_width: FloatArray
    length: FloatArray
    curvature: FloatArray
    observed: BoolArray
    gap: BoolArray
    node: IntArray
    across: FloatArray
    differences: ThirdDifferences
    bend: FloatArray
    apexes: list[int]


def edge_frame(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> EdgeFrame:
    """Return a curve in steps of `NODE_STEP`, its tips among the nodes, with the points near it."""
    curve, spacing, _ = resample(curve, sample.local, NODE_STEP)
    count = len(curve)
    rows = sorted({int(np.argmin(((curve - apex) ** 2).sum(axis=1))) for apex in apexes})
    normals, half_width = _normals(curve, rows), _half_widths(curve, spacing, rows)
    gap = shapely.distance(shapely.points(curve), sample.filled) <= BESIDE * spacing
    observed = (half_width >= NARROW) & ~gap
    part = np.minimum(sample.noise / spacing, MAX_NOISE)
    blur = blurred(part).blur
    points = np.asarray(sample.local.tree.data)
    reach = float((INSIDE * blur * spacing).max())
    node = cKDTree(curve).query(points, distance_upper_bound=reach)[1]
    points, node = points[node < count], node[node < count]
    across = ((points - curve[node]) * normals[node]).sum(axis=1) / spacing[node]
    near = observed[node] & (across < OUTSIDE * blur[node]) & (across > -INSIDE * blur[node])
    differences, bend = _third_differences(curve, normals, spacing, rows)
    return EdgeFrame(
        curve,
        normals,
        spacing,
        part,
        half_width,
        *_lengths(curve, normals, spacing, rows),
        observed,
        gap,
        node[near],
        across[near],
        differences,
        bend,
        rows,
    )


def _normals(curve: FloatArray, apexes: list[int]) -> FloatArray:
    """Return the unit normals (n, 2) to the right, smoothed along the curve between its tips."""
    sides = np.roll(curve, -1, axis=0) - curve
    sides /= np.maximum(np.hypot(*sides.T), 1e-300)[:, None]
    width, count = SMOOTH_NORMALS / NODE_STEP, len(curve)
    smoothed = np.empty_like(sides)
    for i, start in enumerate(apexes):
        length = (apexes[(i + 1) % len(apexes)] - start) % count or count
        rows = (start + np.arange(length)) % count
        smoothed[rows] = gaussian_filter1d(sides[rows], min(width, length / 3), axis=0, mode="nearest")
    if not apexes:
        smoothed = gaussian_filter1d(sides, width, axis=0, mode="wrap")
    tangents = smoothed + np.roll(smoothed, 1, axis=0)
    normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)
    return np.asarray(normals / np.maximum(np.hypot(*normals.T), 1e-300)[:, None])


def _lengths(
    curve: FloatArray, normals: FloatArray, spacing: FloatArray, apexes: list[int]
) -> tuple[FloatArray, FloatArray]:
    """Return the length (n,) of margin across the normal at each node, in spacings, and the curvature there."""
    sides = (np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)) / 2
    before, after = np.roll(normals, 1, axis=0), np.roll(normals, -1, axis=0)
    turn = (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / 2
    turn[(np.array(apexes, dtype=int)[:, None] + [-1, 0, 1]) % len(curve)] = 0.0
    length = (normals[:, 0] * sides[:, 1] - normals[:, 1] * sides[:, 0]) / spacing
    return length, turn / NODE_STEP


def _half_widths(curve: FloatArray, spacing: FloatArray, apexes: list[int]) -> FloatArray:
    """Return half the distance (n,) to the other flank of a tip, in spacings; more than enough where there is none."""
    count = len(curve)
    half = np.full(count, 2 * INSIDE)
    steps = np.arange(count // 4)
    for apex in apexes:
        one, other = (apex - steps) % count, (apex + steps) % count
        width = np.hypot(*(curve[one] - curve[other]).T) / 2 / spacing[other]
        for rows in (one, other):
            half[rows] = np.minimum(half[rows], width)
    return half


def _third_differences(
    curve: FloatArray, normals: FloatArray, spacing: FloatArray, apexes: list[int]
) -> tuple[ThirdDifferences, FloatArray]:
    """Return the third differences along the normal of what moves, and of the curve itself (n,); none at tips."""
    count = len(curve)
    free = np.zeros(count, dtype=bool)
    free[(np.array(apexes, dtype=int)[:, None] + [-2, -1, 0, 1]) % count] = True
    factors, bend = np.zeros((len(SHIFTS), count)), np.zeros(count)
    for row, (factor, shift) in enumerate(zip((-1.0, 3.0, -3.0, 1.0), SHIFTS, strict=True)):
        factors[row] = factor * (normals * np.roll(normals, -shift, axis=0)).sum(axis=1)
        bend += factor * (normals * np.roll(curve, -shift, axis=0)).sum(axis=1) / spacing
    return ThirdDifferences(np.where(free, 0.0, factors)), np.where(free, 0.0, bend)
