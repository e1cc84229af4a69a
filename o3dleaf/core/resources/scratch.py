"""Numbers that lie in a temporary file, mapped, where memory would hold too little beside them."""

import tempfile

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import claim
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.resources.budget import usable_memory
from o3dleaf.core.resources.needs import SMALL

SHARE = 0.25
"""Of the memory that may be used, which they may take."""


def is_held(count: int) -> bool:
    """Return whether so many numbers of eight bytes lie in memory, and not in a file."""
    room = None if 8 * count <= SMALL else usable_memory()
    return room is None or 8 * count <= SHARE * room.free


def scratch_array(count: int) -> npt.NDArray[np.float64]:
    """Return an array (count,) to be filled: in memory, or in a file of the temporary folder, which goes with it.

    Raises
    ------
    O3DLeafError
        If it is to lie in a file, and the disk has no room.
    """
    if is_held(count):
        return np.empty(count)
    try:
        with tempfile.TemporaryFile(prefix="o3dleaf-") as file:
            claim(file, 8 * count)
            file.truncate(8 * count)
            return np.asarray(np.memmap(file, dtype=np.float64, mode="r+", shape=(count,)))
    except OSError as cause:
        raise O3DLeafError(
            f"fit: {8e-9 * count:.3g} GB of coefficients find no place in {tempfile.gettempdir()} ({cause.strerror}); "
            "set TMPDIR to a folder of a larger disk, or state more memory (--memory)"
        ) from cause
