"""Boundary loops of a sheet that are no holes but ends of a tube, as of a sheath: told by how far they turn."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes, trace_rings

HALF = -np.pi
"""Turn of a loop midway between that of a hole in a plane, -2π, and that of a tube's end, 0."""

MIN_EDGES = 7
"""Edges around a tube at least: around one that is two edges wide, of which planes through neighbors hold both sides,
there are 2π."""


def corner_angles(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the sum (n,) of the angles that triangles (m, 3) have at each vertex."""
    corners = vertices[triangles]
    total = np.zeros(len(vertices))
    for corner in range(3):
        one, other = (corners[:, (corner + by) % 3] - corners[:, corner] for by in (1, 2))
        across = np.linalg.norm(np.cross(one, other), axis=1)
        np.add.at(total, triangles[:, corner], np.arctan2(across, np.einsum("ij,ij->i", one, other)))
    return total


def find_tube_ends(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    r"""Return the vertices (k, 3) of boundary loops, but the longest, that are ends of a tube and no holes of a sheet.

    A loop turns by :math:`\sum_i π − α_i`, the discrete integral of its geodesic curvature, with the angles α of the
    sheet at its vertices: by −2π around a hole of a plane, by 0 at the end of a cylinder, whatever its corners are.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
        An oriented manifold sheet.

    References
    ----------
    Do Carmo (1976), Differential Geometry of Curves and Surfaces, 4-5: the theorem of Gauss and Bonnet.
    """
    edges = EdgeTable.of(triangles)
    rings = trace_rings(edges, find_holes(vertices, triangles, edges))
    outer = int(np.argmax(rings.perimeter)) if len(rings) else -1
    turns = np.pi - corner_angles(vertices, triangles)
    loops = [rings[ring] for ring in range(len(rings)) if ring != outer]
    ends = [loop for loop in loops if len(loop) >= MIN_EDGES and turns[loop].sum() > HALF]
    return np.asarray(vertices[np.concatenate([np.empty(0, np.int64), *ends])])
