"""Meshes read with their labels: a PLY's face property, the solids of an STL, the groups of an OBJ."""

import re
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from o3dleaf.core.atomic_files import PLY_HEADER, require_whole_ply
from o3dleaf.core.checks import FloatArray, require_file
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, build_mesh, mesh_arrays
from o3dleaf.core.units import METRES
from o3dleaf.io.labelled_mesh import LABELS, LabelArray, LabelledMesh
from o3dleaf.io.triangle_mesh import join_corners, read_triangle_mesh
from o3dleaf.leaf.instancing.stream import TRIANGLE

PIECE = 1 << 24
"""Bytes of an ASCII STL that are looked at together."""
MOST = 256
"""Names that labels of one byte can have."""
SOLID = re.compile(rb"^[ \t]*solid\b[ \t]*(\S*)", re.MULTILINE)
VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
PLY_TYPES |= {"float": "f4", "double": "f8"}
PLY_TYPES |= {f"{kind}{bits}": f"{kind[0]}{bits // 8}" for kind in ("int", "uint", "float") for bits in (8, 16, 32, 64)}

Read = tuple[FloatArray, IntArray, LabelArray | None, tuple[str, ...], str | None]
"""Vertices, triangles, labels, their names, the unit."""


def read_labelled_mesh(path: str | PathLike[str]) -> LabelledMesh:
    """Return a mesh with the labels of its triangles, where the file has them.

    ======  ===============================================================================
    suffix  where labels are looked for
    ======  ===============================================================================
    .ply    the property ``label`` of the faces, and the comment that names them
    .stl    the solids of an ASCII file; the attributes of a binary one that o3dleaf wrote
    .obj    the groups (``g``)
    ======  ===============================================================================

    Names that are the leaf's own (adaxial, abaxial, rim) get its numbers, others the next ones as they come. Equal
    corners of an STL become one vertex, and files without labels come, as `read_triangle_mesh` reads them.

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
    readers = {".ply": _read_ply, ".stl": _read_stl, ".obj": _read_obj}
    reader = readers.get(file.suffix.lower())
    found = None if reader is None else reader(file)
    if found is None:
        unit = _ply_unit(_ply_header(file)[0]) if file.suffix.lower() == ".ply" else None
        return LabelledMesh(read_triangle_mesh(file), unit=unit)
    vertices, triangles, labels, names, unit = found
    if not len(triangles):
        raise InputError(f"{file}: holds no triangle; is it cut off?")
    return LabelledMesh(build_mesh(*mesh_arrays((vertices, triangles))), labels, names, unit)


def _read_ply(file: Path) -> Read | None:
    """Return a PLY whose faces have labels, and are triangles."""
    require_whole_ply(file)
    header, start = _ply_header(file)
    faces = _element(header, "face")
    if ["property", "uchar", "label"] not in faces and ["property", "uint8", "label"] not in faces:
        return None
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(header[1][1])
    if order is None:
        raise InputError(f"{file}: labels are read from binary PLY only; write it as binary")
    vertex = np.dtype([(w[2], order + PLY_TYPES[w[1]]) for w in _element(header, "vertex")[1:]])
    counts = {w[1]: int(w[2]) for w in header if w[0] == "element"}
    fields: list[tuple[Any, ...]] = []
    for w in faces[1:]:
        if w[1] == "list":
            fields += [("count", order + PLY_TYPES[w[2]]), ("corners", order + PLY_TYPES[w[3]], (3,))]
        else:
            fields.append((w[2], order + PLY_TYPES[w[1]]))
    face = np.dtype(fields)
    here = start + vertex.itemsize * counts["vertex"]
    if list(counts) != ["vertex", "face"] or file.stat().st_size != here + face.itemsize * counts["face"]:
        raise InputError(f"{file}: has labels, but other faces than triangles, or was cut off; triangulate it")
    points = np.fromfile(file, vertex, counts["vertex"], offset=start)
    rows = np.fromfile(file, face, counts["face"], offset=here)
    vertices = np.stack([points[axis] for axis in "xyz"], axis=1).astype(np.float64)
    labels = rows["label"].astype(np.uint8)
    return vertices, rows["corners"].astype(np.int64), labels, _ply_names(header, labels), _ply_unit(header)


def _ply_header(file: Path) -> tuple[list[list[str]], int]:
    """Return the header's lines as words, and where the numbers begin."""
    require_whole_ply(file)
    with file.open("rb") as stream:
        head = stream.read(PLY_HEADER)
    end = head.find(b"\n", head.find(b"end_header")) + 1
    return [line.split() for line in head[:end].decode("ascii", "replace").splitlines() if line.strip()], end


def _element(header: list[list[str]], name: str) -> list[list[str]]:
    """Return the lines of one element: itself and its properties."""
    lines, inside = [], False
    for words in header:
        if words[0] == "element":
            inside = words[1] == name
        if inside and words[0] in {"element", "property"}:
            lines.append(words)
    return lines


