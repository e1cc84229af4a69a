"""OBJ: text with every digit of float64, normals where there are any, one group a label."""

from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import claim
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.io.labelled_mesh import label_parts
from o3dleaf.io.mesh_data import IndexArray, MeshBlocks, MeshData
from o3dleaf.io.polygons.numbers import floats_of, integers_of
from o3dleaf.io.polygons.triangulation import triangulate

BLOCK = 1 << 17
"""Rows turned into text at once."""


SHORTEST = 8
"""Bytes of a line, at least."""


def write_obj(out: IO[bytes], mesh: MeshBlocks, comments: tuple[str, ...] = (), *, group: str | None = None) -> None:
    """Write vertices, normals, and the triangles of each label that occurs as a group.

    Parameters
    ----------
    out : binary file
    mesh : MeshBlocks
    comments : tuple of str
        Comments, in its first lines.
    group : str, optional
        Name of the one group of a mesh without labels; by default it has no group.
    """
    total = mesh.vertex_count + mesh.triangle_count
    normals = mesh.normals
    claim(out, SHORTEST * (total + (0 if normals is None else len(normals))))
    out.writelines(f"# {line}\n".encode() for line in comments)
    for start, stop in blocks(mesh.vertex_count, BLOCK):
        out.write(_rows("v %r %r %r\n", mesh.vertex_block(start, stop)))
        progress.report(stop, total)
    if normals is not None:
        for start, stop in blocks(len(normals), BLOCK):
            out.write(_rows("vn %r %r %r\n", normals[start:stop]))
    corner, repeat = ("%d", 1) if normals is None else ("%d//%d", 2)
    done = mesh.vertex_count
    for label, name in enumerate(mesh.label_names or (group,)):
        head = "" if name is None else f"g {name}\n"
        for start, stop in blocks(mesh.triangle_count, BLOCK):
            triangles = _of_label(mesh, label, start, stop)
            if len(triangles):
                out.write(head.encode() + _rows(f"f {corner} {corner} {corner}\n", np.repeat(triangles + 1, repeat, 1)))
                head = ""
            done += len(triangles)
            progress.report(done, total)


def _rows(line: str, rows: npt.NDArray[Any]) -> bytes:
    """Return one `line` a row."""
    return (line * len(rows) % tuple(rows.ravel().tolist())).encode()


def _of_label(mesh: MeshBlocks, label: int, start: int, stop: int) -> IndexArray:
    """Return the triangles of a block that have a label; without labels, all of them."""
    triangles, labels = mesh.triangle_block(start, stop)
    return triangles if labels is None else triangles[labels == label]


def read_obj(file: Path) -> MeshData:
    """Return an OBJ, its groups as labels, if all of it is triangles in groups, with normals and colors of vertices.

    Normals are kept where every vertex has one of its own, and colors where all have one. Texture coordinates and
    materials are not read, nor the files that it names.

    Raises
    ------
    InputError
        If a line is no vertex or no face, as the last one of a file that was cut off, or a face names no vertex.
    """
    vertices: list[bytes] = []
    normals: list[bytes] = []
    faces: list[list[bytes]] = []
    known: list[int] = []  # vertices before each face: negative numbers count back from there
    groups: list[tuple[str, int]] = []
    with file.open("rb") as stream:
        for line in stream:
            if line.startswith(b"v "):
                vertices.append(line[2:])
            elif line.startswith(b"vn "):
                normals.append(line[3:])
            elif line.startswith(b"g "):
                groups.append((line[2:].split()[0].decode("ascii", "replace") if line[2:].split() else "", 0))
            elif line.startswith(b"f "):
                faces.append(line[2:].split())
                known.append(len(vertices))
                if groups:
                    groups[-1] = groups[-1][0], groups[-1][1] + 1
    if any(len(row) < 3 for row in faces) or any(len(line.split()) < 3 for line in vertices):
        raise InputError(f"{file}: has a vertex or a face with fewer than three numbers; it was cut off, copy it again")
    counts = np.array([len(row) for row in faces], dtype=np.int64)
    points = floats_of((word for line in vertices for word in line.split()[:3]), file).reshape(-1, 3)
    numbers = integers_of((word.split(b"/", 1)[0] for row in faces for word in row), file)
    corners = np.where(numbers < 0, np.repeat(np.array(known, dtype=np.int64), counts) + numbers, numbers - 1)
    triangles, _ = triangulate(points, counts, corners, file)
    attributes = _colors(vertices, file) | _normals(normals, points, faces, numbers, file)
    if sum(count for _, count in groups) != len(faces) or len(triangles) != len(faces) or not groups:
        return MeshData(points, triangles, attributes=attributes)
    labels, names = label_parts(groups)
    return MeshData(points, triangles, labels, names, attributes=attributes)


def holds_faces(file: Path) -> bool:
    """Return whether an OBJ has a face, and not vertices alone."""
    with file.open("rb") as stream:
        return any(line.startswith(b"f ") for line in stream)


def _colors(vertices: list[bytes], file: Path) -> dict[str, FloatArray]:
    """Return the colors behind the positions, shares of 1, if all vertices have some."""
    words = [line.split()[3:6] for line in vertices]
    if not words or any(len(each) < 3 for each in words):
        return {}
    return {"colors": np.clip(floats_of((word for each in words for word in each), file).reshape(-1, 3), 0.0, 1.0)}


def _normals(
    lines: list[bytes], points: FloatArray, faces: list[list[bytes]], numbers: IntArray, file: Path
) -> dict[str, FloatArray]:
    """Return the normals, if there is one a vertex, of the same number in every face."""
    if not lines or len(lines) != len(points):
        return {}
    parts = [word.split(b"/") for row in faces for word in row]
    if any(len(each) < 3 or each[2] != each[0] for each in parts) or any(len(line.split()) < 3 for line in lines):
        return {}
    if np.any(numbers < 0):
        return {}
    return {"normals": floats_of((word for line in lines for word in line.split()[:3]), file).reshape(-1, 3)}
