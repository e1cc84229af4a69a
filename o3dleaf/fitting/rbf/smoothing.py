"""Smoothing: the number on the diagonal, given, from the paper's ρ, or chosen by GCV."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from o3dleaf.core.arguments.kinds import SmoothingValue
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.shaped.shaped_kernels import Shaped
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

CHOICES = ("gcv", "gcv-per-ball")

GRID = 49
"""Trial values of the smoothing, log-spaced over the spectrum; the best is refined between its neighbors."""


@dataclass(frozen=True)
class Smoothing:
    r"""Smoothing on the diagonal of every local system: s = value, or s = ρ N/θ (equation (2)).

    Attributes
    ----------
    value : float, "gcv" or "gcv-per-ball"
        The number, in the unit length^k of the data (k the power of φ), or for ρ in length^(2m−d).
    per_point : float
        1/θ where the value is the paper's ρ, else 0.
    score : float or None
        The GCV score of the value where it was chosen, in the values' unit squared; see `gcv_score`.
    """

    value: SmoothingValue = field(metadata={"stored": "amount"})
    per_point: float = 0.0
    score: float | None = None

    def scale(self, count: int) -> float:
        """Return what the value is multiplied with for a system of `count` points."""
        return self.per_point * count if self.per_point else 1.0

    def diagonal(self, count: int) -> float:
        """Return s for a system of `count` points; the value must be a number by now."""
        return self._number * self.scale(count)

    def diagonals(self, counts: IntArray, per_ball: FloatArray | None = None) -> FloatArray:
        """Return s for each of many systems, of `counts` points, from the one value or from each one's own."""
        scales = self.per_point * counts if self.per_point else np.ones(len(counts))
        return np.asarray((self._number if per_ball is None else per_ball) * scales)

    @property
    def _number(self) -> float:
        """The value, or raise `InputError` where it has not been chosen."""
        if isinstance(self.value, str):
            raise InputError(f"smoothing: is still {self.value!r}; choose it first")
        return self.value

    def chosen(self, spectrum: "Spectrum") -> "Smoothing":
        """Return the smoothing with the value that `choose_by_gcv` takes, or `choose_by_risk`, and its score."""
        if spectrum.noise is not None:
            value, score = choose_by_risk(spectrum)
            return replace(self, value=value, score=score)
        value = choose_by_gcv(spectrum)
        return replace(self, value=value, score=gcv_score(value, spectrum))

    def chosen_from(self, trials: FloatArray, squares: FloatArray, weight: float) -> "Smoothing":
        """Return the smoothing with the trial value of least held-out error, and the mean square of that error.

        Of values that two points in `weight` could not tell apart, the largest: see `choose_by_gcv`.

        Parameters
        ----------
        trials, squares : (n,) ndarrays
            Trial values, rising, and the sums of squared errors at points left out.
        weight : float
            Number of those points, or the sum of their weights.

        Raises
        ------
        InputError
            If no point could be left out.
        """
        if not weight:
            raise InputError("smoothing: too few points for 'gcv'; give a number")
        best = np.flatnonzero(squares <= squares.min() * (1 + 2 / weight))[-1]
        return replace(self, value=float(trials[best]), score=float(squares[best] / weight))


def as_smoothing(
    kernel: Polyharmonic | Shaped, smoothing: SmoothingValue | None, rho: SmoothingValue | None
) -> Smoothing:
    """Return `smoothing` (on the diagonal as it is) or `rho` (times N/θ), or none for neither.

    Raises
    ------
    InputError
        If both are given, one is negative, or the kernel has no θ for `rho` to refer to.
    """
    if smoothing is not None and rho is not None:
        raise InputError("smoothing, rho: both are given; give one of them")
    value = rho if rho is not None else (0.0 if smoothing is None else smoothing)
    if isinstance(value, str):
        if value not in CHOICES:
            raise InputError(f"smoothing: unknown {value!r}; give a number, 'gcv' or 'gcv-per-ball'")
    elif not (np.isfinite(value) and value >= 0):
        raise InputError(f"smoothing: is {value}; give a number >= 0 or 'gcv'")
    if rho is None:
        return Smoothing(value)
    if kernel.theta is None:
        raise InputError(
            f"rho: {kernel} in {kernel.dimension}-D minimizes no thin-plate energy, so it has no theta; "
            f"give smoothing={value!r}"
        )
    return Smoothing(value, 1 / kernel.theta)


@dataclass(frozen=True)
class SplineModel:
    """Parameters of the splines: kernel, degree of the tail, smoothing."""

    kernel: Polyharmonic
    degree: int
    smoothing: Smoothing

    @cached_property
    def exponents(self) -> IntArray:
        """(q, d) exponents of the tail's monomials."""
        return tail_exponents(self.kernel.dimension, self.degree)


