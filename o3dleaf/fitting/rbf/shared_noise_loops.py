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
from o3dleaf.fitting.rbf.reflector_loops import subtract

MIN_SLOPE = 1e-2
"""Share of the data's slope that a fit has at least when its errors are judged by it."""


class SharedNoise(NamedTuple):
    """The groups of several rows, and S: times `apart`, and `shifts` of the group's sum more.

    Attributes
    ----------
    order : (m,)
        Their rows, group by group.
    ends, shifts : (k,)
    apart, share : float
        1/√(1 − β) and the share β of the variance that a group has in common.
    """

    order: Any
    ends: Any
    shifts: Any
    apart: float
    share: float


class HeldOut(NamedTuple):
    """Sums over groups left out: squares of errors, what slopes lack, times rises (m,); weights and squared rises."""

    squares: Any
    slopes: Any
    totals: Any


@njit(nogil=True, cache=True)
def shared_noise(groups, share):
    """Return the noise of rows that belong to groups (n,), named by any numbers; without a share no row has a group."""
    count = groups.size if share > 0.0 else 0
    order, ends, shifts = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count)
    sorted_rows = np.argsort(groups, kind="mergesort") if count > 0 else order
    filled, several, first = 0, 0, 0
    while first < count:
        last = first + 1
        while last < count and groups[sorted_rows[last]] == groups[sorted_rows[first]]:
            last += 1
        size = last - first
        if size > 1:
            apart, together = factors(size, share)
            for i in range(first, last):
                order[filled] = sorted_rows[i]
                filled += 1
            ends[several], shifts[several] = filled, (together - apart) / size
            several += 1
        first = last
    return SharedNoise(order[:filled], ends[:several], shifts[:several], factors(1, share)[0], share)


@njit(nogil=True, cache=True)
def factors(size, share):
    """Return what S multiplies a group's differences from its mean with, and its mean."""
    return 1.0 / math.sqrt(1.0 - share), 1.0 / math.sqrt(1.0 + (size - 1) * share)


@njit(nogil=True, cache=True)
def whiten(noise, vector):
    """Multiply a vector (n,) with S, in place."""
    order, ends, shifts, apart, _ = noise
    first = 0
    for k in range(ends.size):
        total = 0.0
        for i in range(first, ends[k]):
            total += vector[order[i]]
        total *= shifts[k]
        for i in range(first, ends[k]):
            vector[order[i]] = apart * vector[order[i]] + total
        first = ends[k]


@njit(nogil=True, cache=True)
def whitened(values, roots, noise):
    """Return W^½ S f of values f (n,)."""
    shared = values.copy()
    whiten(noise, shared)
    return shared * roots


@njit(nogil=True, cache=True)
def inverse(noise):
    """Return the noise whose S is the inverse."""
    order, ends, shifts, apart, share = noise
    inverted, first = np.empty(ends.size), 0
    for k in range(ends.size):
        size = ends[k] - first
        inverted[k] = (1.0 / (apart + size * shifts[k]) - 1.0 / apart) / size
        first = ends[k]
    return SharedNoise(order, ends, inverted, 1.0 / apart, share)


@njit(nogil=True, cache=True)
def smoothing_bias(weights, diagonal, values, counts, measured, noise):
    """Return what a fit lacks at measured rows on average, less what is chance; 0 without a share.

    Smoothing takes off what bends: between two sheets of a thin part the field is a ridge, and the rounded one is too
    high on both. It leaves D^½ C D^½ λ of the values; as Σ λ = 0, rows off the surface make up for the measured ones.
    The mean m of these is multiplied with max(0, 1 − v/m²), v its variance, as James and Stein do. A mean of points
    counts as often as they do: those beyond a surface that bends are more than those within, and stand for fewer.

    The points lie on both sides of the surface, by σ. Of a field that bends along its normal the mean over them is not
    0 where it is 0 on the surface, but ½ σ² F'': with σ² = v/F'², see `bend`, that is what remains.

    Parameters
    ----------
    weights : (n,)
        λ of the fit.
    diagonal : (n,)
        What smoothing has added to each row's diagonal, D.
    values : (n,)
        Signed distances, 0 at measured rows.
    counts : (n,)
        The weights of the rows: how many points each stands for.
    measured : (n,) bool
    noise : SharedNoise
    """
    if noise.share <= 0.0:
        return 0.0
    roots, inverted = np.sqrt(diagonal), inverse(noise)
    residuals = roots * weights
    whiten(inverted, residuals)
    whiten(inverted, residuals)
    rows, weight, total, squares = 0, 0.0, 0.0, 0.0
    for j in range(residuals.size):
        residuals[j] *= roots[j]
        if measured[j]:
            residual, count = residuals[j], counts[j]
            rows, weight = rows + 1, weight + count
            total, squares = total + count * residual, squares + count * residual * residual
    if rows < 2 or total == 0.0:
        return 0.0
    mean = total / weight
    variance = (squares - total * mean) / (rows - 1)
    lacking = max(0.0, 1.0 - variance / (total * mean)) * mean
    return lacking + 0.5 * variance * rows / weight * bend(values, residuals, counts, measured, noise)


