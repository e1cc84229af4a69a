"""Distances along a cloud of points, from neighbor to neighbor, and its far ends."""

from collections.abc import Iterator

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query

NEIGHBORS = (16, 32, 64)
"""Points that each is joined to, itself among them: as few as join the cloud. Of 16 rows of a scanner still hang
together that are four times as far apart as their points, of 32 rows sixteen times."""
JOINED = 0.9
"""Share of a cloud's points that are in one piece where it is joined: what else there is lies beside the leaf."""
CELL = 3 / 8
"""Of the neighbors, that whose distance tells the area of a point's cell: π r²/k has the right mean, whatever the
pattern, but where the k nearest are all of one row."""
MAX_ENDS = 6
"""Ends of a cloud that are looked at, the farthest first."""


class PointWays:
    """The ways along the largest connected piece of a cloud, each point joined to its nearest ones.

    Attributes
    ----------
    rows : (n,) ndarray of int64
        The points of that piece.
    points : (n, 3) ndarray
    cells : (n,) ndarray
        Area that each stands for.
    """

    def __init__(self, points: FloatArray) -> None:
        for most in NEIGHBORS:
            length, graph = _joined(points, min(most, len(points)))
            label = connected_components(graph, directed=False)[1]
            sizes = np.bincount(label)
            if sizes.max() >= JOINED * len(points):
                break
        self.rows: IntArray = np.flatnonzero(label == np.argmax(sizes))
        self.points = points[self.rows]
        nearest = max(1, round(CELL * (length.shape[1] - 1)))
        self.cells = np.pi * length[self.rows, nearest] ** 2 / nearest
        self._graph = graph[self.rows][:, self.rows]

    def from_point(self, point: int) -> FloatArray:
        """Return the (n,) distances from one of the points."""
        return np.asarray(dijkstra(self._graph, directed=False, indices=point))

    def beside(self, some: BoolArray) -> BoolArray:
        """Return which (n,) points are linked to one of `some` (n,)."""
        return np.asarray(self._graph @ some.astype(np.float64) > 0)

    def far_ends(self) -> tuple[int, int]:
        """Return two points that are farthest apart, as three sweeps find them."""
        start = int(np.argmax(np.linalg.norm(self.points - self.points.mean(axis=0), axis=1)))
        second = int(np.argmax(self.from_point(start)))
        return second, int(np.argmax(self.from_point(second)))

    def ends_from(self, point: int, common: float, taken: BoolArray | None = None) -> Iterator[tuple[int, float]]:
        """Yield ends of the cloud and their distances from a point, the farthest first.

        The next one is the farthest point of whose way no more than the share `common` is that of one found before;
        none among those `taken` (n,).
        """
        away = self.from_point(point)
        shared = np.zeros(len(away)) if taken is None else np.where(taken, np.inf, 0.0)
        for _ in range(MAX_ENDS):
            free = np.where(shared <= common * away, away, 0.0)
            end = int(free.argmax())
            if not free[end] > 0:
                return
            yield end, float(free[end])
            shared = np.maximum(shared, (away[end] + away - self.from_point(end)) / 2)


def _joined(points: FloatArray, count: int) -> tuple[FloatArray, scipy.sparse.csr_array]:
    """Return the distances (n, count) of points to the nearest, themselves first, and the graph that joins these."""
    length, row = query(cKDTree(points), points, k=np.arange(1, count + 1))
    # Two points in one place would be no link.
    length = np.maximum(length, 1e-12 * max(float(length.max()), np.finfo(float).tiny))
    own = np.repeat(np.arange(len(points)), count - 1)
    graph = scipy.sparse.coo_array((length[:, 1:].ravel(), (own, row[:, 1:].ravel())), shape=(len(points),) * 2).tocsr()
    return length, graph.maximum(graph.T)
