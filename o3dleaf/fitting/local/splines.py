"""Splines of values: one smoothed polyharmonic spline a ball, in unit coordinates."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.kinds import SmoothingValue
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.core.resume.blocks import run_kept_blocks
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local import fit_loops
from o3dleaf.fitting.local.blend_loops import SplineBalls, StretchedBalls
from o3dleaf.fitting.local.blending import blend_balls, single_error
from o3dleaf.fitting.local.columns.column_splines import LocalColumns, fit_columns
from o3dleaf.fitting.local.fit_loops import SharedTrials, SplineArrays, Tails
from o3dleaf.fitting.local.fitter import POINTS_PER_BALL, ScatteredData
from o3dleaf.fitting.local.smoothing_selection import BallSmoothing
from o3dleaf.fitting.local.stretches import StretchedCover, stretched
from o3dleaf.fitting.rbf.kernels import Polyharmonic, as_degree, as_kernel, require_twice_differentiable
from o3dleaf.fitting.rbf.shared_noise_loops import SharedNoise, shared_noise
from o3dleaf.fitting.rbf.smoothing import Smoothing, SplineModel, as_smoothing
from o3dleaf.fitting.rbf.tail import IntArray

BATCH_SIZE = 4
"""Balls that are fitted in one compiled call: between calls threads wait for one another."""

BY_BALL = ("tails", "ranks", "dropped", "smoothing_per_ball", "stretches")
"""What `LocalSplines` have one row a ball of."""


@dataclass(frozen=True)
class Splines:
    """Splines of values, as `PUInterpolant.fit` makes them where nothing else is requested, with its options."""

    kernel: str | Polyharmonic = "cubic"
    degree: int | None = None
    smoothing: SmoothingValue | None = None
    rho: SmoothingValue | None = None
    points_per_ball: int | tuple[int, int] = POINTS_PER_BALL

    def fit(self, cover: Cover, data: ScatteredData) -> "LocalSplines | LocalColumns":
        """Fit every ball of the cover, to one column of values or to several."""
        model = self.model(data.points.shape[1])
        if data.values.ndim > 1:
            return fit_columns(cover, data, model)
        return fit_splines(stretched(cover, data), data, model)

    def model(self, dimension: int) -> SplineModel:
        """Return kernel, degree and smoothing for points of a dimension, or raise `InputError` or `IllPosedError`."""
        kernel = as_kernel(self.kernel, dimension)
        return SplineModel(kernel, as_degree(self.degree, kernel), as_smoothing(kernel, self.smoothing, self.rho))


def fit_splines(
    cover: Cover,
    data: ScatteredData,
    model: SplineModel,
    terms: IntArray | None = None,
    known: SharedTrials | None = None,
) -> "LocalSplines":
    """Fit a spline to the points of every ball.

    Of the tail's monomials, lowest degree first, ball i has ``terms[i]``, or all of them. What balls choose their
    smoothing among may be `known`.
    """
    count, exponents = len(cover.radii), model.exponents
    tail = Tails(exponents, np.full(count, len(exponents)) if terms is None else terms)
    # Balls that choose before their fit take about as long for it, a sample of them nothing.
    choosing, solving = progress.split(model.smoothing.value == "gcv-per-ball" and data.groups is None, 1)
    with single_threaded_blas():
        with choosing:
            chosen = BallSmoothing.chosen(cover, data, model, tail.terms, known)
        with solving:
            fitted = _fit_balls(cover, data, model.kernel.power, tail, chosen)
    places = data.points.shape[1] * cover.offsets[:-1]
    sites, weights, tails, ranks, dropped = fitted
    return LocalSplines(
        model.kernel,
        chosen.smoothing,
        cover.offsets,
        places,
        sites,
        weights,
        tails,
        exponents,
        ranks,
        dropped,
        chosen.per_ball,
        None if data.weights is None else data.weights[cover.members],
        data.named[cover.members] if data.share else None,
        data.share,
        cover.stretches if isinstance(cover, StretchedCover) else None,
        chosen.trials,
    )


def _fit_balls(cover: Cover, data: ScatteredData, power: int, tail: Tails, chosen: BallSmoothing) -> SplineArrays:
    """Return the fits of all balls, and write the smoothing of those that choose it on the way."""
    count, total, dimension = len(cover.radii), int(cover.offsets[-1]), data.points.shape[1]
    fitted = SplineArrays(
        np.empty(dimension * total),
        np.empty(total),
        np.zeros((count, len(tail.exponents))),
        np.empty(count, dtype=np.int64),
        np.empty(count, dtype=np.int64),
    )
    values, (smoothing, per_ball, trials) = data.weighted, chosen
    diagonals = None if trials else smoothing.diagonals(cover.counts, per_ball)

    def task(start: int, stop: int) -> None:
        balls = start, stop, values, cover.balls, tail, power
        if trials:
            fit_loops.fit_choosing_balls(*balls, data.groups, trials, per_ball, fitted)
        else:
            fit_loops.fit_balls(*balls, diagonals, data.named, data.share, fitted)

    def written(start: int, stop: int) -> tuple[npt.NDArray[Any], ...]:
        first, last = cover.offsets[start], cover.offsets[stop]
        sites, weights, *by_ball = fitted
        own = () if trials is None or per_ball is None else (per_ball,)
        by_ball = [each[start:stop] for each in (*by_ball, *own)]
        return sites[dimension * first : dimension * last], weights[first:last], *by_ball

    run_kept_blocks(task, count, BATCH_SIZE, written)
    return fitted


@dataclass(frozen=True, eq=False)
class LocalSplines:
    """One smoothed polyharmonic spline a ball, in unit coordinates, stored end to end for the compiled blend.

    A ball without points, a bare one of `VoxelCover`, has its tail alone.

    Attributes
    ----------
    kernel : Polyharmonic
    smoothing : Smoothing
        With its value chosen, where it was "gcv"; the word is left where it was "gcv-per-ball".
    offsets, places : (M + 1,), (M,) int64 ndarrays
        Ball i has the weights ``offsets[i]:offsets[i + 1]``, and its points from ``places[i]`` on.
    sites, weights, tails : (·,), (total,), (M, q) ndarrays
        Points as (d, N_i) blocks, λ, and the tail's coefficients. Balls on a lattice share blocks.
    exponents : (q, d) int64 ndarray
    ranks, dropped : (M,) int64 ndarrays
        Rank of each ball's tail on its points; directions of its system that coinciding points left out.
    smoothing_per_ball : (M,) ndarray or None
        Each ball's own value of the smoothing, where it was "gcv-per-ball".
    point_weights : (total,) ndarray or None
        The weights of the points of each ball, where there were any.
    point_groups : (total,) int64 ndarray or None
        The groups of the points of each ball, where these share errors.
    share : float
        The part of the variance that a group has in common, see `ScatteredData`.
    stretches : (M, d, d) ndarray or None
        What the unit coordinates of each ball were multiplied with, where distances are not Euclid's, see `stretched`.
    trials : SharedTrials or None
        What the balls chose their smoothing among; read from a file, a plain tuple.
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
    smoothing_per_ball: FloatArray | None = field(default=None, metadata={"stored": "amounts"})
    point_weights: FloatArray | None = field(default=None, metadata={"stored": "trust"})
    point_groups: IntArray | None = None
    share: float = 0.0
    stretches: FloatArray | None = None
    trials: SharedTrials | None = None

    def __repr__(self) -> str:
        return f"LocalSplines({self.kernel}, {len(self.tails):,} balls)"

    @property
    def diagonals(self) -> FloatArray:
        """(M,) the number s on the diagonal of each ball, in the data's unit."""
        return self.smoothing.diagonals(np.diff(self.offsets), self.smoothing_per_ball)

    def ball(self, ball: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the (d, N) points of a ball in its unit coordinates, their (N,) λ and their (N,) weights."""
        first, last = self.offsets[ball], self.offsets[ball + 1]
        dimension, place = self.kernel.dimension, self.places[ball]
        points = self.sites[place : place + dimension * (last - first)].reshape(dimension, last - first)
        weights = np.ones(last - first) if self.point_weights is None else self.point_weights[first:last]
        return points, self.weights[first:last], weights

    def noise(self, ball: int) -> SharedNoise:
        """Return what the points of a ball share of their errors, as the compiled loops take it."""
        first, last = self.offsets[ball], self.offsets[ball + 1]
        named = np.arange(last - first) if self.point_groups is None else self.point_groups[first:last]
        noise: SharedNoise = shared_noise(named, self.share)
        return noise

    def fit_alike(self, cover: Cover, data: ScatteredData, balls: IntArray) -> "LocalSplines":
        """Fit the balls of a cover with the stretches of some of these and their smoothing, chosen anew if it was."""
        degree = int(self.exponents.sum(axis=1).max())
        over = cover if self.stretches is None else StretchedCover.of(cover, self.stretches[balls])
        return fit_splines(over, data, SplineModel(self.kernel, degree, self.smoothing), known=self.trials)

    def composed(self, others: "LocalSplines", rows: IntArray) -> "LocalSplines":
        """Return those of the balls of both, one after the other, that are the rows (n,), in their order.

        Both have the kernel, the tail and the smoothing of the first, and no two balls share points.
        """
        counts, old = np.concatenate([np.diff(self.offsets), np.diff(others.offsets)]), len(self.tails)
        dimension = self.kernel.dimension
        # Runs of balls that follow one another in one of both are copied as they lie, without an index of every number.
        ends = np.flatnonzero((np.diff(rows) != 1) | (rows[1:] == old)) + 1
        first, last = rows[np.append(0, ends)], rows[np.append(ends, len(rows)) - 1] + 1

        def both(name: str, starts: Callable[[LocalSplines], IntArray]) -> Any:
            parts = []
            for begin, end in zip(first, last, strict=True):
                source, shift = (self, 0) if begin < old else (others, old)
                array, at = getattr(source, name), starts(source)
                if array is None:
                    return None
                parts.append(array[at[begin - shift] : at[end - shift]])
            return np.concatenate(parts)

        offsets = np.concatenate([[0], np.cumsum(counts[rows])])
        places, own = {id(each): dimension * each.offsets for each in (self, others)}, np.arange(len(counts) + 1)
        return replace(
            self,
            offsets=offsets,
            places=dimension * offsets[:-1],
            sites=both("sites", lambda each: places[id(each)]),
            **{name: both(name, lambda each: each.offsets) for name in ("weights", "point_weights", "point_groups")},
            **{name: both(name, lambda _: own) for name in BY_BALL},
        )

    def with_points(self, cover: Cover, data: ScatteredData, balls: IntArray) -> "LocalSplines":
        """Return the splines with some of their balls fitted again, to their points in a cover."""
        rows = np.arange(len(self.tails))
        rows[balls] = len(rows) + np.arange(len(balls))
        return self.composed(self.fit_alike(cover.only(balls), data, balls), rows)

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at (n, d) queries, outside the index's box too.

        Raises
        ------
        InputError
            If second derivatives are requested of a kernel that has none.
        """
        return blend_balls(self.balls(level, dtype), index, queries, level)

    def balls(self, level: int, dtype: np.dtype[Any]) -> SplineBalls | StretchedBalls:
        """Return what the compiled blend reads, or raise `InputError` where the kernel lacks the derivatives."""
        if level == 2:
            require_twice_differentiable(self.kernel)
        sites, weights = (self.sites, self.weights) if dtype == np.float64 else self._single
        power, exponents = self.kernel.power, self.exponents
        splines = SplineBalls(self.offsets, self.places, sites, weights, self.tails, exponents, power, self._widest)
        return splines if self.stretches is None else StretchedBalls.of(splines, self.stretches)

    @cached_property
    def _widest(self) -> int:
        """Points of the ball that has most."""
        return int(np.diff(self.offsets).max())

    @cached_property
    def single_error(self) -> float:
        """The most by which values in single precision are off in the balls."""
        return single_error(self.offsets, self.places, self.sites, self.weights, self.kernel, self._lengths)

    @cached_property
    def single_rounding(self) -> float:
        """About how far values in single precision are off in most balls: roundings of terms λ φ add up by chance.

        Terms are (2 l)ᵏ λ at most, of r² log r hardly more. `single_error` is a bound, thousands of times as large.
        """
        filled = np.diff(self.offsets) > 0
        squares = np.add.reduceat(self.weights**2, self.offsets[:-1][filled])
        longer = self._lengths[filled] ** (2 * self.kernel.power)
        return float(np.finfo(np.float32).eps / 2 * 2**self.kernel.power * np.sqrt(np.median(longer * squares)))

    @cached_property
    def _lengths(self) -> FloatArray:
        """(M,) how many times as long, at most, stretched coordinates of each ball are."""
        stretches = np.eye(1)[np.newaxis] if self.stretches is None else self.stretches
        return np.broadcast_to(np.abs(stretches).sum(axis=2).max(axis=1), len(self.tails))

    @cached_property
    def _single(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Sites and weights in single precision."""
        return self.sites.astype(np.float32), self.weights.astype(np.float32)
