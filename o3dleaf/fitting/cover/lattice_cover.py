r"""A cover of a lattice of voxels: balls that sit alike on it have the same voxels, seen from their centers.

The lattice is cut into tiles of a few voxels, each with its ball. Seen from its center, a ball in the
interior contains the same voxels as any other, one at a face the same as all others at that face: a
*class*. Away from a narrow band balls may be *bare*: larger ones, fitted by a polynomial alone.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.resources.scratch import ROWS, GrowingArray, made_by_rows
from o3dleaf.fitting.cover.lattice_band import LatticeBand
from o3dleaf.fitting.rbf.tail import IntArray


@dataclass(frozen=True, eq=False)
class VoxelCover:
    """Balls around the tiles of a lattice, sorted into classes of balls that contain alike voxels.

    Attributes
    ----------
    shape : tuple of int
        Voxels of the lattice along each axis.
    steps : (d, d) ndarray
        Displacement from a voxel to the next along each axis, one a row, in the unit of the field.
    tile : (d,) int64 ndarray
        Voxels of a tile along each axis, at level 0; at level l its side is 2ˡ times as long, and
        every 2ˡth voxel along each axis counts.
    starts, levels : (M, d), (M,) int64 ndarrays
        First voxel and level of each ball's tile.
    overlap : float
        Radius of a ball over half the diagonal of its tile.
    classes : (M,) int64 ndarray
        The class of each ball.
    keys : (C, 2 + 2 d) int64 ndarray
        Level of each class, how many voxels its balls find before and after their tile along each axis, and whether
        they are bare.
    """

    shape: tuple[int, ...]
    steps: FloatArray
    tile: IntArray
    starts: IntArray
    levels: IntArray
    overlap: float
    classes: IntArray
    keys: IntArray

    @classmethod
    def fit(
        cls,
        shape: tuple[int, ...],
        steps: FloatArray,
        most: int,
        overlap: float,
        mask: npt.NDArray[np.bool_] | None = None,
        layers: slice = slice(None),
    ) -> "VoxelCover":
        """Tile a lattice so that a ball contains at most `most` voxels.

        Where a `mask` of the lattice's shape is given, tiles that contain none of its voxels are merged,
        2 by 2 along each axis, as long as the lattice is large enough. Without one, some `layers` of tiles along the
        first axis may be asked for alone.
        """
        tile = _tile(np.array(shape), np.linalg.norm(steps, axis=1), most, overlap)
        starts, levels = _all_tiles(shape, tile, layers) if mask is None else _merged_tiles(mask, tile)
        return cls._sorted(shape, steps, tile, overlap, starts, levels, np.zeros(len(starts), dtype=bool))

    @classmethod
    def _sorted(  # noqa: PLR0917 - a lattice, its tiles, and the balls
        cls,
        shape: tuple[int, ...],
        steps: FloatArray,
        tile: IntArray,
        overlap: float,
        starts: IntArray,
        levels: IntArray,
        bare: npt.NDArray[np.bool_],
    ) -> "VoxelCover":
        """Return the cover of some balls, sorted into classes."""
        most, ends = _reach(tile, np.linalg.norm(steps, axis=1), overlap), np.array(shape) - 1
        sides = (int(levels.max(initial=0)) + 1, *(most + 1), *(most + 1), 2)

        def codes(start: int, stop: int) -> IntArray:
            """Return the key of each ball as one number: rows are sorted the same way, in a tenth of the time."""
            level = levels[start:stop]
            first, stride = starts[start:stop] + _shift(level), (1 << level)[:, np.newaxis]
            before = np.minimum(first // stride, most)
            after = np.minimum((ends - first) // stride - (tile - 1), most)
            return np.ravel_multi_index((level, *before.T, *after.T, bare[start:stop]), sides)

        found = [np.unique(codes(*part)) for part in blocks(len(starts), ROWS)]
        known = np.unique(np.concatenate(found)) if found else np.empty(0, dtype=np.int64)
        classes = made_by_rows(levels.shape, lambda *part: np.searchsorted(known, codes(*part)), np.int64)
        keys = np.stack(np.unravel_index(known, sides), axis=1)
        return cls(shape, steps, tile, starts, levels, overlap, classes, keys)

    def banded(self, data: npt.NDArray[Any], isovalue: float, averaged: float = 1.0) -> "VoxelCover":
        """Return a cover whose balls near the isovalue are those of this one, and bare ones elsewhere; of no mask.

        `averaged` is how many voxels the fit averages over, as `LatticeBand.of` takes it.
        """
        reach = _reach(self.tile, np.linalg.norm(self.steps, axis=1), self.overlap)
        return self.with_tiles(*LatticeBand.of(data, isovalue, self.tile, reach, averaged).balls())

    def with_tiles(self, starts: IntArray, levels: IntArray, bare: npt.NDArray[np.bool_]) -> "VoxelCover":
        """Return the cover by the balls of other tiles of these sides: their first voxels, levels, and whether bare."""
        return self._sorted(self.shape, self.steps, self.tile, self.overlap, starts, levels, bare)

    @property
    def bare(self) -> npt.NDArray[np.bool_]:
        """(M,) which balls are fitted by a polynomial alone."""
        return np.asarray(self.keys[self.classes, -1] == 1)

    def reaching(self, low: FloatArray, high: FloatArray, origin: FloatArray) -> "VoxelCover":
        """Return the cover without the balls that do not reach into a box of the field's coordinates."""
        found = GrowingArray(np.int64, (len(self.shape),)), GrowingArray(np.int64), GrowingArray(np.int64)
        number = np.full(len(self.keys), -1)
        for start, stop in blocks(len(self.starts), ROWS):
            centers, levels = self._centers(origin, start, stop), self.levels[start:stop]
            gap = np.maximum(np.maximum(low - centers, centers - high), 0.0)
            kept = np.linalg.norm(gap, axis=1) < self._radius * (1 << levels)
            for whole, part in zip(found, (self.starts[start:stop], levels, self.classes[start:stop]), strict=True):
                whole.append(part[kept])
            number[self.classes[start:stop][kept]] = 0
        used = np.flatnonzero(number == 0)
        number[used] = np.arange(len(used))
        starts, levels, classes = (each.whole() for each in found)
        for start, stop in blocks(len(classes), ROWS):
            classes[start:stop] = number[classes[start:stop]]
        return VoxelCover(self.shape, self.steps, self.tile, starts, levels, self.overlap, classes, self.keys[used])

    def centers(self, origin: FloatArray) -> FloatArray:
        """Return the (M, d) centers of the balls, `origin` being the position of voxel (0, 0, 0)."""
        return made_by_rows(self.starts.shape, partial(self._centers, origin))

    def _centers(self, origin: FloatArray, start: int, stop: int) -> FloatArray:
        sides = self.tile * (1 << self.levels[start:stop])[:, np.newaxis]
        return origin + _moved(self.starts[start:stop] + (sides - 1) / 2, self.steps)

    @property
    def radii(self) -> FloatArray:
        """(M,) radii of the balls."""
        return made_by_rows(self.levels.shape, lambda start, stop: self._radius * (1 << self.levels[start:stop]))

    def radius_of(self, number: int) -> float:
        """Return the radius of the balls of a class."""
        return float(self._radius * (1 << self.keys[number, 0]))

    @property
    def _radius(self) -> float:
        """Radius of a ball of level 0."""
        diagonal = np.linalg.norm(self.tile * np.linalg.norm(self.steps, axis=1))
        return self.overlap * float(diagonal) / 2

    def voxels(self, number: int) -> IntArray:
        """Return the (n, d) voxels, counted from the first of its tile, that a ball of a class contains."""
        dimension = len(self.shape)
        level, before, after = (
            self.keys[number, 0],
            self.keys[number, 1 : 1 + dimension],
            self.keys[number, 1 + dimension : -1],
        )
        axes = [np.arange(-low, side + high) for low, side, high in zip(before, self.tile, after, strict=True)]
        voxels = (np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension) << level) + _shift(level)
        inside = np.linalg.norm(self._from_center(voxels, level), axis=1) <= self._radius * (1 << level)
        contained: IntArray = voxels[inside]
        return contained

    def points(self, number: int, voxels: IntArray) -> FloatArray:
        """Return the (d, n) unit coordinates of a class's `voxels`, in the directions of the field's axes."""
        level = self.keys[number, 0]
        offsets = self._from_center(voxels, level)
        local: FloatArray = np.ascontiguousarray(offsets.T) / (self._radius * (1 << level))
        return local

    def _from_center(self, voxels: IntArray, level: int) -> FloatArray:
        middle = (self.tile * (1 << level) - 1) / 2
        return _moved(voxels - middle, self.steps)


