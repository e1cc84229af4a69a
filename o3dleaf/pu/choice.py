"""How much each ball is smoothed, where the data are to say it: one amount for all, or each ball's own."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from o3dleaf.checks import FloatArray
from o3dleaf.parallel import Progress, run_blocks
from o3dleaf.pu import loops
from o3dleaf.pu.cover import Cover
from o3dleaf.rbf.kernels import Polyharmonic
from o3dleaf.rbf.smoothing import Smoothing, Spectrum, choose_by_gcv, trial_amounts
from o3dleaf.rbf.tail import IntArray

T = TypeVar("T")

GCV_BALLS = 32
"""Balls whose pooled score chooses the smoothing; an eigen-decomposition costs ten factorisations."""


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
    where the tail takes all the freedom of its points, so that nothing can be smoothed.

    Parameters
    ----------
    cover : Cover
    points, values, trust : (n, d), (n,), (n,) ndarrays
    kernel, exponents, rule
        Of the fit.
    terms : (M,) int64 ndarray
        How many of the monomials the tail of each ball has.
    owners : (n,) int64 ndarray, optional
        The row that each constraint belongs to, its own for those that stand for a measured point. "gcv" then
        leaves a point out with all its constraints and judges it by its own.
    progress : callable, optional
        ``progress(done, total)`` over balls that choose for themselves.
    """
    if not isinstance(rule.amount, str):
        return rule, None
    count = len(cover.radii)
    balls = (cover.centres, cover.radii, cover.offsets, cover.members)

    def spectrum(ball: int) -> Spectrum:
        found, coefficients = loops.ball_spectrum(
            ball, points, values, trust, balls, exponents[: terms[ball]], kernel.power
        )
        scale = rule.scale(int(cover.counts[ball])) / cover.radii[ball] ** kernel.power
        return Spectrum(found / scale, coefficients, int(cover.counts[ball]))

    def squares(ball: int) -> tuple[FloatArray, int]:
        scales = amounts * rule.scale(int(cover.counts[ball])) / cover.radii[ball] ** kernel.power
        tail = exponents[: terms[ball]]
        return loops.ball_held_out_squares(ball, points, values, trust, balls, tail, kernel.power, owners, scales)

    sample = np.unique(np.linspace(0, count - 1, GCV_BALLS).round().astype(np.int64))
    if rule.amount == "gcv" and owners is not None:
        amounts = trial_amounts(Spectrum.pooled(each_ball(spectrum, sample[:: max(1, len(sample) // 4)])))
        found = each_ball(squares, sample)
        return rule.chosen_from(amounts, sum(part[0] for part in found), sum(part[1] for part in found)), None
    if rule.amount == "gcv":
        return rule.chosen(Spectrum.pooled(each_ball(spectrum, sample))), None
    return rule, np.array(each_ball(lambda ball: _own_amount(spectrum(ball)), np.arange(count), progress))


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
