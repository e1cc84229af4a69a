"""Handles of a sheet: a short way around each, for the message that it cannot be laid flat."""

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.surface.mesh.topology import BoundaryLoops, EdgeTable

ROUNDS = 4
"""Vertices that shortest ways are sought from, each on the shortest loop before it: later ones found no shorter."""


def shortest_handle(vertices: FloatArray, triangles: IntArray, edges: EdgeTable, loops: BoundaryLoops) -> IntArray:
    """Return the vertices (k,) of a short loop on a connected sheet that no disc, and no hole, of it is bounded by.

    Around a handle or through it. Shortest ways from a vertex make a tree; of the edges left, those make a tree of the
    triangles and the rims that close the longest loops, and each edge in neither closes a loop that parts nothing:
    there are two for each handle. The shortest is taken, and sought again from a vertex on it.

    Parameters
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
        Of genus above 0.
    edges : EdgeTable
    loops : BoundaryLoops
        The sheet's boundary.

    References
    ----------
    Eppstein (2003), Dynamic generators of topologically embedded graphs; Erickson and Whittlesey (2005), Greedy optimal
    homotopy and homology generators.
    """
    sides = _sides(edges, len(triangles), loops)
    root, best, shortest = int(triangles[0, 0]), np.empty(0, np.int64), np.inf
    for _ in range(ROUNDS):
        loop, length = _loop_from(root, vertices, edges, sides)
        if not length < shortest:
            break
        best, shortest = loop, length
        root = int(loop[len(loop) // 2])
    return best


def _sides(edges: EdgeTable, count: int, loops: BoundaryLoops) -> IntArray:
    """Return the two triangles of each edge (e, 2), numbers from `count` on for the rims and holes."""
    first = edges.first(np.arange(len(edges.ends)))
    sides = np.column_stack([edges.order[first], edges.order[np.minimum(first + 1, len(edges.order) - 1)]]) // 3
    sides[loops.edges, 1] = count + loops.of_edge
    return np.asarray(sides, np.int64)


def _loop_from(root: int, vertices: FloatArray, edges: EdgeTable, sides: IntArray) -> tuple[IntArray, float]:
    """Return the shortest loop that shortest ways from a vertex make with an edge in no tree, and its length."""
    one, other = edges.ends.astype(np.int64).T
    length = np.linalg.norm(vertices[one] - vertices[other], axis=1)
    length = np.maximum(length, 1e-12 * length.max())
    graph = scipy.sparse.coo_array((length, (one, other)), shape=(len(vertices), len(vertices))).tocsr()
    distance, before = dijkstra(graph, directed=False, indices=root, return_predecessors=True)
    around = distance[one] + distance[other] + length
    left = np.flatnonzero((before[one] != other) & (before[other] != one))
    # Of edges between the same two the one with the longest loop stands for all: a sparse array would add them up.
    left = left[np.lexsort((-around[left], *np.sort(sides[left], axis=1).T))]
    pairs = np.sort(sides[left], axis=1)
    new = np.append(True, (pairs[1:] != pairs[:-1]).any(axis=1)) & (pairs[:, 0] != pairs[:, 1])
    rows, pairs = left[new], pairs[new]
    size = int(sides.max()) + 1
    rank = np.empty(len(rows))
    rank[np.argsort(-around[rows], kind="stable")] = np.arange(1, len(rows) + 1)
    tree = minimum_spanning_tree(scipy.sparse.coo_array((rank, tuple(pairs.T)), shape=(size, size)).tocsr()).tocoo()
    open_edges = np.setdiff1d(left, rows[np.isin(rank, tree.data)])
    if not len(open_edges):
        return np.empty(0, np.int64), np.inf
    edge = int(open_edges[np.argmin(around[open_edges])])
    ways = [_way(int(end), before) for end in (one[edge], other[edge])]
    shared = len(set(ways[0]) & set(ways[1]))  # both end at the root; what they share is no part of the loop
    loop = ways[0][: len(ways[0]) - shared + 1] + ways[1][: len(ways[1]) - shared][::-1]
    return np.array(loop, np.int64), float(around[edge] - 2 * distance[loop[len(ways[0]) - shared]])


def _way(vertex: int, before: IntArray) -> list[int]:
    """Return the vertices from one to the root of a tree."""
    way = [vertex]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way
