"""Triangle meshes from and to files, by the suffix of the name: whole or not at all, with every digit and label."""

from collections.abc import Callable
from os import PathLike
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.atomic_files import require_writable, whole_file
from o3dleaf.core.checks.files import require_file
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.io.labelled_mesh import AnyMesh, LabelledMesh
from o3dleaf.io.mesh_data import MeshData, unit_comment
from o3dleaf.io.obj import read_obj, write_obj
from o3dleaf.io.ply import write_ply
from o3dleaf.io.ply_reader import read_ply
from o3dleaf.io.polygons.off import read_off
from o3dleaf.io.stl import HEADER, is_binary, read_stl, write_stl
from o3dleaf.io.stl_text import read_stl_text

SUFFIXES = (".ply", ".obj", ".stl")
"""Formats of meshes."""
OPEN3D = "Created by Open3D"
"""Comment of a plain mesh without labels, whose file is the same byte for byte as by Open3D's own writer."""


def read_triangle_mesh(path: str | PathLike[str]) -> o3d.geometry.TriangleMesh:
    """Return the triangle mesh of a PLY, OBJ, STL or OFF file; `read_mesh` keeps its labels too.

    STL repeats every corner of a triangle: equal ones become one vertex, without a normal.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read or was cut off, or it holds no triangle.
    """
    file = require_file(path)
    mesh = _open3d_mesh(_read(file))
    if not mesh.has_triangles():
        raise InputError(f"{file}: no triangles could be read; give a mesh, not a point cloud, as PLY, OBJ, STL or OFF")
    return mesh


def _read(file: Path) -> MeshData:
    """Return what the reader of a format makes of a file: our own, as Open3D's lose their way in damaged files."""
    suffix = file.suffix.lower()
    if suffix not in READERS:
        raise InputError(f"{file}: unknown kind of mesh {file.suffix!r}; give one of {', '.join(READERS)}")
    return READERS[suffix](file)


def _read_any_stl(file: Path) -> MeshData:
    return read_stl(file) if is_binary(file) else read_stl_text(file)


READERS: dict[str, Callable[[Path], MeshData]] = {
    ".ply": read_ply, ".obj": read_obj, ".stl": _read_any_stl, ".off": read_off
}  # fmt: skip


def _open3d_mesh(data: MeshData) -> o3d.geometry.TriangleMesh:
    """Return a mesh from a file, its numbers checked."""
    mesh = build_mesh(*mesh_arrays((data.vertices, data.triangles)))
    for name, values in data.attributes.items():
        setattr(mesh, f"vertex_{name}", o3d.utility.Vector3dVector(np.ascontiguousarray(values)))
    return mesh


@checked
def read_mesh(path: str | PathLike[str]) -> LabelledMesh:
    """Return a mesh with the labels of its triangles, where the file has them.

    ======  ===============================================================================
    suffix  where labels are looked for
    ======  ===============================================================================
    .ply    the property ``label`` of the faces, and the comment that names them
    .stl    the solids of an ASCII file; the attributes of a binary one that o3dleaf wrote
    .obj    the groups (``g``)
    ======  ===============================================================================

    Names that are the leaf's own (adaxial, abaxial, rim) get its numbers, others the next ones as they come. STL
    repeats every corner of a triangle: equal ones become one vertex. Faces of more than three corners are cut into
    triangles. Normals and colors of vertices come along; textures and materials are not looked at, nor any other file.

    Parameters
    ----------
    path : path-like
        PLY, STL, OBJ or OFF.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, holds no triangle, or labels of other polygons than triangles.
    """
    file = require_file(path)
    data = _read(file)
    if not len(data.triangles):
        raise InputError(f"{file}: has no triangles; it is a point cloud, or cut off; give a mesh")
    return LabelledMesh(_open3d_mesh(data), data.labels, data.names, data.unit)


@checked
def write_mesh(mesh: AnyMesh, path: str | PathLike[str], comments: tuple[str, ...] | None = None) -> None:
    """Write a mesh to a file, by the suffix of its name; a failure leaves nothing new behind.

    The file is written under another name in the same folder and then takes its own, so that a
    reader never sees half of it, and an old file of the name survives a failure.

    ======  =========================================================================================
    suffix  what is kept
    ======  =========================================================================================
    .ply    binary, vertices in float64, with normals and colors if the mesh has them, and with all
            other attributes of a tensor mesh's vertices (`o3d.t.io.read_point_cloud` reads them back);
            labels as a property of the faces, the unit and the names of labels as comments
    .obj    text with every digit of float64 (Open3D's own writer keeps six) and normals; labels as
            groups, the unit as a comment
    .stl    binary, float32 by the format's definition, with the triangles' normals; labels as the
            triangles' attributes
    ======  =========================================================================================

    `export_mesh` knows what other programs want.

    Parameters
    ----------
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
        Not modified.
    path : path-like
    comments : tuple of str, optional
        Comments of the file, instead of "o3dleaf" and the unit.

    Raises
    ------
    InputError
        If the suffix is unknown, the folder is not there or cannot be written to, or the mesh is empty.
    O3DLeafError
        If the disk is full or the writer fails.
    """
    target = require_writable(path, SUFFIXES)
    data, suffix = MeshData.of(mesh), target.suffix.lower()
    lines = _comments(mesh, data, suffix) if comments is None else comments
    with whole_file(target) as temporary, temporary.open("r+b") as out:
        if suffix == ".ply":
            write_ply(out, data, (OPEN3D,) if lines is None else lines, index="uint" if lines is None else "int")
        elif suffix == ".stl":
            words = OPEN3D.ljust(HEADER, "\0") if lines is None else "; ".join(lines)
            write_stl(out, data, words.encode("ascii", "replace"))
        else:
            write_obj(out, data, lines or ())


def _comments(mesh: AnyMesh, data: MeshData, suffix: str) -> tuple[str, ...] | None:
    """Return the comments of a file; None: those of Open3D's own writer."""
    if isinstance(mesh, LabelledMesh):
        # Binary STL that begins with our name has labels.
        return None if suffix == ".stl" and data.labels is None else ("o3dleaf", *unit_comment(mesh.unit))
    is_ours = suffix == ".ply" and data.attributes and isinstance(mesh, o3d.t.geometry.TriangleMesh)
    return ("o3dleaf mesh",) if is_ours else None
