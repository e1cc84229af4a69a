r"""Balls on a lattice of voxels: those that sit alike share their points, their matrix and its factor.

The lattice is cut into tiles of a few voxels, each with its ball. Seen from its centre, a ball in the
interior holds the same voxels as any other, one at a face the same as all others at that face: a
*class*. A rigid motion keeps distances, hence the matrix of :math:`φ`. A class is factored once, and its
balls are the columns of one right-hand side.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import Progress, run_blocks, single_threaded_blas
from o3dleaf.fitting.pu.local import LocalSplines
from o3dleaf.fitting.pu.smoothing_selection import GCV_BALLS, each_ball
from o3dleaf.fitting.rbf.factor import LocalFactor
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

COLUMNS = 256
"""Balls of a class that are solved for at once; fixed, so that the result does not depend on the threads."""


@dataclass(frozen=True, eq=False)
class VoxelCover:
    """Balls around the tiles of a lattice, sorted into classes of balls that hold alike voxels.

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
    keys : (C, 1 + 2 d) int64 ndarray
        Level of each class, and how many voxels its balls find before and after their tile along each axis.
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
    ) -> "VoxelCover":
        """Tile a lattice so that a ball holds at most `most` voxels.

        Where a `mask` of the lattice's shape is given, tiles that hold none of its voxels are merged,
        2 by 2 along each axis, as long as the lattice is large enough.
        """
        spacing = np.linalg.norm(steps, axis=1)
        tile = _tile(np.array(shape), spacing, most, overlap)
        starts, levels = _all_tiles(shape, tile) if mask is None else _merged_tiles(mask, tile)
        reach = _reach(tile, spacing, overlap)
        first, stride = starts + _shift(levels), (1 << levels)[:, np.newaxis]
        before = np.minimum(first // stride, reach)
        after = np.minimum((np.array(shape) - 1 - first) // stride - (tile - 1), reach)
        keys, classes = np.unique(np.column_stack([levels, before, after]), axis=0, return_inverse=True)
        return cls(shape, steps, tile, starts, levels, overlap, classes.ravel(), keys)

    def reaching(self, low: FloatArray, high: FloatArray, origin: FloatArray) -> "VoxelCover":
        """Return the cover without the balls that do not reach into a box of the field's coordinates."""
        centres = self.centres(origin)
        gap = np.maximum(np.maximum(low - centres, centres - high), 0.0)
        kept = np.linalg.norm(gap, axis=1) < self.radii
        used, classes = np.unique(self.classes[kept], return_inverse=True)
        parts = self.starts[kept], self.levels[kept], self.overlap, classes.ravel(), self.keys[used]
        return VoxelCover(self.shape, self.steps, self.tile, *parts)

    def centres(self, origin: FloatArray) -> FloatArray:
        """Return the (M, d) centres of the balls, `origin` being the position of voxel (0, 0, 0)."""
        middle = self.starts + (self.tile * (1 << self.levels)[:, np.newaxis] - 1) / 2
        return origin + _moved(middle, self.steps)

    @property
    def radii(self) -> FloatArray:
        """(M,) radii of the balls."""
        radii: FloatArray = np.asarray(self._radius * (1 << self.levels), dtype=np.float64)
        return radii

    @property
    def _radius(self) -> float:
        """Radius of a ball of level 0."""
        diagonal = np.linalg.norm(self.tile * np.linalg.norm(self.steps, axis=1))
        return self.overlap * float(diagonal) / 2

    def voxels(self, number: int) -> IntArray:
        """Return the (n, d) voxels, counted from the first of its tile, that a ball of a class holds."""
        dimension = len(self.shape)
        level, before, after = (
            self.keys[number, 0],
            self.keys[number, 1 : 1 + dimension],
            self.keys[number, 1 + dimension :],
        )
        axes = [np.arange(-low, side + high) for low, side, high in zip(before, self.tile, after, strict=True)]
        found = (np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension) << level) + _shift(level)
        inside = np.linalg.norm(self._from_centre(found, level), axis=1) <= self._radius * (1 << level)
        held: IntArray = found[inside]
        return held

    def points(self, number: int, voxels: IntArray) -> FloatArray:
        """Return the (d, n) unit coordinates of a class's `voxels`, in the directions of the field's axes."""
        level = self.keys[number, 0]
        offsets = self._from_centre(voxels, level)
        local: FloatArray = np.ascontiguousarray(offsets.T) / (self._radius * (1 << level))
        return local

    def _from_centre(self, voxels: IntArray, level: int) -> FloatArray:
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
    """Return the sides of the largest nearly cubic tile whose ball holds at most `most` voxels."""
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
    """Return how many voxels the ball of a tile in the middle of the lattice holds."""
    radius = overlap * np.linalg.norm(tile * spacing) / 2
    squares = []
    for side, size, step in zip(tile, shape, spacing, strict=True):
        reach = 0 if side == size else int(radius / step) + 1
        squares.append(((np.arange(-reach, side + reach) - (side - 1) / 2) * step) ** 2)
    total = squares[0]
    for square in squares[1:]:
        total = np.add.outer(total, square)
    return int(np.sum(total <= radius**2))


def _all_tiles(shape: tuple[int, ...], tile: IntArray) -> tuple[IntArray, IntArray]:
    """Return the starts of tiles that cover the lattice; the last along an axis is moved back to lie within."""
    axes = [np.minimum(np.arange(0, size, side), size - side) for size, side in zip(shape, tile, strict=True)]
    starts = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(shape))
    return starts, np.zeros(len(starts), dtype=np.int64)


