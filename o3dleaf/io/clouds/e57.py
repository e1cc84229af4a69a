"""E57 files, by pye57, an extra."""

from pathlib import Path
from typing import Any

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import Columns

SUFFIXES = (".e57",)
AXES = ("cartesianX", "cartesianY", "cartesianZ")
COLORS = ("colorRed", "colorGreen", "colorBlue")


def read_e57(file: Path) -> Columns:
    """Return the valid points of all scans of an E57 file, each in its place by its pose, with colors, if any.

    Colors come where every scan has some. Coordinates, in float64, are in meters, as the standard (ASTM E2807) says;
    they are never converted: name it (``--scan-unit m``).

    Raises
    ------
    InputError
        If pye57 is missing, or the file is damaged or has no scan.
    """
    try:
        import pye57  # noqa: PLC0415 - an extra that few need
    except ImportError as cause:
        raise InputError(f"{file}: needs pye57; run: pip install 'o3dleaf[e57]'") from cause
    try:
        opened = pye57.E57(str(file))
        try:
            scans = [
                dict(opened.read_scan(number, colors=True, ignore_missing_fields=True))
                for number in range(opened.scan_count)
            ]
        finally:
            opened.close()
    except Exception as cause:  # libE57 and pye57 raise whatever a broken file makes them
        reason = " ".join(str(cause).split())
        raise InputError(f"{file}: cannot be read as E57 ({reason}); export it again") from cause
    if not scans:
        raise InputError(f"{file}: has no scan; export one with points")
    points = np.concatenate([_stacked(scan, AXES) for scan in scans])
    colored = all(name in scan for scan in scans for name in COLORS)
    return Columns(points, None, np.concatenate([_stacked(scan, COLORS) for scan in scans]) if colored else None)


def _stacked(scan: dict[str, Any], names: tuple[str, ...]) -> FloatArray:
    return np.stack([np.asarray(scan[name], dtype=np.float64) for name in names], axis=1)
