"""Necks of a sheet: where two parts of it, each wide, hang together by little, as leaves that touch do."""

from typing import NamedTuple

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import dijkstra

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.core.places import tell_middle, tell_place
from o3dleaf.core.units import tell_length
from o3dleaf.surface.mesh.topology import EdgeTable

NARROW = 0.5
"""Width of a neck over that of the narrower part, at most: of the leaves that were looked at none is half as wide and
wide again, but for its petiole. It is told, and nothing is cut that was not asked for."""
RAGGED = 2.0
"""Edges that a rim is ragged by, one on either side of a neck: so much may be missing of what is narrow by chance."""
MIN_PART = 0.1
"""Share of the sheet's area that a part has at least; less is a shred of a margin."""


class Necks(NamedTuple):
    """Which part (v,) each vertex of a sheet belongs to, the largest first, and a line of the read-out."""

    part: IntArray
    note: str


def find_necks(vertices: FloatArray, triangles: IntArray) -> Necks | None:
    """Return the parts of a sheet that hang together by narrow necks, or None of a sheet that has none.

    Of the depth, the distance from the rim along the sheet, each wide part has a peak, and where two meet, half the
    neck's width is left. Vertices are taken by falling depth; parts that meet are one, unless the depth there is less
    than half of both peaks by what a rim is ragged.

    Parameters
    ----------
    vertices : (v, 3) ndarray
    triangles : (m, 3) ndarray of int
        An oriented manifold sheet with a rim.
    """
    edges = EdgeTable.of(triangles)
    ends = edges.ends.astype(np.int64)
    length = np.linalg.norm(vertices[ends[:, 1]] - vertices[ends[:, 0]], axis=1)
    tiny = np.finfo(float).tiny
    graph = scipy.sparse.coo_array(
        (np.maximum(length, tiny), (ends[:, 0], ends[:, 1])), shape=(len(vertices), len(vertices))
    ).tocsr()
    graph = (graph + graph.T).tocsr()
    rim = np.unique(ends[edges.count == 1])
    depth = dijkstra(graph, indices=rim, min_only=True)
    thirds = np.repeat(triangle_areas(vertices, triangles) / 3, 3)
    area = np.asarray(np.bincount(triangles.ravel(), thirds, len(vertices)), np.float64)
    edge = float(np.median(length))
    label, necks = _parts(depth, RAGGED * edge, area, graph.indptr, graph.indices)
    if not necks:
        return None
    # What is no deeper than the necks belongs to the part that is nearest along the sheet.
    core = np.flatnonzero(depth > depth[necks].max())
    nearest = dijkstra(graph, indices=core, min_only=True, return_predecessors=True)[2]
    label = np.where(nearest >= 0, label[nearest], label)
    names, part, sizes = _ranked(label, area)
    shown = "; ".join(
        f"{tell_length(size, 2)} at {tell_middle(vertices[part == name], vertices)}"
        for name, size in zip(names, sizes, strict=True)
    )
    # Where all vertices of a neck lie on its rim it is still as wide as an edge, as over a gap of the scan.
    wide = np.maximum(2 * depth, edge)
    at = ", ".join(f"{tell_length(wide[place])} wide at {tell_place(vertices[place], vertices)}" for place in necks)
    return Necks(part, f"{len(names)} parts, areas about {shown}, hang together by {at}: `piece` takes one of them")


def _parts(
    depth: FloatArray, ragged: float, area: FloatArray, first: IntArray, neighbor: IntArray
) -> tuple[IntArray, list[int]]:
    """Return the part (v,) of each vertex, and a vertex in each neck between them."""
    parent, peak, size = np.full(len(depth), -1), depth.copy(), area.copy()
    whole = MIN_PART * float(area[np.isfinite(depth)].sum())
    met: dict[tuple[int, int], int] = {}

    def root(of: int) -> int:
        while parent[of] != of:
            parent[of] = parent[parent[of]]
            of = int(parent[of])
        return of

    for vertex in np.argsort(-np.where(np.isfinite(depth), depth, -1.0), kind="stable").tolist():
        around = neighbor[first[vertex] : first[vertex + 1]]
        roots = sorted({root(int(other)) for other in around if parent[other] >= 0}, key=lambda one: -peak[one])
        parent[vertex] = roots[0] if roots else vertex
        if not roots:
            continue
        size[roots[0]] += area[vertex]
        for other in roots[1:]:
            one = root(vertex)
            if depth[vertex] + ragged <= NARROW * peak[other] and min(size[one], size[other]) >= whole:
                met.setdefault((min(one, other), max(one, other)), vertex)
                continue
            parent[other] = one
            size[one] += size[other]
    label = np.array([root(vertex) for vertex in range(len(depth))])
    return label, [neck for pair, neck in met.items() if root(pair[0]) != root(pair[1])]


def _ranked(label: IntArray, area: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the numbers of parts from the largest on, the number of each vertex's (v,), and their areas."""
    _, part = np.unique(label, return_inverse=True)
    sizes = np.asarray(np.bincount(part, area), np.float64)
    order = np.argsort(-sizes, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return np.arange(len(order)), rank[part].astype(np.int64), sizes[order]
