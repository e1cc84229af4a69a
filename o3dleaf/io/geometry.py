"""The mesh or the point cloud of a file, whichever it is."""

from os import PathLike
from pathlib import Path

import open3d as o3d

from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.counts import count_points, count_triangles
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.triangle_mesh import read_triangle_mesh


def read_geometry(path: str | PathLike[str]) -> o3d.geometry.TriangleMesh | o3d.geometry.PointCloud:
    """Return the mesh of a file, or its point cloud if it has no triangles.

    Raises
    ------
    InputError
        If it can be read as neither.
    """
    try:
        return read_triangle_mesh(path)
    except InputError:
        return read_point_cloud(path, least=1)


def count_geometry(path: str | PathLike[str]) -> tuple[int, int]:
    """Return about how many triangles a file has and, if it has none, how many points; before it is read."""
    triangles = count_triangles(Path(path))
    return triangles, 0 if triangles else count_points(Path(path))
