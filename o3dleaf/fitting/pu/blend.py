"""Evaluation of every blend of balls: values, gradients and Hessians, at points and on lattices."""

from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import require_one_column
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.errors import InputError
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fitter import LocalFits
from o3dleaf.fitting.local.jet_loops import unpack

BATCH_SIZE = 1 << 20
"""Points blended at once. It bounds the memory that evaluation needs beside its arguments and its
result: 128 bytes a point where Hessians in space are requested, hence `WORKING_MEMORY`; eight of them
are left over for what the threads work in, which is enough for sixteen."""
WORKING_MEMORY = 128 * BATCH_SIZE
"""128 MiB, however many points are requested; the result does not depend on it."""
FOLD_BLOCK = 1 << 15


class Blended:
    r"""A partition of unity that can be evaluated: local fits, and the index of those that contain a point.

    Outside its domain a blend goes on as the local fits of the balls do that contain the nearest point of it, with the
    weights that they have there: :math:`F(x) = \sum_i w_i(p(x)) F_i(x)`. A polynomial that all of them reproduce is
    reproduced there too. F is continuous, and derivatives are those of this formula: across the border the one along
    the way out changes by :math:`\sum_i \partial w_i F_i`, which is as small as the fits agree. From 10⁶ radii of a
    ball on (10³ in single precision) its fit stays as it is, so that F is finite at every finite point. Whatever the
    number of points, evaluation needs `WORKING_MEMORY` beside its arguments and its result.
    """

    local: LocalFits
    index: BallIndex

    @property
    def columns(self) -> int | None:
        """c, the number of values at a point, or None where it is one number."""
        return getattr(self.local, "columns", None)

    def __call__(self, points: npt.ArrayLike, *, dtype: npt.DTypeLike = np.float64) -> npt.NDArray[Any]:
        """Return the (n,) values, or (n, c) of `columns`, at (n, d) points.

        Parameters
        ----------
        points : (n, d) array_like
        dtype : float64 or float32
            The numbers that the sums over a ball's points are formed in. Single precision is two to three times
            as fast, and right to about 10⁻⁷ of the largest λ_j φ(r_j), of which the value may be a small rest.
        """
        return self._evaluate(points, 0, dtype)

    def gradient(self, points: npt.ArrayLike, *, dtype: npt.DTypeLike = np.float64) -> npt.NDArray[Any]:
        """Return the (n, d) analytic gradients, or (n, c, d), at (n, d) points, through weights and local fits.

        Parameters
        ----------
        points : (n, d) array_like
        dtype : float64 or float32
            As for the values.
        """
        return self._evaluate(points, 1, dtype)

    def hessian(self, points: npt.ArrayLike, *, dtype: npt.DTypeLike = np.float64) -> npt.NDArray[Any]:
        """Return the (n, d, d) analytic second derivatives, or (n, c, d, d), at (n, d) points.

        Parameters
        ----------
        points : (n, d) array_like
        dtype : float64 or float32
            As for the values.

        Raises
        ------
        InputError
            If the local fits are not twice differentiable: splines of φ = −r and r² log r are not.
        """
        return self._evaluate(points, 2, dtype)

    def jets(self, points: npt.ArrayLike, level: int, *, dtype: npt.DTypeLike = np.float64) -> tuple[FloatArray, ...]:
        """Return values (n,), gradients (n, d) and, at `level` 2, Hessians (n, d, d) at (n, d) points, in one pass.

        Of c columns of values they are (n, c), (n, c, d) and (n, c, d, d).

        Parameters
        ----------
        points : (n, d) array_like
        level : {0, 1, 2}
            The highest order of the derivatives.
        dtype : float64 or float32
            As for the values.
        """
        return self._derivatives(points, tuple(range(level + 1)), dtype)

    def on_lattice(
        self,
        bounds: npt.ArrayLike,
        spacing: float | npt.ArrayLike,
        *,
        dtype: npt.DTypeLike = np.float64,
    ) -> tuple[Lattice, npt.NDArray[Any]]:
        """Return the lattice of whole multiples of `spacing` that covers a box, and the values on it.

        Parameters
        ----------
        bounds : (2, d) array_like
            Lower, then upper corner, in the field's unit.
        spacing : float or (d,) array_like
            Step, one for all axes or one each.
        dtype : float64 or float32
            As for single points; also that of the result.

        Returns
        -------
        lattice : Lattice
        values : ndarray of shape ``lattice.shape``

        Raises
        ------
        InputError, MemoryBudgetError
            If the box or the spacing cannot be meant, or the lattice would not fit into memory.
        """
        require_one_column(self, "on_lattice")
        kind = _as_kind(dtype)
        lattice = Lattice.covering(bounds, spacing, dimension=self.index.bounds.shape[1])
        return lattice, sample_lattice(lambda points: self(points, dtype=kind), lattice, dtype=kind)

    def _evaluate(self, points: npt.ArrayLike, level: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """Return the values, gradients or Hessians: the derivatives of order `level`."""
        return self._derivatives(points, (level,), dtype)[0]

    def _derivatives(
        self, points: npt.ArrayLike, orders: tuple[int, ...], dtype: npt.DTypeLike
    ) -> tuple[npt.NDArray[Any], ...]:
        kind = _as_kind(dtype)
        dimension = self.index.bounds.shape[1]
        queries = as_points(points, dim=dimension)
        columns = () if self.columns is None else (self.columns,)
        results = tuple(np.empty((len(queries), *columns, *[dimension] * order), dtype=kind) for order in orders)
        for first, last in blocks(len(queries), BATCH_SIZE // (self.columns or 1)):
            self._fill(queries[first:last], dict(zip(orders, (part[first:last] for part in results), strict=True)))
        return results

    def stacked_jets(self, queries: FloatArray, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, to derivatives of `level` at checked (n, d) points."""
        return self.local.blend(self.index, queries, level=level, dtype=dtype)

    def _fill(self, queries: FloatArray, results: dict[int, npt.NDArray[Any]]) -> None:
        """Write the derivatives of some orders at one chunk of points; what that took is given back on return."""
        level = max(results)
        jets = self.stacked_jets(queries, level, results[level].dtype)
        if jets.ndim == 2:
            self._unpack(jets, queries, results)
            return
        for column, part in enumerate(jets):
            each = {order: np.empty_like(result[:, column], order="C") for order, result in results.items()}
            self._unpack(part, queries, each)
            for order, result in results.items():
                result[:, column] = each[order]

    def _unpack(self, jets: FloatArray, queries: FloatArray, results: dict[int, npt.NDArray[Any]]) -> None:
        """Write the derivatives of some orders of what has the jets (jet, n)."""
        kind = results[max(results)].dtype
        parts = [results.get(order, np.empty((0, *[queries.shape[1]] * order), dtype=kind)) for order in range(3)]

        def task(start: int, stop: int) -> None:
            unpack(start, stop, jets, *parts)

        run_blocks(task, len(queries), FOLD_BLOCK)


def _as_kind(dtype: npt.DTypeLike) -> np.dtype[Any]:
    """Return `dtype` as NumPy's object if it is float64 or float32, else raise `InputError`."""
    try:
        kind = np.dtype(dtype)
    except TypeError:
        kind = None
    if kind is None or kind not in {np.dtype(np.float64), np.dtype(np.float32)}:
        raise InputError(f"dtype: is {dtype}; give float64 or float32")
    return kind
