"""A volume that stays in its file: its voxels are read where they are asked for."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.checks.voxels import as_voxels
from o3dleaf.core.errors import InputError
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.core.units import check_unit
from o3dleaf.leaf.ct.threshold import MAX_VOXELS, METHODS, histogram_threshold
from o3dleaf.leaf.ct.volume import PlacedVoxels, Volume, as_spacing, slices_in

BLOCK = 32**3
"""Voxels in a block of the sample."""
ALONG = (8, 16, 256)
"""Edges of a block where voxels lie in rows, the row last: one page of memory each, not one for every 32 voxels."""
STRATA = 5
"""Blocks along each axis in a round of the sample: 125 blocks, four million voxels."""
ROUNDS = 4
"""What five hundred blocks do not meet is less than a hundredth of the volume, and is looked for in all of it."""
PART = 1 << 24
"""Voxels, about, that are read at once where all of them are."""


@checked
@dataclass(frozen=True, eq=False, init=False, repr=False)
class VolumeOnDisk(PlacedVoxels):
    """A volume in a file, opened by `open_volume`: a part of it is read by `crop`, as a `Volume`.

    HDF5 stays open until `close`, or the end of a ``with`` block::

        with o3l.open_volume("scan.h5") as volume:
            block = volume.crop(bounds)

    Nothing is looked at before it is read: a file whose far end holds NaN is found out there.

    Attributes
    ----------
    voxels : (nx, ny, nz) array-like
        Intensities along (x, y, z), read by slices.
    spacing, origin : (3,) ndarray
    unit : str or None
        As of `Volume`.
    """

    voxels: Any
    spacing: FloatArray
    origin: FloatArray
    unit: str | None = None

    def __init__(
        self,
        voxels: Any,
        spacing: npt.ArrayLike,
        origin: npt.ArrayLike = (0.0, 0.0, 0.0),
        unit: str | None = None,
    ) -> None:
        shape = getattr(voxels, "shape", None)
        if not isinstance(shape, tuple) or len(shape) != 3 or not hasattr(voxels, "__getitem__"):
            raise InputError("voxels: are no array of three dimensions; open a file by open_volume")
        object.__setattr__(self, "voxels", voxels)
        object.__setattr__(self, "spacing", as_spacing(spacing))
        object.__setattr__(self, "origin", as_points(origin, "origin", dim=3)[0])
        object.__setattr__(self, "unit", check_unit(unit))

    def __repr__(self) -> str:
        shape = " × ".join(f"{count:,}" for count in self.shape)
        return f"VolumeOnDisk({shape} voxels, {self.voxels.dtype}, unit {self.unit})"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along (x, y, z)."""
        nx, ny, nz = self.voxels.shape
        return int(nx), int(ny), int(nz)

    @checked
    def crop(self, bounds: npt.ArrayLike) -> Volume:
        """Read the voxels whose centers lie in `bounds` (2, 3), in `unit`, and no others.

        Raises
        ------
        InputError
            If fewer than 2 voxels are left along an axis, or those that are read are not finite.
        """
        slices, origin = slices_in(self, bounds)
        return Volume(np.asarray(self.voxels[slices]), self.spacing, origin, self.unit)

    @checked
    def threshold(self, method: str = "mixture") -> float:
        """Return the intensity that separates leaf from air, from a sample of blocks of 32,768 voxels.

        Of 5 × 5 × 5 parts of the volume one block each is read at a place drawn with a fixed seed, four million voxels
        in all; where they show no two classes, as in a file that is mostly empty, as many again, up to four times. Then
        all of it is read, a few million voxels at a time, and the level is that of four to eight million of those that
        are not zero, evenly from the whole.

        Parameters
        ----------
        method : {"mixture", "valley", "otsu"}
            As of `Volume.threshold`.

        Raises
        ------
        InputError
            If the volume shows no two classes.
        """
        require_choice(method, METHODS, "threshold")
        rng = np.random.default_rng(0)
        seen: list[npt.NDArray[Any]] = []
        for _ in range(ROUNDS):
            for block in self._blocks(rng):
                values = np.asarray(self.voxels[block]).ravel()
                seen.append(values[values != 0])
            level = _level_of(np.concatenate(seen), method)
            if level is not None:
                return level
        level = _level_of(self._sample_of_all(), method)
        if level is None:
            raise InputError(
                "threshold: the volume does not show two classes, air and leaf; crop the volume to the leaf, or give "
                "the threshold as a number"
            )
        return level

    def close(self) -> None:
        """Close the file, where it is one that stays open; nothing more can be read from it."""
        close = getattr(self.voxels, "close", None)
        if close is not None:
            close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _sample_of_all(self) -> npt.NDArray[Any]:
        """Return every n-th of the voxels that are not zero, in the order in which they are read: all parts of it."""
        kept: list[npt.NDArray[Any]] = []
        stride, passed, held, parts = 1, 0, 0, list(self._parts())
        for number, part in enumerate(parts):
            values = as_voxels(np.asarray(self.voxels[part]), "volume").ravel()
            values = values[values != 0]
            kept.append(values[-passed % stride :: stride].copy())
            passed, held = passed + len(values), held + len(kept[-1])
            while held > 2 * MAX_VOXELS:
                # The first kept is the first of all: every other one of these is every 2n-th of all.
                kept, stride = [np.concatenate(kept)[::2].copy()], 2 * stride
                held = len(kept[0])
            release_pages(self.voxels)
            progress.report(number + 1, len(parts))
        return np.concatenate(kept)

    def _parts(self) -> Iterator[tuple[slice, ...]]:
        """Yield the slices of parts of `PART` voxels that fill the volume, whole chunks where the file has chunks."""
        shape = np.array(self.shape)
        strides = getattr(self.voxels, "strides", None)
        order = np.arange(3)[::-1] if strides is None else np.argsort(strides)
        sides = np.minimum(getattr(self.voxels, "chunks", None) or (1, 1, 1), shape)
        for axis in order:
            sides[axis] = min(sides[axis] * max(1, PART // int(sides.prod())), shape[axis])
        for first in product(*(range(0, shape[axis], sides[axis]) for axis in order[::-1])):
            low = np.array(first)[np.argsort(order[::-1])]
            yield tuple(slice(a, b) for a, b in zip(low.tolist(), np.minimum(low + sides, shape).tolist(), strict=True))

    def _blocks(self, rng: np.random.Generator) -> Iterator[tuple[slice, ...]]:
        """Yield the slices of one block in each part of the volume, in one chunk of the file where it has chunks."""
        shape = np.array(self.shape)
        chunks = np.minimum(getattr(self.voxels, "chunks", None) or shape, shape)
        sides = self._sides(chunks)
        parts = np.clip(shape // sides, 1, STRATA)
        for cell in product(*map(range, parts)):
            first = np.floor((np.array(cell) + rng.random(3)) * shape / parts).astype(int)
            inside = chunks * (first // chunks)
            first = np.maximum(np.minimum(first, np.minimum(inside + chunks, shape) - sides), inside)
            yield tuple(slice(a, b) for a, b in zip(first, np.minimum(first + sides, shape), strict=True))

    def _sides(self, chunks: npt.NDArray[np.int_]) -> npt.NDArray[np.int_]:
        """Return the edges of a block: a cube if it may be, flat in flat chunks, long where voxels lie in rows."""
        sides, left = np.ones(3, dtype=int), float(BLOCK)
        strides = getattr(self.voxels, "strides", None)
        for k, axis in enumerate(np.argsort(chunks) if strides is None else np.argsort(strides)[::-1]):
            edge = ALONG[k] if strides is not None else int(np.ceil(left ** (1 / (3 - k))))
            sides[axis] = min(chunks[axis], edge)
            left /= sides[axis]
        return sides


def _level_of(sample: npt.NDArray[Any], method: str) -> float | None:
    """Return the level of some intensities, or None where there are none, or no two classes."""
    try:
        return histogram_threshold(sample, method) if len(sample) else None
    except (InputError, ValueError):
        return None
