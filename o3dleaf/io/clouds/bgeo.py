"""Points as BGEO (Houdini's classic one), which particle programs read by the library Partio: single precision."""

from collections.abc import Mapping
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import claim
from o3dleaf.core.checks.arrays import FloatArray

FLOAT, INTEGER, VECTOR = 0, 1, 5
"""Kinds of attributes."""


def write_bgeo_points(out: IO[bytes], points: FloatArray, table: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write (n, 3) points and what each of them carries: (n,) numbers, whole or not, and (n, 3) vectors.

    Everything is big endian: a head, the attributes with their sizes and defaults, then a row for each point, its
    position with a fourth coordinate of 1 in front.
    """
    head = b"BgeoV" + np.array([5, len(points), 0, 0, 0, len(table), 0, 0, 0], dtype=">i4").tobytes()
    kinds: list[tuple[str, Any]] = [("P", (">f4", (4,)))]
    for name, values in table.items():
        size = 3 if values.ndim == 2 else 1
        whole = values.dtype.kind in "iu"
        kind = VECTOR if size == 3 else INTEGER if whole else FLOAT
        text = name.encode("ascii", "replace")
        head += (
            len(text).to_bytes(2, "big") + text + size.to_bytes(2, "big") + kind.to_bytes(4, "big") + bytes(4 * size)
        )
        kinds.append((name, (">i4" if whole else ">f4", (3,)) if size == 3 else ">i4" if whole else ">f4"))
    rows = np.empty(len(points), dtype=np.dtype(kinds))
    rows["P"][:, :3], rows["P"][:, 3] = points, 1.0
    for name, values in table.items():
        rows[name] = values
    claim(out, len(head) + rows.nbytes + 2)
    out.write(head)
    out.write(rows.tobytes())
    out.write(b"\x00\xff")  # no further groups