@njit(nogil=True, cache=True)
def bend(values, residuals, counts, measured, noise):
    """Return F''/F'² of a field F along the normals of measured points, from what it lacks of the values; 0 if unknown.

    A point has rows before and behind it, by d, where v = ∓d, so that F = v − r has the slope 1 − Δr/2d and the second
    difference of −r. Where d is shorter on one side another sheet is near, and what noise reaches is no parabola. One
    number moves the field all over the ball: it is multiplied with the share of points with equal rows less that of
    the others.
    """
    order, first = noise.order, 0
    weight, even, slopes, bends = 0.0, 0.0, 0.0, 0.0
    for k in range(noise.ends.size):
        point, inner, outer = -1, order[first], order[first]
        for i in range(first, noise.ends[k]):
            row = order[i]
            point = row if measured[row] else point
            inner = row if values[row] > values[inner] else inner
            outer = row if values[row] < values[outer] else outer
        first = noise.ends[k]
        if point < 0 or point in (inner, outer):
            continue
        count, distance = counts[point], values[inner] - values[point]
        weight += count
        if values[point] - values[outer] == distance:
            even += count
            slopes += count * (1.0 - (residuals[inner] - residuals[outer]) / (2.0 * distance))
            bends += count * (2.0 * residuals[point] - residuals[inner] - residuals[outer]) / distance**2
    if 2.0 * even <= weight:
        return 0.0
    return bends / even / max(slopes / even, MIN_SLOPE) ** 2 * (2.0 * even / weight - 1.0)


@njit(nogil=True, cache=True)
def whiten_rows(noise, matrix):
    """Multiply a matrix (n, q) with S, in place."""
    order, ends, shifts, apart, _ = noise
    first, total = 0, np.empty(matrix.shape[1])
    for k in range(ends.size):
        total[:] = 0.0
        for i in range(first, ends[k]):
            subtract(matrix[order[i]], -shifts[k], total)
        for i in range(first, ends[k]):
            row = matrix[order[i]]
            for column in range(row.size):
                row[column] = apart * row[column] + total[column]
        first = ends[k]


@njit(nogil=True, cache=True)
def whiten_both_sides(noise, matrix):
    """Make a symmetric A (n, n) S A S, in place."""
    whiten_rows(noise, matrix)
    for row in matrix:
        whiten(noise, row)


@njit(nogil=True, cache=True)
def held_out(count):
    """Return the sums of `add_errors` for so many values of the smoothing, 0."""
    return HeldOut(np.zeros(count), np.zeros(count), np.zeros(2))


@njit(nogil=True, cache=True)
def count_group(rows, name, values, roots, share, sums):
    """Count a group in, and return what multiplies its errors W^½ S e (g,) to the measured row's, and to its slope's.

    Where errors are shared, only that of the row `name` counts, and the slope is that of the values' rises from it.
    """
    size = rows.size
    own, slope = np.zeros(size), np.zeros(size)
    if share == 0.0:
        for row in rows:
            sums.totals[0] += roots[row] ** 2
        return own, slope
    apart, together = factors(size, share)
    mean, weight = (1.0 / together - 1.0 / apart) / size, roots[name] ** 2
    rises = 0.0
    for i in range(size):
        rises += values[rows[i]] - values[name]
    for i in range(size):
        rise, single = values[rows[i]] - values[name], (1.0 / apart) / roots[rows[i]]
        own[i] = mean / roots[rows[i]] + (single if rows[i] == name else 0.0)
        slope[i] = weight * (rises * own[i] - rises * mean / roots[rows[i]] - rise * single)
        sums.totals[1] += weight * rise * rise
    sums.totals[0] += weight
    return own, slope


@njit(nogil=True, cache=True)
def add_errors(missed, size, weight, readings, share, sums, k):
    """Add the errors W^½ S e of a group of that size to the sums of the trial value k; see `count_group`."""
    if share == 0.0:
        for i in range(size):
            sums.squares[k] += missed[i] * missed[i]
        return
    own, slope = readings
    error = 0.0
    for i in range(size):
        error += own[i] * missed[i]
        sums.slopes[k] += slope[i] * missed[i]
    sums.squares[k] += weight * error * error


@njit(nogil=True, cache=True)
def judged(sums):
    """Return the squares (m,) of what each value misses, over those of the slope that it leaves, and the weight."""
    squares, (weight, rises) = sums.squares.copy(), sums.totals
    if rises > 0.0:
        for k in range(squares.size):
            squares[k] /= max(1.0 + sums.slopes[k] / rises, MIN_SLOPE) ** 2
    return squares, weight
