"""Smoothing chosen from the data: one value for all balls, or one for each ball."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.resume.blocks import run_kept_blocks
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local import fit_loops
from o3dleaf.fitting.local.columns.column_fit_loops import ball_column_spectra
from o3dleaf.fitting.local.fit_loops import SharedTrials
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, SplineModel, choose_by_gcv, trial_values
from o3dleaf.fitting.rbf.tail import IntArray

T = TypeVar("T")

GCV_BALLS = 32
"""Balls whose pooled score chooses the smoothing; an eigen-decomposition costs ten factorizations."""

SHARED_POINTS, MIN_BALLS = 2400, 8
"""Where groups of points are left out together the sample has as many balls as contain so many points, and 8 at least:
an eigen-decomposition takes the cube of a ball's points."""

GROUP = 3
"""Rows of a point, on the surface and off its two sides, that balls that choose for themselves leave out together."""

LESS, MORE = 3.0, 100.0
"""How far below and above the value that balls agree on one of them may choose."""

FREEDOM = 4.0
"""Degrees of freedom of the Student's t that balls' errors are judged by, as in Lange, Little & Taylor (1989)."""

SINGLE = 2.0**-24
"""Rounding of single precision: errors of less than this share of the values' deviation are none, as of planes."""

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

    if data.groups is not None:
        shared = SharedErrors(cover, data, model, terms)
        pooled, trials = shared.agreed()
        return (pooled, None) if smoothing.value == "gcv" else (smoothing, shared.each(trials))
    if smoothing.value == "gcv":
        return smoothing.chosen(Spectrum.pooled(each_ball(spectrum, even_rows(len(cover.radii), GCV_BALLS)))), None
    return smoothing, _value_of_each(lambda ball: _own_value(spectrum(ball)), len(cover.radii))


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """The choice where the points of a group share their error; the parameters of `choose_smoothing`."""

    cover: Cover
    data: ScatteredData
    model: SplineModel
    terms: IntArray

    def agreed(self) -> tuple[Smoothing, SharedTrials]:
        """Return the smoothing that a sample of balls agrees on, and what each of them may choose for itself.

        That is a tenth to a hundred times of it. A pooled fit that nearly goes through the data has found no noise,
        and nothing to choose: there all take its value.
        """
        sample = even_rows(len(self.cover.radii), max(MIN_BALLS, round(SHARED_POINTS / np.median(self.cover.counts))))
        decomposed = each_ball(lambda ball: fit_loops.decompose_ball(*self._system(ball), *self._sharing), sample)
        few = slice(None, None, max(1, len(sample) // 4))
        found = zip(sample[few], decomposed[few], strict=True)
        trials = trial_values(np.concatenate([part[0] / self._scale(ball) for ball, part in found]))
        pooled, blocks = self._pooled(sample, decomposed, trials)
        chosen = cast("float", pooled.value)
        near = (trials >= chosen / LESS) & (trials <= chosen * MORE)
        if blocks[0, np.searchsorted(trials, chosen), 0, 0] < NOISY:
            near = trials == chosen
        inverses, near_values = np.ascontiguousarray(np.linalg.inv(blocks[:, near])), trials[near]
        usual = int(np.searchsorted(near_values, chosen))
        return pooled, SharedTrials(near_values, inverses, usual, pooled.per_point, self.data.share)

    def _pooled(self, sample: IntArray, decomposed: list[Any], trials: FloatArray) -> tuple[Smoothing, FloatArray]:
        """Return the smoothing of `trials` (m,) that a sample of balls agrees on, and the mean blocks.

        Its score is the `robust_mean` of the balls'.
        The blocks (g, m, g, g) are the mean s B_II of groups of 1, ..., g rows; of groups that no ball has, one.
        """
        system = dict(zip(sample.tolist(), decomposed, strict=True))

        def squares_of(ball: int) -> tuple[Any, ...]:
            taken = ball, self.data.weighted, self.cover.balls, system[ball], *self._sharing
            found: tuple[Any, ...] = fit_loops.ball_held_out_squares(*taken, trials * self._scale(ball), GROUP)
            return found

        squares, weights, blocks, counts = (np.array(part) for part in zip(*each_ball(squares_of, sample), strict=True))
        weight, blocks, counts = weights.sum(), blocks.sum(axis=0), counts.sum(axis=0)
        mean_squares = robust_mean(squares, weights, float(SINGLE * np.std(self.data.values)) ** 2)
        mean = blocks / np.maximum(counts, 1)[:, np.newaxis, np.newaxis, np.newaxis]
        for size in range(GROUP):
            unknown = np.arange(GROUP) > (size if counts[size] else -1)
            mean[size][:, unknown, unknown] = 1.0
        return self.model.smoothing.chosen_from(trials, weight * mean_squares, weight), mean

    def each(self, trials: SharedTrials) -> FloatArray:
        """Return each ball's own value; `fit_loops.fit_choosing_balls` chooses it on its way to the fit."""
        own = replace(self.model.smoothing, value=float(trials.values[trials.usual]))

        def value_of(ball: int) -> float:
            taken = *self._system(ball), *self._sharing, trials.values * self._scale(ball), trials.inverses
            squares, weight = fit_loops.ball_shared_squares(*taken)
            return cast("float", (own.chosen_from(trials.values, squares, weight) if weight else own).value)

        return _value_of_each(value_of, len(self.cover.radii))

    @property
    def _sharing(self) -> tuple[Any, float]:
        return self.data.groups, self.data.share

    def _system(self, ball: int) -> tuple[Any, ...]:
        """Return what the compiled loops take of a ball."""
        tail = self.model.exponents[: self.terms[ball]]
        return ball, self.data.weighted, self.cover.balls, tail, self.model.kernel.power

    def _scale(self, ball: int) -> float:
        """Return what a value of the smoothing is multiplied with in a ball's unit coordinates."""
        scale = self.model.smoothing.scale(int(self.cover.counts[ball]))
        return float(scale / self.cover.radii[ball] ** self.model.kernel.power)


class BallSmoothing(NamedTuple):
    """The smoothing of each ball: one for all, values (M,) of its own, or what it chooses of `trials` in its fit.

    In that case the fit writes the values.
    """

    smoothing: Smoothing
    per_ball: FloatArray | None
    trials: SharedTrials | None

    @classmethod
    def chosen(
        cls, cover: Cover, data: ScatteredData, model: SplineModel, terms: IntArray, trials: SharedTrials | None = None
    ) -> "BallSmoothing":
        """Choose it, or what the balls are to choose among, unless that is known."""
        if model.smoothing.value == "gcv-per-ball" and data.groups is not None:
            known = SharedErrors(cover, data, model, terms).agreed()[1] if trials is None else SharedTrials(*trials)
            return cls(model.smoothing, np.empty(len(cover.radii)), known)
        return cls(*choose_smoothing(cover, data, model, terms), None)


def robust_mean(squares: FloatArray, weights: FloatArray, rounding: float) -> FloatArray:
    r"""Return the mean over balls of their mean squared errors m_b, for each trial value of the smoothing.

    .. math:: f \Bigl(\exp \frac{\sum_b w_b \log (1 + m_b / f)}{\sum_b w_b} - 1\Bigr), \qquad f = ν\, \tilde m

    As the likelihood of Student's t with ν = 4 has it: the arithmetic mean of balls that err alike, while one whose
    points are missed by far, as at a thin tip, counts by its logarithm, and does not choose for all.

    Parameters
    ----------
    squares : (b, m) ndarray
        Sums of squared errors.
    weights : (b,) ndarray
        Number of the points that they are of, or the sum of their weights.
    rounding : float
        Mean square of errors that are rounding: the least that the median of the balls' least ones, m̃, may be.

    References
    ----------
    Lange, Little & Taylor (1989), Journal of the American Statistical Association 84, 881-896.
    """
    known = weights > 0
    if not known.any():
        return np.zeros(squares.shape[1])
    means = squares[known] / weights[known, np.newaxis]
    usual = FREEDOM * max(float(np.median(means.min(axis=1))), rounding, np.finfo(float).tiny)
    return np.asarray(usual * np.expm1(weights[known] / weights.sum() @ np.log1p(means / usual)))


def _own_value(spectrum: Spectrum) -> float:
    return choose_by_gcv(spectrum) if np.any(spectrum.eigenvalues > 0) else 0.0


def _value_of_each(work: Callable[[int], float], count: int) -> FloatArray:
    """Return what `work` says of each ball, on all threads."""
    values = np.empty(count)

    def task(start: int, stop: int) -> None:
        for ball in range(start, stop):
            values[ball] = work(ball)

    run_kept_blocks(task, count, 1, lambda start, stop: (values[start:stop],))
    return values


def each_ball(work: Callable[[int], T], balls: IntArray, *, reports: bool = False) -> list[T]:
    """Return what `work` says of each ball, in their order, on all threads; see `run_blocks` for `reports`."""
    results: dict[int, T] = {}

    def task(start: int, stop: int) -> None:
        for k in range(start, stop):
            results[k] = work(int(balls[k]))

    run_blocks(task, len(balls), 1, reports=reports)
    return [results[k] for k in range(len(balls))]