@dataclass(frozen=True, eq=False)
class Spectrum:
    r"""Eigenvalues and coefficients that give the GCV score of every smoothing, of one local system or of many.

    Attributes
    ----------
    eigenvalues, coefficients : (n,) ndarrays
        e over what the value is multiplied with, and c, on the null space of the tail's transpose.
    count : int
        N, the number of points: n and the ranks of the tails.
    noise : (n,) ndarray, optional
        Variances of the coefficients, where the noise of the data is known.
    """

    eigenvalues: FloatArray
    coefficients: FloatArray
    count: int
    noise: FloatArray | None = None

    @classmethod
    def pooled(cls, parts: Iterable["Spectrum"]) -> "Spectrum":
        """Return the spectrum of many systems that share one value."""
        spectra = list(parts)
        known = [part.noise for part in spectra if part.noise is not None]
        return cls(
            np.concatenate([part.eigenvalues for part in spectra]),
            np.concatenate([part.coefficients for part in spectra]),
            sum(part.count for part in spectra),
            np.concatenate(known) if len(known) == len(spectra) else None,
        )


def gcv_score(value: float, spectrum: Spectrum) -> float:
    r"""Return the score of a smoothing above 0, in the values' unit squared (Wahba 1990, chapter 4).

    .. math:: V = \frac{\frac{1}{N} |r|^2}{\bigl(\frac{1}{N} \mathrm{tr}(I - A)\bigr)^2}, \qquad
              |r|^2 = \sum_k \Bigl(\frac{s\,c_k}{e_k+s}\Bigr)^2, \quad \mathrm{tr}(I - A) = \sum_k \frac{s}{e_k+s}

    Of many systems the residuals and the traces are added up first. With weights, r is W^½ (f − F).

    Parameters
    ----------
    value : float
    spectrum : Spectrum
    """
    residual, trace = _residual(value, spectrum)
    return spectrum.count * residual / trace**2


def _residual(value: float, spectrum: Spectrum) -> tuple[float, float]:
    """Return |r|² and tr(I − A)."""
    shrink = 1 / (1 + spectrum.eigenvalues / value)
    return float(np.sum((shrink * spectrum.coefficients) ** 2)), float(np.sum(shrink))


def trial_values(eigenvalues: FloatArray) -> FloatArray:
    """Return values of the smoothing, log-spaced, from next to none to all that matters of eigenvalues (n,).

    Raises
    ------
    InputError
        If the systems leave no degree of freedom to judge by.
    """
    positive = eigenvalues[eigenvalues > 0]
    if not len(positive):
        raise InputError("smoothing: too few points for 'gcv'; give a number")
    return np.asarray(np.exp(np.linspace(np.log(positive.min() / 10), np.log(positive.max() * 100), GRID)))


def choose_by_risk(spectrum: Spectrum) -> tuple[float, float]:
    r"""Return the smoothing of least error where the noise is known, correlated or not, and the mean square of that.

    .. math:: R = \frac{1}{N} \sum_k \Bigl(\frac{s\,c_k}{e_k+s}\Bigr)^2
              + \frac{2}{N} \sum_k \frac{e_k\,ν_k}{e_k+s},

    Mallows' Cp (1973) with ν_k the variance of c_k: the mean square error but for what does not depend on s, plus the
    mean of ν. Of trial values, the largest whose R is above the least one by no more than a degree of freedom costs, as
    in `choose_by_gcv`.

    Parameters
    ----------
    spectrum : Spectrum
        With its noise.
    """
    noise = np.zeros(1) if spectrum.noise is None else spectrum.noise
    trials = trial_values(spectrum.eigenvalues)
    kept = [1 / (1 + spectrum.eigenvalues / value) for value in trials]
    risks = np.array([np.sum((part * spectrum.coefficients) ** 2 + 2 * (1 - part) * noise) for part in kept])
    best = int(np.flatnonzero(risks <= risks.min() + 2 * noise.mean())[-1])
    return float(trials[best]), float(risks[best] / spectrum.count)


def choose_by_gcv(spectrum: Spectrum) -> float:
    r"""Return the largest smoothing that is consistent with the data.

    The least score marks the smoothing of least error only to within what the noise of the data makes
    of it, and where the curve is flat (few points, or nothing but noise) its minimum may lie decades
    too low. So it is the largest value with

    .. math:: V \le V_{min} + 2 \hat σ^2/N, \qquad \hat σ^2 = |r_{min}|^2/N,

    the cost of one degree of freedom in Mallows' Cp, at the noise that the residual of the minimum
    shows. Where that fit goes through the data nothing is given away: they may all be signal. Data
    that the tail alone reproduces have no noise and no curve; they get the largest value tried, a
    hundred times the largest eigenvalue, and come back as they are.

    Parameters
    ----------
    spectrum : Spectrum

    Raises
    ------
    InputError
        If the systems leave no degree of freedom to judge by.
    """
    grid = np.log(trial_values(spectrum.eigenvalues))
    scores = np.array([gcv_score(np.exp(x), spectrum) for x in grid])
    best = int(np.argmin(scores))
    bracket = (grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)])
    refined = minimize_scalar(lambda x: gcv_score(np.exp(x), spectrum), bounds=bracket, method="bounded")
    least, lowest = min((scores[best], grid[best]), (float(refined.fun), float(refined.x)))
    limit = least + 2 * _residual(np.exp(lowest), spectrum)[0] / spectrum.count**2
    within = float(max([lowest, *grid[scores <= limit]]))
    beyond = grid[grid > within]
    if not len(beyond):
        return float(np.exp(within))
    return float(np.exp(brentq(lambda x: gcv_score(np.exp(x), spectrum) - limit, within, beyond[0])))
