"""Where an assembled surface goes: arrays in memory, or a PLY, STL or OBJ file written at known places.

Records have one size each, so that blocks may come in any order and from any thread; nothing of the
mesh is held. STL repeats the corners and OBJ is text: both are made from a scratch file at the end.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import require_free, require_writable, whole_file
from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import blocks
from o3dleaf.io.labelled_mesh import LABELS, LabelledMesh
from o3dleaf.io.triangle_mesh import SUFFIXES

VERTEX_BYTES = 24
FACE = np.dtype([("count", "u1"), ("corners", "<i4", (3,)), ("label", "u1")])
"""A face of a PLY file, packed."""
TRIANGLE = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("label", "<u2")])
"""A triangle of an STL file; its label is in the attribute."""
OBJ_VERTEX_BYTES, OBJ_FACE_BYTES = 64, 32
"""Longest line of an OBJ file, nearly."""
BLOCK = 1 << 17


class Mesh(Protocol):
    """What is known of a surface before it is made."""

    @property
    def vertices(self) -> int:
        """Number of vertices."""
        ...

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        ...


class Arrays:
    """A sink that keeps the mesh.

    Attributes
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    labels : (m,) ndarray of uint8
    """

    def __init__(self, mesh: Mesh) -> None:
        self.vertices = np.empty((mesh.vertices, 3))
        self.triangles = np.empty((mesh.triangles, 3), dtype=np.int64)
        self.labels = np.empty(mesh.triangles, dtype=np.uint8)

    def put_vertices(self, start: int, vertices: FloatArray) -> None:
        """Keep the vertices number start, ..."""
        self.vertices[start : start + len(vertices)] = vertices

    def put_triangles(self, start: int, triangles: npt.NDArray[np.integer[Any]], labels: npt.NDArray[np.uint8]) -> None:
        """Keep the triangles number start, ..."""
        self.triangles[start : start + len(triangles)] = triangles
        self.labels[start : start + len(triangles)] = labels


@dataclass(frozen=True)
class Counts:
    """The size of a mesh that is in memory."""

    vertices: int
    triangles: int


def write_mesh(mesh: LabelledMesh, path: str | PathLike[str], comments: tuple[str, ...] | None = None) -> None:
    """Write a labelled mesh to a PLY, STL or OBJ file, whole or not at all, saying its unit."""
    vertices, triangles = np.asarray(mesh.mesh.vertices), np.asarray(mesh.mesh.triangles)
    said = ("o3dleaf", *unit_comment(mesh.unit)) if comments is None else comments
    labels = np.zeros(len(triangles), dtype=np.uint8) if mesh.labels is None else mesh.labels
    with mesh_file(path, Counts(len(vertices), len(triangles)), said) as sink:
        sink.put_vertices(0, vertices)
        sink.put_triangles(0, triangles, labels)


class PlyFile:
    """A sink that writes binary PLY: float64 vertices, faces with a label each."""

    def __init__(self, path: Path, mesh: Mesh, comments: tuple[str, ...]) -> None:
        """Write the header; the file has its full length from the start."""
        header = _ply_header(mesh, comments)
        self.mesh = mesh
        self.first_vertex = len(header)
        self.first_face = self.first_vertex + VERTEX_BYTES * mesh.vertices
        self.file = os.open(path, os.O_RDWR)
        try:
            _write_at(self.file, header, 0)
            os.ftruncate(self.file, self.first_face + FACE.itemsize * mesh.triangles)
        except BaseException:
            self.close()
            raise

    def put_vertices(self, start: int, vertices: FloatArray) -> None:
        """Write the vertices number start, ..."""
        data = np.ascontiguousarray(vertices, dtype="<f8")
        _write_at(self.file, data, self.first_vertex + VERTEX_BYTES * start)

    def put_triangles(self, start: int, triangles: npt.NDArray[np.integer[Any]], labels: npt.NDArray[np.uint8]) -> None:
        """Write the faces number start, ..."""
        faces = np.empty(len(triangles), dtype=FACE)
        faces["count"], faces["corners"], faces["label"] = 3, triangles, labels
        _write_at(self.file, faces, self.first_face + FACE.itemsize * start)

    def vertices_at(self, start: int, count: int) -> FloatArray:
        """Return vertices that were written."""
        data = os.pread(self.file, VERTEX_BYTES * count, self.first_vertex + VERTEX_BYTES * start)
        return np.frombuffer(data, dtype="<f8").reshape(-1, 3)

    def faces_at(self, start: int, count: int) -> npt.NDArray[Any]:
        """Return faces that were written."""
        data = os.pread(self.file, FACE.itemsize * count, self.first_face + FACE.itemsize * start)
        return np.frombuffer(data, dtype=FACE)

    def close(self) -> None:
        """Close the file."""
        os.close(self.file)


@contextmanager
def mesh_file(path: str | PathLike[str], mesh: Mesh, comments: tuple[str, ...] = ()) -> Iterator[PlyFile]:
    """Yield a sink for a file of the path's suffix: .ply, .stl or .obj; it takes the name when it is whole.

    ======  ====================================================================================
    suffix  what is written
    ======  ====================================================================================
    .ply    binary, float64 vertices; property ``label`` of a face: 0 adaxial, 1 abaxial, 2 rim
    .stl    binary, float32 by the format's definition; the label is the triangle's attribute
    .obj    text, every digit of float64; faces in three groups named by their labels
    ======  ====================================================================================

    Raises
    ------
    InputError
        If the suffix is unknown or the folder cannot be written to.
    O3DLeafError
        If the disk has no room for it, said before anything is written, or writing fails.
    """
    target = require_writable(path, SUFFIXES)
    require_free(target, sum(file_bytes(target.suffix.lower(), mesh, comments)))
    with whole_file(target) as temporary:
        if target.suffix.lower() == ".ply":
            with _opened(temporary, mesh, comments) as file:
                yield file
            return
        convert = _write_stl if target.suffix.lower() == ".stl" else _write_obj
        scratch = temporary.with_suffix(".scratch")
        scratch.touch()
        try:
            with _opened(scratch, mesh, comments) as file:
                yield file
                with temporary.open("wb") as out:
                    convert(out, file, comments)
        finally:
            scratch.unlink(missing_ok=True)


def file_bytes(suffix: str, mesh: Mesh, comments: tuple[str, ...] = ()) -> tuple[int, int]:
    """Return the size of a file, exact but for OBJ, and that of the scratch file beside it."""
    binary = len(_ply_header(mesh, comments)) + VERTEX_BYTES * mesh.vertices + FACE.itemsize * mesh.triangles
    if suffix == ".ply":
        return binary, 0
    if suffix == ".stl":
        return 84 + TRIANGLE.itemsize * mesh.triangles, binary
    return OBJ_VERTEX_BYTES * mesh.vertices + OBJ_FACE_BYTES * mesh.triangles, binary


@contextmanager
def _opened(path: Path, mesh: Mesh, comments: tuple[str, ...]) -> Iterator[PlyFile]:
    file = PlyFile(path, mesh, comments)
    try:
        yield file
    finally:
        file.close()


def unit_comment(unit: str | None) -> tuple[str, ...]:
    """Return the line by which a file says its unit, if there is one."""
    return () if unit is None else (f"unit {unit}",)


def _ply_header(mesh: Mesh, comments: tuple[str, ...]) -> bytes:
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {line}" for line in comments),
        "comment label: " + ", ".join(f"{number} {name}" for number, name in enumerate(LABELS)),
        f"element vertex {mesh.vertices}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {mesh.triangles}",
        "property list uchar int vertex_indices",
        "property uchar label",
        "end_header",
    ]
    return ("\n".join(lines) + "\n").encode("ascii", "replace")


def _write_at(file: int, data: bytes | npt.NDArray[Any], offset: int) -> None:
    """Write all of `data`; the system may take it in parts."""
    view = memoryview(data).cast("B") if isinstance(data, bytes) else data.reshape(-1).view(np.uint8).data
    while len(view):
        written = os.pwrite(file, view, offset)
        view, offset = view[written:], offset + written


def _write_stl(out: IO[bytes], scratch: PlyFile, comments: tuple[str, ...]) -> None:
    """Write binary STL from the scratch file, a block of triangles at a time."""
    out.write("; ".join(comments).encode("ascii", "replace")[:80].ljust(80))
    out.write(np.uint32(scratch.mesh.triangles).tobytes())
    for start, stop in blocks(scratch.mesh.triangles, BLOCK):
        faces = scratch.faces_at(start, stop - start)
        corners = _corners(scratch, faces["corners"])
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        triangles = np.empty(len(faces), dtype=TRIANGLE)
        triangles["normal"] = normal / np.where(length > 0, length, 1.0)
        triangles["corners"], triangles["label"] = corners, faces["label"]
        out.write(triangles.tobytes())


def _corners(scratch: PlyFile, triangles: npt.NDArray[np.int32]) -> FloatArray:
    """Return the (m, 3, 3) positions of some triangles; those of one block are numbered in few runs."""
    numbers, row = np.unique(triangles, return_inverse=True)
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1024) + 1)
    parts = []
    for run in runs:
        found = scratch.vertices_at(int(run[0]), int(run[-1] - run[0]) + 1)
        parts.append(found[run - run[0]])
    positions: FloatArray = np.concatenate(parts)[row.reshape(-1, 3)]
    return positions


def _write_obj(out: IO[bytes], scratch: PlyFile, comments: tuple[str, ...]) -> None:
    """Write OBJ from the scratch file: every vertex, then the faces of each label."""
    out.writelines(f"# {line}\n".encode() for line in comments)
    for start, stop in blocks(scratch.mesh.vertices, BLOCK):
        rows = scratch.vertices_at(start, stop - start)
        out.write(("v %r %r %r\n" * len(rows) % tuple(rows.ravel().tolist())).encode())
    for label, name in enumerate(LABELS):
        group = f"g {name}\n".encode()
        for start, stop in blocks(scratch.mesh.triangles, BLOCK):
            faces = scratch.faces_at(start, stop - start)
            corners = faces["corners"][faces["label"] == label] + 1
            if len(corners):
                out.write(group + ("f %d %d %d\n" * len(corners) % tuple(corners.ravel().tolist())).encode())
                group = b""
