"""The energy of a chart that is as rigid as possible, its gradient and its Hessian."""

from functools import cached_property

import numpy as np
import scipy.sparse

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.chart.flattening.elimination import MeshPattern
from o3dleaf.leaf.chart.flattening.stretch import laid_down


class RigidEnergy:
    r"""Area-weighted mean square of a chart's stretches' distance from 1; a flip counts by its mirror image.

    .. math:: E = 2 \sum_t w_t \left((|a_t| - 1)^2 + |b_t|^2\right)

    As complex numbers a triangle's map is z ↦ a z + b conj(z), and its stretches are abs(a) + abs(b) and
    abs(a) − abs(b), which is negative where it is flipped. What has no area does not count.

    Parameters
    ----------
    vertices : (n, 3) ndarray
        On the sheet.
    triangles : (m, 3) ndarray of int
    """

    def __init__(self, vertices: FloatArray, triangles: IntArray) -> None:
        length, along, height = laid_down(vertices, triangles)
        area = np.where(np.isfinite(along), length * height, 0.0)
        self._share = area / area.sum()
        self._length, self._height = (np.where(area > 0, edge, np.inf) for edge in (length, height))
        self._along = np.where(area > 0, along, 0.0) / self._length
        self._triangles, self._count = triangles, len(vertices)
        self.used = np.unique(triangles[area > 0])
        first, third = 1 / self._length, 1 / self._height
        x = np.stack([-first, first, np.zeros_like(first)], axis=1)
        y = np.stack([(self._along - 1) * third, -self._along * third, third], axis=1)
        self._turns, self._mirrors = (x - 1j * y) / 2, (x + 1j * y) / 2

    @cached_property
    def pattern(self) -> MeshPattern:
        """Where the Hessians have entries."""
        return MeshPattern.of(self._triangles, self._count)

    def __call__(self, chart: FloatArray) -> float:
        """Return the energy of an (n, 2) chart."""
        turn, mirror = self._maps(chart)
        return float(self._share @ ((np.abs(turn) - 1) ** 2 + np.abs(mirror) ** 2)) * 2

    def gradient(self, chart: FloatArray) -> FloatArray:
        """Return the (n, 2) gradient at a chart."""
        turn, mirror = self._maps(chart)
        pull = self._turns.conj() * (self._share * (turn - _direction(turn)))[:, np.newaxis]
        pull = 4 * (pull + self._mirrors.conj() * (self._share * mirror)[:, np.newaxis]).ravel()
        corners = self._triangles.ravel()
        return np.column_stack([np.bincount(corners, part, len(chart)) for part in (pull.real, pull.imag)])

    def hessian(self, chart: FloatArray, *, convex: bool = False) -> scipy.sparse.csc_array:
        r"""Return the (2n, 2n) Hessian at a chart, its rows and columns in the order of the `pattern`.

        .. math:: 4 \left(L - \sum_t \frac{w_t}{|a_t|} s_t s_t^T\right), \qquad s_t δ = \mathrm{Im}\,\bar u_t a_t(δ)

        with u the direction of a, and L of the energy without rotations. A triangle that is pressed together,
        abs(a) < 1, would rather turn aside.

        Parameters
        ----------
        chart : (n, 2) ndarray
        convex : bool
            Take abs(a) for no less than 1, so that no direction curves down.
        """
        turn, _ = self._maps(chart)
        size = np.maximum(np.abs(turn), 1.0 if convex else np.finfo(float).tiny)
        corners = _direction(turn).conj()[:, np.newaxis] * self._turns
        aside = np.stack([corners.imag, corners.real], axis=2).reshape(-1, 6)
        turning = (4 * self._share / size)[:, np.newaxis] * aside
        return self.pattern.matrix(self._flat - turning[:, :, np.newaxis] * aside[:, np.newaxis])

    @cached_property
    def _flat(self) -> FloatArray:
        """The share of each triangle in 4 L (m, 6, 6), the same at every chart."""
        parts = (np.einsum("mi,mj->mij", part.conj(), part).real for part in (self._turns, self._mirrors))
        return np.asarray(np.einsum("m,mij,ab->miajb", 4 * self._share, sum(parts), np.eye(2)).reshape(-1, 6, 6))

    def _maps(self, chart: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return a and b of each triangle, (m,) complex numbers each."""
        # Of differences: places far from 0 would leave a rounding of their own, which turns long leaves.
        first, second, third = (chart.view(np.complex128).ravel()[corner] for corner in self._triangles.T)
        x = (second - first) / self._length
        y = (third - first - self._along * (second - first)) / self._height
        return (x - 1j * y) / 2, (x + 1j * y) / 2


def _direction(numbers: FloatArray) -> FloatArray:
    """Return complex numbers (m,) over their size, 1 for 0."""
    size = np.abs(numbers)
    return np.divide(numbers, size, out=np.ones_like(numbers), where=size > 0)
