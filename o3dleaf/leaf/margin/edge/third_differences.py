"""Third differences around a closed curve, and systems that they make: bands, but for the corners of the ring."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray

SHIFTS = (-1, 0, 1, 2)
"""Steps from the node of a difference to those that it is taken of."""
REACH = SHIFTS[-1] - SHIFTS[0]


@dataclass(frozen=True)
class ThirdDifferences:
    """A third difference at each of n nodes of a closed curve.

    Attributes
    ----------
    factors : (4, n) ndarray
        Row k has the factors of the nodes `SHIFTS[k]` steps on.
    """

    factors: FloatArray

    def of(self, values: FloatArray) -> FloatArray:
        """Return the differences (n,) of values at the nodes."""
        terms = [factor * _turned(values, -shift) for factor, shift in zip(self.factors, SHIFTS, strict=True)]
        return np.asarray(sum(terms))

    def transposed(self, values: FloatArray) -> FloatArray:
        """Return what the transposed differences make of (n,) values."""
        terms = [_turned(factor * values, shift) for factor, shift in zip(self.factors, SHIFTS, strict=True)]
        return np.asarray(sum(terms))

    def squared(self, weights: FloatArray) -> "RingMatrix":
        """Return the matrix DᵀWD of the sum of squares with weights (n,)."""
        bands = np.zeros((REACH + 1, len(weights)))
        for i, first in enumerate(SHIFTS):
            for j in range(i, len(SHIFTS)):
                bands[j - i] += np.roll(weights * self.factors[i] * self.factors[j], first)
        return RingMatrix.of(bands)


@dataclass(frozen=True)
class RingMatrix:
    """A symmetric, positive matrix between nodes of a ring that are near one another.

    Numbered by turns from both sides of the first node, those near on the ring are near in the row, and it is a band.

    Attributes
    ----------
    place : (n,) ndarray of int64
        Numbers of the nodes.
    band : (2 `REACH` + 1, n) ndarray
        Its lower diagonals in that order.
    """

    place: IntArray
    band: FloatArray

    @classmethod
    def of(cls, bands: FloatArray) -> "RingMatrix":
        """Return the matrix of entries (`REACH` + 1, n): row k has those between each node and the one k steps on."""
        count = bands.shape[1]
        nodes = np.arange(count)
        place = np.minimum(2 * nodes, 2 * (count - 1 - nodes) + 1)
        band = np.zeros((2 * REACH + 1, count))
        for step, row in enumerate(bands):
            other = np.roll(place, -step)
            band[np.abs(place - other), np.minimum(place, other)] = row
        return cls(place, band)

    def solve(self, diagonal: FloatArray, right: FloatArray) -> FloatArray:
        """Return the solution (n,) with (n,) numbers added on the diagonal."""
        band, ordered = self.band.copy(), np.empty_like(right)
        band[0, self.place] += diagonal
        ordered[self.place] = right
        return np.asarray(solveh_banded(band, ordered, lower=True, overwrite_ab=True, check_finite=False)[self.place])


def _turned(values: FloatArray, shift: int) -> FloatArray:
    """Return what `np.roll` does, which takes ten times as long for a row this short."""
    return np.concatenate([values[-shift:], values[:-shift]])
