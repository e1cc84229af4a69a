"""Edge-connected pieces of a mesh, by area."""

import numpy as np
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, build_mesh, drop_unused_vertices, mesh_arrays, triangle_areas
from o3dleaf.surface.mesh.topology import label_triangles


def connected_components(mesh: MeshLike) -> tuple[IntArray, FloatArray]:
    """Return which edge-connected piece each triangle belongs to, the largest by area first.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)

    Returns
    -------
    labels : (m,) ndarray of int64
        0 for the triangles of the largest piece, 1 for the next, and so on; of equal ones the one seen first comes
        first.
    areas : (c,) ndarray of float64
        Area of each piece, falling, in the square of the mesh's unit.
    """
    vertices, triangles = mesh_arrays(mesh)
    labels = label_triangles(triangles)
    areas = np.bincount(labels, weights=triangle_areas(vertices, triangles)).astype(np.float64)
    ranking = np.argsort(-areas, kind="stable")
    rank = np.empty(len(areas), dtype=np.int64)
    rank[ranking] = np.arange(len(areas))
    return rank[labels], areas[ranking]


def largest_component(mesh: MeshLike) -> tuple[o3d.geometry.TriangleMesh, FloatArray]:
    """Return the largest piece of a mesh, by area, and the areas (c,) of all pieces, falling."""
    labels, areas = connected_components(mesh)
    vertices, triangles = mesh_arrays(mesh)
    return build_mesh(*drop_unused_vertices(vertices, triangles[labels == 0])), areas
