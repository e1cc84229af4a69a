"""The plane through the voxels of a ball that lies away from the surface."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray

STEEPEST = 0.9
"""Of the value in the middle of a bare ball, how much its plane may rise or fall to the ball's edge: all of it lies on
the side of the isovalue on which its voxels lie."""


@dataclass(frozen=True, eq=False)
class BarePlane:
    """The plane of least squares through the values of a bare ball, not as steep as to leave their side of zero.

    Attributes
    ----------
    solution : (q, n) ndarray
        From values to coefficients of the tail, those of a degree above 1 being zero.
    rank : int
    """

    solution: FloatArray
    rank: int

    @classmethod
    def of(cls, points: FloatArray, exponents: IntArray) -> "BarePlane":
        """Return it for (d, n) points in unit coordinates."""
        low = exponents.sum(axis=1) <= 1
        matrix = np.prod(points.T[:, np.newaxis, :] ** exponents[low], axis=2)
        solution = np.zeros((len(exponents), points.shape[1]))
        solution[low] = np.linalg.pinv(matrix)
        return cls(solution, int(np.linalg.matrix_rank(matrix)))

    def solve(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return no λ, (m, 0), and the (m, q) tails of (m, n) values."""
        # Not by BLAS, whose bits depend on how many balls there are.
        tails: FloatArray = np.einsum("mn,qn->mq", values, self.solution)
        # The first monomial is 1.
        rise = np.linalg.norm(tails[:, 1:], axis=1)
        most = STEEPEST * np.abs(tails[:, 0])
        tails[:, 1:] *= np.where(rise > most, most / np.maximum(rise, np.finfo(np.float64).tiny), 1.0)[:, np.newaxis]
        return np.empty((len(values), 0)), tails
