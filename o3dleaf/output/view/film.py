"""The pixels of a picture that a mesh covers, and the light that has been gathered in them."""

from collections.abc import Callable
from dataclasses import dataclass
from math import gcd

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import get_num_threads, run_blocks
from o3dleaf.output.view.shade_loops import add_samples, find_calm, share_sky, span_samples

BATCH_SIZE = 1 << 18
"""PixelSamples shaded at once, on all threads together."""

GOLDEN = 0.618033989


@dataclass(frozen=True)
class PixelSamples:
    """PixelSamples of some pixels.

    Attributes
    ----------
    columns, rows : (n,) ndarrays
        Where they lie, in pixels from the upper left corner.
    number : (n,) ndarray of int64
        Of the sample among those of its pixel; all are among the first samples, or none is.
    pixel : (n,) ndarray of int64
        Of its pixel on the film.
    """

    columns: FloatArray
    rows: FloatArray
    number: IntArray
    pixel: IntArray


@dataclass(frozen=True)
class Lit:
    """The light of samples that hit something, and where they hit it.

    Attributes
    ----------
    hit : (k,) ndarray of int64
        Rows of the samples.
    light : (k, 6) ndarray
        Linear RGB that does not depend on the sky, and that of an open sky.
    seen : (k,) ndarray
        The part of the sky that is open.
    place, normal : (k, 3) ndarrays
    """

    hit: IntArray
    light: FloatArray
    seen: FloatArray
    place: FloatArray
    normal: FloatArray


Light = Callable[[PixelSamples], Lit]


class Film:
    """Sums over the samples of every covered pixel, which lie on a grid of `finer` × `finer` in each.

    The first `finer` samples, no two in one row or column of the grid, tell where more would change nothing.
    """

    def __init__(self, covered: BoolArray, finer: int) -> None:
        self.pixels: IntArray = np.flatnonzero(covered)
        count = len(self.pixels)
        self.finer = finer
        self.number: npt.NDArray[np.int32] = np.full(covered.shape, -1, dtype=np.int32)
        self.number.ravel()[self.pixels] = np.arange(count)
        self.fixed, self.sky, self.dimmed = (np.zeros((count, 3), dtype=np.float32) for _ in range(3))
        self.hits, self.seen = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.float32)
        self.taken = np.zeros(count, dtype=np.int32)
        self.low, self.high = (np.full((count, 3), limit, dtype=np.float32) for limit in (np.inf, -np.inf))
        self.place, self.normal = (np.zeros((count, 3), dtype=np.float32) for _ in range(2))

    def take_first(self, light: Light) -> None:
        """Take the first samples of all pixels, and note what tells whether a pixel and its neighbors show the same."""

        def task(start: int, stop: int) -> None:
            samples = self._samples(np.arange(start, stop), range(self.finer))
            lit = light(samples)
            row = self._add(samples, lit)
            span_samples(row, lit.light, lit.place, lit.normal, self.low, self.high, self.place, self.normal)

        run_blocks(task, len(self.pixels), self._batch(self.finer))

    def take_others(self, chosen: BoolArray, light: Light) -> None:
        """Take the other samples of chosen pixels."""
        pixels, numbers = np.flatnonzero(chosen), range(self.finer, self.finer**2)

        def task(start: int, stop: int) -> None:
            samples = self._samples(pixels[start:stop], numbers)
            self._add(samples, light(samples))

        if numbers:
            run_blocks(task, len(pixels), self._batch(len(numbers)))

    @staticmethod
    def _batch(each: int) -> int:
        """Return the pixels to take at once: each thread its share of the memory, no sample depends on another."""
        return max(1, BATCH_SIZE // (each * get_num_threads()))

    def _samples(self, pixels: IntArray, numbers: range) -> PixelSamples:
        """Return samples of some pixels, and count them as taken."""
        at = _places(self.finer)[numbers.start : numbers.stop]
        self.taken[pixels] += len(numbers)
        width = self.number.shape[1]
        row, column = self.pixels[pixels] // width, self.pixels[pixels] % width
        return PixelSamples(
            (column[:, np.newaxis] + at[:, 1]).ravel(),
            (row[:, np.newaxis] + at[:, 0]).ravel(),
            np.tile(np.arange(numbers.start, numbers.stop), len(pixels)),
            np.repeat(pixels, len(numbers)),
        )

    def _add(self, samples: PixelSamples, lit: Lit) -> IntArray:
        """Add what samples hit to their pixels, and return those."""
        row = samples.pixel[lit.hit]
        add_samples(row, lit.light, lit.seen, self.fixed, self.sky, self.dimmed, self.hits, self.seen)
        return row

    def find_calm(self, contrast: float, depth: float) -> BoolArray:
        """Return the pixels around which nothing changes after the first samples."""
        calm = np.zeros(len(self.pixels), dtype=bool)
        find_calm(
            self.pixels, self.number, self.hits, self.finer, self.low, self.high, self.place, self.normal,
            contrast, depth, calm,
        )  # fmt: skip
        return calm

    def share_sky(self, depth: float) -> None:
        """Give pixels that one surface fills the mean sky of their neighborhood."""
        share_sky(
            self.pixels, self.number, self.finer, self.hits, self.taken, self.place, self.normal, depth,
            self.seen, self.sky, self.dimmed,
        )  # fmt: skip

    def image(self) -> FloatArray:
        """Return the (height, width, 4) linear RGB times coverage, and coverage."""
        image = np.zeros((*self.number.shape, 4))
        taken = np.maximum(self.taken, 1)[:, np.newaxis]
        image.reshape(-1, 4)[self.pixels] = np.column_stack([self.fixed + self.dimmed, self.hits]) / taken
        return image


def _places(finer: int) -> FloatArray:
    """Return the (finer², 2) rows and columns, 0 to 1, of a pixel's samples, first those no two of which share one."""
    step = next(step for step in range(round(GOLDEN * finer), 2 * finer) if gcd(step, finer) == 1)
    row, column = np.divmod(np.arange(finer**2), finer)
    grid = (np.column_stack([row, column]) + 0.5) / finer
    return np.asarray(grid[np.argsort(column != row * step % finer, kind="stable")])
