"""LAS and LAZ files, by laspy, an extra."""

from pathlib import Path

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import Columns

SUFFIXES = (".las", ".laz")


def read_las(file: Path) -> Columns:
    """Return the points of a LAS or LAZ file: its integers times scale plus offset, in float64.

    Coordinates are in the unit of the file's reference system, meters by convention; they are never converted: name
    it (``--scan-unit m``). Northings of millions of meters keep every digit of the file's scale.

    Raises
    ------
    InputError
        If laspy is missing, or the file is damaged or ends early.
    """
    try:
        import laspy  # noqa: PLC0415 - an extra that few need
    except ImportError as cause:
        raise InputError(f"{file}: needs laspy; run: pip install 'o3dleaf[las]'") from cause
    try:
        with laspy.open(file) as reader:
            expected = int(reader.header.point_count)
            points = np.asarray(reader.read().xyz, dtype=np.float64)
    except (laspy.errors.LaspyException, ValueError, OSError, EOFError, RuntimeError) as cause:
        raise InputError(f"{file}: cannot be read as LAS ({_one_line(cause)}); export it again") from cause
    if len(points) != expected:
        raise InputError(f"{file}: was cut off, {len(points)} points where {expected} are expected; copy it again")
    return Columns(points)


def _one_line(cause: BaseException) -> str:
    return " ".join(str(cause).split())
