"""The distance between two meshes."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, mesh_arrays
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import EdgeTable


def surface_distance(mesh: MeshLike, other: MeshLike) -> float:
    """Return the Hausdorff distance of two surfaces, the largest from either to the other, as samples find it.

    max(max_a d(a, B), max_b d(b, A)) over the vertices, the middles of edges and the centroids of
    triangles, to the other's triangles: from below, and off by little where both are finer than what
    they show. Positions are single precision about the meshes' middle: off by 1e-7 of their extent.

    Parameters
    ----------
    mesh, other : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        In one unit, which is the result's.

    Raises
    ------
    InputError
        If one has no triangle.
    """
    first, second = mesh_arrays(mesh), mesh_arrays(other)
    if not len(first[1]) or not len(second[1]):
        raise InputError("mesh: has no triangles; there is no distance to it")
    return surface_distance_of(first, second)


def surface_distance_of(first: tuple[FloatArray, IntArray], second: tuple[FloatArray, IntArray]) -> float:
    """Return `surface_distance` of two pairs of arrays that have triangles."""
    return max(_farthest(first, second), _farthest(second, first))


def _farthest(mesh: tuple[FloatArray, IntArray], other: tuple[FloatArray, IntArray]) -> float:
    """Return the largest distance of samples of `mesh` from `other`."""
    vertices, triangles = mesh
    ends = EdgeTable.of(triangles).ends
    middles = vertices[ends].mean(axis=1), vertices[triangles].mean(axis=1)
    samples = np.concatenate([vertices[np.unique(triangles)], *middles])
    return float(distance_to_mesh(*other, samples).max())
