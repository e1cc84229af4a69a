"""NPY: the coordinates of points as an array of NumPy, and normals beside them."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import as_floats
from o3dleaf.core.checks.files import is_file
from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import Columns

SUFFIXES = (".npy",)


def read_npy(file: Path) -> Columns:
    """Return the points of an (n, 3) array, or of an (n, 6) one with normals.

    Raises
    ------
    InputError
        If it is no array of real numbers of such a shape, or was cut off; pickled objects are never loaded.
    """
    array = _opened(file)
    if array.ndim != 2 or array.shape[1] not in {3, 6}:
        raise InputError(
            f"{file}: has an array of shape {array.shape}; give (n, 3) coordinates, or (n, 6) with normals after them"
        )
    numbers = as_floats(array, str(file))
    return Columns(numbers[:, :3], numbers[:, 3:] if array.shape[1] == 6 else None)


def holds_points(file: Path) -> bool:
    """Return whether a file is an array of rows, of which a volume has none; False where it is none or cut off."""
    return count_rows(file) is not None


def count_rows(file: Path) -> int | None:
    """Return the number of rows of a file, by its header; None where it is no array of rows, or cut off."""
    try:
        array = _opened(file) if is_file(file) else np.empty(0)  # a pipe would be waited for
    except (InputError, OSError):
        return None
    return len(array) if array.ndim == 2 else None


def _opened(file: Path) -> npt.NDArray[Any]:
    """Return the array of a file, mapped: none of its numbers is read."""
    try:
        array: npt.NDArray[Any] = np.lib.format.open_memmap(file, mode="r")
    except (ValueError, EOFError) as cause:
        raise InputError(f"{file}: is no array of numbers, or was cut off ({cause}); save it by numpy.save") from cause
    return array
