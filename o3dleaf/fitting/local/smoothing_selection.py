"""Smoothing chosen from the data: one value for all balls, or one for each ball."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.resume.blocks import run_kept_blocks
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local import fit_loops
from o3dleaf.fitting.local.columns.column_fit_loops import ball_column_spectra
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, SplineModel, choose_by_gcv, trial_values
from o3dleaf.fitting.rbf.tail import IntArray

T = TypeVar("T")

GCV_BALLS = 32
"""Balls whose pooled score chooses the smoothing; an eigen-decomposition costs ten factorizations."""

SHARED_POINTS, LEAST_BALLS = 2400, 8
"""Where groups of points are left out together the sample has as many balls as contain so many points, and 8 at least:
an eigen-decomposition takes the cube of a ball's points. Over 18 clouds of surfaces the value is a factor of 1.4 from
that of 256 balls (median), once, on a flat curve, 66; a decade matters."""

GROUP = 3
"""Rows of a point, on the surface and off its two sides, that balls that choose for themselves leave out together."""

LESS, MORE = 10.0, 100.0
"""How far below and above the value that balls agree on one of them may choose."""

NOISY = 0.5
"""Share of a point's error that the pooled fit must leave beside the surface for balls to have a choice."""


def choose_smoothing(
    cover: Cover, data: ScatteredData, model: SplineModel, terms: IntArray
) -> tuple[Smoothing, FloatArray | None]:
    """Return the smoothing, its value chosen, and each ball's own value instead where they choose for themselves.

    "gcv" takes what a fixed sample of balls agrees on, "gcv-per-ball" what each ball chooses: 0
    where the tail takes all the degrees of freedom of its points, so that nothing can be smoothed. Where the data
    have groups it is what `SharedErrors.each` says, each point being left out with its whole group. Of several columns
    of values the spectra are pooled.

    Parameters
    ----------
    cover : Cover
    data : ScatteredData
    model : SplineModel
        Of the fit.
    terms : (M,) int64 ndarray
        How many of the monomials the tail of each ball has.
    """
    smoothing = model.smoothing
    if not isinstance(smoothing.value, str):
        return smoothing, None
    values, exponents, power = data.weighted, model.exponents, model.kernel.power
    several = data.values.ndim == 2
    if several and data.groups is not None:
        raise InputError("groups: 'gcv' knows them of one column of values only; give a number, or leave groups out")

    def spectrum(ball: int) -> Spectrum:
        tail, count = exponents[: terms[ball]], int(cover.counts[ball])
        find = ball_column_spectra if several else fit_loops.ball_spectrum
        eigenvalues, coefficients = find(ball, values, cover.balls, tail, power)
        eigenvalues = eigenvalues / (smoothing.scale(count) / cover.radii[ball] ** power)
        if several:
            return Spectrum.pooled(Spectrum(eigenvalues, column, count) for column in coefficients)
        return Spectrum(eigenvalues, coefficients, count)

    every = np.arange(len(cover.radii))
    size = GCV_BALLS if data.groups is None else max(LEAST_BALLS, round(SHARED_POINTS / float(np.median(cover.counts))))
    sample = np.unique(np.linspace(0, len(every) - 1, size).round().astype(np.int64))
    if data.groups is not None:
        trials = trial_values(Spectrum.pooled(each_ball(spectrum, sample[:: max(1, len(sample) // 4)])))
        shared = SharedErrors(cover, data, model, terms)
        pooled, blocks = shared.pooled(sample, trials)
        return (pooled, None) if smoothing.value == "gcv" else (smoothing, shared.each(pooled, trials, blocks))
    if smoothing.value == "gcv":
        return smoothing.chosen(Spectrum.pooled(each_ball(spectrum, sample))), None
    return smoothing, _value_of_each(lambda ball: _own_value(spectrum(ball)), len(every))


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """The choice where the points of a group share their error; the parameters of `choose_smoothing`."""

    cover: Cover
    data: ScatteredData
    model: SplineModel
    terms: IntArray

    def pooled(self, sample: IntArray, trials: FloatArray) -> tuple[Smoothing, FloatArray]:
        """Return the smoothing of `trials` (m,) that a sample of balls agrees on, and the mean blocks.

        The blocks (g, m, g, g) are the mean s B_II of groups of 1, ..., g rows; of groups that no ball has, one.
        """
        each = each_ball(lambda ball: fit_loops.ball_held_out_squares(*self._system(ball, trials, GROUP)), sample)
        squares, weight, blocks, counts = (sum(part[k] for part in each) for k in range(4))
        mean = blocks / np.maximum(counts, 1)[:, np.newaxis, np.newaxis, np.newaxis]
        for size in range(GROUP):
            unknown = np.arange(GROUP) > (size if counts[size] else -1)
            mean[size][:, unknown, unknown] = 1.0
        return self.model.smoothing.chosen_from(trials, squares, weight), mean

    def each(self, pooled: Smoothing, trials: FloatArray, blocks: FloatArray) -> FloatArray:
        """Return each ball's own value, from a tenth to a hundred times the pooled one, by the means of the blocks.

        A pooled fit that nearly goes through the data has found no noise, and nothing to choose: all take its value.
        """
        chosen = cast("float", pooled.value)
        count = len(self.cover.radii)
        if blocks[0, np.searchsorted(trials, chosen), 0, 0] < NOISY:
            return np.full(count, chosen)
        near = np.flatnonzero((trials >= chosen / LESS) & (trials <= chosen * MORE))
        inverses, candidates = np.ascontiguousarray(np.linalg.inv(blocks[:, near])), trials[near]

        def value_of(ball: int) -> float:
            squares, weight = fit_loops.ball_shared_squares(*self._system(ball, candidates, inverses))
            return cast("float", pooled.chosen_from(candidates, squares, weight).value) if weight else chosen

        return _value_of_each(value_of, count)

    def _system(self, ball: int, trials: FloatArray, last: object) -> tuple[Any, ...]:
        """Return what the compiled loops take of a ball, with `trials` in its unit coordinates, up to their `last`."""
        cover, power = self.cover, self.model.kernel.power
        scaled = trials * self.model.smoothing.scale(int(cover.counts[ball])) / cover.radii[ball] ** power
        tail = self.model.exponents[: self.terms[ball]]
        return ball, self.data.weighted, cover.balls, tail, power, self.data.groups, scaled, last


def _own_value(spectrum: Spectrum) -> float:
    return choose_by_gcv(spectrum) if np.any(spectrum.eigenvalues > 0) else 0.0


def _value_of_each(work: Callable[[int], float], count: int) -> FloatArray:
    """Return what `work` says of each ball, on all threads."""
    values = np.empty(count)

    def task(start: int, stop: int) -> None:
        for ball in range(start, stop):
            values[ball] = work(ball)

    run_kept_blocks(task, count, 1, lambda start, stop: (values[start:stop],), reports=True)
    return values


def each_ball(work: Callable[[int], T], balls: IntArray, *, reports: bool = False) -> list[T]:
    """Return what `work` says of each ball, in their order, on all threads; see `run_blocks` for `reports`."""
    results: dict[int, T] = {}

    def task(start: int, stop: int) -> None:
        for k in range(start, stop):
            results[k] = work(int(balls[k]))

    run_blocks(task, len(balls), 1, reports=reports)
    return [results[k] for k in range(len(balls))]
