"""How much to smooth: the number on the diagonal, given, from the paper's ρ, or chosen by GCV."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from o3dleaf.checks import FloatArray
from o3dleaf.errors import InputError
from o3dleaf.rbf.kernels import Polyharmonic

Amount = float | Literal["gcv"]
"""A number >= 0, or "gcv" to have it chosen by generalised cross-validation."""

GRID = 49
"""Trial values of the smoothing, log-spaced over the spectrum; the best is refined between its neighbours."""


@dataclass(frozen=True)
class Smoothing:
    r"""The rule that gives every local system its diagonal: s = amount, or s = ρ N/θ (equation (2)).

    Attributes
    ----------
    amount : float or "gcv"
        The number, in the unit length^k of the data (k the power of φ), or for ρ in length^(2m−d).
    per_point : float
        1/θ where the amount is the paper's ρ, else 0.
    """

    amount: Amount
    per_point: float = 0.0

    def scale(self, count: int) -> float:
        """Return what the amount is multiplied with for a system of `count` points."""
        return self.per_point * count if self.per_point else 1.0

    def diagonal(self, count: int) -> float:
        """Return s for a system of `count` points; the amount must be a number by now."""
        if self.amount == "gcv":
            raise InputError("smoothing: is still 'gcv'; choose it first")
        return float(self.amount) * self.scale(count)

    def diagonals(self, counts: npt.NDArray[np.int64]) -> FloatArray:
        """Return s for each of many systems, of `counts` points."""
        return np.array([self.diagonal(int(count)) for count in counts])


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
        if amount != "gcv":
            raise InputError(f"smoothing: unknown {amount!r}; give a number or 'gcv'")
    elif not (np.isfinite(amount) and amount >= 0):
        raise InputError(f"smoothing: is {amount}; give a number >= 0 or 'gcv'")
    if rho is None:
        return Smoothing(amount)
    if kernel.theta is None:
        raise InputError(
            f"rho: r^{kernel.power} in {kernel.dimension}-D minimises no thin-plate energy, so it has no theta; "
            "give smoothing"
        )
    return Smoothing(amount, 1 / kernel.theta)


def gcv_score(amount: float, spectra: Sequence[tuple[FloatArray, FloatArray]], scales: FloatArray) -> float:
    r"""Return the pooled score of one amount of smoothing over local systems (Wahba 1990, chapter 4).

    .. math:: V = n \sum_i \sum_j \Bigl(\frac{s_i c_{ij}}{e_{ij}+s_i}\Bigr)^2 \Big/
              \Bigl(\sum_i \sum_j \frac{s_i}{e_{ij}+s_i}\Bigr)^2, \qquad s_i = \text{amount}·\text{scale}_i

    Parameters
    ----------
    spectra : sequence of (e, c)
        Eigenvalues and coefficients of each system on the null space of Pᵀ.
    scales : (len(spectra),) ndarray
        Factor from the common amount to each system's diagonal.
    """
    residual = trace = count = 0.0
    for (eigenvalues, coefficients), scale in zip(spectra, scales, strict=True):
        shrink = 1 / (1 + np.maximum(eigenvalues, 0) / (amount * scale))
        residual += float(np.sum((shrink * coefficients) ** 2))
        trace += float(np.sum(shrink))
        count += len(eigenvalues)
    return count * residual / trace**2


def choose_by_gcv(spectra: Sequence[tuple[FloatArray, FloatArray]], scales: FloatArray) -> float:
    """Return the amount of smoothing with the least pooled GCV score.

    Raises
    ------
    InputError
        If the systems leave no degree of freedom to judge by.
    """
    ends = [(e[e > 0].min() / s, e.max() / s) for (e, _), s in zip(spectra, scales, strict=True) if np.any(e > 0)]
    if not ends:
        raise InputError("smoothing: too few points for 'gcv' to judge by; give a number")
    low, high = min(e[0] for e in ends), max(e[1] for e in ends)
    grid = np.linspace(np.log(low) - np.log(10), np.log(high) + np.log(100), GRID)
    scores = [gcv_score(np.exp(x), spectra, scales) for x in grid]
    best = int(np.argmin(scores))
    bracket = (grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)])
    found = minimize_scalar(lambda x: gcv_score(np.exp(x), spectra, scales), bounds=bracket, method="bounded")
    return float(np.exp(found.x))
