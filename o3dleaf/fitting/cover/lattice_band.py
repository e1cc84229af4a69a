"""A narrow band of a lattice's tiles around a level: those near it as they are, larger ones where all is on one side.

A tile is *far* from the level if all voxels around it, as far as its ball reaches and two more, lie on one side of it,
and farther from it than a part of their own range: what smooths or interpolates such voxels does not cross the level
there. A fit that averages over voxels is shown averages over no more of them: noise that it takes away does not count.
Far tiles are merged, 2 by 2 along each axis, as long as that holds for the larger ball, so that their number grows with
the band and not with the volume.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.processes.spread import current_spread
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.core.resources.scratch import ROWS, GrowingArray, scratch_array
from o3dleaf.fitting.rbf.tail import IntArray

BoolArray = npt.NDArray[np.bool_]

RESERVE = 0.25
"""Part of their range that voxels keep from the level. A spline of r³ goes beyond noise no farther than the noise
itself does, and beyond a step by a tenth of it, next to the step alone."""
GUARD = 2
"""Voxels beyond a ball that are looked at as well: the surface is less than one from a voxel on the other side, and the
edge of a lattice as fine as the voxels ends one farther."""
MAX_AVERAGED = 3
"""Voxels along each axis that are averaged at most: what that moves stays within the guard."""
PART = 1 << 18
"""Voxels that are looked at together, at least a row of tiles: sums of them take two MiB at most."""


@dataclass(frozen=True, eq=False)
class LatticeBand:
    """The tiles of a lattice that are far from a level.

    Attributes
    ----------
    shape : tuple of int
        Voxels along each axis.
    tile : (d,) int64 ndarray
        Voxels of a tile along each axis.
    reach : (d,) int64 ndarray
        Voxels beyond a tile in which its ball, or one of its neighbors', contains any.
    far : ndarray of bool
        By tile along each axis.
    """

    shape: tuple[int, ...]
    tile: IntArray
    reach: IntArray
    far: BoolArray

    @classmethod
    def of(
        cls, data: npt.NDArray[Any], level: float, tile: IntArray, reach: IntArray, averaged: float = 1.0
    ) -> "LatticeBand":
        """Look at the voxels, a layer of tiles at a time, as they lie in memory or in a file.

        `averaged` is how many voxels what is fitted to them averages over, 1 for an interpolant.
        """
        order = np.argsort(data.strides)[::-1]
        sides, around = tile[order].tolist(), (reach[order] + GUARD).tolist()
        window, windows = int(np.clip(averaged ** (1 / data.ndim) + 1e-9, 1, MAX_AVERAGED)), []
        for size, side, more in zip(np.array(data.shape)[order].tolist(), sides, around, strict=True):
            starts, before = np.minimum(np.arange(0, size, side), size - side).tolist(), more + window - 1
            windows.append([slice(max(first - before, 0), first + side + more) for first in starts])
        far, spread = scratch_array(tuple(len(each) for each in windows), np.bool_), current_spread()
        read = None if spread is None else spread.stand_in(data)
        rows = (sides[0] + 2 * around[0] + 2 * (window - 1)) * int(np.prod(np.array(data.shape)[order[2:]]))
        together = max(1, PART // (rows * sides[1])) if data.ndim > 1 else 1
        layers = _Layers(data.__getitem__ if read is None else read, level, order, window, windows[1:], together)

        def look(first: int, last: int) -> None:
            for layer in range(first, last):
                far[layer] = layers(windows[0][layer])

        if spread is None or read is None:
            run_blocks(look, len(far), 1)
        else:
            for layer, found in spread.each(layers, windows[0]):
                far[layer] = found
        return cls(data.shape, tile, reach, np.ascontiguousarray(far.transpose(np.argsort(order))))

    def balls(self) -> tuple[IntArray, IntArray, BoolArray]:
        """Return starts (M, d) and levels (M,) of tiles that cover the lattice, and which of them are far."""
        dimension, whole = len(self.shape), np.array(self.shape) // self.tile
        merged = scratch_array(self.far.shape, np.bool_)
        merged[...] = False
        table = scratch_array(tuple(size + 1 for size in self.far.shape), np.int64)
        table[...] = 0
        np.logical_not(self.far, out=table[(slice(1, None),) * dimension])
        for axis in range(dimension):
            np.cumsum(table, axis=axis, out=table)
        found = GrowingArray(np.int64, (dimension,)), GrowingArray(np.int64), GrowingArray(np.bool_)

        def add(starts: IntArray, level: int, bare: BoolArray) -> None:
            for part, each in zip(found, (starts, np.full(len(starts), level), bare), strict=True):
                part.append(each)

        for level in range(int(np.log2(whole.min())) if whole.all() else 0, 0, -1):
            side = 1 << level
            # The ball reaches so much farther beyond; what its outermost tiles have looked at counts.
            margin = -(-(side - 1) * (self.reach + 1) // self.tile)
            inside = np.indices((side,) * dimension).reshape(dimension, -1).T
            # The tiles within so many larger ones are listed together.
            for coarse in _by_layers(np.broadcast_to(True, whole >> level), ROWS >> dimension * level):
                places = coarse << level
                low, high = np.maximum(places - margin, 0), np.minimum(places + side + margin, self.far.shape)
                free = ~merged[tuple(places.T)] & (_sums(table, low, high) == 0)
                merged[tuple((places[free, np.newaxis] + inside).reshape(-1, dimension).T)] = True
                add(places[free] * self.tile, level, np.ones(np.count_nonzero(free), dtype=bool))
        for left in _by_layers(merged, ROWS, marked=False):
            add(np.minimum(left * self.tile, np.array(self.shape) - self.tile), 0, self.far[tuple(left.T)])
        starts, levels, bare = (each.whole() for each in found)
        return starts, levels, bare


@dataclass(frozen=True)
class _Layers:
    """The tiles of a layer that are far.

    Attributes
    ----------
    read : callable
        ``read(slices)`` returns a part of the lattice.
    level : float
    order : (d,) ndarray of int
        The axes, the slowest first.
    window : int
        Voxels along each axis that are averaged.
    windows : list of lists of slices
        What is looked at for each tile, along the other axes.
    together : int
        Tiles along the second axis that are looked at together: memory does not grow with the layer.
    """

    read: Callable[[tuple[slice, ...]], npt.NDArray[Any]]
    level: float
    order: IntArray
    window: int
    windows: list[list[slice]]
    together: int

    def __call__(self, rows: slice) -> BoolArray:
        """Look at the layer of some rows along the slowest axis."""
        slices = [slice(None)] * len(self.order)
        slices[self.order[0]] = slice(rows.start, rows.stop + self.window - 1)
        voxels = self.read(tuple(slices))
        layer = voxels.transpose(self.order)
        far = self._by_parts(layer) if self.windows else self._far(layer, [])
        release_pages(voxels)
        return far

    def _by_parts(self, layer: npt.NDArray[Any]) -> BoolArray:
        """Look at some tiles along the second axis at a time."""
        second, others, parts = self.windows[0], self.windows[1:], []
        for first in range(0, len(second), self.together):
            some = second[first : first + self.together]
            begin = some[0].start
            moved = [slice(each.start - begin, each.stop - begin) for each in some]
            parts.append(self._far(layer[:, begin : some[-1].stop + self.window - 1], [moved, *others]))
        return np.concatenate(parts)

    def _far(self, voxels: npt.NDArray[Any], windows: list[list[slice]]) -> BoolArray:
        """Return which tiles are far of those whose windows are looked at, in some voxels of a layer."""
        part = _averages(voxels, self.window, np.argsort(self.order))
        low, high = (_extremes(extreme, part, windows) - self.level for extreme in (np.minimum, np.maximum))
        reserve = RESERVE * (high - low)
        return np.asarray((low > reserve) | (-high > reserve))


def _by_layers(mask: BoolArray, together: int, *, marked: bool = True) -> Iterator[IntArray]:
    """Yield the places (n, d) that are marked, or that are not, about so many together, by layers of the first axis."""
    layers = max(1, together * len(mask) // max(mask.size, 1))
    for first, last in blocks(len(mask), layers):
        places = np.argwhere(mask[first:last] == marked)
        places[:, 0] += first
        yield places


def _averages(part: npt.NDArray[Any], window: int, axes: IntArray) -> npt.NDArray[Any]:
    """Return the averages over all boxes of so many voxels along each axis, or of all where there are fewer.

    The order of the axes decides the last bits.
    """
    if window == 1:
        return part
    sums = part.astype(np.result_type(part.dtype, np.float32))
    for axis in axes:
        size = part.shape[axis]
        width = min(window, size)
        rows = np.moveaxis(sums, axis, 0)
        total = rows[: size - width + 1].copy()
        for first in range(1, width):
            total += rows[first : size - width + 1 + first]
        total /= width
        sums = np.moveaxis(total, 0, axis)
    return sums


def _extremes(extreme: np.ufunc, part: npt.NDArray[Any], windows: list[list[slice]]) -> FloatArray:
    """Return the least or largest value of a layer in the windows of its tiles along the other axes."""
    reduced = extreme.reduce(part, axis=0)
    for axis, each in enumerate(windows):
        rows = np.moveaxis(reduced, axis, 0)
        reduced = np.stack([extreme.reduce(rows[window], axis=0) for window in each], axis=axis)
    return np.asarray(reduced, dtype=np.float64)


def _sums(table: IntArray, low: IntArray, high: IntArray) -> IntArray:
    """Return the sums over boxes, from `low` to before `high` (n, d), by the table of those from the first tile."""
    total = np.zeros(len(low), dtype=np.int64)
    for corner in product((0, 1), repeat=low.shape[1]):
        sign = (-1) ** (low.shape[1] - sum(corner))
        total += sign * table[tuple(np.where(np.array(corner) == 1, high, low).T)]
    return total
