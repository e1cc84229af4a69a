"""The pixels of a picture that a mesh covers, and the light that has been gathered in them."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import gcd

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.output.view.shade_loops import add_samples, find_calm, share_sky, span_samples

BATCH_SIZE = 1 << 17
"""Samples shaded at once."""

GOLDEN = 0.618033989


@dataclass(frozen=True)
class Samples:
    """Samples of some pixels.

    Attributes
    ----------
    columns, rows : (n,) ndarrays
        Where they lie, in pixels from the upper left corner.
    number : (n,) ndarray of int64
        Of the sample among those of its pixel.
    pixel : (n,) ndarray of int64
        Of its pixel on the film.
    """

    columns: FloatArray
    rows: FloatArray
    number: IntArray
    pixel: IntArray


@dataclass(frozen=True)
class Lit:
    """What samples hit.

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


class Film:
    """Sums over the samples of every covered pixel, which lie on a grid of `finer` × `finer` in each.

    The first `finer` samples, no two in one row or column of the grid, tell where more would change nothing.
    """

    def __init__(self, covered: BoolArray, finer: int) -> None:
        self.pixels: IntArray = np.flatnonzero(covered)
        count = len(self.pixels)
        self.finer = finer
        self.number = np.full(covered.shape, -1, dtype=np.int32)
        self.number.ravel()[self.pixels] = np.arange(count)
        self.fixed, self.sky, self.dimmed = (np.zeros((count, 3), dtype=np.float32) for _ in range(3))
        self.hits, self.seen = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.float32)
        self.taken = np.zeros(count, dtype=np.int32)
        self.low, self.high = (np.full((count, 3), limit, dtype=np.float32) for limit in (np.inf, -np.inf))
        self.place, self.normal = (np.zeros((count, 3), dtype=np.float32) for _ in range(2))

    def first_samples(self) -> Iterator[Samples]:
        """Yield batches of the first samples of all pixels."""
        return self._samples(np.arange(len(self.pixels)), range(self.finer))

    def other_samples(self, calm: BoolArray) -> Iterator[Samples]:
        """Yield batches of the other samples of the pixels that are not calm."""
        return self._samples(np.flatnonzero(~calm), range(self.finer, self.finer**2))

    def _samples(self, chosen: IntArray, numbers: range) -> Iterator[Samples]:
        at = _places(self.finer)[numbers.start : numbers.stop]
        each = len(numbers)
        if not each:
            return
        for start, stop in blocks(len(chosen), max(1, BATCH_SIZE // each)):
            here = chosen[start:stop]
            self.taken[here] += each
            row, column = np.divmod(self.pixels[here], self.number.shape[1])
            yield Samples(
                (column[:, np.newaxis] + at[:, 1]).ravel(),
                (row[:, np.newaxis] + at[:, 0]).ravel(),
                np.tile(np.arange(numbers.start, numbers.stop), len(here)),
                np.repeat(here, each),
            )

    def add(self, samples: Samples, lit: Lit) -> None:
        """Add what samples hit to their pixels."""
        row = samples.pixel[lit.hit]
        add_samples(row, lit.light, lit.seen, self.fixed, self.sky, self.dimmed, self.hits, self.seen)

    def compare(self, samples: Samples, lit: Lit) -> None:
        """Note what tells whether a pixel and its neighbors show the same."""
        row = samples.pixel[lit.hit]
        span_samples(row, lit.light, lit.place, lit.normal, self.low, self.high, self.place, self.normal)

    def settle(self, contrast: float, depth: float) -> BoolArray:
        """Return which pixels are calm after the first samples, and give those the mean sky of their neighborhood."""
        calm = np.zeros(len(self.pixels), dtype=bool)
        find_calm(
            self.pixels, self.number, self.hits, self.finer, self.low, self.high, self.place, self.normal,
            contrast, depth, calm,
        )  # fmt: skip
        share_sky(self.pixels, self.number, calm, self.hits, self.seen, self.sky, self.dimmed)
        return calm

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
