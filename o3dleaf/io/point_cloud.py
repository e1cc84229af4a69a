"""Reading point clouds through Open3D, with the checks that keep a bad file from becoming a bad surface."""

from os import PathLike

import numpy as np
import open3d as o3d

from o3dleaf.core.checks import require_file, require_finite
from o3dleaf.core.errors import InputError
from o3dleaf.io.ply_reader import require_whole_ply

SUFFIXES = (".ply", ".pcd", ".xyz", ".xyzn", ".xyzrgb", ".pts")


def read_point_cloud(path: str | PathLike[str], *, least: int = 3, finite: bool = True) -> o3d.geometry.PointCloud:
    """Return the points of a file that Open3D reads: PLY, PCD, XYZ, XYZN, XYZRGB or PTS.

    Parameters
    ----------
    path : str or path
    least : int
        The fewest points that will do.
    finite : bool
        Whether a point that is NaN or infinite is an error; `preprocess_point_cloud` leaves such points out.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, it claims more points than it can hold, it holds
        fewer than `least`, or one is not finite.
    """
    file = require_file(path)
    if file.suffix.lower() not in SUFFIXES:
        raise InputError(f"{file}: unknown kind of point cloud {file.suffix!r}; give one of {', '.join(SUFFIXES)}")
    if file.suffix.lower() == ".ply":
        require_whole_ply(file)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        cloud = o3d.io.read_point_cloud(file, remove_nan_points=False, remove_infinite_points=False)
    points = np.asarray(cloud.points)
    if not len(points):
        raise InputError(f"{file}: no points could be read; the cloud is empty or the file is damaged, export it again")
    if len(points) < least:
        raise InputError(f"{file}: has {len(points)} points; at least {least} are needed")
    if finite:
        require_finite(points, str(file))
    return cloud
