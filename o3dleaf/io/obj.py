"""OBJ: text with every digit of float64, normals where there are any, one group a label."""

from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import blocks
from o3dleaf.io.labelled_mesh import label_parts
from o3dleaf.io.mesh_data import IndexArray, MeshBlocks, MeshData

BLOCK = 1 << 17
"""Rows turned into text at once."""


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


def read_obj(file: Path) -> MeshData | None:
    """Return an OBJ of triangles by its groups; without groups, or with other polygons, None.

    Raises
    ------
    InputError
        If a line is no vertex or no face, as the last one of a file that was cut off.
    """
    vertices: list[bytes] = []
    corners: list[list[bytes]] = []
    groups: list[tuple[str, int]] = []
    with file.open("rb") as stream:
        for line in stream:
            if line.startswith(b"v "):
                vertices.append(line[2:])
            elif line.startswith(b"g "):
                groups.append((line[2:].split()[0].decode("ascii", "replace") if line[2:].split() else "", 0))
            elif line.startswith(b"f "):
                corners.append(line[2:].split())
                if groups:
                    groups[-1] = groups[-1][0], groups[-1][1] + 1
    if any(len(row) < 3 for row in corners) or any(len(line.split()) < 3 for line in vertices):
        raise InputError(f"{file}: has a vertex or a face with fewer than three numbers; it was cut off, copy it again")
    if sum(count for _, count in groups) != len(corners) or any(len(row) != 3 for row in corners):
        return None
    points = np.array([line.split()[:3] for line in vertices], dtype=np.bytes_).astype(np.float64)
    numbers = np.array([[word.split(b"/")[0] for word in row] for row in corners], dtype=np.bytes_).astype(np.int64)
    labels, names = label_parts(groups)
    return MeshData(points.reshape(-1, 3), numbers.reshape(-1, 3) - 1, labels, names)
