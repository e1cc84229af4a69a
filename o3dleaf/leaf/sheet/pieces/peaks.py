"""Peaks of a function on a sheet, and the parts that are theirs: those that stay apart where they meet."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.surface.mesh.topology import EdgeTable

MIN_PART = 0.1
"""Share of the sheet's area that a part has at least; less is a shred of a margin."""


class JoinedParts(NamedTuple):
    """Which part (v,) each vertex of a sheet belongs to, the largest first, and what is said of them."""

    part: IntArray
    note: str


class PartAtPass(NamedTuple):
    """A part where it meets another one: the function's value at its peak, and its area down to there."""

    peak: float
    area: float


def edge_graph(vertices: FloatArray, edges: EdgeTable) -> scipy.sparse.csr_array:
    """Return the edges of a mesh as a symmetric graph, with their lengths."""
    ends = edges.ends.astype(np.int64)
    length = np.linalg.norm(vertices[ends[:, 1]] - vertices[ends[:, 0]], axis=1)
    length = np.maximum(length, np.finfo(float).tiny)
    graph = scipy.sparse.coo_array((length, (ends[:, 0], ends[:, 1])), shape=(len(vertices),) * 2).tocsr()
    return (graph + graph.T).tocsr()


def find_peaks(
    value: FloatArray, area: FloatArray, graph: scipy.sparse.csr_array, stays: Callable[[float, PartAtPass], bool]
) -> tuple[IntArray, dict[tuple[int, int], int]]:
    """Return the part (v,) of each vertex, by a vertex that is its name, and one where each two of them meet, by names.

    Vertices are taken by falling value, and joined to parts beside them. Parts that meet at one become one, unless both
    have a tenth of the area and `stays`, of the value there and the part with the lower peak, says otherwise.

    Parameters
    ----------
    value, area : (v,) ndarrays
        Of the vertices; a value may be infinite where nothing is known.
    graph : (v, v) sparse array
    stays : callable
    """
    known = np.isfinite(value)
    whole = MIN_PART * float(area[known].sum())
    first, neighbor = graph.indptr, graph.indices
    parent, peak, size = np.full(len(value), -1), value.copy(), area.copy()
    met: dict[tuple[int, int], int] = {}

    def root(of: int) -> int:
        while parent[of] != of:
            parent[of] = parent[parent[of]]
            of = int(parent[of])
        return of

    for vertex in np.argsort(-np.where(known, value, -1.0), kind="stable").tolist():
        around = neighbor[first[vertex] : first[vertex + 1]]
        roots = sorted({root(int(other)) for other in around if parent[other] >= 0}, key=lambda one: -peak[one])
        parent[vertex] = roots[0] if roots else vertex
        if not roots:
            continue
        size[roots[0]] += area[vertex]
        for other in roots[1:]:
            one = root(vertex)
            if min(size[one], size[other]) >= whole and stays(value[vertex], PartAtPass(peak[other], size[other])):
                met.setdefault((min(one, other), max(one, other)), vertex)
                continue
            parent[other] = one
            size[one] += size[other]
    label = np.array([root(vertex) for vertex in range(len(value))])
    return label, {pair: place for pair, place in met.items() if root(pair[0]) != root(pair[1])}


def vertex_areas(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the area (v,) of each vertex, a third of its triangles'."""
    thirds = np.repeat(triangle_areas(vertices, triangles) / 3, 3)
    return np.asarray(np.bincount(triangles.ravel(), thirds, len(vertices)), np.float64)


def ranked(label: IntArray, area: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the numbers of parts from the largest on, the number of each vertex's (v,), and their areas."""
    _, part = np.unique(label, return_inverse=True)
    sizes = np.asarray(np.bincount(part, area), np.float64)
    order = np.argsort(-sizes, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return np.arange(len(order)), rank[part].astype(np.int64), sizes[order]
