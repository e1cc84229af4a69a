"""Splines of several columns of values: one smoothed polyharmonic spline a ball and column, in unit coordinates."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.blending import blend_balls
from o3dleaf.fitting.local.columns import column_fit_loops
from o3dleaf.fitting.local.columns.column_blend_loops import ColumnBalls, blend_columns
from o3dleaf.fitting.local.fit_loops import SplineArrays, Tails
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.smoothing_selection import choose_smoothing
from o3dleaf.fitting.rbf.kernels import Polyharmonic, require_twice_differentiable
from o3dleaf.fitting.rbf.smoothing import Smoothing, SplineModel
from o3dleaf.fitting.rbf.tail import IntArray

BATCH_SIZE = 4
"""Balls that are fitted in one compiled call, as in `splines`."""


def fit_columns(cover: Cover, data: ScatteredData, model: SplineModel) -> "LocalColumns":
    """Fit splines of all columns of values to the points of every ball, by one factorization each."""
    count, total, dimension = len(cover.radii), int(cover.offsets[-1]), data.points.shape[1]
    exponents, values, columns = model.exponents, data.weighted, data.values.shape[1]
    fitted = SplineArrays(
        np.empty(dimension * total),
        np.empty((columns, total)),
        np.zeros((count, columns, len(exponents))),
        np.empty(count, dtype=np.int64),
        np.empty(count, dtype=np.int64),
    )
    tail = Tails(exponents, np.full(count, len(exponents)))
    choosing, solving = progress.split(model.smoothing.value == "gcv-per-ball", 1)
    with single_threaded_blas():
        with choosing:
            smoothing, per_ball = choose_smoothing(cover, data, model, tail.terms)
        diagonals, power = smoothing.diagonals(cover.counts, per_ball), model.kernel.power

        def task(start: int, stop: int) -> None:
            column_fit_loops.fit_column_balls(start, stop, values, cover.balls, tail, power, diagonals, fitted)

        with solving:
            run_blocks(task, count, BATCH_SIZE, reports=True)
    sites, weights, tails, ranks, dropped = fitted
    offsets, places = cover.offsets, dimension * cover.offsets[:-1]
    return LocalColumns(
        model.kernel, smoothing, offsets, places, sites, weights, tails, exponents, ranks, dropped, per_ball
    )


@dataclass(frozen=True, eq=False)
class LocalColumns:
    """One smoothed polyharmonic spline a ball for each of c columns of values, as `LocalSplines` has it of one.

    Attributes
    ----------
    kernel : Polyharmonic
    smoothing : Smoothing
        One for all columns, with its value chosen, where it was "gcv".
    offsets, places, sites, exponents, ranks, dropped, smoothing_per_ball
        As in `LocalSplines`.
    weights, tails : (c, total), (M, c, q) ndarrays
        λ, and the tail's coefficients.
    """

    kernel: Polyharmonic
    smoothing: Smoothing
    offsets: IntArray
    places: IntArray
    sites: FloatArray
    weights: FloatArray
    tails: FloatArray
    exponents: IntArray
    ranks: IntArray
    dropped: IntArray
    smoothing_per_ball: FloatArray | None = field(default=None)

    def __repr__(self) -> str:
        return f"LocalColumns({self.kernel}, {len(self.tails):,} balls, {self.columns} columns)"

    @property
    def columns(self) -> int:
        """c, the number of columns."""
        return len(self.weights)

    @property
    def diagonals(self) -> FloatArray:
        """(M,) the number s on the diagonal of each ball, in the data's unit."""
        return self.smoothing.diagonals(np.diff(self.offsets), self.smoothing_per_ball)

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets (c, jet, n) of the blend at (n, d) queries, outside the index's box too.

        Raises
        ------
        InputError
            If second derivatives are requested of a kernel that has none.
        """
        if level == 2:
            require_twice_differentiable(self.kernel)
        sites, weights = (self.sites, self.weights) if dtype == np.float64 else self._single
        widest = int(np.diff(self.offsets).max())
        model = ColumnBalls(
            self.offsets, self.places, sites, weights, self.tails, self.exponents, self.kernel.power, widest
        )
        return blend_balls(model, index, queries, level, blend=blend_columns, columns=(self.columns,))

    @cached_property
    def _single(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Sites and weights in single precision."""
        return self.sites.astype(np.float32), self.weights.astype(np.float32)