def _moved(voxels: npt.NDArray[Any], steps: FloatArray) -> FloatArray:
    """Return the displacements of (n, d) steps along the lattice; not by BLAS, whose bits depend on its threads."""
    moved: FloatArray = np.einsum("ia,ab->ib", voxels, steps)
    return moved


def _shift(level: Any) -> Any:
    """Return the first voxel of a tile that counts: of every 2ˡ, the middle one."""
    shift = (1 << level) // 2
    return shift[:, np.newaxis] if np.ndim(shift) else shift


def _reach(tile: IntArray, spacing: FloatArray, overlap: float) -> IntArray:
    """Return how many voxels a ball reaches beyond its tile along each axis; a quarter allows for `_shift`."""
    radius = overlap * np.linalg.norm(tile * spacing) / 2
    return np.floor(radius / spacing - (tile - 1) / 2 + 0.25).astype(np.int64)


def _tile(shape: IntArray, spacing: FloatArray, most: int, overlap: float) -> IntArray:
    """Return the sides of the largest nearly cubic tile whose ball contains at most `most` voxels."""
    tile = np.ones(len(shape), dtype=np.int64)
    growing = tile < shape
    while growing.any():
        axis = int(np.argmin(np.where(growing, tile * spacing, np.inf)))
        larger = tile.copy()
        larger[axis] += 1
        if _count(larger, shape, spacing, overlap) > most:
            break
        tile = larger
        growing = tile < shape
    return tile


