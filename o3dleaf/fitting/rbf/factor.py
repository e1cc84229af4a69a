"""One local system factored once for many right-hand sides: columns of values, or balls that contain alike points."""

from dataclasses import dataclass

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import IllPosedError
from o3dleaf.fitting.rbf import cholesky_loops, column_loops, solve_loops
from o3dleaf.fitting.rbf.reflector_loops import block_reflector
from o3dleaf.fitting.rbf.tail import IntArray


@dataclass(frozen=True, eq=False)
class LocalFactor:
    r"""Factorization of the system (A + D) λ + P a = f, Pᵀ λ = 0, for any right-hand side f.

    .. math:: P = Q \binom{R}{0}, \quad Q = I - Y^T T Y, \quad Q^T (A + D)\, Q =
              \begin{pmatrix} \cdot & B \\ B^T & L L^T \end{pmatrix}

    Attributes
    ----------
    reflectors, triangle : (r, n), (r, r) ndarrays
        Y and T (Schreiber and Van Loan 1989).
    right, basis : (r, r), (q, r) ndarrays
        R, and the polynomials that it belongs to: see `o3dleaf.fitting.rbf.reflector_loops.restrict_tail`.
    above, cholesky : (r, n − r), (n − r, n − r) ndarrays
        B and L.
    """

    reflectors: FloatArray
    triangle: FloatArray
    right: FloatArray
    basis: FloatArray
    above: FloatArray
    cholesky: FloatArray

    @property
    def rank(self) -> int:
        """r, the rank of the tail on the points."""
        return len(self.right)

    @classmethod
    def of(cls, points: FloatArray, exponents: IntArray, power: int, diagonal: FloatArray) -> "LocalFactor":
        """Factor the system of (d, n) points in unit coordinates, with (n,) numbers on the diagonal.

        Hold BLAS at one thread around it and around `solve`.

        Raises
        ------
        IllPosedError
            If the system is singular to rounding, as it is where points coincide and nothing is smoothed.
        """
        matrix, vectors, betas, right, basis = solve_loops.project(points, exponents, power, diagonal)
        rank = len(right)
        lower, fit = cholesky_loops.cholesky(matrix[rank:, rank:].copy())
        if not fit:
            raise IllPosedError(
                "smoothing: without it the system of these points is singular to rounding; give a number above 0"
            )
        return cls(vectors, block_reflector(vectors, betas), right, basis, matrix[:rank, rank:].copy(), lower)

    def solve(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the (m, n) λ and the (m, q) a of (m, n) values."""
        parts = self.reflectors, self.triangle, self.right, self.basis, self.above, self.cholesky
        weights, tail = column_loops.solve_columns(*parts, values.T.copy())
        return weights.T, tail.T
