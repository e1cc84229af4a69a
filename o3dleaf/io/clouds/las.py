"""LAS and LAZ files, by laspy, an extra."""

from pathlib import Path
from typing import Any

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import Columns
from o3dleaf.io.clouds.las_header import require_sane_las

SUFFIXES = (".las", ".laz")
COLORS = (("red", "green", "blue"),)
NORMALS = (("nx", "ny", "nz"), ("normalx", "normaly", "normalz"), ("normal x", "normal y", "normal z"))
"""Names, in small letters, of the extra dimensions that programs keep normals in: the format has none."""


def read_las(file: Path) -> Columns:
    """Return the points of a LAS or LAZ file, its integers times scale plus offset, with colors and normals, if any.

    Colors are those of the point format, where one is not black; normals are extra dimensions.

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
    require_sane_las(file)
    try:
        with laspy.open(file) as reader:
            expected = int(reader.header.point_count)
            content = reader.read()
            points = np.asarray(content.xyz, dtype=np.float64)
            colors, normals = (_dimensions(content, names) for names in (COLORS, NORMALS))
    except Exception as cause:  # laspy and its codec raise whatever a broken file makes them
        raise InputError(f"{file}: cannot be read as LAS ({_one_line(cause)}); export it again") from cause
    if len(points) != expected:
        raise InputError(f"{file}: was cut off, {len(points)} points where {expected} are expected; copy it again")
    return Columns(points, normals, colors if colors is not None and colors.any() else None)


def _dimensions(content: Any, choices: tuple[tuple[str, ...], ...]) -> FloatArray | None:
    """Return the columns (n, 3) of the first choice of names that all stand in a file, or None."""
    names = {name.lower(): name for name in content.point_format.dimension_names}
    for choice in choices:
        if all(name in names for name in choice):
            return np.column_stack([np.asarray(content[names[name]], dtype=np.float64) for name in choice])
    return None


def _one_line(cause: BaseException) -> str:
    return " ".join(str(cause).split())
