"""Scanco's ISQ, and AIM by aimio-py: in the intensities that they store."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats.stated import Stated, import_extra

ISQ, AIM = ".isq", ".aim"
SUFFIXES = (ISQ, AIM)
ISQ_MAGIC, ISQ_BLOCK = b"CTDATA-HEADER_V1", 512
"""How an ISQ file begins, and the bytes of a block, of which the first is the header."""
ISQ_SIZES, ISQ_OFFSET = struct.Struct("<6i"), struct.Struct("<i")
ISQ_SIZES_AT, ISQ_OFFSET_AT = 44, 508
"""Where an ISQ header has the voxels along (x, y, z) with the sides of the whole, and the blocks after the header."""
AIM_MAGIC = b"AIMDATA_V030   \0"
AIM_PARTS = {True: (struct.Struct("<5q"), len(AIM_MAGIC)), False: (struct.Struct("<5i"), 0)}
"""The lengths of an AIM file's parts, and where they stand, in version 3 and before."""
MAX_RATIO = 2000
"""AIM packs runs of one value: 255 voxels in two bytes, or of one bit."""


def read(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (z, y, x) voxels of an ISQ file, mapped, or of an AIM file, and its lattice.

    Raises
    ------
    InputError
        If the file is damaged or truncated, or aimio-py, which reads AIM, is not installed.
    """
    if path.suffix.lower() == ISQ:
        return _read_isq(path)
    py_aimio = import_extra("py_aimio", "scanco", path, package="aimio-py")
    try:
        _require_sane_parts(path)
        _require_sane_shape(py_aimio.aim_info(str(path))["dimensions"], path.stat().st_size)
        voxels, stated = py_aimio.read_aim(str(path))
        return voxels, Stated(
            np.array(stated["element_size"], np.float64), np.array(stated["origin"], np.float64), "mm"
        )
    except (RuntimeError, ValueError, OSError, OverflowError, MemoryError, KeyError) as cause:
        reason = " ".join(str(cause).split())
        raise InputError(f"{path}: is truncated or damaged ({reason}); copy or export it again") from cause


def _read_isq(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the voxels, mapped, and the lattice: the sides of the whole are stated in micrometers."""
    with path.open("rb") as stream:
        head = stream.read(ISQ_BLOCK)
    if len(head) < ISQ_BLOCK or not head.startswith(ISQ_MAGIC):
        raise InputError(f"{path}: is truncated, or does not begin as ISQ does; copy or export it again")
    numbers = ISQ_SIZES.unpack_from(head, ISQ_SIZES_AT)
    shape, sides = numbers[:3], np.array(numbers[3:], dtype=np.float64)
    start = ISQ_BLOCK * (1 + ISQ_OFFSET.unpack_from(head, ISQ_OFFSET_AT)[0])
    size = path.stat().st_size
    if min(numbers) < 1 or start < ISQ_BLOCK or start + 2 * shape[0] * shape[1] * shape[2] > size:
        raise InputError(
            f"{path}: is truncated or damaged, {size} bytes for {shape} voxels from byte {start}; copy it again"
        )
    voxels = np.memmap(path, dtype="<i2", mode="r", offset=start, shape=shape[::-1])
    return voxels, Stated(sides / np.array(shape), np.zeros(3), "um")


def _require_sane_parts(path: Path) -> None:
    """Raise `ValueError` where the lengths of an AIM file's parts make no sense, or are more than there is."""
    with path.open("rb") as stream:
        head = stream.read(64)
    parts, start = AIM_PARTS[head.startswith(AIM_MAGIC[:12])]
    lengths = parts.unpack_from(head.ljust(64, b"\0"), start)
    expected = start + sum(lengths)
    if min(lengths) < 0 or expected > path.stat().st_size:
        raise ValueError(f"parts of {lengths} bytes")


def _require_sane_shape(shape: tuple[int, ...], size: int) -> None:
    """Raise `ValueError` for more voxels than a file of this size can hold."""
    if min(shape) < 1 or np.prod([float(count) for count in shape]) > MAX_RATIO * size:
        raise ValueError(f"{shape} voxels in {size} bytes")
