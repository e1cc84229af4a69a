"""Binary PLY, written at known places: in one go from memory, or block by block, in any order and from any thread."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import claim
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import blocks
from o3dleaf.io.labelled_mesh import LabelArray
from o3dleaf.io.mesh_data import IndexArray, MeshData

TYPES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"} | {
    "f4": "float",
    "f8": "double",
}
"""PLY's names of NumPy's types."""
XYZ = np.dtype([(axis, "<f8") for axis in "xyz"])
"""A vertex that carries nothing."""
BLOCK = 1 << 17
"""Vertices or triangles written at once."""
GAP = 1024
"""Vertices that are read though they were not requested, rather than going to the disk twice."""


@dataclass(frozen=True)
class PlyLayout:
    """Elements and properties of a binary PLY file, known before its first vertex.

    Attributes
    ----------
    vertices : int
    triangles : int, optional
        None: points without faces.
    vertex : dtype
        Of a vertex.
    names : tuple of str, optional
        Of the labels of the faces; None: they have none.
    comments : tuple of str
    index : {"int", "uint"}
        Type that the header gives to the numbers of vertices.
    """

    vertices: int
    triangles: int | None = None
    vertex: np.dtype[Any] = XYZ
    names: tuple[str, ...] | None = None
    comments: tuple[str, ...] = ()
    index: str = "int"

    @cached_property
    def header(self) -> bytes:
        """The header, its comments in ASCII."""
        lines = ["ply", "format binary_little_endian 1.0", *(f"comment {line}" for line in self.comments)]
        if self.names is not None:
            lines.append("comment label: " + ", ".join(f"{number} {name}" for number, name in enumerate(self.names)))
        lines.append(f"element vertex {self.vertices}")
        lines += [f"property {TYPES[self.vertex[name].str[1:]]} {name}" for name in self.vertex.names or ()]
        if self.triangles is not None:
            lines += [f"element face {self.triangles}", f"property list uchar {self.index} vertex_indices"]
        lines += [] if self.names is None else ["property uchar label"]
        return "\n".join([*lines, "end_header", ""]).encode("ascii", "replace")

    @property
    def face(self) -> np.dtype[Any]:
        """Packed dtype of a face."""
        label = [] if self.names is None else [("label", "u1")]
        return np.dtype([("count", "u1"), ("corners", "<i4", (3,)), *label])

    def vertex_offset(self, number: int) -> int:
        """Return where a vertex begins."""
        return len(self.header) + self.vertex.itemsize * number

    def face_offset(self, number: int) -> int:
        """Return where a face begins."""
        return self.vertex_offset(self.vertices) + self.face.itemsize * number

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self.face_offset(self.triangles or 0)


class PlyFile:
    """A binary PLY file of known layout, written block by block, and read back so by the writers of other formats."""

    normals = None

    def __init__(self, file: IO[bytes], layout: PlyLayout) -> None:
        """Write the header; the file has its full length from the start."""
        self.layout, self._file = layout, file.fileno()
        # Not pread and pwrite, which Windows has not; and writes to one file wait for one another in the system, too.
        self._place = Lock()
        self.vertex_count, self.triangle_count = layout.vertices, layout.triangles or 0
        self.label_names = layout.names or ()
        claim(file, layout.size)
        self._write(layout.header, 0)
        os.ftruncate(self._file, layout.size)

    def put_vertices(self, start: int, vertices: npt.NDArray[Any]) -> None:
        """Write the vertices number start, ...: positions (n, 3), or (n,) records where they carry more."""
        rows = vertices if vertices.dtype.names else np.ascontiguousarray(vertices, dtype="<f8")
        self._write(rows, self.layout.vertex_offset(start))

    def put_triangles(self, start: int, triangles: IndexArray, labels: LabelArray | None = None) -> None:
        """Write the faces number start, ..."""
        faces = np.empty(len(triangles), dtype=self.layout.face)
        faces["count"], faces["corners"] = 3, triangles
        if labels is not None:
            faces["label"] = labels
        self._write(faces, self.layout.face_offset(start))

    def vertex_block(self, start: int, stop: int) -> FloatArray:
        """Return the positions of vertices that were written."""
        offset, stop_offset = self.layout.vertex_offset(start), self.layout.vertex_offset(stop)
        return np.frombuffer(self._read(stop_offset - offset, offset), dtype="<f8").reshape(-1, 3)

    def triangle_block(self, start: int, stop: int) -> tuple[IndexArray, LabelArray | None]:
        """Return triangles that were written, and their labels."""
        offset, stop_offset = self.layout.face_offset(start), self.layout.face_offset(stop)
        faces = np.frombuffer(self._read(stop_offset - offset, offset), dtype=self.layout.face)
        return faces["corners"], None if self.layout.names is None else faces["label"]

    def corners(self, triangles: IndexArray) -> FloatArray:
        """Return the (m, 3, 3) positions of triangles; those of one block are numbered in few runs."""
        numbers, row = np.unique(triangles, return_inverse=True)
        runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > GAP) + 1)
        parts = [self.vertex_block(int(run[0]), int(run[-1]) + 1)[run - run[0]] for run in runs]
        return np.asarray(np.concatenate(parts)[row.reshape(-1, 3)])

    def _write(self, data: bytes | npt.NDArray[Any], offset: int) -> None:
        """Write all of `data`; the system may take it in parts."""
        view = memoryview(data).cast("B") if isinstance(data, bytes) else data.reshape(-1).view(np.uint8).data
        with self._place:
            os.lseek(self._file, offset, os.SEEK_SET)
            while len(view):
                view = view[os.write(self._file, view) :]

    def _read(self, size: int, offset: int) -> bytes:
        with self._place:
            os.lseek(self._file, offset, os.SEEK_SET)
            return os.read(self._file, size)


def write_ply(out: IO[bytes], mesh: MeshData, comments: tuple[str, ...] = (), *, index: str = "int") -> None:
    """Write a mesh with all that its vertices carry, and the labels of its faces."""
    columns = {**dict(zip("xyz", mesh.vertices.T, strict=True)), **attribute_columns(mesh.attributes)}
    names = None if mesh.labels is None else mesh.names
    total = mesh.triangle_count
    file = PlyFile(out, PlyLayout(mesh.vertex_count, total, _record(columns), names, comments, index))
    _put_columns(file, columns)
    for start, stop in blocks(total, BLOCK):
        file.put_triangles(start, *mesh.triangle_block(start, stop))
        progress.report(stop, total)


def write_ply_points(out: IO[bytes], columns: Mapping[str, npt.NDArray[Any]], comments: tuple[str, ...]) -> None:
    """Write points by their columns, x, y and z first."""
    file = PlyFile(out, PlyLayout(len(columns["x"]), vertex=_record(columns), comments=comments))
    _put_columns(file, columns)


def attribute_columns(attributes: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Return (n,) columns by PLY's names for what vertices carry: nx, ny, nz, red, green, blue, others as they are."""
    columns: dict[str, npt.NDArray[Any]] = {}
    for name, values in attributes.items():
        rows = values.reshape(len(values), -1)
        if name == "colors":
            shades = rows if rows.dtype == np.uint8 else np.floor(255 * np.clip(rows, 0, 1) + 0.5).astype(np.uint8)
            columns |= dict(zip(("red", "green", "blue"), shades.T, strict=True))
        elif name == "normals":
            columns |= dict(zip(("nx", "ny", "nz"), rows.astype(np.float64).T, strict=True))
        else:
            several = rows.shape[1] > 1
            columns |= {f"{name}_{n}" if several else name: column for n, column in enumerate(rows.T)}
    return columns


def _record(columns: Mapping[str, npt.NDArray[Any]]) -> np.dtype[Any]:
    """Return what a vertex with such columns consists of: their types, or float64 where PLY has not theirs."""
    kinds = {name: column.dtype.str[1:] for name, column in columns.items()}
    return np.dtype([(name, f"<{kind}" if kind in TYPES else "<f8") for name, kind in kinds.items()])


def _put_columns(file: PlyFile, columns: Mapping[str, npt.NDArray[Any]]) -> None:
    for start, stop in blocks(file.vertex_count, BLOCK):
        rows = np.empty(stop - start, dtype=file.layout.vertex)
        for name, column in columns.items():
            rows[name] = column[start:stop]
        file.put_vertices(start, rows)
