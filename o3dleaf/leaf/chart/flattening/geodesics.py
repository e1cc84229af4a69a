"""Distances along a sheet, and its far ends."""

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import dijkstra

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.surface.mesh.topology import EdgeTable


class Ways:
    """The ways along a mesh: its vertices and middles of edges, all six of a triangle joined to each other.

    A shortest way through them is at most some hundredths longer than the shortest on the surface; ways along
    edges alone are up to a seventh longer, and differently so in each direction.

    Attributes
    ----------
    vertices : (n, 2 or 3) ndarray
    triangles : (m, 3) ndarray of int
    """

    def __init__(self, vertices: FloatArray, triangles: IntArray) -> None:
        self.vertices, self.triangles = vertices, triangles
        edges = EdgeTable.of(triangles)
        nodes = np.concatenate([vertices, vertices[edges.ends].mean(axis=1)])
        each = np.column_stack([triangles, len(vertices) + edges.of_half.reshape(-1, 3)])
        first, second = np.triu_indices(6, 1)
        pairs = np.sort(np.column_stack([each[:, first].ravel(), each[:, second].ravel()]), axis=1)
        pairs = np.stack(np.divmod(np.unique(pairs @ [len(nodes), 1]), len(nodes)), axis=1)
        length = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
        # Two vertices in one place would be no link.
        length = np.maximum(length, 1e-12 * length.max())
        shape = (len(nodes), len(nodes))
        self._graph = scipy.sparse.coo_array((length, tuple(pairs.T)), shape=shape).tocsr()

    def from_vertex(self, vertex: int) -> FloatArray:
        """Return the (n,) distances of the vertices from one of them; 0 where there is no way."""
        found = dijkstra(self._graph, directed=False, indices=vertex)[: len(self.vertices)]
        return np.asarray(np.where(np.isfinite(found), found, 0.0))

    def far_ends(self) -> tuple[int, int]:
        """Return two vertices that are farthest apart along the surface, as three sweeps find them."""
        used = np.unique(self.triangles)
        middle = self.vertices[used].mean(axis=0)
        start = int(used[np.argmax(np.linalg.norm(self.vertices[used] - middle, axis=1))])
        second = int(np.argmax(self.from_vertex(start)))
        third = int(np.argmax(self.from_vertex(second)))
        return second, third
