"""The noise of voxels, where it is correlated: what those are off that lie away from a level, on one side of it.

A scanner's noise passes through its reconstruction, so that neighboring voxels share some of it, and no rule that takes
noise for independent can tell that part from the surface (Altman 1990).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.cover.voxel_values import VoxelValues
from o3dleaf.fitting.rbf.tail import IntArray

BLUR = 1.0
"""Voxels: sides are told apart by smoothed values."""
AROUND = 5
"""Edge, in voxels, of the cube on one side of the level around a voxel that counts: a blurred step is two wide."""
REACH = 7
"""Voxels between two whose covariance is known: a ball's diameter."""
BLOCK = 40
"""Edge, in voxels, of the blocks that are looked at."""
BLOCKS = 2
"""Blocks along each axis, at even distances."""
MIN_VOXELS = 4_000
"""On either side: a correlation is known to two hundredths then."""
MIN_NOISE = 0.04
"""Of the step between the sides: less moves the surface by a tenth of its blur at most, and structure that is finer
than what tells the sides apart may be as much."""
CORRELATED = 0.2
"""Of neighbors, more than of voxels three apart, which drift correlates as much: less leads cross-validation astray by
little. `samples.wheat_ct` has 0.1, a noise after a Gaussian of half a voxel 0.3."""


@dataclass(frozen=True, eq=False)
class VoxelNoise:
    """Noise that is alike everywhere.

    Attributes
    ----------
    covariances : ndarray of side 2 REACH + 1 along each axis
        Of two voxels, by their displacement; of a voxel with itself in the middle.
    """

    covariances: FloatArray

    @classmethod
    def of(cls, values: VoxelValues) -> "VoxelNoise | None":
        """Return the noise of voxels away from a level; None where it is independent, slight or not seen.

        It is that of the quieter side: pockets, and other structure that is finer than what tells the sides apart, add.
        """
        shape = values.data.shape
        sums, pairs = (np.zeros((2, *(2 * REACH + 1,) * len(shape))) for _ in range(2))
        totals = np.zeros((2, 2))
        for block in _blocks(shape):
            data = values.data[block].astype(np.float64) - values.isovalue
            above = gaussian_filter(data, BLUR) > 0
            for side, pure in enumerate((~maximum_filter(above, AROUND), minimum_filter(above, AROUND))):
                if pure.any():
                    totals[side] += pure.sum(), data[pure].sum()
                    sums[side] += _correlated(np.where(pure, data - data[pure].mean(), 0.0))
                    pairs[side] += _correlated(pure.astype(np.float64))
        if totals[:, 0].min() < MIN_VOXELS:
            return None
        low, high = totals[:, 1] / totals[:, 0]
        middle, unit = np.full(len(shape), REACH), np.eye(len(shape), dtype=np.int64)
        # Of displacements that few pairs have nothing is known.
        known = np.where(pairs > MIN_VOXELS, sums / np.maximum(pairs, 1.0), 0.0)
        covariances = min(known, key=lambda each: float(each[tuple(middle)]))
        covariances = (covariances + np.flip(covariances)) / 2
        variance = covariances[tuple(middle)]
        if variance <= (MIN_NOISE * (high - low)) ** 2:
            return None
        near, far = (np.mean([covariances[tuple(middle + step * axis)] for axis in unit]) for step in (1, 3))
        return cls(covariances) if near - far > CORRELATED * variance else None

    def between(self, voxels: IntArray) -> FloatArray:
        """Return the covariances (n, n) of voxels (n, d)."""
        apart = voxels[:, np.newaxis] - voxels
        near = (np.abs(apart) <= REACH).all(axis=2)
        places = np.clip(apart + REACH, 0, 2 * REACH)
        return np.where(near, self.covariances[tuple(np.moveaxis(places, 2, 0))], 0.0)


def _blocks(shape: tuple[int, ...]) -> Iterator[tuple[slice, ...]]:
    """Yield blocks of a lattice, a fixed number of them along each axis that is long enough."""
    ends = []
    for size in shape:
        edge = min(size, BLOCK)
        count = min(BLOCKS, size // edge)
        starts = np.linspace(0, size - edge, 2 * count + 1)[1::2] if size > edge else np.zeros(1)
        ends.append([slice(int(start), int(start) + edge) for start in starts])
    yield from product(*ends)


def _correlated(values: FloatArray) -> FloatArray:
    """Return the sums of the products of values that are displaced by up to `REACH` along each axis."""
    size = [fft.next_fast_len(count + REACH, real=True) for count in values.shape]
    spread = np.asarray(fft.rfftn(values, size))
    products = fft.irfftn(spread * spread.conj(), size)
    shifts = [np.arange(-REACH, REACH + 1) % count for count in size]
    return np.asarray(products[np.ix_(*shifts)])
