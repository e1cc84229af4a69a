"""How far two meshes are apart."""

import numpy as np
import open3d as o3d

from o3dleaf.checks import FloatArray
from o3dleaf.errors import InputError
from o3dleaf.mesh.arrays import IntArray, MeshLike, mesh_arrays
from o3dleaf.mesh.topology import EdgeTable


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
    middle = first[0].mean(axis=0)
    sides = [(vertices - middle, triangles) for vertices, triangles in (first, second)]
    return max(_farthest(*sides), _farthest(*sides[::-1]))


def _farthest(mesh: tuple[FloatArray, IntArray], other: tuple[FloatArray, IntArray]) -> float:
    """Return the largest distance of samples of `mesh` from `other`."""
    vertices, triangles = mesh
    edges = EdgeTable.of(triangles)
    samples = np.concatenate(
        [vertices[np.unique(triangles)], vertices[edges.ends].mean(axis=1), vertices[triangles].mean(axis=1)]
    )
    scene = o3d.t.geometry.RaycastingScene()
    tensor = o3d.core.Tensor.from_numpy
    scene.add_triangles(tensor(other[0].astype(np.float32)), tensor(other[1].astype(np.uint32)))
    return float(scene.compute_distance(tensor(samples.astype(np.float32))).numpy().max())
