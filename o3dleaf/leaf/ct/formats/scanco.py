"""Scanco's ISQ and AIM, in the intensities that they store."""

import struct
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats.stated import Stated

ISQ, AIM = ".isq", ".aim"
SUFFIXES = (ISQ, AIM)
ISQ_MAGIC, ISQ_BLOCK = b"CTDATA-HEADER_V1", 512
"""How an ISQ file begins, and the bytes of a block, of which the first is the header."""
ISQ_SIZES, ISQ_OFFSET = struct.Struct("<6i"), struct.Struct("<i")
ISQ_SIZES_AT, ISQ_OFFSET_AT = 44, 508
"""Where an ISQ header has the voxels along (x, y, z) with the sides of the whole, and the blocks after the header."""


@dataclass(frozen=True)
class AimLayout:
    """Places in the header of an AIM file, in one version of the format.

    Attributes
    ----------
    magic : bytes
        How the file begins.
    parts, own : Struct, tuple of int
        The lengths of the header's two parts, the log, the voxels and what comes last; those that are its own.
    kind : int
        Where in the second part the kind of the voxels stands.
    numbers, places : Struct, tuple of int
        Three numbers, and where in the second part the position, the counts, the rim and the sizes of voxels stand.
    """

    magic: bytes
    parts: struct.Struct
    own: tuple[int, int]
    kind: int
    numbers: struct.Struct
    places: tuple[int, int, int, int]


NEW_AIM = AimLayout(b"AIMDATA_V030   \0", struct.Struct("<5q"), (40, 224), 12, struct.Struct("<3q"), (16, 40, 64, 184))
OLD_AIM = AimLayout(b"", struct.Struct("<5i"), (20, 140), 20, struct.Struct("<3i"), (24, 36, 48, 108))
NANOMETERS = 1e-6
"""Of version 3, in millimeters; before, they are millimeters in the floating point of VAX."""
KINDS = {0x00010001: "i1", 0x00020002: "<i2"}
VAX, RUNS = 0x00040004, 0x00080002
"""Kinds of voxels: as they are; of VAX's floating point; bytes as pairs of a value and its count, behind their length.
"""


def read(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (z, y, x) voxels of an ISQ or AIM file, mapped where they are not packed, and its lattice.

    Raises
    ------
    InputError
        If the file is damaged or truncated, or holds bits, as of a mask, instead of intensities.
    """
    try:
        return _read_isq(path) if path.suffix.lower() == ISQ else _read_aim(path)
    except InputError:
        raise
    except (ValueError, struct.error) as cause:
        raise InputError(f"{path}: is truncated or damaged ({cause}); copy or export it again") from cause


def _read_isq(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the voxels and the lattice: the sides of the whole are stated in micrometers."""
    with path.open("rb") as stream:
        head = stream.read(ISQ_BLOCK)
    if not head.startswith(ISQ_MAGIC):
        raise ValueError("it does not begin as ISQ does")
    numbers = ISQ_SIZES.unpack_from(head, ISQ_SIZES_AT)
    shape, sides = numbers[:3], np.array(numbers[3:], dtype=np.float64)
    start = ISQ_BLOCK * (1 + ISQ_OFFSET.unpack_from(head, ISQ_OFFSET_AT)[0])
    if min(numbers) < 1:
        raise ValueError(f"{shape} voxels")
    return _mapped(path, start, "<i2", shape), Stated(sides / np.array(shape), np.zeros(3), "um")


def _read_aim(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the voxels and the lattice of an AIM file of either version."""
    with path.open("rb") as stream:
        head = stream.read(512)
    layout = NEW_AIM if head.startswith(NEW_AIM.magic) else OLD_AIM
    lengths = layout.parts.unpack_from(head, len(layout.magic))
    if lengths[:2] != layout.own or min(lengths) < 0:
        raise ValueError("it does not begin as AIM does")
    size, expected = path.stat().st_size, len(layout.magic) + sum(lengths)
    if expected > size:
        raise ValueError(f"{size} bytes where {expected} are expected")
    second = len(layout.magic) + lengths[0]
    (kind,) = struct.unpack_from("<i", head, second + layout.kind)
    position, shape, rim = (layout.numbers.unpack_from(head, second + place) for place in layout.places[:3])
    sizes = np.array(layout.numbers.unpack_from(head, second + layout.places[3]), dtype=np.int64)
    spacing = np.array(NANOMETERS * sizes if layout is NEW_AIM else _from_vax(sizes.astype("<i4")), dtype=np.float64)
    if min(shape) < 1:
        raise ValueError(f"{shape} voxels")
    start = second + lengths[1] + lengths[2]
    if kind == RUNS and not any(rim):
        voxels = _unpacked(path, start, lengths[3], layout.parts.size // 5, shape)
    elif kind == VAX:
        voxels = _from_vax(_mapped(path, start, "<i4", shape))
    elif kind in KINDS:
        voxels = _mapped(path, start, KINDS[kind], shape)
    else:
        raise InputError(f"{path}: holds voxels of kind {kind:#010x}, which is not read; export gray values as short")
    origin = (np.array(position, np.float64) + rim) * spacing
    return voxels, Stated(spacing, origin, "mm")


def _mapped(path: Path, start: int, kind: str, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """Return the voxels from a byte on, if so many are there."""
    size, expected = path.stat().st_size, start + np.dtype(kind).itemsize * prod(shape)
    if start < 0 or expected > size:
        raise ValueError(f"{size} bytes where {expected} are expected")
    return np.memmap(path, dtype=kind, mode="r", offset=start, shape=shape[::-1])


def _unpacked(path: Path, start: int, length: int, word: int, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """Return voxels that are stored as pairs of a value and its count."""
    with path.open("rb") as stream:
        stream.seek(start)
        content = stream.read(length)
    stated = int.from_bytes(content[:word], "little")
    pairs = np.frombuffer(content[word:stated], np.uint8)
    if not word <= stated <= len(content) or len(pairs) % 2:
        raise ValueError(f"{len(content)} bytes of runs where {stated} are stated")
    values, counts = pairs[::2].view(np.int8), pairs[1::2]
    if int(counts.sum(dtype=np.int64)) != prod(shape):
        raise ValueError(f"runs of {int(counts.sum(dtype=np.int64))} voxels for {shape}")
    return np.repeat(values, counts).reshape(shape[::-1])


def _from_vax(words: npt.NDArray[np.int32]) -> npt.NDArray[np.float32]:
    """Return numbers in the single precision of VAX: its halves stand the other way round, its exponent is two more."""
    halves = np.ascontiguousarray(words).view("<u2").reshape(*words.shape, 2)[..., ::-1]
    numbers = np.ascontiguousarray(halves).view("<f4")[..., 0]
    with np.errstate(under="ignore", invalid="ignore"):
        return np.asarray(numbers / np.float32(4))
