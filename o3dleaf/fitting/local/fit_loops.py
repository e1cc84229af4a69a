"""The compiled loops of fits of values, ball by ball: splines, their spectra and their held-out errors."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.cover.ball_loops import rows_of
from o3dleaf.fitting.local.jet_loops import stretch
from o3dleaf.fitting.rbf.radial_loops import put
from o3dleaf.fitting.rbf.shared_error_loops import shared_squares, solve_chosen, solve_shared
from o3dleaf.fitting.rbf.shared_noise_loops import shared_noise, smoothing_bias, whitened
from o3dleaf.fitting.rbf.solve_loops import left_by, project
from o3dleaf.fitting.rbf.spectrum_loops import decompose, held_out_squares, spectra
from o3dleaf.fitting.rbf.tail import IntArray


class WeightedValues(NamedTuple):
    """Points (n, d), their values (n,) and weights (n,)."""

    points: FloatArray
    values: FloatArray
    weights: FloatArray


class Tails(NamedTuple):
    """Exponents (q, d) of the tail's monomials, lowest degree first, and how many of them each ball has, (M,)."""

    exponents: IntArray
    terms: IntArray


class SplineArrays(NamedTuple):
    """Splines of all balls, end to end; see `o3dleaf.fitting.local.splines.LocalSplines`."""

    sites: FloatArray
    weights: FloatArray
    tails: FloatArray
    ranks: IntArray
    dropped: IntArray


class SharedTrials(NamedTuple):
    """Values of the smoothing (m,), rising, that balls choose among where groups of points share their error.

    Attributes
    ----------
    values : (m,) ndarray
        In the data's unit.
    inverses : (g, m, g, g) ndarray
        Inverses of the mean s B_II of groups of 1, ..., g rows, for each value.
    usual : int
        The place of the value that a sample of balls agrees on, which balls take that have no group to leave out.
    per_point : float
        What the values are multiplied with for each point of a ball, 0 for nothing; see `Smoothing`.
    share : float
        The part of the variance of its rows that a group has in common.
    """

    values: FloatArray
    inverses: FloatArray
    usual: int
    per_point: float
    share: float


@njit(nogil=True, cache=True)
def gather(data, rows, balls, ball):
    """Return the unit coordinates (d, n), stretched if they are, and the values of the points `rows` of a ball."""
    points, center, radius = data.points, balls.centers[ball], balls.radii[ball]
    count, dimension = rows.size, center.size
    local, values = np.empty((dimension, count)), np.empty(count)
    for j in range(count):
        values[j] = data.values[rows[j]]
        for axis in range(dimension):
            local[axis, j] = (points[rows[j], axis] - center[axis]) / radius
    if len(balls.stretches) > 0:
        stretch(balls.stretches[ball], local.copy(), count, local)
    return local, values


@njit(nogil=True, cache=True)
def spread_normals(start, stop, normals, weights, balls, spreads):
    """Write the covariances (d, d) of the normals of the points of the balls start:stop; normals of 0 do not count."""
    dimension = normals.shape[1]
    mean, total = np.empty(dimension), 0.0
    for ball in range(start, stop):
        spread = spreads[ball]
        mean[:], spread[:], total = 0.0, 0.0, 0.0
        for row in rows_of(balls, ball):
            for a in range(dimension):
                weighted = weights[row] * normals[row, a]
                mean[a] += weighted
                total += weighted * normals[row, a]
                for b in range(dimension):
                    spread[a, b] += weighted * normals[row, b]
        for a in range(dimension if total > 0.0 else 0):
            for b in range(dimension):
                spread[a, b] = spread[a, b] / total - mean[a] / total * mean[b] / total


@njit(nogil=True, cache=True)
def write_ball(ball, first, local, solved, fitted):
    """Write the fit of a ball, whose points (d, n) have the weights from `first` on, as `solve_shared` returns it."""
    weights, coefficients, rank, dropped = solved
    dimension, count = local.shape
    put(local.ravel(), fitted.sites[dimension * first : dimension * (first + count)])
    put(weights, fitted.weights[first : first + count])
    put(coefficients, fitted.tails[ball])
    fitted.ranks[ball] = rank
    fitted.dropped[ball] = dropped


