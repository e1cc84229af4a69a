"""The dense system of any kernel for columns of values, also without the tail that makes it positive definite."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import IllPosedError, InputError
from o3dleaf.fitting.rbf import solve_loops
from o3dleaf.fitting.rbf.cholesky_loops import SINGULAR
from o3dleaf.fitting.rbf.factor import LocalFactor
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.shaped.shaped_kernels import Shaped
from o3dleaf.fitting.rbf.shaped.shaped_loops import shaped_matrix
from o3dleaf.fitting.rbf.spectrum_loops import coefficients_of, decompose_system, spectra
from o3dleaf.fitting.rbf.tail import IntArray

MISSED = 1e-4
"""Share of the largest value by which a fit that left out directions may miss values: what is left of rounding in
them is far below, and a direction that matters far above."""


@dataclass(frozen=True, eq=False)
class DenseSystem:
    """The system (A + D) λ + P a = f, Pᵀ λ = 0 of a kernel and a tail, at points in unit coordinates.

    Attributes
    ----------
    kernel : Polyharmonic or Shaped
    exponents : (q, d) int64 ndarray
    shape : float
        ε times the radius of the unit coordinates.
    """

    kernel: Polyharmonic | Shaped
    exponents: IntArray
    shape: float

    @property
    def lacks_tail(self) -> bool:
        """Return whether there is no tail although the kernel needs one."""
        return not len(self.exponents) and self.kernel.least_degree >= 0

    @property
    def unit_scale(self) -> float:
        """What the smoothing is multiplied with in unit coordinates."""
        return 1.0 if isinstance(self.kernel, Shaped) else 1 / self.shape**self.kernel.power

    def solve(self, points: FloatArray, values: FloatArray, diagonal: FloatArray) -> tuple[FloatArray, FloatArray, int]:
        """Return λ, a and the rank of the tail, of (n,) values, or for each of (n, m) columns a row each.

        Raises
        ------
        IllPosedError
            If it lacks the tail that the kernel needs and is singular to rounding.
        """
        if isinstance(self.kernel, Shaped) or self.lacks_tail:
            weights, tails, rank = self._solve_matrix(points, as_rows_of(values), diagonal)
            return (weights[0], tails[0], rank) if values.ndim == 1 else (weights, tails, rank)
        exponents, power = self.exponents, self.kernel.power
        if values.ndim == 1:
            weights, tail, rank, _ = solve_loops.solve_local(points, values, exponents, power, diagonal)
            return weights, tail, rank
        rows = as_rows_of(values)
        try:
            factor = LocalFactor.of(points, exponents, power, diagonal)
        except IllPosedError:
            # Coinciding points: what they agree on is found column by column.
            each = [solve_loops.solve_local(points, row, exponents, power, diagonal) for row in rows]
            return np.array([one[0] for one in each]), np.array([one[1] for one in each]), each[0][2]
        weights, tails = factor.solve(rows)
        return weights, np.ascontiguousarray(tails), len(factor.right)

    def spectra(self, points: FloatArray, rows: FloatArray, roots: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what `o3dleaf.fitting.rbf.spectrum_loops.spectra` does, of any kernel with its tail.

        Raises
        ------
        InputError
            If it lacks the tail.
        """
        if self.lacks_tail:
            raise InputError("smoothing: 'gcv' needs the kernel's tail; give a number, or leave the degree out")
        if isinstance(self.kernel, Polyharmonic):
            eigenvalues, coefficients = spectra(points, rows, roots, self.exponents, self.kernel.power)
        else:
            decomposed = decompose_system(self._matrix(points), *self._tail(points), roots)
            eigenvalues, coefficients = coefficients_of(rows, roots, decomposed)
        return eigenvalues, coefficients

    def _matrix(self, points: FloatArray) -> FloatArray:
        """Return A."""
        kernel = self.kernel
        if isinstance(kernel, Shaped):
            matrix: FloatArray = shaped_matrix(points, kernel.profile, self.shape)
        else:
            matrix = solve_loops.radial_matrix(points, kernel.power)
        return matrix

    def _tail(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return P, and the frame by which its rank is found."""
        exponents = self.exponents
        return solve_loops.tail_matrix(points, exponents), solve_loops.natural_monomials(points, exponents)

    def _solve_matrix(
        self, points: FloatArray, rows: FloatArray, diagonal: FloatArray
    ) -> tuple[FloatArray, FloatArray, int]:
        """Return (m, n) λ, (m, q) a and the rank of the tail, by the matrix itself."""
        matrix = self._matrix(points)
        matrix[np.diag_indices(len(matrix))] += diagonal
        if self.lacks_tail:
            return solve_symmetric(matrix, rows), np.empty((len(rows), 0)), 0
        projected = solve_loops.project_system(matrix, *self._tail(points))
        each = [solve_loops.solve_projected(row, projected) for row in rows]
        return np.array([one[0] for one in each]), np.array([one[1] for one in each]), each[0][2]


def as_rows_of(values: FloatArray) -> FloatArray:
    """Return (n,) or (n, m) values as rows (m, n)."""
    return np.atleast_2d(np.ascontiguousarray(values.T))


def solve_symmetric(matrix: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the (m, n) λ of (m, n) values for a symmetric matrix that need not be positive definite.

    Directions in which it is singular to rounding, as flat kernels leave them, are left out where the values have
    nothing in them.

    Raises
    ------
    IllPosedError
        If the values have something there.
    """
    factor, pivots, broken = lapack.dgetrf(matrix)
    if not broken and lapack.dgecon(factor, np.abs(matrix).sum(axis=0).max())[0] > np.finfo(np.float64).eps:
        return np.ascontiguousarray(lapack.dgetrs(factor, pivots, rows.T)[0].T)
    eigenvalues, vectors = np.linalg.eigh(matrix)
    kept = np.abs(eigenvalues) > SINGULAR * np.abs(eigenvalues).sum()
    weights: FloatArray = (rows @ vectors[:, kept] / eigenvalues[kept]) @ vectors[:, kept].T
    if np.abs(weights @ matrix - rows).max() > MISSED * np.abs(rows).max():
        raise IllPosedError("degree: -1 leaves a singular system for this kernel; leave the degree out, or smooth")
    return np.ascontiguousarray(weights)
