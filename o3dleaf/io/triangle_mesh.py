"""Meshes to disk: whole or not at all, with every digit that the format holds."""

from os import PathLike
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.atomic_files import require_whole_ply, require_writable, whole_file
from o3dleaf.core.checks import FloatArray, require_file
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.mesh_arrays import MeshLike, build_mesh, mesh_arrays

SUFFIXES = (".ply", ".obj", ".stl")
"""What meshes can be written as."""

PLY_TYPES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"} | {
    "f4": "float",
    "f8": "double",
}
"""PLY's names of NumPy's types."""

LINES = 100_000
"""Rows of an OBJ file that are turned into text at once."""


def read_triangle_mesh(path: str | PathLike[str]) -> o3d.geometry.TriangleMesh:
    """Return the triangle mesh of a PLY, OBJ, STL or OFF file; `o3dleaf.read_labelled_mesh` keeps its labels too.

    STL repeats every corner of a triangle: equal ones become one vertex, without a normal.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or it holds no triangle.
    """
    file = require_file(path)
    if file.suffix.lower() == ".ply":
        require_whole_ply(file)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        mesh = o3d.io.read_triangle_mesh(file)
    if not mesh.has_triangles():
        raise InputError(f"{file}: no triangles could be read; is it a point cloud, or no PLY, OBJ, STL or OFF file?")
    vertices, triangles = mesh_arrays(mesh)
    return join_corners(vertices[triangles]) if file.suffix.lower() == ".stl" else mesh


def join_corners(corners: FloatArray) -> o3d.geometry.TriangleMesh:
    """Return the mesh of the (m, 3, 3) corners of its triangles, exactly equal ones as one vertex."""
    mesh = build_mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return mesh.remove_duplicated_vertices()


def write_triangle_mesh(path: str | PathLike[str], mesh: MeshLike) -> None:
    """Write a mesh to a file, by the suffix of its name; a failure leaves nothing new behind.

    The file is written under another name in the same folder and then takes its own, so that a
    reader never sees half of it, and an old file of the name survives a failure.

    ======  =========================================================================================
    suffix  what is kept
    ======  =========================================================================================
    .ply    binary, vertices in float64, with normals and colours if the mesh has them, and with all
            other attributes of a tensor mesh's vertices (`o3d.t.io.read_point_cloud` reads them back)
    .obj    text with every digit of float64 (Open3D's own writer keeps six)
    .stl    binary, float32 by the format's definition, with the triangles' normals
    ======  =========================================================================================

    Parameters
    ----------
    path : path-like
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.

    Raises
    ------
    InputError
        If the suffix is unknown, the folder is not there or cannot be written to, or the mesh is empty.
    O3DLeafError
        If the disk is full or the writer fails.
    """
    writers = dict(zip(SUFFIXES, (_write_open3d, _write_obj, _write_stl), strict=True))
    target = require_writable(path, SUFFIXES)
    extra = _attributes(mesh) if target.suffix.lower() == ".ply" else {}
    legacy = mesh if isinstance(mesh, o3d.geometry.TriangleMesh) else build_mesh(*mesh_arrays(mesh))
    if not legacy.has_triangles():
        raise InputError(f"{target}: the mesh has no triangles; there is nothing to write")
    with whole_file(target) as temporary:
        if extra:
            _write_attributes(temporary, legacy, extra)
        else:
            writers[target.suffix.lower()](temporary, legacy)


def _attributes(mesh: MeshLike) -> dict[str, npt.NDArray[Any]]:
    """Return the attributes of a tensor mesh's vertices but their positions, (n, c) each."""
    if not isinstance(mesh, o3d.t.geometry.TriangleMesh):
        return {}
    found = {name: np.asarray(tensor.cpu().numpy()) for name, tensor in mesh.vertex.items() if name != "positions"}
    return {name: values.reshape(len(values), -1) for name, values in found.items()}


def _write_attributes(path: Path, mesh: o3d.geometry.TriangleMesh, extra: dict[str, npt.NDArray[Any]]) -> None:
    """Write binary PLY with the vertices' attributes as properties, which Open3D's writers of meshes leave out."""
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    columns = dict(zip("xyz", vertices.T, strict=True))
    for name, values in extra.items():
        if name == "colors":
            colours = values if values.dtype == np.uint8 else np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)
            columns |= dict(zip(("red", "green", "blue"), colours.T, strict=True))
        elif name == "normals":
            columns |= dict(zip(("nx", "ny", "nz"), values.astype(np.float64).T, strict=True))
        else:
            several = values.shape[1] > 1
            columns |= {f"{name}_{n}" if several else name: column for n, column in enumerate(values.T)}
    rows = np.empty(len(vertices), dtype=[(name, _little(column.dtype)) for name, column in columns.items()])
    for name, column in columns.items():
        rows[name] = column
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
    faces["count"], faces["corners"] = 3, triangles
    header = ["ply", "format binary_little_endian 1.0", "comment o3dleaf mesh", f"element vertex {len(rows)}"]
    header += [f"property {PLY_TYPES[rows.dtype[name].str[1:]]} {name}" for name in columns]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        file.write(rows.tobytes())
        file.write(faces.tobytes())


def _little(dtype: np.dtype[Any]) -> str:
    """Return the type of PLY's that holds numbers of a type: the same, or float64."""
    return f"<{dtype.str[1:]}" if dtype.str[1:] in PLY_TYPES else "<f8"


def _write_open3d(path: Path, mesh: o3d.geometry.TriangleMesh) -> None:
    """Write by Open3D, whose writers say no by returning False."""
    if not o3d.io.write_triangle_mesh(path, mesh, write_ascii=False):
        raise O3DLeafError(f"{path.suffix}: Open3D could not write the mesh; free space on the disk or choose another")


def _write_stl(path: Path, mesh: o3d.geometry.TriangleMesh) -> None:
    """Write binary STL with the triangles' normals, without which Open3D leaves an empty file."""
    copy = build_mesh(*mesh_arrays(mesh))
    copy.compute_triangle_normals()
    _write_open3d(path, copy)


def _write_obj(path: Path, mesh: o3d.geometry.TriangleMesh) -> None:
    """Write OBJ with the shortest text of each number that reads back bit for bit."""
    normals = np.asarray(mesh.vertex_normals) if mesh.has_vertex_normals() else np.empty((0, 3))
    corner = "%d//%d" if len(normals) else "%d"
    corners = np.asarray(mesh.triangles) + 1
    with path.open("w", encoding="ascii", newline="\n") as file:
        _write_rows(file, "v %r %r %r\n", np.asarray(mesh.vertices))
        _write_rows(file, "vn %r %r %r\n", normals)
        _write_rows(file, f"f {corner} {corner} {corner}\n", np.repeat(corners, 2 if len(normals) else 1, axis=1))


def _write_rows(file: TextIO, line: str, rows: npt.NDArray[Any]) -> None:
    """Write one `line` a row, many rows at a time."""
    for start in range(0, len(rows), LINES):
        block = rows[start : start + LINES]
        file.write(line * len(block) % tuple(block.ravel().tolist()))
