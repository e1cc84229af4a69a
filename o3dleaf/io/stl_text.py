"""STL as text, one named solid a label, every digit of float64, as OpenFOAM and Gmsh tell patches apart.

A vertex is turned into text once a block; records of one width are then put together by NumPy,
which is some ten times as fast as a line of text a triangle.
"""

import re
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import claim
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.io.labelled_mesh import label_parts
from o3dleaf.io.mesh_data import MeshData, face_vectors, unit_rows
from o3dleaf.io.polygons.numbers import floats_of
from o3dleaf.io.stl import START, join_corners

BLOCK = 1 << 16
"""Triangles turned into text at once."""
READ_SIZE = 1 << 24
"""Bytes that are looked at together."""
SOLID = re.compile(rb"^[ \t]*solid\b[ \t]*(\S*)", re.MULTILINE)
VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
NUMBER = "% .16e"
"""17 digits, which read back bit for bit; 23 characters while the exponent has two digits."""
MIN_LENGTH, MAX_LENGTH = 1e-99, 9.9e99
"""Exponents of three digits do not fit the records: what is smaller is zero, what is larger refused."""
NORMAL = "% .6f"
"""Normals are for looking at: readers compute their own."""
WIDTH, NORMAL_WIDTH = 23, 9
PIECES = (b"facet normal", b"\nouter loop\nvertex ", b"\nvertex ", b"\nvertex ", b"\nendloop\nendfacet\n")
FACET = np.dtype(
    [("open", f"S{len(PIECES[0]) + 1}"), ("normal", f"S{3 * NORMAL_WIDTH + 2}")]
    + [
        field
        for corner in range(3)
        for field in ((f"to{corner}", f"S{len(PIECES[1 + corner])}"), (f"vertex{corner}", f"S{3 * WIDTH + 2}"))
    ]
    + [("close", f"S{len(PIECES[4])}")]
)
"""A triangle, all of one length."""


def write_stl_text(out: IO[bytes], mesh: MeshData, name: str) -> None:
    """Write one solid for each label that occurs, called by it; without labels one called `name`.

    The format has no place for a unit.
    """
    claim(out, FACET.itemsize * mesh.triangle_count)
    done = 0
    for solid, triangles in mesh.parts(name):
        out.write(f"solid {solid}\n".encode())
        for start, stop in blocks(len(triangles), BLOCK):
            out.write(facets(mesh.vertices, triangles[start:stop]).tobytes())
            progress.report(done + stop, mesh.triangle_count)
        out.write(f"endsolid {solid}\n".encode())
        done += len(triangles)


def facets(vertices: FloatArray, triangles: IntArray) -> npt.NDArray[np.void]:
    """Return the text of (m, 3) triangles, one record each."""
    numbers, rows = np.unique(triangles, return_inverse=True)
    lines = number_lines(vertices[numbers], NUMBER, WIDTH)
    records = np.empty(len(triangles), dtype=FACET)
    records["open"], records["close"] = PIECES[0] + b" ", PIECES[4]
    records["normal"] = number_lines(unit_rows(face_vectors(vertices[triangles])), NORMAL, NORMAL_WIDTH)
    for corner in range(3):
        records[f"to{corner}"] = PIECES[1 + corner]
        records[f"vertex{corner}"] = lines[rows.reshape(-1, 3)[:, corner]]
    return records


def number_lines(rows: FloatArray, form: str, width: int) -> npt.NDArray[np.bytes_]:
    """Return the text of each of (n, 3) rows, all of one length.

    Raises
    ------
    InputError
        If a number is too large for it.
    """
    if np.abs(rows).max(initial=0.0) > MAX_LENGTH:
        raise InputError(f"vertices: reach {np.abs(rows).max():.3g}; give lengths in a larger unit")
    kept = np.where(np.abs(rows) < MIN_LENGTH, 0.0, rows)
    text = (f"{form} {form} {form}" * len(kept)) % tuple(kept.ravel().tolist())
    return np.frombuffer(text.encode("ascii"), dtype=f"S{3 * width + 2}")


def read_stl_text(file: Path) -> MeshData:
    """Return an STL that is text, its solids as labels.

    Raises
    ------
    InputError
        If it is no STL, or a facet does not have three corners.
    """
    with file.open("rb") as stream:
        if not stream.read(START).lstrip().startswith(b"solid"):
            raise InputError(f"{file}: is no STL, or was cut off; copy it again, or export it again")
    corners, solids = _facets_of(file)
    labels, names = label_parts(solids)
    return MeshData(*join_corners(corners), labels, names)


def _facets_of(file: Path) -> tuple[FloatArray, list[tuple[str, int]]]:
    """Return the (m, 3, 3) corners, and the solids as (name, triangles)."""
    corners: list[FloatArray] = []
    solids: list[tuple[str, int]] = []
    with file.open("rb") as stream:
        rest = b""
        while block := stream.read(READ_SIZE):
            # Cut behind a line that ends a triangle or a solid.
            cut = (text := rest + block).rfind(b"endfacet") + len(b"endfacet")
            text, rest = (text[:cut], text[cut:]) if cut >= len(b"endfacet") else (b"", text)
            starts = [*SOLID.finditer(text)]
            for place, part in enumerate([text[: starts[0].start()] if starts else text, *_between(text, starts)]):
                if place:
                    solids.append((starts[place - 1].group(1).decode("ascii", "replace"), 0))
                rows = floats_of((word for words in VERTEX.findall(part) for word in words), file).reshape(-1, 3)
                if len(rows) % 3 or (len(rows) and not solids):
                    raise InputError(f"{file}: is no ASCII STL, a facet does not have three corners; export it again")
                if len(rows):
                    corners.append(rows.reshape(-1, 3, 3))
                    solids[-1] = solids[-1][0], solids[-1][1] + len(rows) // 3
    return np.concatenate([np.empty((0, 3, 3)), *corners]), solids


def _between(text: bytes, starts: list[re.Match[bytes]]) -> list[bytes]:
    """Return the text from each start to the next."""
    ends = [match.start() for match in starts[1:]] + [len(text)] * bool(starts)
    return [text[match.end() : end] for match, end in zip(starts, ends, strict=True)]
