"""Scanco's ISQ and AIM, by aimio-py: in the intensities that they store."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats.stated import Stated, import_extra

ISQ, AIM = ".isq", ".aim"
SUFFIXES = (ISQ, AIM)


def read(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (z, y, x) voxels of an ISQ file, mapped, or of an AIM file, and its lattice.

    Raises
    ------
    InputError
        If aimio-py is not installed, or the file is damaged or truncated.
    """
    py_aimio = import_extra("py_aimio", "scanco", path, package="aimio-py")
    try:
        if path.suffix.lower() == ISQ:
            return _read_isq(path, py_aimio.isq_info(str(path)))
        voxels, stated = py_aimio.read_aim(str(path))
        return voxels, Stated(
            np.array(stated["element_size"], np.float64), np.array(stated["origin"], np.float64), "mm"
        )
    except (RuntimeError, ValueError, OSError, OverflowError, MemoryError, KeyError) as cause:
        raise InputError(f"{path}: is truncated or damaged ({cause}); copy or export it again") from cause


def _read_isq(path: Path, header: dict[str, Any]) -> tuple[npt.NDArray[Any], Stated]:
    """Return the voxels, mapped, and the lattice: the sides of the whole are stated in micrometers."""
    shape = np.array(header["dimensions_p"], dtype=np.int64)
    spacing = np.array(header["dimensions_um"], dtype=np.float64) / shape
    voxels = np.memmap(path, dtype="<i2", mode="r", offset=int(header["data_offset"]), shape=tuple(shape[::-1]))
    return voxels, Stated(spacing, np.zeros(3), "um")