@njit(nogil=True, cache=True)
def fit_balls(start, stop, data, balls, tail, power, smoothing, groups, share, fitted):
    """Fit the balls start:stop; `smoothing` is each ball's diagonal in the data's unit.

    The rows of a group (n,) have that share of their variance in common. Tail coefficients that a ball has no terms for
    stay as they are.
    """
    for ball in range(start, stop):
        first, last = balls.offsets[ball], balls.offsets[ball + 1]
        rows, radius = balls.members[first:last], balls.radii[ball]
        local, values = gather(data, rows, balls, ball)
        counts, named = data.weights[rows], groups[rows]
        diagonal = smoothing[ball] / radius**power / counts
        exponents, noise = tail.exponents[: tail.terms[ball]], shared_noise(named, share)
        solved = solve_shared(local, values, exponents, power, diagonal, noise)
        solved[1][0] += smoothing_bias(solved[0], diagonal, values, counts, named == rows, noise)
        write_ball(ball, first, local, solved, fitted)


@njit(nogil=True, cache=True)
def ball_residuals(ball, data, balls, exponents, power, smoothing):
    """Return f − F (n,) of one ball's fit at its own points; `smoothing` is each ball's diagonal in the data's unit."""
    rows, radius = rows_of(balls, ball), balls.radii[ball]
    local, values = gather(data, rows, balls, ball)
    diagonal = smoothing[ball] / radius**power / data.weights[rows]
    return left_by(values, project(local, exponents, power, diagonal), diagonal)


@njit(nogil=True, cache=True)
def fit_choosing_balls(start, stop, data, balls, tail, power, groups, trials, chosen, fitted):
    """Fit the balls start:stop, each with the smoothing of the trials that it chooses, written into `chosen` (M,)."""
    for ball in range(start, stop):
        first, last = balls.offsets[ball], balls.offsets[ball + 1]
        rows, radius = balls.members[first:last], balls.radii[ball]
        local, values = gather(data, rows, balls, ball)
        scale = trials.per_point * rows.size if trials.per_point > 0.0 else 1.0
        scaled = trials.values * (scale / radius**power)
        counts, named = data.weights[rows], local_groups(rows, groups)
        exponents, noise = tail.exponents[: tail.terms[ball]], shared_noise(groups[rows], trials.share)
        solved, best = solve_chosen(
            local, values, np.sqrt(counts), exponents, power, named, noise, scaled, trials.inverses, trials.usual
        )
        diagonal = scaled[best] / counts
        solved[1][0] += smoothing_bias(solved[0], diagonal, values, counts, groups[rows] == rows, noise)
        write_ball(ball, first, local, solved, fitted)
        chosen[ball] = trials.values[best]


@njit(nogil=True, cache=True)
def ball_spectrum(ball, data, balls, exponents, power):
    """Return the spectrum of one ball's weighted system, in unit coordinates."""
    rows = rows_of(balls, ball)
    local, values = gather(data, rows, balls, ball)
    eigenvalues, coefficients = spectra(local, values.reshape(1, -1), np.sqrt(data.weights[rows]), exponents, power)
    return eigenvalues, coefficients[0]


@njit(nogil=True, cache=True)
def local_groups(rows, groups):
    """Return the place in `rows`, rising, of the row that names each row's group; −1 where it is not among them."""
    places = np.searchsorted(rows, groups[rows])
    for j in range(places.size):
        if places[j] == rows.size or rows[places[j]] != groups[rows[j]]:
            places[j] = -1
    return places


@njit(nogil=True, cache=True)
def decompose_ball(ball, data, balls, exponents, power, groups, share):
    """Return what `decompose` does of one ball's weighted system, in unit coordinates; see `shared_noise_loops`."""
    rows = rows_of(balls, ball)
    local, _ = gather(data, rows, balls, ball)
    roots, noise = np.sqrt(data.weights[rows]), shared_noise(groups[rows], share)
    return decompose(local, roots, exponents, power, noise)


@njit(nogil=True, cache=True)
def ball_held_out_squares(ball, data, balls, decomposed, groups, share, trials, max_size):
    """Return one ball's `held_out_squares`, and its sums of blocks of up to `max_size` rows and their numbers."""
    rows = rows_of(balls, ball)
    blocks, counts = np.zeros((max_size, trials.size, max_size, max_size)), np.zeros(max_size)
    roots, named, values = np.sqrt(data.weights[rows]), local_groups(rows, groups), data.values[rows]
    weighted = whitened(values, roots, shared_noise(groups[rows], share))
    squares, weight = held_out_squares(decomposed, values, weighted, roots, named, share, trials, blocks, counts)
    return squares, weight, blocks, counts


@njit(nogil=True, cache=True)
def ball_shared_squares(ball, data, balls, exponents, power, groups, share, trials, inverses):
    """Return one ball's `shared_squares`."""
    rows = rows_of(balls, ball)
    local, values = gather(data, rows, balls, ball)
    named, noise, roots = local_groups(rows, groups), shared_noise(groups[rows], share), np.sqrt(data.weights[rows])
    return shared_squares(local, values, roots, exponents, power, named, noise, trials, inverses)