def _count(tile: IntArray, shape: IntArray, spacing: FloatArray, overlap: float) -> int:
    """Return how many voxels the ball of a tile in the middle of the lattice contains."""
    radius = overlap * np.linalg.norm(tile * spacing) / 2
    squares = []
    for side, size, step in zip(tile, shape, spacing, strict=True):
        reach = 0 if side == size else int(radius / step) + 1
        squares.append(((np.arange(-reach, side + reach) - (side - 1) / 2) * step) ** 2)
    total = squares[0]
    for square in squares[1:]:
        total = np.add.outer(total, square)
    return int(np.sum(total <= radius**2))


def _all_tiles(shape: tuple[int, ...], tile: IntArray, layers: slice = slice(None)) -> tuple[IntArray, IntArray]:
    """Return the starts of tiles that cover the lattice; the last along an axis is moved back to lie within."""
    axes = [np.minimum(np.arange(0, size, side), size - side) for size, side in zip(shape, tile, strict=True)]
    starts = np.stack(np.meshgrid(axes[0][layers], *axes[1:], indexing="ij"), axis=-1).reshape(-1, len(shape))
    return starts, np.zeros(len(starts), dtype=np.int64)


def _merged_tiles(mask: npt.NDArray[np.bool_], tile: IntArray) -> tuple[IntArray, IntArray]:
    """Return starts and levels of tiles: as large as can be where no voxel is marked, whole in the lattice."""
    table = np.zeros([size + 1 for size in mask.shape], dtype=np.int64)
    table[(slice(1, None),) * mask.ndim] = mask
    for axis in range(mask.ndim):
        np.cumsum(table, axis=axis, out=table)
    whole = np.array(mask.shape) // tile
    merged = np.zeros(-(-np.array(mask.shape) // tile), dtype=bool)
    done: list[tuple[IntArray, int]] = []
    for level in range(int(np.log2(whole.min())), 0, -1):
        places = np.argwhere(np.ones(whole >> level, dtype=bool)) << level
        free = ~merged[tuple(places.T)] & ~_marked(table, places * tile, tile << level)
        inside = np.array(list(product(range(1 << level), repeat=mask.ndim)))
        merged[tuple((places[free, np.newaxis] + inside).reshape(-1, mask.ndim).T)] = True
        done.append((places[free] * tile, level))
    starts, _ = _all_tiles(mask.shape, tile)
    done.append((starts[~merged.ravel()], 0))
    return np.concatenate([s for s, _ in done]), np.concatenate([np.full(len(s), level) for s, level in done])


def _marked(table: IntArray, starts: IntArray, sides: IntArray) -> npt.NDArray[np.bool_]:
    """Return which boxes of voxels contain a marked one, by the table of sums over all boxes from the first voxel."""
    total = np.zeros(len(starts), dtype=np.int64)
    for corner in product((0, 1), repeat=len(sides)):
        sign = (-1) ** (len(sides) - sum(corner))
        total += sign * table[tuple((starts + np.array(corner) * sides).T)]
    return total > 0
