"""Words of a text as numbers; what is none is an error of ours."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray


def floats_of(words: Iterable[bytes], file: Path) -> FloatArray:
    """Return words as numbers, or raise `InputError`."""
    try:
        return np.fromiter(map(float, words), np.float64)
    except ValueError as cause:
        raise no_number(file, cause) from cause


def integers_of(words: Iterable[bytes], file: Path) -> IntArray:
    """Return words as whole numbers, or raise `InputError`."""
    try:
        return np.fromiter(map(int, words), np.int64)
    except (ValueError, OverflowError) as cause:
        raise no_number(file, cause) from cause


def no_number(file: Path, cause: Exception) -> InputError:
    """Return the error of a file that has something else in the place of a number."""
    reason = " ".join(str(cause).split())[:100]
    return InputError(
        f"{file}: has no number where one belongs ({reason}); it is damaged or was cut off, export it again"
    )
