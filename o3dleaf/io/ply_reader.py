"""PLY files: their headers, points and faces, normals, colors and labels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import METERS
from o3dleaf.io.labelled_mesh import MAX_LABELS, LabelArray, name_labels
from o3dleaf.io.mesh_data import MeshData
from o3dleaf.io.polygons.ply_items import Element, Items, Property, read_binary_items, read_text_items
from o3dleaf.io.polygons.triangulation import triangulate

HEADER = 65536
"""Bytes in which the header of a PLY file must end."""
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"float": "f4", "double": "f8"}
TYPES |= {f"{kind}{bits}": f"{kind[0]}{bits // 8}" for kind in ("int", "uint", "float") for bits in (8, 16, 32, 64)}
"""NumPy's names of PLY's types."""
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
NUMBERS = frozenset(map(str, range(MAX_LABELS)))
"""Labels that a comment may name."""
FORMATS = [["ascii"], *([name] for name in ORDERS)]
COLORS = ("red", "green", "blue")
CORNERS = ("vertex_indices", "vertex_index")
"""What the list of a face's corners is called."""


@dataclass(frozen=True)
class PlyHeader:
    """The lines of a header as words, and where the numbers begin."""

    lines: list[list[str]]
    end: int

    @classmethod
    def of(cls, file: Path) -> "PlyHeader":
        """Read the header of a file.

        Raises
        ------
        InputError
            If it is no PLY.
        """
        with file.open("rb") as stream:
            head = stream.read(HEADER)
        end = head.find(b"end_header")
        if not head.startswith(b"ply") or end < 0 or head.find(b"\n", end) < 0:
            raise InputError(f"{file}: is no PLY file, it does not begin with 'ply' and a header; export it again")
        lines = [line.split() for line in head[:end].decode("ascii", "replace").splitlines()]
        return cls([words for words in lines if words], head.find(b"\n", end) + 1)

    @property
    def order(self) -> str | None:
        """The order of bytes, "<" or ">", or None of a text."""
        return next((ORDERS.get(words[1]) for words in self.lines if words[0] == "format" and len(words) > 1), None)

    def elements(self, file: Path) -> list[Element]:
        """Return the kinds of items, in their order in the file.

        Raises
        ------
        InputError
            If a line makes no sense, a type is unknown, or a name occurs twice.
        """
        if not any(words[0] == "format" and words[1:2] in FORMATS for words in self.lines):
            raise InputError(f"{file}: its PLY header names no format, ascii or binary; export it again")
        try:
            elements: list[tuple[str, int, list[Property]]] = []
            for words in self.lines:
                if words[0] == "element":
                    elements.append((words[1], _count(words[2]), []))
                elif words[0] == "property":
                    elements[-1][2].append(self._property(words))
            _require_once([name for name, *_ in elements])
            for _, _, properties in elements:
                _require_once([each.name for each in properties])
        except (IndexError, KeyError, ValueError) as cause:
            raise InputError(f"{file}: its PLY header is damaged ({cause}); export it again") from cause
        for name, count, properties in elements:
            if properties and count > file.stat().st_size:
                raise InputError(f"{file}: is too short for {count} items ({name}); it was cut off, copy it again")
        return [Element(name, count, tuple(properties)) for name, count, properties in elements]

    def _property(self, words: list[str]) -> Property:
        order = self.order or "<"
        if words[1] != "list":
            return Property(words[2], np.dtype(order + TYPES[words[1]]))
        length = np.dtype(order + TYPES[words[2]])
        if length.kind == "f":
            raise ValueError(f"the length of {words[4]} is a fraction")
        return Property(words[4], np.dtype(order + TYPES[words[3]]), length)

    @property
    def unit(self) -> str | None:
        """The unit that a comment states: ``comment unit mm``."""
        said = (words[2] for words in self.lines if words[:2] == ["comment", "unit"] and len(words) == 3)
        return next((unit for unit in said if unit in METERS), None)

    def label_names(self, labels: LabelArray) -> tuple[str, ...]:
        """Return the names that a comment gives to labels: ``comment label: 0 adaxial, 1 abaxial, 2 rim``."""
        comment = next((" ".join(words[2:]) for words in self.lines if words[:2] == ["comment", "label:"]), "")
        parts = [part.split(maxsplit=1) for part in comment.split(",") if len(part.split()) > 1]
        return name_labels(labels, {int(number): name for number, name in parts if number in NUMBERS})


