"""Reading point clouds through Open3D, with the checks that keep a bad file from becoming a bad surface."""

from os import PathLike
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dleaf.checks import require_file, require_finite
from o3dleaf.errors import InputError

SUFFIXES = (".ply", ".pcd", ".xyz", ".xyzn", ".xyzrgb", ".pts")
HEADER = 65536


def read_point_cloud(path: str | PathLike[str], *, least: int = 3) -> o3d.geometry.PointCloud:
    """Return the points of a file that Open3D reads: PLY, PCD, XYZ, XYZN, XYZRGB or PTS.

    Parameters
    ----------
    path : str or path
    least : int
        The fewest points that will do.

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
        _check_ply(file)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        cloud = o3d.io.read_point_cloud(file, remove_nan_points=False, remove_infinite_points=False)
    points = np.asarray(cloud.points)
    if not len(points):
        raise InputError(f"{file}: no points could be read; is it a damaged file or an empty cloud?")
    if len(points) < least:
        raise InputError(f"{file}: holds {len(points)} points; at least {least} are needed")
    require_finite(points, str(file))
    return cloud


def _check_ply(file: Path) -> None:
    """Refuse a PLY whose header claims more points than its bytes can hold: Open3D would allocate them all."""
    with file.open("rb") as stream:
        head = stream.read(HEADER)
    if not head.startswith(b"ply"):
        raise InputError(f"{file}: does not begin with 'ply'; it is no PLY file, export it again")
    end = head.find(b"end_header")
    for line in head[: max(end, 0)].splitlines():
        words = line.split()
        if words[:2] == [b"element", b"vertex"] and len(words) == 3 and words[2].isdigit():
            # Three coordinates take six bytes at the very least, as text ("0 0 0\n") and as binary.
            if int(words[2]) * 6 > file.stat().st_size:
                raise InputError(f"{file}: claims {int(words[2])} points but is too short for them; it was cut off")
            return
    raise InputError(f"{file}: its PLY header names no points; export it again")
