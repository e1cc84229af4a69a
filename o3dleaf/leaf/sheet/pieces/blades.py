"""Blades that part from a tube, as those of a seedling do from their sheath: a sheet that no chart lays flat."""

import numpy as np
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.places import tell_middle, tell_place
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.sheet.pieces.peaks import JoinedParts, PartAtPass, edge_graph, find_peaks, ranked, vertex_areas
from o3dleaf.surface.mesh.topology import EdgeTable


def find_blades(vertices: FloatArray, triangles: IntArray, ends: FloatArray) -> JoinedParts | None:
    """Return the blades that part from a tube and the tube, or None of a sheet without a tube or with fewer than two.

    Of the distance along the sheet from the tube's end each blade has a peak, and down to where it meets another one it
    is longer than wide: its length squared exceeds its area. What lies below is the tube.

    Parameters
    ----------
    vertices : (v, 3) ndarray
    triangles : (m, 3) ndarray of int
        An oriented manifold sheet.
    ends : (k, 3) ndarray
        Vertices around ends of its tube: `find_tube_ends`.
    """
    if not len(ends):
        return None
    graph, area = edge_graph(vertices, EdgeTable.of(triangles)), vertex_areas(vertices, triangles)
    along = dijkstra(graph, indices=np.unique(query(cKDTree(vertices), ends)[1]), min_only=True)
    label, met = find_peaks(along, area, graph, _is_long)
    if not met:
        return None
    foot = {name: max(along[place] for pair, place in met.items() if name in pair) for pair in met for name in pair}
    down_to = np.array([foot.get(name, np.inf) for name in label.tolist()])
    blades, part, sizes = ranked(np.where(along > down_to, label, -1), area)
    tube = part[np.argmin(along)]
    each = "; ".join(
        f"{tell_length(sizes[number], 2)} at {tell_middle(vertices[part == number], vertices)}"
        for number in blades
        if number != tube
    )
    at = ", ".join(tell_place(vertices[place], vertices) for place in met.values())
    what = f"{len(blades) - 1} blades, areas about {each}, leave a tube, as a sheath or a stem, at {at}"
    return JoinedParts(part, what)


def _is_long(foot: float, blade: PartAtPass) -> bool:
    return bool((blade.peak - foot) ** 2 > blade.area)
