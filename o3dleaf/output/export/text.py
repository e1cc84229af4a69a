"""Meshes as text: STL with one named solid a label, OBJ with one group a label; every digit of float64.

A vertex is turned into text once a block; records of one width are then put together by NumPy,
which is some ten times as fast as a line of text a triangle.
"""

from typing import IO

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import Progress, blocks
from o3dleaf.output.export.labelled_mesh import Surface, face_vectors, unit_rows

BLOCK = 1 << 16
"""Triangles or rows turned into text at once."""
NUMBER = "% .16e"
"""17 digits, which read back bit for bit; 23 characters while the exponent has two digits."""
SMALLEST, LARGEST = 1e-99, 9.9e99
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
"""A triangle of an ASCII STL file, all of one length."""


def write_stl_solids(out: IO[bytes], surface: Surface, name: str, progress: Progress | None = None) -> None:
    """Write ASCII STL: one solid for each label that occurs, called by it; without labels one called `name`.

    The format has no place for a unit.
    """
    done = 0
    for solid, triangles in surface.parts(name):
        out.write(f"solid {solid}\n".encode())
        for start, stop in blocks(len(triangles), BLOCK):
            out.write(facets(surface.vertices, triangles[start:stop]).tobytes())
            if progress:
                progress(done + stop, len(surface.triangles))
        out.write(f"endsolid {solid}\n".encode())
        done += len(triangles)


def facets(vertices: FloatArray, triangles: IntArray) -> npt.NDArray[np.void]:
    """Return the text of (m, 3) triangles, one record each."""
    numbers, rows = np.unique(triangles, return_inverse=True)
    lines = number_lines(vertices[numbers], NUMBER, WIDTH)
    records = np.empty(len(triangles), dtype=FACET)
    records["open"], records["close"] = PIECES[0] + b" ", PIECES[4]
    records["normal"] = number_lines(unit_rows(face_vectors(vertices, triangles)), NORMAL, NORMAL_WIDTH)
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
    if np.abs(rows).max(initial=0.0) > LARGEST:
        raise InputError(f"vertices: reach {np.abs(rows).max():.3g}; give lengths in a larger unit")
    kept = np.where(np.abs(rows) < SMALLEST, 0.0, rows)
    text = (f"{form} {form} {form}" * len(kept)) % tuple(kept.ravel().tolist())
    return np.frombuffer(text.encode("ascii"), dtype=f"S{3 * width + 2}")


def write_obj(out: IO[bytes], surface: Surface, name: str, progress: Progress | None = None) -> None:
    """Write OBJ: vertices, normals if there are any, and the faces in one group for each label."""
    total = len(surface.vertices) + len(surface.triangles)
    out.write(f"# o3dleaf {name}, lengths in {surface.unit or 'no stated unit'}\n".encode("ascii", "replace"))
    for keyword, rows in (("v", surface.vertices), ("vn", surface.normals)):
        for start, stop in blocks(0 if rows is None else len(rows), BLOCK):
            part = [] if rows is None else rows[start:stop].ravel().tolist()
            out.write((f"{keyword} %r %r %r\n" * (stop - start) % tuple(part)).encode())
            if progress:
                progress(stop, total)
    corner, repeat = ("%d", 1) if surface.normals is None else ("%d//%d", 2)
    done = len(surface.vertices)
    for group, triangles in surface.parts(name):
        out.write(f"g {group}\n".encode())
        for start, stop in blocks(len(triangles), BLOCK):
            named = np.repeat(triangles[start:stop] + 1, repeat, axis=1).ravel().tolist()
            out.write((f"f {corner} {corner} {corner}\n" * (stop - start) % tuple(named)).encode())
            if progress:
                progress(done + stop, total)
        done += len(triangles)
