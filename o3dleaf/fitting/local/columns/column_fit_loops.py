"""The compiled loops of fits of several columns of values, ball by ball; those of one column are in `fit_loops`."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.cover.ball_loops import rows_of
from o3dleaf.fitting.local.columns.held_out_loops import held_out
from o3dleaf.fitting.rbf.cholesky_loops import cholesky, solve_rows, solve_triangle
from o3dleaf.fitting.rbf.radial_loops import dot, put
from o3dleaf.fitting.rbf.reflector_loops import reflect
from o3dleaf.fitting.rbf.solve_loops import project, solve_projected
from o3dleaf.fitting.rbf.spectrum_loops import spectra


@njit(nogil=True, cache=True)
def gather_columns(points, values, rows, center, radius):
    """Return the unit coordinates (d, n) of the points `rows` of a ball and their values, a row (c, n) each."""
    count, dimension, columns = rows.size, center.size, values.shape[1]
    local = np.empty((dimension, count))
    data = np.empty((columns, count))
    for j in range(count):
        for k in range(columns):
            data[k, j] = values[rows[j], k]
        for axis in range(dimension):
            local[axis, j] = (points[rows[j], axis] - center[axis]) / radius
    return local, data


@njit(nogil=True, cache=True)
def solve_all(values, projected):
    """Solve what `project_system` made for the rows of (c, n) values: (c, n) λ, (c, q) a, and directions left out."""
    matrix, vectors, betas, triangle, basis = projected
    columns, count = values.shape
    rank, dropped = len(triangle), 0
    weights, tail = np.zeros((columns, count)), np.empty((columns, len(basis)))
    lower, fit = matrix, False
    if rank < count:
        lower, fit = cholesky(matrix[rank:, rank:].copy())
    if not fit:
        # Coinciding points, or a tail that takes all the points: row by row.
        for k in range(columns):
            one, coefficients, _, dropped = solve_projected(values[k], projected)
            put(one, weights[k])
            put(coefficients, tail[k])
        return weights, tail, dropped
    rotated = values.copy()
    for k in range(columns):
        reflect(rotated[k], vectors, betas, True)
        put(rotated[k, rank:], weights[k, rank:])
    solve_rows(lower, weights[:, rank:])
    for k in range(columns):
        reduced = np.empty(rank)
        for i in range(rank):
            reduced[i] = rotated[k, i] - dot(matrix[i, rank:], weights[k, rank:], count - rank)
        solve_triangle(triangle, reduced)
        reflect(weights[k], vectors, betas, False)
        put(basis @ reduced, tail[k])
    return weights, tail, 0


@njit(nogil=True, cache=True)
def fit_column_balls(start, stop, data, balls, tail, power, smoothing, fitted):
    """Fit the balls start:stop; `smoothing` is each ball's diagonal in the data's unit.

    The arrays of `fitted` are those of one column, but the weights (c, total) and the tails (M, c, q).
    """
    dimension = balls.centers.shape[1]
    for ball in range(start, stop):
        first, last = balls.offsets[ball], balls.offsets[ball + 1]
        rows, radius = balls.members[first:last], balls.radii[ball]
        local, values = gather_columns(data.points, data.values, rows, balls.centers[ball], radius)
        diagonal = smoothing[ball] / radius**power / data.weights[rows]
        projected = project(local, tail.exponents[: tail.terms[ball]], power, diagonal)
        fitted.ranks[ball] = len(projected[3])
        weights, coefficients, fitted.dropped[ball] = solve_all(values, projected)
        put(local.ravel(), fitted.sites[dimension * first : dimension * last])
        for k in range(data.values.shape[1]):
            put(weights[k], fitted.weights[k, first:last])
            put(coefficients[k], fitted.tails[ball, k])


@njit(nogil=True, cache=True)
def ball_column_spectra(ball, data, balls, exponents, power):
    """Return the spectrum of one ball's weighted system, in unit coordinates, with a row of coefficients a column."""
    rows = rows_of(balls, ball)
    local, values = gather_columns(data.points, data.values, rows, balls.centers[ball], balls.radii[ball])
    return spectra(local, values, np.sqrt(data.weights[rows]), exponents, power)


@njit(nogil=True, cache=True)
def ball_held_out(ball, data, balls, exponents, power, smoothing, groups):
    """Return the held-out errors (c, n) of one ball's fit at its own points; see `held_out_loops`."""
    rows = rows_of(balls, ball)
    local, values = gather_columns(data.points, data.values, rows, balls.centers[ball], balls.radii[ball])
    diagonal = smoothing[ball] / balls.radii[ball] ** power / data.weights[rows]
    return held_out(local, values, exponents, power, diagonal, groups[rows])
