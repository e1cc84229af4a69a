"""The lines of a planar sample, as laser line scanners leave them: their directions, place by place."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.trees import query
from o3dleaf.leaf.margin.sample_spacing import NEIGHBORS, BoolArray, SampleNeighbors, axes_to

ALONG = {4: 1.1, 8: 1.0, 16: 1.0}
"""Neighbors of a point that may all be of its own line: half of them to either side, where lines are farther apart than
that. More of them show lines through more noise. And how many times as far as the last of them others may be that count
with them: of the six points nearest in a lattice of triangles, all as far but for a rounding, four have a direction."""
MIN_ORDER = 1 / 3
"""Length of the mean of unit vectors of twice the neighbors' angles from which on they are of a line, between 0 of none
and 1: in the median over a leaf independent points have 0.1 by chance, and 0.3 on a strip three spacings wide."""
LEAST_ORDER = 1e-9
"""What is no direction at all counts as."""
LENGTH = 4.0
"""Spacings over which a margin is smoothed and its points are counted (`COUNT_WIDTH`)."""


@dataclass(frozen=True)
class SampleLines:
    """The lines of a planar sample.

    Attributes
    ----------
    tree : cKDTree
        Of the points (n, 2).
    along : (n, 2) ndarray
        Unit vectors along the lines.
    apart : (n,) ndarray
        Distance of the lines.
    spacing : (n,) ndarray
        Square root of the area that a point stands for.
    astray : (n,) ndarray
        Standard deviation of the directions, an angle.
    clear : (n,) bool ndarray
        Whether there are lines at that place.
    """

    tree: cKDTree
    along: FloatArray
    apart: FloatArray
    spacing: FloatArray
    astray: FloatArray
    clear: BoolArray

    @property
    def are_most(self) -> bool:
        """Whether there are lines at half of the points."""
        return bool(2 * np.count_nonzero(self.clear) >= len(self.clear))

    @property
    def steps(self) -> FloatArray:
        """Distance (n,) of the points along lines."""
        return np.asarray(self.spacing**2 / self.apart)

    def inside(self, deep: BoolArray) -> bool:
        """Return whether there are lines at most of the points deep (n,) inside, not along a margin alone.

        Vertices of a mesh that were set along a margin are as dense there as points of a line.
        """
        return bool(2 * np.count_nonzero(self.clear & deep) > np.count_nonzero(deep))

    def spaced(self, spacing: FloatArray) -> "SampleLines":
        """Return the lines where points stand for other areas, `spacing` (n,) squared."""
        return replace(self, apart=self.apart * (spacing / self.spacing) ** 2, spacing=spacing)

    def nearest(self, places: FloatArray) -> IntArray:
        """Return the rows (k,) of the points nearest to places (k, 2)."""
        return np.asarray(query(self.tree, places, k=[1])[1][:, 0])

    def apart_at(self, places: FloatArray) -> FloatArray:
        """Return the distance (k,) of the lines at places (k, 2); 0 where there are none."""
        near = self.nearest(places)
        return np.where(self.clear[near], self.apart[near], 0.0)

    def ended(self, places: FloatArray, sides: FloatArray) -> FloatArray:
        """Return how far (k,) lines end at sides (k, 2) of a margin, at places (k, 2), and do not run along them.

        0 along lines; 1 where so many end that one does within `LENGTH`, and where there are no lines.
        """
        near = self.nearest(places)
        x, y = self.along[near].T
        sine = np.abs(x * sides[:, 1] - y * sides[:, 0]) / np.maximum(np.hypot(*sides.T), 1e-300)
        ends = LENGTH * self.spacing[near] * sine / self.apart[near]
        return np.where(self.clear[near], np.minimum(ends**2, 1.0), 1.0)


def sample_lines(neighbors: SampleNeighbors, spacing: FloatArray) -> SampleLines | None:
    """Return the lines of points by their `neighbors` and `spacing` (n,); None if fewer than half show any."""
    lines = local_lines(neighbors, spacing)
    return lines if lines is not None and lines.are_most else None


def local_lines(neighbors: SampleNeighbors, spacing: FloatArray) -> SampleLines | None:
    """Return what lines there are, place by place, of points by their `neighbors` and `spacing` (n,); None of too few.

    The direction at a point is the mean of those to the nearest neighbors of each of the points around it, as axes, of
    twice the angle. Of k neighbors on a line the last is k/2 steps away. Of `ALONG` those are taken that agree best.
    """
    points, tree, away, around = neighbors
    if len(points) <= NEIGHBORS:
        return None
    axis = axes_to(around[:, 1:], points)
    near = [away[:, 1:] <= far * away[:, [count]] for count, far in ALONG.items()]
    means = [((axis * each).sum(axis=1) / each.sum(axis=1))[around].mean(axis=1) for each in near]
    best = int(np.argmax([np.median(np.abs(mean)) for mean in means]))
    mean, count, order = means[best], list(ALONG)[best], np.abs(means[best])
    turn = np.angle(mean) / 2
    along = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    way = points[around[:, count]] - points
    step = np.abs((way * along).sum(axis=1))[around].mean(axis=1) / (count / 2)
    # Of normal angles with deviation σ the mean axis has the length exp(−2 σ²); lines have one pair for two neighbors.
    astray = np.sqrt(-np.log(np.clip(order, LEAST_ORDER, 1.0)) / 2 / (NEIGHBORS * count / 2))
    return SampleLines(tree, along, spacing**2 / step, spacing, astray, order >= MIN_ORDER)
