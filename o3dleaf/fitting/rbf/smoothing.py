"""How much to smooth: the number on the diagonal, given, from the paper's ρ, or chosen by GCV."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, minimize_scalar

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf.kernels import Polyharmonic

Amount = float | Literal["gcv", "gcv-per-ball"]
"""A number >= 0, or "gcv" to have it chosen by generalised cross-validation, for all balls or for each of its own."""

CHOICES = ("gcv", "gcv-per-ball")

GRID = 49
"""Trial values of the smoothing, log-spaced over the spectrum; the best is refined between its neighbours."""


@dataclass(frozen=True)
class Smoothing:
    r"""The rule that gives every local system its diagonal: s = amount, or s = ρ N/θ (equation (2)).

    Attributes
    ----------
    amount : float, "gcv" or "gcv-per-ball"
        The number, in the unit length^k of the data (k the power of φ), or for ρ in length^(2m−d).
    per_point : float
        1/θ where the amount is the paper's ρ, else 0.
    score : float or None
        The GCV score of the amount where it was chosen, in the values' unit squared; see `gcv_score`.
    """

    amount: Amount
    per_point: float = 0.0
    score: float | None = None

    def scale(self, count: int) -> float:
        """Return what the amount is multiplied with for a system of `count` points."""
        return self.per_point * count if self.per_point else 1.0

    def diagonal(self, count: int) -> float:
        """Return s for a system of `count` points; the amount must be a number by now."""
        if isinstance(self.amount, str):
            raise InputError(f"smoothing: is still {self.amount!r}; choose it first")
        return self.amount * self.scale(count)

    def diagonals(self, counts: npt.NDArray[np.int64], amounts: FloatArray | None = None) -> FloatArray:
        """Return s for each of many systems, of `counts` points, from the rule's amount or from each one's own."""
        if amounts is None:
            return np.array([self.diagonal(int(count)) for count in counts])
        return np.array([amount * self.scale(int(count)) for amount, count in zip(amounts, counts, strict=True)])

    def chosen(self, spectrum: "Spectrum") -> "Smoothing":
        """Return the rule with the amount that `choose_by_gcv` takes, and its score."""
        amount = choose_by_gcv(spectrum)
        return replace(self, amount=amount, score=gcv_score(amount, spectrum))

    def chosen_from(self, amounts: FloatArray, squares: FloatArray, judged: int) -> "Smoothing":
        """Return the rule with the amount of least held-out error, and the mean square of that error.

        Of amounts that two points in `judged` could tell apart, the largest: see `choose_by_gcv`.

        Parameters
        ----------
        amounts, squares : (n,) ndarrays
            Trial amounts, rising, and the sums of squared errors at points left out.
        judged : int
            Number of those points.

        Raises
        ------
        InputError
            If no point could be left out.
        """
        if not judged:
            raise InputError("smoothing: too few points for 'gcv' to judge by; give a number")
        best = np.flatnonzero(squares <= squares.min() * (1 + 2 / judged))[-1]
        return replace(self, amount=float(amounts[best]), score=float(squares[best] / judged))


def as_smoothing(kernel: Polyharmonic, smoothing: Amount | None, rho: Amount | None) -> Smoothing:
    """Return the rule for `smoothing` (on the diagonal as it is) or `rho` (times N/θ), or none for neither.

    Raises
    ------
    InputError
        If both are given, one is negative, or the kernel has no θ for `rho` to refer to.
    """
    if smoothing is not None and rho is not None:
        raise InputError("smoothing, rho: both are given; give one of them")
    amount = rho if rho is not None else (0.0 if smoothing is None else smoothing)
    if isinstance(amount, str):
        if amount not in CHOICES:
            raise InputError(f"smoothing: unknown {amount!r}; give a number, 'gcv' or 'gcv-per-ball'")
    elif not (np.isfinite(amount) and amount >= 0):
        raise InputError(f"smoothing: is {amount}; give a number >= 0 or 'gcv'")
    if rho is None:
        return Smoothing(amount)
    if kernel.theta is None:
        raise InputError(
            f"rho: {kernel} in {kernel.dimension}-D minimises no thin-plate energy, so it has no theta; give smoothing"
        )
    return Smoothing(amount, 1 / kernel.theta)


@dataclass(frozen=True, eq=False)
class Spectrum:
    r"""What the score of every amount of smoothing follows from, of one local system or of many.

    Attributes
    ----------
    eigenvalues, coefficients : (n,) ndarrays
        e over what the amount is multiplied with, and c, on the null space of the tail's transpose.
    count : int
        N, the number of points: n and the ranks of the tails.
    """

    eigenvalues: FloatArray
    coefficients: FloatArray
    count: int

    @classmethod
    def pooled(cls, parts: Iterable["Spectrum"]) -> "Spectrum":
        """Return the spectrum of many systems that share one amount."""
        spectra = list(parts)
        return cls(
            np.concatenate([part.eigenvalues for part in spectra]),
            np.concatenate([part.coefficients for part in spectra]),
            sum(part.count for part in spectra),
        )


def gcv_score(amount: float, spectrum: Spectrum) -> float:
    r"""Return the score of an amount of smoothing, above 0, in the values' unit squared (Wahba 1990, chapter 4).

    .. math:: V = \frac{\frac{1}{N} |r|^2}{\bigl(\frac{1}{N} \mathrm{tr}(I - A)\bigr)^2}, \qquad
              |r|^2 = \sum_k \Bigl(\frac{s\,c_k}{e_k+s}\Bigr)^2, \quad \mathrm{tr}(I - A) = \sum_k \frac{s}{e_k+s}

    Of many systems the residuals and the traces are added up first. With weights, r is W^½ (f − F).

    Parameters
    ----------
    amount : float
    spectrum : Spectrum
    """
    residual, freedom = _residual(amount, spectrum)
    return spectrum.count * residual / freedom**2


def _residual(amount: float, spectrum: Spectrum) -> tuple[float, float]:
    """Return |r|² and tr(I − A)."""
    shrink = 1 / (1 + spectrum.eigenvalues / amount)
    return float(np.sum((shrink * spectrum.coefficients) ** 2)), float(np.sum(shrink))


def trial_amounts(spectrum: Spectrum) -> FloatArray:
    """Return amounts of smoothing, log-spaced, from next to none to all that matters.

    Raises
    ------
    InputError
        If the systems leave no degree of freedom to judge by.
    """
    positive = spectrum.eigenvalues[spectrum.eigenvalues > 0]
    if not len(positive):
        raise InputError("smoothing: too few points for 'gcv' to judge by; give a number")
    return np.asarray(np.exp(np.linspace(np.log(positive.min() / 10), np.log(positive.max() * 100), GRID)))


def choose_by_gcv(spectrum: Spectrum) -> float:
    r"""Return the largest amount of smoothing that the data do not speak against.

    The least score marks the smoothing of least error only to within what the noise of the data makes
    of it, and where the curve is flat (few points, or nothing but noise) its minimum may lie decades
    too low. So it is the largest amount with

    .. math:: V \le V_{min} + 2 \hat σ^2/N, \qquad \hat σ^2 = |r_{min}|^2/N,

    the cost of one degree of freedom in Mallows' Cp, at the noise that the residual of the minimum
    shows. Where that fit goes through the data nothing is given away: they may all be signal. Data
    that the tail alone reproduces have no noise and no curve; they get the largest amount tried, a
    hundred times the largest eigenvalue, and come back as they are.

    Parameters
    ----------
    spectrum : Spectrum

    Raises
    ------
    InputError
        If the systems leave no degree of freedom to judge by.
    """
    grid = np.log(trial_amounts(spectrum))
    scores = np.array([gcv_score(np.exp(x), spectrum) for x in grid])
    best = int(np.argmin(scores))
    bracket = (grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)])
    found = minimize_scalar(lambda x: gcv_score(np.exp(x), spectrum), bounds=bracket, method="bounded")
    least, lowest = min((scores[best], grid[best]), (float(found.fun), float(found.x)))
    limit = least + 2 * _residual(np.exp(lowest), spectrum)[0] / spectrum.count**2
    within = float(max([lowest, *grid[scores <= limit]]))
    beyond = grid[grid > within]
    if not len(beyond):
        return float(np.exp(within))
    return float(np.exp(brentq(lambda x: gcv_score(np.exp(x), spectrum) - limit, within, beyond[0])))
