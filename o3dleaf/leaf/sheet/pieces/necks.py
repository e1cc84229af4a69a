"""Necks of a sheet: where two parts of it, each wide, hang together by little, as leaves that touch do."""

import numpy as np
from scipy.sparse.csgraph import dijkstra

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.places import tell_middle, tell_place
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.sheet.pieces.peaks import JoinedParts, edge_graph, find_peaks, ranked, vertex_areas
from o3dleaf.surface.mesh.topology import EdgeTable

NARROW = 0.5
"""Width of a neck over that of the narrower part, at most: of the leaves that were looked at none is half as wide and
wide again, but for its petiole. It is told, and nothing is cut that was not asked for."""
RAGGED = 2.0
"""Edges that a rim is ragged by, one on either side of a neck: so much may be missing of what is narrow by chance."""


def find_necks(vertices: FloatArray, triangles: IntArray) -> JoinedParts | None:
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
    graph = edge_graph(vertices, edges)
    ends = edges.ends.astype(np.int64)
    depth = dijkstra(graph, indices=np.unique(ends[edges.count == 1]), min_only=True)
    area = vertex_areas(vertices, triangles)
    edge = float(np.median(np.linalg.norm(vertices[ends[:, 1]] - vertices[ends[:, 0]], axis=1)))
    label, met = find_peaks(depth, area, graph, lambda at, part: at + RAGGED * edge <= NARROW * part.peak)
    if not met:
        return None
    necks = list(met.values())
    # What is no deeper than the necks belongs to the part that is nearest along the sheet.
    core = np.flatnonzero(depth > depth[necks].max())
    nearest = dijkstra(graph, indices=core, min_only=True, return_predecessors=True)[2]
    label = np.where(nearest >= 0, label[nearest], label)
    names, part, sizes = ranked(label, area)
    shown = "; ".join(
        f"{tell_length(size, 2)} at {tell_middle(vertices[part == name], vertices)}"
        for name, size in zip(names, sizes, strict=True)
    )
    # Where all vertices of a neck lie on its rim it is still as wide as an edge, as over a gap of the scan.
    wide = np.maximum(2 * depth, edge)
    at = ", ".join(f"{tell_length(wide[place])} wide at {tell_place(vertices[place], vertices)}" for place in necks)
    return JoinedParts(part, f"{len(names)} parts, areas about {shown}, hang together by {at}")
