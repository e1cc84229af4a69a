"""The surface under a drop as a height over a plane: a cosine series, whose integrals are known."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.fft import dctn

from o3dleaf.core.checks.arrays import FloatArray

NEGLIGIBLE = 1e-7
"""Coefficients below this, of the largest height or of 1, are left out of what Evolver has to calculate."""
SEEN = 0.01
"""Waves smaller than this, of the largest, need no edges of their own."""
FINER = 4
"""Points of a grid to the shortest half wave, for functions of the heights."""
Shape: TypeAlias = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class CosineSeries:
    r"""A function over a rectangle around the origin, smooth if it is mirrored at its sides.

    .. math:: f(x, y) = \sum_{mn} c_{mn} \cos k_m(x + a/2) \cos k_n(y + b/2), \qquad k_m = πm/a,\; k_n = πn/b

    Attributes
    ----------
    coefficients : (p, q) ndarray
    size : (2,) ndarray
        The sides a and b.
    """

    coefficients: FloatArray
    size: FloatArray

    @classmethod
    def of_grid(cls, values: FloatArray, size: FloatArray) -> "CosineSeries":
        """Return the series that has these values (p, q) at the middles of a grid's p × q cells."""
        weights = dctn(values, type=2) / values.size / 4
        weights[1:] *= 2
        weights[:, 1:] *= 2
        return cls(np.asarray(weights, dtype=np.float64), size)

    @classmethod
    def fit(cls, points: FloatArray, size: FloatArray, counts: tuple[int, int]) -> "CosineSeries":
        """Return the series of p × q terms nearest to scattered points (n, 3), in the sense of least squares."""
        p, q = counts
        factors = [_cosines(points[:, axis], size[axis], count) for axis, count in ((0, p), (1, q))]
        matrix = np.einsum("nm,nk->nmk", *factors).reshape(len(points), -1)
        solved = np.linalg.lstsq(matrix, points[:, 2], rcond=None)[0]
        return cls(np.asarray(solved, dtype=np.float64).reshape(p, q), size)

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the values at (n,) places."""
        first, second = self._factors(x, y)
        return np.asarray(np.einsum("nm,mk,nk->n", first, self.coefficients, second))

    def gradient(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the (n, 2) gradients at (n,) places."""
        first, second = self._factors(x, y)
        sines = [
            -np.sin(np.outer(each + side / 2, _waves(side, count))) * _waves(side, count)
            for each, side, count in zip((x, y), self.size, self.coefficients.shape, strict=True)
        ]
        along = np.einsum("nm,mk,nk->n", sines[0], self.coefficients, second)
        return np.stack([along, np.einsum("nm,mk,nk->n", first, self.coefficients, sines[1])], axis=1)

    def derived(self, function: Callable[[FloatArray, FloatArray], FloatArray]) -> "CosineSeries":
        """Return the series of ``function(values (n,), gradients (n, 2))``, from a grid fine enough for it."""
        counts = [FINER * count if count > 1 else 1 for count in self.coefficients.shape]
        x, y = np.meshgrid(*(_middles(side, n) for side, n in zip(self.size, counts, strict=True)), indexing="ij")
        flat = x.ravel(), y.ravel()
        return self.of_grid(function(self(*flat), self.gradient(*flat)).reshape(x.shape), self.size)

    @property
    def shortest_wave(self) -> float:
        """Length of the shortest wave that is a hundredth of the largest one; infinite on a plane."""
        sizes = np.abs(self.coefficients)
        sizes[0, 0] = 0.0
        m, n = np.nonzero(sizes > SEEN * sizes.max())
        numbers = np.hypot(np.pi * m / self.size[0], np.pi * n / self.size[1])
        return float(2 * np.pi / numbers.max()) if len(m) else np.inf

    def scaled(self, factor: float) -> "CosineSeries":
        """Return the heights and lengths in another unit."""
        return CosineSeries(self.coefficients * factor, self.size * factor)

    def raised(self, height: float) -> "CosineSeries":
        """Return the series with a constant added."""
        weights = self.coefficients.copy()
        weights[0, 0] += height
        return replace(self, coefficients=weights)

    def _factors(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        p, q = self.coefficients.shape
        return _cosines(x, self.size[0], p), _cosines(y, self.size[1], q)

    def expression(self) -> str:
        """Return f in the language of Surface Evolver."""
        return self._sum(lambda k, t: f"cos({t})" if k else "1")

    def integral(self) -> str:
        """Return ∫ f dx in the language of Surface Evolver."""
        return self._sum(lambda k, t: f"sin({t})/{k:.15g}" if k else "x")

    def moment(self) -> str:
        """Return ∫ x f dx in the language of Surface Evolver."""
        return self._sum(lambda k, t: f"(x*sin({t})/{k:.15g}+cos({t})/{k * k:.15g})" if k else "x^2/2")

    def _sum(self, along: Callable[[float, str], str]) -> str:
        """Return the sum whose terms have, of each wave along x, what is given, and cosines along y."""
        least = NEGLIGIBLE * max(1.0, np.abs(self.coefficients).max())
        a, b = self.size
        parts = []
        for m, k in enumerate(_waves(a, len(self.coefficients))):
            rows = [(n, weight) for n, weight in enumerate(self.coefficients[m]) if abs(weight) > least]
            if not rows:
                continue
            terms = [
                f"({weight:.15g})" + (f"*cos({np.pi * n / b:.15g}*(y+{b / 2:.15g}))" if n else "") for n, weight in rows
            ]
            parts.append(f"{along(k, f'{k:.15g}*(x+{a / 2:.15g})')}*({' + '.join(terms)})")
        return " \\\n  + ".join(parts) if parts else "0"


def _waves(side: float, count: int) -> FloatArray:
    """Return the wave numbers of `count` terms."""
    return np.asarray(np.pi * np.arange(count) / side)


def _cosines(x: FloatArray, side: float, count: int) -> FloatArray:
    """Return the (n, count) cosines at (n,) places."""
    return np.asarray(np.cos(np.outer(x + side / 2, _waves(side, count))))


def _middles(side: float, count: int) -> FloatArray:
    """Return the middles of `count` equal parts of a side, around 0."""
    return np.asarray(((np.arange(count) + 0.5) / count - 0.5) * side)