def _count(word: str) -> int:
    """Return a number of items."""
    if not (word.isascii() and word.isdigit()):
        raise ValueError(f"{word} is no number of items")
    return int(word)


def _require_once(names: list[str]) -> None:
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"{min(twice)} occurs more than once")


def read_ply(file: Path, *, faces: bool = True) -> MeshData:
    """Return points and triangles of a PLY file with normals, colors, and labels of triangles, where it has them.

    Parameters
    ----------
    file : Path
    faces : bool
        Whether faces are wanted; those of more than three corners are cut into triangles.

    Raises
    ------
    InputError
        If the file is no PLY, names no points, was cut off or is damaged, or has labels of other polygons.
    """
    header = PlyHeader.of(file)
    items = _items(file, header, {"vertex", "face"} if faces else {"vertex"})
    points = items["vertex"].numbers
    vertices = _columns(points, "xyz")
    if vertices is None:
        raise InputError(f"{file}: its points have no x, y and z; export it again")
    attributes = {"normals": _columns(points, ("nx", "ny", "nz")), "colors": _colors(points)}
    kept = {name: values for name, values in attributes.items() if values is not None and len(values)}
    data = MeshData(vertices, np.empty((0, 3), np.int64), unit=header.unit, attributes=kept)
    return _with_faces(data, items["face"], header, file) if "face" in items else data


def read_ply_points(file: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the numbers that a PLY file has of its points by the names of their properties, (n,) each.

    Raises
    ------
    InputError
        As `read_ply` does.
    """
    return _items(file, PlyHeader.of(file), {"vertex"})["vertex"].numbers


def count_items(file: Path, name: str) -> int:
    """Return how many vertices, faces, ... a PLY file says that it has; 0 where it makes no sense."""
    try:
        elements = PlyHeader.of(file).elements(file)
    except InputError:
        return 0
    return next((element.count for element in elements if element.name == name), 0)


def _items(file: Path, header: PlyHeader, wanted: set[str]) -> dict[str, Items]:
    """Return the items of some kinds, of which points must be there."""
    elements = header.elements(file)
    named = {element.name for element in elements}
    if "vertex" not in named:
        raise InputError(f"{file}: its PLY header lists no vertices; export it again")
    read = read_text_items if header.order is None else read_binary_items
    return read(file, header.end, elements, wanted & named)


def _columns(numbers: dict[str, npt.NDArray[Any]], names: Sequence[str]) -> FloatArray | None:
    """Return columns (n, 3) as float64, or None where one is missing."""
    if not all(name in numbers for name in names):
        return None
    with np.errstate(invalid="ignore"):  # a signaling NaN becomes a quiet one
        return np.stack([numbers[name].astype(np.float64) for name in names], axis=1)


def _colors(numbers: dict[str, npt.NDArray[Any]]) -> FloatArray | None:
    """Return colors as shares of 1: of the largest number of their type, or as they are."""
    colors = _columns(numbers, COLORS)
    if colors is None:
        return None
    kind = numbers["red"].dtype
    largest = float(np.iinfo(kind).max) if kind.kind in "iu" else 255.0 if colors.max(initial=0.0) > 1 else 1.0
    return np.clip(colors / largest, 0.0, 1.0)


def _with_faces(data: MeshData, items: Items, header: PlyHeader, file: Path) -> MeshData:
    """Return points with the triangles of a file's faces, and their labels."""
    corners = next((items.lists[name] for name in CORNERS if name in items.lists), None)
    if corners is None:
        return data
    counts, numbers = corners
    triangles, _ = triangulate(data.vertices, counts, numbers.astype(np.int64), file)
    labels = items.numbers.get("label")
    if labels is None or labels.dtype != np.uint8:
        return replace(data, triangles=triangles)
    if len(triangles) != len(counts):
        raise InputError(f"{file}: has labels, but other faces than triangles; triangulate it")
    return replace(data, triangles=triangles, labels=labels, names=header.label_names(labels))
