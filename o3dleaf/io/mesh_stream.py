"""Sinks of a surface that is made block by block: arrays in memory, or a PLY, STL or OBJ file.

Blocks may come in any order and from any thread; of a file nothing is kept in memory. STL repeats the corners and OBJ
is text: both are made from a scratch file at the end.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Protocol

import numpy as np

from o3dleaf.core.atomic_files import require_free, require_writable, whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.io.labelled_mesh import LABELS, LabelArray
from o3dleaf.io.mesh_data import IndexArray
from o3dleaf.io.obj import write_obj
from o3dleaf.io.ply import PlyFile, PlyLayout
from o3dleaf.io.stl import START, TRIANGLE, write_stl
from o3dleaf.io.triangle_mesh import SUFFIXES

OBJ_VERTEX_BYTES, OBJ_TRIANGLE_BYTES = 64, 32
"""Longest line of an OBJ file, nearly."""


class MeshSize(Protocol):
    """Numbers of vertices and triangles of a surface, known before it is made."""

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

    def __init__(self, size: MeshSize) -> None:
        """Make room for it, or raise `MemoryBudgetError`."""
        what, cure = f"mesh: {size.triangles:,} triangles", "coarsen the spacing, choose a region or write it to a file"
        require_resources(measured.TRIANGLE * size.triangles, what, cure)
        self.vertices = np.empty((size.vertices, 3))
        self.triangles = np.empty((size.triangles, 3), dtype=np.int64)
        self.labels = np.empty(size.triangles, dtype=np.uint8)

    def put_vertices(self, start: int, vertices: FloatArray) -> None:
        """Keep the vertices number start, ..."""
        self.vertices[start : start + len(vertices)] = vertices

    def put_triangles(self, start: int, triangles: IndexArray, labels: LabelArray) -> None:
        """Keep the triangles number start, ..."""
        self.triangles[start : start + len(triangles)] = triangles
        self.labels[start : start + len(triangles)] = labels


class Copies:
    """A sink that hands on what it takes to two others."""

    def __init__(self, first: "Arrays | PlyFile", second: "Arrays | PlyFile") -> None:
        self.sinks = first, second

    def put_vertices(self, start: int, vertices: FloatArray) -> None:
        """Hand on the vertices number start, ..."""
        for sink in self.sinks:
            sink.put_vertices(start, vertices)

    def put_triangles(self, start: int, triangles: IndexArray, labels: LabelArray) -> None:
        """Hand on the triangles number start, ..."""
        for sink in self.sinks:
            sink.put_triangles(start, triangles, labels)


@contextmanager
def mesh_file(
    path: str | PathLike[str],
    size: MeshSize,
    comments: tuple[str, ...] = (),
    *,
    scratch: Path | None = None,
) -> Iterator[PlyFile]:
    """Yield a sink for a file of the path's suffix: .ply, .stl or .obj; it takes the name when it is whole.

    ======  =========================================================================
    suffix  what is written
    ======  =========================================================================
    .ply    binary, float64 vertices; the label as a property of the faces
    .stl    binary, float32 by the format's definition; the label as the attribute
    .obj    text, every digit of float64; faces in groups named by their labels
    ======  =========================================================================

    Parameters
    ----------
    path : path-like
    size : MeshSize
    comments : tuple of str
    scratch : Path, optional
        A file on the same disk that the blocks go to and stay in if they do not all come: opened again, it still has
        them.

    Raises
    ------
    InputError
        If the suffix is unknown or the folder cannot be written to.
    O3DLeafError
        If the disk has no room for it, said before anything is written, or writing fails.
    """
    target = require_writable(path, SUFFIXES)
    suffix = target.suffix.lower()
    require_free(target, sum(file_bytes(suffix, size, comments)))
    layout = _layout(size, comments)
    with whole_file(target) as temporary:
        if scratch is not None:
            scratch.touch()
            with scratch.open("r+b") as blocks:
                surface = PlyFile(blocks, layout)
                yield surface
                if suffix != ".ply":
                    _write_again(surface, temporary, suffix, comments)
            if suffix == ".ply":
                scratch.replace(temporary)
        elif suffix == ".ply":
            with temporary.open("r+b") as out:
                yield PlyFile(out, layout)
        else:
            with tempfile.TemporaryFile(dir=temporary.parent) as blocks:
                surface = PlyFile(blocks, layout)
                yield surface
                _write_again(surface, temporary, suffix, comments)


def _write_again(surface: PlyFile, path: Path, suffix: str, comments: tuple[str, ...]) -> None:
    """Write a surface as STL or OBJ."""
    with path.open("wb") as out:
        if suffix == ".stl":
            write_stl(out, surface, "; ".join(comments).encode("ascii", "replace"))
        else:
            write_obj(out, surface, comments)


def file_bytes(suffix: str, size: MeshSize, comments: tuple[str, ...] = ()) -> tuple[int, int]:
    """Return the size of a file, exact but for OBJ, and that of the scratch file beside it."""
    binary = _layout(size, comments).size
    if suffix == ".ply":
        return binary, 0
    if suffix == ".stl":
        return START + TRIANGLE.itemsize * size.triangles, binary
    return OBJ_VERTEX_BYTES * size.vertices + OBJ_TRIANGLE_BYTES * size.triangles, binary


def _layout(size: MeshSize, comments: tuple[str, ...]) -> PlyLayout:
    return PlyLayout(size.vertices, size.triangles, names=LABELS, comments=comments)
