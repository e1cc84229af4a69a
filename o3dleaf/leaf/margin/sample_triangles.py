"""The Delaunay triangles of a planar sample, with what is measured of each."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.trees import query
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.sample_spacing import BoolArray, SampleNeighbors, even_points, local_shape
from o3dleaf.surface.mesh.topology import label_nodes

BESIDE = 0.5
"""Spacings between places along a border from which distances are taken: those of 1 are 0.03 too long at most."""


@dataclass(frozen=True)
class Triangulation:
    """The Delaunay triangles of a planar sample.

    Attributes
    ----------
    near : SampleNeighbors
        Of the points.
    triangles : (m, 3) int ndarray
        Counter-clockwise.
    neighbors : (m, 3) int ndarray
        The triangle opposite to each corner; −1 at the hull.
    areas : (m,) ndarray
    metric : (n, 3) ndarray
        The local metric of determinant 1 (`local_shape`).
    reach : (m,) ndarray
        Longest side of each in that metric: a length.
    """

    near: SampleNeighbors
    triangles: IntArray
    neighbors: IntArray
    areas: FloatArray
    metric: FloatArray
    reach: FloatArray

    @property
    def points(self) -> FloatArray:
        """The sample, (n, 2)."""
        return self.near.points


def triangulate(points: FloatArray) -> Triangulation:
    """Return the Delaunay triangles of (n, 2) distinct points.

    Raises
    ------
    InputError
        If they lie on one line.
    """
    try:
        delaunay = Delaunay(points)
    except QhullError as cause:
        raise InputError("points: lie on one line; give points that cover an area") from cause
    near, triangles = SampleNeighbors.of(points), delaunay.simplices.astype(np.int64)
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    metric = _metric(near, triangles)
    reach = longest_sides((a, b, c), metric[triangles].mean(axis=1))
    clockwise = (twice < 0)[:, None]
    triangles = np.where(clockwise, triangles[:, [0, 2, 1]], triangles)
    neighbors = np.where(clockwise, delaunay.neighbors[:, [0, 2, 1]], delaunay.neighbors).astype(np.int64)
    return Triangulation(near, triangles, neighbors, np.abs(twice) / 2, metric, reach)


def measured_by(mesh: Triangulation, metric: FloatArray) -> Triangulation:
    """Return the triangles with another metric (n, 3) at their points."""
    mesh = replace(mesh, metric=metric)
    return replace(mesh, reach=side_lengths(mesh).max(axis=1))


def _metric(near: SampleNeighbors, triangles: IntArray) -> FloatArray:
    """Return the metric (n, 3) at each point: that of the nearest of `even_points`."""
    even = even_points(near)
    if len(even) == len(near.points):
        return local_shape(near, triangles)
    sparse = SampleNeighbors.of(near.points[even])
    metric = local_shape(sparse, Delaunay(sparse.points).simplices.astype(np.int64))
    return np.asarray(metric[sparse.tree.query(near.points)[1]])


def longest_sides(corners: tuple[FloatArray, FloatArray, FloatArray], metric: FloatArray) -> FloatArray:
    """Return the longest side (m,) of triangles, three arrays (m, 2) of corners, in a metric (m, 3) for each."""
    return np.asarray(np.sqrt(np.max(_squares_of_sides(corners, metric), axis=0)))


def side_lengths(mesh: Triangulation) -> FloatArray:
    """Return the sides (m, 3) of its triangles in their metric, each opposite to its corner."""
    a, b, c = (mesh.points[mesh.triangles[:, corner]] for corner in range(3))
    return np.sqrt(np.stack(_squares_of_sides((a, b, c), mesh.metric[mesh.triangles].mean(axis=1)), axis=1))


def _squares_of_sides(corners: tuple[FloatArray, FloatArray, FloatArray], metric: FloatArray) -> list[FloatArray]:
    """Return the squares of the sides opposite to the three corners (m, 2), in a metric (m, 3) for each."""
    a, b, c = corners
    return [
        metric[:, 0] * side[:, 0] ** 2 + 2 * metric[:, 1] * side[:, 0] * side[:, 1] + metric[:, 2] * side[:, 1] ** 2
        for side in (c - b, a - c, b - a)
    ]


def inner_points(mesh: Triangulation, kept: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return the points of kept triangles, and those of them with kept triangles all around."""
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.triangles[kept]] = True
    inner = used.copy()
    inner[mesh.triangles[~kept]] = False
    row, side = np.nonzero(mesh.neighbors < 0)
    for turn in (1, 2):  # the side at the hull is the one opposite to its corner
        inner[mesh.triangles[row, (side + turn) % 3]] = False
    return used, inner


def border_distance(mesh: Triangulation, kept: BoolArray, spacing: FloatArray) -> FloatArray:
    """Return the distance (n,) of the points from the border of the triangles kept, of sides that may be long.

    It is that of the nearest of places along these, `BESIDE` of the local `spacing` (n,) apart at most.
    """
    row, side = np.nonzero(~np.append(kept, False)[mesh.neighbors] & kept[:, None])
    first, last = (mesh.triangles[row, (side + turn) % 3] for turn in (1, 2))
    begin, way = mesh.points[first], mesh.points[last] - mesh.points[first]
    count = np.ceil(np.hypot(*way.T) / (BESIDE * np.minimum(spacing[first], spacing[last]))).astype(np.int64)
    before = np.repeat(np.cumsum(count) - count, count)
    share = (np.arange(count.sum()) - before) / np.repeat(count, count)
    places = np.repeat(begin, count, axis=0) + share[:, None] * np.repeat(way, count, axis=0)
    return np.asarray(query(cKDTree(places), mesh.points, k=[1])[0][:, 0])


def components_of(neighbors: IntArray, chosen: BoolArray) -> IntArray:
    """Return the edge-connected component (m,) of each chosen triangle by the `neighbors` of all, −1 for the others."""
    rows = np.flatnonzero(chosen)
    place = np.full(len(chosen) + 1, -1)
    place[rows] = np.arange(len(rows))
    other = place[neighbors[rows]]
    row, side = np.nonzero(other >= 0)
    labels = np.full(len(chosen), -1, dtype=np.int64)
    labels[rows] = label_nodes(np.ascontiguousarray(row), other[row, side], len(rows))
    return labels
