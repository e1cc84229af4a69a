"""The header of a PLY file, whether the file is complete, and triangles with their labels from it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.core.units import METERS
from o3dleaf.io.labelled_mesh import LabelArray, name_labels
from o3dleaf.io.mesh_data import MeshData

HEADER = 65536
"""Bytes in which the header of a PLY file must end."""
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"float": "f4", "double": "f8"}
TYPES |= {f"{kind}{bits}": f"{kind[0]}{bits // 8}" for kind in ("int", "uint", "float") for bits in (8, 16, 32, 64)}
"""NumPy's names of PLY's types."""
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


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
        if not head.startswith(b"ply") or end < 0:
            raise InputError(f"{file}: is no PLY file, it does not begin with 'ply' and a header; export it again")
        lines = [line.split() for line in head[:end].decode("ascii", "replace").splitlines()]
        return cls([words for words in lines if words], head.find(b"\n", end) + 1)

    @property
    def order(self) -> str | None:
        """The order of bytes, "<" or ">", or None of a text."""
        return next((ORDERS.get(words[1]) for words in self.lines if words[0] == "format" and len(words) > 1), None)

    @property
    def is_text(self) -> bool:
        """True for an ASCII file."""
        return ["format", "ascii", "1.0"] in self.lines

    @property
    def counts(self) -> dict[str, int]:
        """Number of items of each element."""
        return {words[1]: int(words[2]) for words in self.lines if words[0] == "element" and words[-1].isdigit()}

    @property
    def unit(self) -> str | None:
        """The unit that a comment states: ``comment unit mm``."""
        said = (words[2] for words in self.lines if words[:2] == ["comment", "unit"] and len(words) == 3)
        return next((unit for unit in said if unit in METERS), None)

    def properties(self, element: str) -> list[list[str]]:
        """Return the lines of the properties of an element."""
        lines, inside = [], False
        for words in self.lines:
            if words[0] == "element":
                inside = words[1] == element
            elif inside and words[0] == "property":
                lines.append(words)
        return lines

    def label_names(self, labels: LabelArray) -> tuple[str, ...]:
        """Return the names that a comment gives to labels: ``comment label: 0 adaxial, 1 abaxial, 2 rim``."""
        comment = next((" ".join(words[2:]) for words in self.lines if words[:2] == ["comment", "label:"]), "")
        parts = [part.split(maxsplit=1) for part in comment.split(",") if len(part.split()) > 1]
        return name_labels(labels, {int(number): name for number, name in parts if number.isdigit()})


def require_whole_ply(file: Path) -> PlyHeader:
    """Refuse a PLY file that is shorter than its header claims: a reader would allocate it all and leave the rest wild.

    Raises
    ------
    InputError
        If the file is no PLY, names no points, or was cut off.
    """
    header = PlyHeader.of(file)
    count = header.counts.get("vertex")
    if count is None:
        raise InputError(f"{file}: its PLY header lists no vertices; export it again")
    if header.is_text:
        with file.open("rb") as stream:
            stream.seek(header.end)
            lines = sum(block.count(b"\n") for block in iter(lambda: stream.read(1 << 20), b"")) + 1
        enough = lines >= count
    else:
        kinds = [words[1] for words in header.properties("vertex")]
        size = sum(np.dtype(TYPES.get(kind, "u1")).itemsize for kind in kinds)
        enough = file.stat().st_size - header.end >= size * count
    if not enough:
        raise InputError(f"{file}: is too short for the {count} points of its header; it was cut off, copy it again")
    return header


def read_ply(file: Path, header: PlyHeader) -> MeshData | None:
    """Return a PLY whose faces are triangles with labels; None where they have none.

    Raises
    ------
    InputError
        If it is written out, has other faces than triangles or was cut off.
    """
    faces = header.properties("face")
    if ["property", "uchar", "label"] not in faces and ["property", "uint8", "label"] not in faces:
        return None
    order = header.order
    if order is None:
        raise InputError(f"{file}: labels are read from binary PLY only; write it as binary")
    vertex = np.dtype([(words[2], order + TYPES[words[1]]) for words in header.properties("vertex")])
    fields: list[tuple[Any, ...]] = []
    for words in faces:
        if words[1] == "list":
            fields += [("count", order + TYPES[words[2]]), ("corners", order + TYPES[words[3]], (3,))]
        else:
            fields.append((words[2], order + TYPES[words[1]]))
    face, counts = np.dtype(fields), header.counts
    first_face = header.end + vertex.itemsize * counts["vertex"]
    if list(counts) != ["vertex", "face"] or file.stat().st_size != first_face + face.itemsize * counts["face"]:
        raise InputError(f"{file}: has labels, but other faces than triangles, or was cut off; triangulate it")
    points = np.fromfile(file, vertex, counts["vertex"], offset=header.end)
    rows = np.fromfile(file, face, counts["face"], offset=first_face)
    vertices = np.stack([points[axis] for axis in "xyz"], axis=1).astype(np.float64)
    labels = rows["label"].astype(np.uint8)
    return MeshData(vertices, rows["corners"].astype(np.int64), labels, header.label_names(labels), header.unit)
