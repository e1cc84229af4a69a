"""How much each ball is smoothed, where the data are to say it: one amount for all, or each ball's own."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import Progress, run_blocks
from o3dleaf.fitting.pu import ball_loops
from o3dleaf.fitting.pu.cover import Cover
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, choose_by_gcv, trial_amounts
from o3dleaf.fitting.rbf.tail import IntArray

T = TypeVar("T")

GCV_BALLS = 32
"""Balls whose pooled score chooses the smoothing; an eigen-decomposition costs ten factorisations."""

GROUP = 3
"""Rows of a point, on the surface and off its two sides, that balls that choose for themselves leave out together."""

LESS, MORE = 10.0, 100.0
"""How far below and above the amount that balls agree on one of them may choose."""

NOISY = 0.5
"""Share of a point's error that the pooled fit must leave beside the surface for balls to have a choice."""


def choose_amounts(
    cover: Cover,
    points: FloatArray,
    values: FloatArray,
    trust: FloatArray,
    *,
    kernel: Polyharmonic,
    exponents: IntArray,
    terms: IntArray,
    rule: Smoothing,
    owners: IntArray | None = None,
    progress: Progress | None = None,
) -> tuple[Smoothing, FloatArray | None]:
    """Return the rule, its amount chosen, and each ball's own amount instead where they choose for themselves.

    "gcv" takes what a fixed sample of balls agrees on, "gcv-per-ball" what each ball chooses: 0
    where the tail takes all the freedom of its points, so that nothing can be smoothed. With owners
    it is what `SharedErrors.each` says.

    Parameters
    ----------
    cover : Cover
    points, values, trust : (n, d), (n,), (n,) ndarrays
    kernel, exponents, rule
        Of the fit.
    terms : (M,) int64 ndarray
        How many of the monomials the tail of each ball has.
    owners : (n,) int64 ndarray, optional
        The row that each constraint belongs to, its own for those that stand for a measured point. The choice
        then leaves a point out with all its constraints; see `SharedErrors`.
    progress : callable, optional
        ``progress(done, total)`` over balls that choose for themselves.
    """
    if not isinstance(rule.amount, str):
        return rule, None
    count = len(cover.radii)
    balls = (cover.centres, cover.radii, cover.offsets, cover.members)

    def spectrum(ball: int) -> Spectrum:
        found, coefficients = ball_loops.ball_spectrum(
            ball, points, values, trust, balls, exponents[: terms[ball]], kernel.power
        )
        scale = rule.scale(int(cover.counts[ball])) / cover.radii[ball] ** kernel.power
        return Spectrum(found / scale, coefficients, int(cover.counts[ball]))

    sample = np.unique(np.linspace(0, count - 1, GCV_BALLS).round().astype(np.int64))
    if owners is not None:
        trials = trial_amounts(Spectrum.pooled(each_ball(spectrum, sample[:: max(1, len(sample) // 4)])))
        shared = SharedErrors(cover, points, values, trust, kernel, exponents, terms, rule, owners)
        pooled, blocks = shared.pooled(sample, trials)
        return (pooled, None) if rule.amount == "gcv" else (rule, shared.each(pooled, trials, blocks, progress))
    if rule.amount == "gcv":
        return rule.chosen(Spectrum.pooled(each_ball(spectrum, sample))), None
    return rule, np.array(each_ball(lambda ball: _own_amount(spectrum(ball)), np.arange(count), progress))


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """The choice where constraints made from one point share its error; the parameters of `choose_amounts`."""

    cover: Cover
    points: FloatArray
    values: FloatArray
    trust: FloatArray
    kernel: Polyharmonic
    exponents: IntArray
    terms: IntArray
    rule: Smoothing
    owners: IntArray

    def pooled(self, sample: IntArray, trials: FloatArray) -> tuple[Smoothing, FloatArray]:
        """Return the rule with the amount of `trials` (m,) that a sample of balls agrees on, and the mean blocks.

        The blocks (g, m, g, g) are the mean s B_II of groups of 1, ..., g rows; of groups that no ball has, one.
        """
        found = each_ball(lambda ball: ball_loops.ball_held_out_squares(*self._system(ball, trials, GROUP)), sample)
        squares, judged, blocks, groups = (sum(part[k] for part in found) for k in range(4))
        mean = blocks / np.maximum(groups, 1)[:, np.newaxis, np.newaxis, np.newaxis]
        for size in range(GROUP):
            unknown = np.arange(GROUP) > (size if groups[size] else -1)
            mean[size][:, unknown, unknown] = 1.0
        return self.rule.chosen_from(trials, squares, judged), mean

    def each(
        self, pooled: Smoothing, trials: FloatArray, blocks: FloatArray, progress: Progress | None = None
    ) -> FloatArray:
        """Return each ball's own amount, from a tenth to a hundred times the pooled one, by the means of the blocks.

        A pooled fit that nearly goes through the data has found no noise, and nothing to choose: all take its amount.
        """
        chosen = cast("float", pooled.amount)
        count = len(self.cover.radii)
        if blocks[0, np.searchsorted(trials, chosen), 0, 0] < NOISY:
            return np.full(count, chosen)
        rungs = np.flatnonzero((trials >= chosen / LESS) & (trials <= chosen * MORE))
        inverses, amounts = np.linalg.inv(blocks[:, rungs]), trials[rungs]

        def own(ball: int) -> float:
            squares, judged = ball_loops.ball_shared_squares(*self._system(ball, amounts, inverses))
            return cast("float", pooled.chosen_from(amounts, squares, judged).amount) if judged else chosen

        return np.array(each_ball(own, np.arange(count), progress))

    def _system(self, ball: int, amounts: FloatArray, last: object) -> tuple[Any, ...]:
        """Return what the compiled loops take of a ball, with `amounts` in its unit coordinates, up to their `last`."""
        cover, power = self.cover, self.kernel.power
        balls = (cover.centres, cover.radii, cover.offsets, cover.members)
        scaled = amounts * self.rule.scale(int(cover.counts[ball])) / cover.radii[ball] ** power
        tail = self.exponents[: self.terms[ball]]
        return ball, self.points, self.values, self.trust, balls, tail, power, self.owners, scaled, last


def _own_amount(spectrum: Spectrum) -> float:
    return choose_by_gcv(spectrum) if np.any(spectrum.eigenvalues > 0) else 0.0


def each_ball(work: Callable[[int], T], balls: IntArray, progress: Progress | None = None) -> list[T]:
    """Return what `work` says of each ball, in their order, on all threads."""
    found: dict[int, T] = {}

    def task(start: int, stop: int) -> None:
        for at in range(start, stop):
            found[at] = work(int(balls[at]))

    run_blocks(task, len(balls), 1, progress)
    return [found[at] for at in range(len(balls))]
