"""Errors that the rows of a group share: their covariance as a change of coordinates, and errors of rows left out.

A point that is off by e along its normal is so with all that was made from it: the errors of its g rows have the
covariance σ² C, C = (1 − β) I + β 11ᵀ. With S = C^(−½) the system (A + s C) λ + P a = f, Pᵀ λ = 0 is
(S A S + s I) μ + S P a = S f, (S P)ᵀ μ = 0 with λ = S μ: what solves the one with s I solves it.

Places that are off make a field too flat, as they do a regression of values on places; and a flat field misses values
by little. How flat is known: where values differ within a group they do so without error.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit

LEAST_SLOPE = 1e-2
"""Share of the data's slope that a fit has at least when its errors are judged by it."""


class SharedNoise(NamedTuple):
    """Rows (n,) group by group, where each group ends among them (k,), and the share β of the variance in common."""

    order: Any
    ends: Any
    share: float


class HeldOut(NamedTuple):
    """Sums over groups left out: squares of errors (m,) and of slopes times rises (m,); weights and squared rises."""

    squares: Any
    slopes: Any
    totals: Any


@njit(nogil=True, cache=True)
def shared_noise(groups, share):
    """Return the noise of rows that belong to groups (n,), named by any numbers."""
    order = np.argsort(groups, kind="mergesort")
    named = groups[order]
    ends = np.append(np.flatnonzero(named[1:] != named[:-1]) + 1, len(named))
    return SharedNoise(order, ends, share)


@njit(nogil=True, cache=True)
def factors(size, share):
    """Return what S multiplies a group's differences from its mean with, and its mean."""
    return 1.0 / math.sqrt(1.0 - share), 1.0 / math.sqrt(1.0 + (size - 1) * share)


@njit(nogil=True, cache=True)
def whiten(noise, rows):
    """Multiply rows (n, q) with S, in place."""
    multiply(noise, rows, False)


@njit(nogil=True, cache=True)
def unwhiten(noise, rows):
    """Multiply rows (n, q) with the inverse of S, in place."""
    multiply(noise, rows, True)


@njit(nogil=True, cache=True)
def multiply(noise, rows, inversely):
    """Multiply rows (n, q) with S or its inverse, in place; of single rows, or without a share, nothing changes."""
    if noise.share == 0.0:
        return
    first = 0
    for last in noise.ends:
        size = last - first
        if size > 1:
            apart, together = factors(size, noise.share)
            if inversely:
                apart, together = 1.0 / apart, 1.0 / together
            for k in range(rows.shape[1]):
                mean = 0.0
                for i in range(first, last):
                    mean += rows[noise.order[i], k] / size
                for i in range(first, last):
                    j = noise.order[i]
                    rows[j, k] = apart * (rows[j, k] - mean) + together * mean
        first = last


@njit(nogil=True, cache=True)
def whiten_both_sides(noise, matrix):
    """Make a symmetric A (n, n) S A S, in place."""
    if noise.share != 0.0:
        whiten(noise, matrix)
        whiten(noise, matrix.T)


@njit(nogil=True, cache=True)
def held_out(count):
    """Return the sums of `add_errors` for so many values of the smoothing, 0."""
    return HeldOut(np.zeros(count), np.zeros(count), np.zeros(2))


@njit(nogil=True, cache=True)
def count_group(rows, name, values, roots, share, sums):
    """Add a group's weights to the sums and, where errors are shared, the squares of its rises from the row `name`."""
    if share == 0.0:
        for row in rows:
            sums.totals[0] += roots[row] ** 2
        return
    weight = roots[name] ** 2
    sums.totals[0] += weight
    for row in rows:
        sums.totals[1] += weight * (values[row] - values[name]) ** 2


@njit(nogil=True, cache=True)
def add_errors(missed, rows, name, values, roots, share, sums, k):
    """Add the errors W^½ S e (g,) of the rows of a group to the sums of the trial value k: all, or the row `name`'s."""
    if share == 0.0:
        for i in range(rows.size):
            sums.squares[k] += missed[i] * missed[i]
        return
    apart, together = factors(rows.size, share)
    mean, own = 0.0, 0.0
    for i in range(rows.size):
        mean += missed[i] / (rows.size * roots[rows[i]])
    for i in range(rows.size):
        if rows[i] == name:
            own = (missed[i] / roots[name] - mean) / apart + mean / together
    weight = roots[name] ** 2
    sums.squares[k] += weight * own * own
    for i in range(rows.size):
        row, rise = rows[i], values[rows[i]] - values[name]
        error = (missed[i] / roots[row] - mean) / apart + mean / together
        sums.slopes[k] += weight * rise * (rise - error + own)


@njit(nogil=True, cache=True)
def judged(sums):
    """Return the squares (m,) of what each value misses, over those of the slope that it leaves, and the weight."""
    squares, (weight, rises) = sums.squares.copy(), sums.totals
    if rises > 0.0:
        for k in range(squares.size):
            squares[k] /= max(sums.slopes[k] / rises, LEAST_SLOPE) ** 2
    return squares, weight
