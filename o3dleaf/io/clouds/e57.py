"""E57 files, by pye57, an extra."""

from pathlib import Path

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import Columns

SUFFIXES = (".e57",)


def read_e57(file: Path) -> Columns:
    """Return the valid points of all scans of an E57 file, each in its place by its pose, in float64.

    Coordinates are in meters, as the standard (ASTM E2807) says; they are never converted: name it
    (``--scan-unit m``).

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
            scans = [opened.read_scan(number, ignore_missing_fields=True) for number in range(opened.scan_count)]
        finally:
            opened.close()
    except (pye57.libe57.E57Exception, ValueError, KeyError, OSError, RuntimeError) as cause:
        reason = " ".join(str(cause).split())
        raise InputError(f"{file}: cannot be read as E57 ({reason}); export it again") from cause
    if not scans:
        raise InputError(f"{file}: has no scan; export one with points")
    axes = ("cartesianX", "cartesianY", "cartesianZ")
    return Columns(np.concatenate([np.stack([scan[axis] for axis in axes], axis=1) for scan in scans]))
