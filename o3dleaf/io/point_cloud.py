"""Reading point clouds by the suffix of the name, with the checks that keep a bad file from becoming a bad surface."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Whole
from o3dleaf.core.checks.arrays import require_finite
from o3dleaf.core.checks.files import require_file
from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds import e57, las, npy, text
from o3dleaf.io.clouds.columns import Columns
from o3dleaf.io.clouds.cut_off import require_whole_cloud
from o3dleaf.io.clouds.pcd import read_pcd
from o3dleaf.io.clouds.pts import read_pts
from o3dleaf.io.obj import holds_faces
from o3dleaf.io.ply_reader import PlyHeader, read_ply
from o3dleaf.io.triangle_mesh import READERS

NAMED = {".xyz": "x y z", ".xyzn": "x y z nx ny nz", ".xyzrgb": "x y z r g b"}
"""Columns of texts whose suffix tells them."""
MESHES = tuple(suffix for suffix in READERS if suffix != ".ply")
"""Formats of meshes, of which the vertices are the points, as they are of a PLY with faces."""
SUFFIXES = (".ply", ".pcd", *NAMED, ".pts", *text.SUFFIXES, *las.SUFFIXES, *e57.SUFFIXES, *npy.SUFFIXES, *MESHES)
OTHERS = {
    **dict.fromkeys(las.SUFFIXES, las.read_las),
    **dict.fromkeys(e57.SUFFIXES, e57.read_e57),
    **dict.fromkeys(npy.SUFFIXES, npy.read_npy),
    ".pcd": read_pcd,
}
"""Readers of formats that are no text and no mesh, by suffix; libraries of the first ones are extras."""
WITH_COLUMNS = (*text.SUFFIXES, *NAMED)
"""Formats whose columns can be named."""


@checked
def read_point_cloud(
    path: str | PathLike[str],
    *,
    least: Whole = 3,
    finite: bool = True,
    columns: str | Sequence[str] | None = None,
) -> o3d.geometry.PointCloud:
    """Return the points of a file: PLY, PCD, XYZ, XYZN, XYZRGB, PTS, TXT, CSV, ASC, LAS, LAZ, E57, NPY, or a mesh.

    Coordinates come as they stand in the file, in float64. Those of LAS (by convention) and E57 (by its standard) are
    in meters and stay so: say it where the unit is asked for. LAS and LAZ need ``pip install 'o3dleaf[las]'``, E57
    ``pip install 'o3dleaf[e57]'``. Colors come along, and normals of LAS; for intensities the cloud has no place.
    NPY is an array (n, 3), or (n, 6) with normals. Of meshes, PLY, OBJ, STL and OFF, the points are the vertices, with
    their colors, and normals where each has one.

    Parameters
    ----------
    path : str or path
    least : int
        The fewest points that will do.
    finite : bool
        Whether a point that is NaN or infinite is an error; `preprocess_point_cloud` leaves such points out.
    columns : str or sequence of str, optional
        Names of the columns of a text file, from the first on, such as "x y z nx ny nz r g b"; any other name leaves
        its column out. By default those in the file's header, or x, y and z.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, it was cut off so that it holds fewer points than it says, it holds
        fewer than `least`, or one is not finite; of text, the message names the line.
    """
    file = require_file(path)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{file}: unknown kind of point cloud {file.suffix!r}; give one of {', '.join(SUFFIXES)}")
    if columns is not None and suffix not in WITH_COLUMNS:
        raise InputError(f"columns: {file} names its own; leave columns out, they are for {', '.join(WITH_COLUMNS)}")
    cloud = _read(file, suffix, columns)
    points = np.asarray(cloud.points)
    if not len(points):
        raise InputError(f"{file}: no points could be read; the cloud is empty or the file is damaged, export it again")
    if len(points) < least:
        raise InputError(f"{file}: has {len(points)} points; at least {least} are needed")
    if finite:
        require_finite(points, str(file))
    return cloud


def has_faces(path: str | PathLike[str]) -> bool:
    """Return whether a file of points is one of a mesh, of which `read_point_cloud` takes the vertices."""
    file = require_file(path)
    if file.suffix.lower() == ".obj":
        return holds_faces(file)
    if file.suffix.lower() != ".ply":
        return file.suffix.lower() in MESHES
    return any(each.name == "face" and each.count for each in PlyHeader.of(file).elements(file))


def _read(file: Path, suffix: str, columns: str | Sequence[str] | None) -> o3d.geometry.PointCloud:
    """Return what the reader of a format makes of a file."""
    if suffix in text.SUFFIXES or columns is not None:
        return text.read_text(file, columns).to_open3d()
    if suffix in OTHERS:
        return OTHERS[suffix](file).to_open3d()
    if suffix in READERS:
        content = read_ply(file, faces=False) if suffix == ".ply" else READERS[suffix](file)
        return Columns(content.vertices, content.normals, content.attributes.get("colors")).to_open3d()
    require_whole_cloud(file)
    return (read_pts(file) if suffix == ".pts" else text.read_columns(file, NAMED[suffix])).to_open3d()