def _merged_tiles(mask: npt.NDArray[np.bool_], tile: IntArray) -> tuple[IntArray, IntArray]:
    """Return starts and levels of tiles: as large as can be where they hold no marked voxel, whole in the lattice."""
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
    """Return which boxes of voxels hold a marked one, by the table of sums over all boxes from the first voxel."""
    total = np.zeros(len(starts), dtype=np.int64)
    for corner in product((0, 1), repeat=len(sides)):
        sign = (-1) ** (len(sides) - sum(corner))
        total += sign * table[tuple((starts + np.array(corner) * sides).T)]
    return total > 0


@dataclass(frozen=True, eq=False)
class VoxelValues:
    """The data of a lattice: read where they lie, as float64 less the isovalue, ball by ball."""

    data: npt.NDArray[Any]
    isovalue: float

    def of(self, starts: IntArray, voxels: IntArray) -> FloatArray:
        """Return the (m, n) values of balls whose tiles start at (m, d), of `voxels` (n, d) counted from there."""
        stride = np.array([int(np.prod(self.data.shape[axis + 1 :])) for axis in range(self.data.ndim)])
        at = (starts @ stride)[:, np.newaxis] + voxels @ stride
        found: FloatArray = self.data.reshape(-1)[at].astype(np.float64)
        found -= self.isovalue
        return found


def fit_splines(
    cover: VoxelCover,
    values: VoxelValues,
    kernel: Polyharmonic,
    degree: int,
    smoothing: Smoothing,
    progress: Progress | None = None,
) -> LocalSplines:
    """Fit a spline to the voxels of every ball, each class of balls by one factorisation."""
    exponents = tail_exponents(len(cover.shape), degree)
    voxels = [cover.voxels(number) for number in range(len(cover.keys))]
    points = [cover.points(number, each) for number, each in enumerate(voxels)]
    sizes = np.array([each.shape[1] for each in points])
    offsets = np.concatenate([[0], np.cumsum(sizes[cover.classes])])
    begins = np.concatenate([[0], np.cumsum(len(cover.shape) * sizes)[:-1]])
    weights, tails = np.empty(offsets[-1]), np.empty((len(cover.starts), len(exponents)))
    factors: list[Any] = [None] * len(points)
    radii = cover.radii
    of_class = radii[np.unique(cover.classes, return_index=True)[1]]
    with single_threaded_blas():
        if isinstance(smoothing.amount, str):
            smoothing = _choose(cover, values, kernel, exponents, smoothing)

        def factor(start: int, stop: int) -> None:
            for number in range(start, stop):
                diagonal = smoothing.diagonal(int(sizes[number])) / of_class[number] ** kernel.power
                factors[number] = LocalFactor.of(
                    points[number], exponents, kernel.power, np.full(sizes[number], diagonal)
                )

        run_blocks(factor, len(points), 1)
        batches = list(_batches(cover.classes))

        def solve_batches(start: int, stop: int) -> None:
            for balls in batches[start:stop]:
                number = cover.classes[balls[0]]
                data = values.of(cover.starts[balls], voxels[number])
                strengths, tails[balls] = factors[number].solve(data)
                weights[offsets[balls][:, np.newaxis] + np.arange(sizes[number])] = strengths

        run_blocks(solve_batches, len(batches), 1, progress)
    ranks = np.array([len(each.right) for each in factors])[cover.classes]
    sites = np.concatenate([each.ravel() for each in points])
    places, dropped = begins[cover.classes], np.zeros(len(radii), dtype=np.int64)
    return LocalSplines(kernel, smoothing, offsets, places, sites, weights, tails, exponents, ranks, dropped)


def _batches(classes: IntArray) -> Iterator[IntArray]:
    """Yield the balls of each class, `COLUMNS` at a time, those of the largest classes first."""
    order = np.argsort(classes, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(classes[order])) + 1)
    for balls in sorted(groups, key=len, reverse=True):
        for start in range(0, len(balls), COLUMNS):
            yield balls[start : start + COLUMNS]


def _choose(
    cover: VoxelCover, values: VoxelValues, kernel: Polyharmonic, exponents: IntArray, rule: Smoothing
) -> Smoothing:
    """Return the rule with the amount that a fixed sample of balls agrees on, by one eigen-decomposition a class."""
    if rule.amount == "gcv-per-ball":
        raise InputError("smoothing: balls on a lattice share one factor and its smoothing; give 'gcv' or a number")
    sample = np.unique(np.linspace(0, len(cover.starts) - 1, GCV_BALLS).round().astype(np.int64))
    batches = list(_batches(cover.classes[sample]))

    def of_class(batch: int) -> Spectrum:
        balls = sample[batches[batch]]
        number = int(cover.classes[balls[0]])
        voxels = cover.voxels(number)
        points, data = cover.points(number, voxels), values.of(cover.starts[balls], voxels)
        found, coefficients = spectra(points, data, np.ones(len(voxels)), exponents, kernel.power)
        found /= rule.scale(len(voxels)) / cover.radii[balls[0]] ** kernel.power
        return Spectrum.pooled(Spectrum(found, each, len(voxels)) for each in coefficients)

    return rule.chosen(Spectrum.pooled(each_ball(of_class, np.arange(len(batches)))))
