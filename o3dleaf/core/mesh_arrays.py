"""The door between Open3D's triangle meshes and NumPy arrays, and distinct rows of these."""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray, as_array
from o3dleaf.core.checks.coordinates import as_sites
from o3dleaf.core.errors import InputError

LAST_VERTEX = 2**53
"""Float64 tells whole numbers apart up to this one."""
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
MeshLike: TypeAlias = o3d.geometry.TriangleMesh | o3d.t.geometry.TriangleMesh | tuple[npt.ArrayLike, npt.ArrayLike]
"""A mesh that functions take: Open3D's legacy or tensor mesh, or (vertices, triangles)."""


class UniqueRows(NamedTuple):
    """The distinct rows (k, d) of an array, rising, the row (k,) where each stands first, and the number (n,) of each.

    As ``np.unique(rows, axis=0, return_index=True, return_inverse=True)`` has them, in a third to a fifth of the time:
    that compares whole rows.
    """

    rows: npt.NDArray[Any]
    first: IntArray
    number: IntArray

    @classmethod
    def of(cls, rows: npt.NDArray[Any]) -> "UniqueRows":
        """Find them in an array (n, d)."""
        order = np.lexsort(rows.T[::-1])
        rising, is_new = rows[order], np.ones(len(rows), dtype=bool)
        is_new[1:] = (rising[1:] != rising[:-1]).any(axis=1)
        number = np.empty(len(rows), dtype=np.int64)
        number[order] = np.cumsum(is_new) - 1
        return cls(rising[is_new], order[is_new], number)


def mesh_arrays(mesh: MeshLike) -> tuple[FloatArray, IntArray]:
    """Return copies of a mesh's vertices and triangles as plain arrays.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Vertices (n, 3) in any unit, triangles (m, 3) of vertex numbers.

    Returns
    -------
    vertices : (n, 3) ndarray of float64
    triangles : (m, 3) ndarray of int64

    Raises
    ------
    InputError
        If it is no mesh of triangles in space, a coordinate is not finite, or a triangle names a vertex that is not
        there.
    """
    if isinstance(mesh, o3d.geometry.TriangleMesh):
        parts: tuple[npt.ArrayLike, npt.ArrayLike] = (np.asarray(mesh.vertices), np.asarray(mesh.triangles))
    elif isinstance(mesh, o3d.t.geometry.TriangleMesh):
        parts = _tensor_parts(mesh)
    else:
        parts = _require_pair(mesh)
    vertices = _as_vertices(parts[0])
    triangles = _as_corners(parts[1])
    if triangles.size and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        raise InputError(
            f"mesh: a triangle refers to a vertex outside 0 to {len(vertices) - 1}; the file may be damaged"
        )
    return vertices, triangles


def _as_vertices(vertices: npt.ArrayLike) -> FloatArray:
    """Return a copy of vertices (n, 3), or raise `InputError`."""
    if as_array(vertices, "mesh vertices").size == 0:
        return np.empty((0, 3))
    return as_sites(vertices, "mesh vertices", dim=3).copy()


def _as_corners(triangles: npt.ArrayLike) -> IntArray:
    """Return a copy of triangles (m, 3), vertex numbers, or raise `InputError`."""
    given = as_array(triangles, "mesh triangles")
    if given.size == 0:
        return np.empty((0, 3), dtype=np.int64)
    if given.ndim != 2 or given.shape[1] != 3:
        raise InputError(
            f"mesh triangles: have shape {given.shape}; give three vertex numbers a row, (m, 3); cut polygons "
            "into triangles"
        )
    whole = given.dtype.kind in "iu" or (given.dtype.kind == "f" and bool(np.all(given == np.floor(given))))
    if not whole:
        raise InputError(f"mesh triangles: are {given.dtype} and no whole numbers; give vertex numbers")
    if np.abs(given).max() > LAST_VERTEX:
        raise InputError(f"mesh triangles: refer to vertex {np.abs(given).max():.3g}; the file may be damaged")
    return given.astype(np.int64, order="C")  # the layout that loops are compiled for


def require_triangles(mesh: MeshLike) -> tuple[FloatArray, IntArray]:
    """Return the mesh's arrays, or raise `InputError` where it has no triangle."""
    vertices, triangles = mesh_arrays(mesh)
    if not len(triangles):
        raise InputError("mesh: has no triangles; give a triangle mesh")
    return vertices, triangles


def _require_pair(mesh: object) -> tuple[npt.ArrayLike, npt.ArrayLike]:
    """Return a pair as it is; anything else is no mesh."""
    if not (isinstance(mesh, Sequence) and len(mesh) == 2):
        raise InputError(f"mesh: is a {type(mesh).__name__}; give an Open3D TriangleMesh or (vertices, triangles)")
    return mesh[0], mesh[1]


def _tensor_parts(mesh: o3d.t.geometry.TriangleMesh) -> tuple[npt.ArrayLike, npt.ArrayLike]:
    """Return the two tensors as arrays; a tensor mesh without them is empty."""
    if "positions" not in mesh.vertex or "indices" not in mesh.triangle:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    return mesh.vertex.positions.cpu().numpy(), mesh.triangle.indices.cpu().numpy()


def build_mesh(vertices: npt.ArrayLike, triangles: npt.ArrayLike) -> o3d.geometry.TriangleMesh:
    """Return Open3D's legacy mesh (float64 vertices) of (n, 3) `vertices` and (m, 3) `triangles`."""
    mesh = o3d.geometry.TriangleMesh()
    mesh.vertices = o3d.utility.Vector3dVector(np.ascontiguousarray(vertices, dtype=np.float64))
    mesh.triangles = o3d.utility.Vector3iVector(np.ascontiguousarray(triangles, dtype=np.int32))
    return mesh


def tensor_mesh(vertices: FloatArray, triangles: IntArray) -> o3d.t.geometry.TriangleMesh:
    """Return Open3D's tensor mesh with float64 positions, which its own `from_legacy` rounds to float32."""
    mesh = o3d.t.geometry.TriangleMesh()
    mesh.vertex.positions = o3d.core.Tensor.from_numpy(np.ascontiguousarray(vertices))
    mesh.triangle.indices = o3d.core.Tensor.from_numpy(np.ascontiguousarray(triangles))
    return mesh


def ray_scene(
    vertices: npt.NDArray[np.float64 | np.float32], triangles: IntArray, threads: int = 0
) -> o3d.t.geometry.RaycastingScene:
    """Return Open3D's scene for rays and distances, in single precision: it holds the digits of what is near zero."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
    arrays = np.ascontiguousarray(vertices, dtype=np.float32), np.ascontiguousarray(triangles, dtype=np.uint32)
    scene.add_triangles(*map(o3d.core.Tensor.from_numpy, arrays))
    return scene


def is_used(vertices: FloatArray, triangles: IntArray) -> BoolArray:
    """Return the (n,) vertices that a triangle names."""
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles] = True
    return used


def drop_unused_vertices(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the mesh without vertices that no triangle names, the others in their old order."""
    used = is_used(vertices, triangles)
    renumber = np.cumsum(used) - 1
    return vertices[used], renumber[triangles].reshape(-1, 3)


def triangle_areas(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (m,) areas of the triangles, in the square of the vertices' unit."""
    # Coordinate by coordinate: np.cross and the norm of rows take four times as long.
    first, second, third = np.ascontiguousarray(triangles.T)
    (x, y, z), (u, v, w) = (
        [each[corner] - each[first] for each in np.ascontiguousarray(vertices.T)] for corner in (second, third)
    )
    return np.asarray(np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2) / 2)