def _ply_names(header: list[list[str]], labels: LabelArray) -> tuple[str, ...]:
    """Return the names that a comment gives to the labels: ``comment label: 0 adaxial, 1 abaxial, 2 rim``."""
    comment = next((" ".join(w[2:]) for w in header if w[:2] == ["comment", "label:"]), "")
    named = dict(part.split(maxsplit=1) for part in comment.split(",") if len(part.split()) > 1)
    count = max(int(labels.max(initial=0)) + 1, len(named) or len(LABELS))
    return tuple(named.get(str(number), (*LABELS, *map(str, range(3, MOST)))[number]) for number in range(count))


def _ply_unit(header: list[list[str]]) -> str | None:
    """Return the unit that a comment states: ``comment unit mm``."""
    return next((w[2] for w in header if w[:2] == ["comment", "unit"] and len(w) == 3 and w[2] in METRES), None)


def _read_stl(file: Path) -> Read | None:
    """Return an STL: by its solids if it is text, by its attributes if it is ours and binary."""
    size = file.stat().st_size
    with file.open("rb") as stream:
        head = stream.read(84)
    if len(head) == 84 and size == 84 + TRIANGLE.itemsize * int.from_bytes(head[80:], "little"):
        if not head.startswith(b"o3dleaf"):
            return None
        records = np.fromfile(file, TRIANGLE, offset=84)
        count = max(int(records["label"].max(initial=0)) + 1, len(LABELS))
        names = (*LABELS, *map(str, range(3, MOST)))[:count]
        return (
            *mesh_arrays(join_corners(records["corners"].astype(np.float64))),
            records["label"].astype(np.uint8),
            names,
            None,
        )
    if not head.lstrip().startswith(b"solid"):
        return None
    corners, solids = _stl_text(file)
    labels, names = _numbered(solids)
    return *mesh_arrays(join_corners(corners)), labels, names, None


def _stl_text(file: Path) -> tuple[FloatArray, list[tuple[str, int]]]:
    """Return the (m, 3, 3) corners of an ASCII STL, and its solids as (name, triangles)."""
    corners: list[FloatArray] = []
    solids: list[tuple[str, int]] = []
    with file.open("rb") as stream:
        rest = b""
        while block := stream.read(PIECE):
            # Cut behind a line that ends a triangle or a solid.
            cut = (text := rest + block).rfind(b"endfacet") + len(b"endfacet")
            text, rest = (text[:cut], text[cut:]) if cut >= len(b"endfacet") else (b"", text)
            starts = [*SOLID.finditer(text)]
            for place, part in enumerate([text[: starts[0].start()] if starts else text, *_between(text, starts)]):
                if place:
                    solids.append((starts[place - 1].group(1).decode("ascii", "replace"), 0))
                found = np.array(VERTEX.findall(part), dtype=np.bytes_).reshape(-1, 3)
                if len(found) % 3 or (len(found) and not solids):
                    raise InputError(f"{file}: is no ASCII STL, a facet has not three corners; export it again")
                if len(found):
                    corners.append(found.astype(np.float64).reshape(-1, 3, 3))
                    solids[-1] = solids[-1][0], solids[-1][1] + len(found) // 3
    return np.concatenate([np.empty((0, 3, 3)), *corners]), solids


def _between(text: bytes, starts: list[re.Match[bytes]]) -> list[bytes]:
    """Return the text from each start to the next."""
    ends = [match.start() for match in starts[1:]] + [len(text)] * bool(starts)
    return [text[match.end() : end] for match, end in zip(starts, ends, strict=True)]


def _read_obj(file: Path) -> Read | None:
    """Return an OBJ of triangles by its groups; without groups, or with other polygons, None."""
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
    if sum(count for _, count in groups) != len(corners) or any(len(row) != 3 for row in corners):
        return None
    points = np.array([line.split()[:3] for line in vertices], dtype=np.bytes_).astype(np.float64)
    numbers = np.array([[word.split(b"/")[0] for word in row] for row in corners], dtype=np.bytes_).astype(np.int64)
    return points.reshape(-1, 3), numbers.reshape(-1, 3) - 1, *_numbered(groups), None


def _numbered(parts: list[tuple[str, int]]) -> tuple[LabelArray, tuple[str, ...]]:
    """Return the label of each triangle of consecutive parts (name, triangles), and the names."""
    names = [*LABELS] if any(name in LABELS for name, _ in parts) else []
    names += [name for name in dict.fromkeys(name for name, _ in parts) if name not in names]
    if len(names) > MOST:
        raise InputError(f"mesh: has {len(names)} solids or groups; at most {MOST} are told apart")
    numbers = np.array([names.index(name) for name, _ in parts], dtype=np.uint8)
    return np.repeat(numbers, [count for _, count in parts]), tuple(names)
