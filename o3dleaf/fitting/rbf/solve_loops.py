"""The compiled solution of one local system, on the null space of the tail's transpose.

Householder reflectors turn the tail P into a triangle; what they make of A + D on the rest of the
space is positive definite, and Cholesky does the rest. Unit coordinates as in `evaluation_loops.py`.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import solve_positive, solve_triangle
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, dot, put, radial_values, squared_distances
from o3dleaf.fitting.rbf.reflector_loops import householder, mirror, reflect, reflect_both_sides, restrict_tail

ROWS = 64
"""Rows of a tall system that are reduced at once: with the triangle they stay in the nearest cache."""


@njit(nogil=True, cache=True)
def radial_matrix(points, power):
    """Return A with A_ij = φ(|z_i − z_j|), symmetric, zero on the diagonal."""
    matrix = lower_radial_matrix(points, power)
    mirror(matrix)
    return matrix


@njit(nogil=True, cache=True)
def lower_radial_matrix(points, power):
    """Return A up to its diagonal; what is above is not written."""
    count = points.shape[1]
    matrix = np.empty((count, count))
    z, squared = np.empty(points.shape[0]), np.empty(count)
    for i in range(count):
        if power == 3 and z.size == 3:
            cubic_row(points, i, matrix[i, : i + 1])
            continue
        for axis in range(z.size):
            z[axis] = points[axis, i]
        # Not in place: the compiler cannot tell that one entry needs no other, and takes them one by one.
        squared_distances(z, points, i + 1, squared)
        radial_values(power, squared, i + 1, matrix[i])
    return matrix


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_row(points, i, row):
    """Write |z_i − z_j|³ of the first of points (3, n), as many as the row has, in one pass."""
    xs, ys, zs = points[0], points[1], points[2]
    x, y, z = xs[i], ys[i], zs[i]
    for j in range(len(row)):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        square = a * a + b * b + c * c
        row[j] = square * math.sqrt(square)


@njit(nogil=True, cache=True)
def tail_matrix(points, exponents):
    """Return P with P_ik = p_k(z_i)."""
    dimension, count = points.shape
    columns = np.ones((len(exponents), count))
    for k in range(len(exponents)):
        column = columns[k]
        for axis in range(dimension):
            coordinate = points[axis]
            for _ in range(exponents[k, axis]):
                for i in range(count):
                    column[i] *= coordinate[i]
    return columns.T.copy()


@njit(nogil=True, cache=True)
def natural_monomials(points, exponents):
    """Return the (q, q) coefficients of √(|α|!/α!) (z − z̄)^α in the monomials z^α, one column each, z̄ the points' mean.

    Turning the points about their mean turns these monomials of a degree orthogonally among
    themselves, and where the center of the ball lies has no part in them.
    """
    count, dimension = exponents.shape
    frame = np.empty((count, count))
    mean = np.empty(dimension)
    for axis in range(dimension):
        mean[axis] = np.mean(points[axis])
    for k in range(count):
        scale, total = 1.0, 0
        for exponent in exponents[k]:
            for step in range(1, exponent + 1):
                total += 1
                scale *= math.sqrt(total / step)
        for row in range(count):
            value = scale
            for axis in range(dimension):
                high, low = exponents[k, axis], exponents[row, axis]
                for step in range(low):
                    value *= (high - step) / (step + 1)
                for _ in range(high - low):
                    value *= -mean[axis]
            frame[row, k] = value
    return frame


@njit(nogil=True, cache=True)
def project(points, exponents, power, diagonal):
    """Return `project_system` of the local system of values at (d, n) points, its matrix radial."""
    matrix = radial_matrix(points, power)
    for i in range(len(matrix)):
        matrix[i, i] += diagonal[i]
    return project_system(matrix, tail_matrix(points, exponents), natural_monomials(points, exponents))


@njit(nogil=True, cache=True)
def project_system(matrix, tail, frame):
    """Return (Qᵀ A Q, reflectors, β, R, basis) of the saddle point of A, overwritten, and P; see `restrict_tail`."""
    vectors, betas, triangle, basis = restrict_tail(tail, frame)
    reflect_both_sides(matrix, vectors, betas, True)
    return matrix, vectors, betas, triangle, basis


@njit(nogil=True, cache=True)
def solve_local(points, values, exponents, power, diagonal):
    """Solve (A + D) λ + P a = f, Pᵀ λ = 0, equation (2) of the paper, on the null space of Pᵀ.

    Parameters
    ----------
    points : (d, n) unit coordinates
    values : (n,)
    exponents : (q, d)
    power : int
    diagonal : (n,)
        D, in unit coordinates: the smoothing, divided by each point's weight.

    Returns
    -------
    weights (n,), tail (q,), rank of P, directions left out
    """
    return solve_projected(values, project(points, exponents, power, diagonal))


@njit(nogil=True, cache=True)
def solve_system(matrix, tail, frame, values):
    """Solve A λ + P a = f, Pᵀ λ = 0 for any A, overwritten, that is positive on the null space of Pᵀ.

    Returns
    -------
    weights (n,), coefficients (q,), rank of P, directions left out
    """
    return solve_projected(values, project_system(matrix, tail, frame))


@njit(nogil=True, cache=True)
def solve_projected(values, projected):
    """Solve what `project_system` made."""
    matrix, vectors, betas, triangle, basis = projected
    count, rank = len(values), len(triangle)
    rotated = values.copy()
    reflect(rotated, vectors, betas, True)
    weights = np.zeros(count)
    put(rotated[rank:], weights[rank:])
    dropped = solve_positive(matrix[rank:, rank:].copy(), weights[rank:])
    reduced = np.empty(rank)
    for k in range(rank):
        reduced[k] = rotated[k] - dot(matrix[k, rank:], weights[rank:], count - rank)
    solve_triangle(triangle, reduced)
    reflect(weights, vectors, betas, False)
    return weights, basis @ reduced, rank, dropped


@njit(nogil=True, cache=True)
def left_by(values, projected, diagonal):
    """Return f − F (n,) at the points of a fit that `project_system` made: D λ, and what left out directions have."""
    matrix, vectors, betas, _, _ = projected
    weights, _, rank, dropped = solve_projected(values, projected)
    left = diagonal * weights
    if dropped > 0:
        rest, turned = values.copy(), weights
        reflect(rest, vectors, betas, True)
        reflect(turned, vectors, betas, True)
        for i in range(len(values)):
            rest[i] = rest[i] - dot(matrix[i, rank:], turned[rank:], len(values) - rank) if i >= rank else 0.0
        reflect(rest, vectors, betas, False)
        left += rest
    return left


@njit(nogil=True, cache=True)
def reduce_rows(rows, right):
    """Return (q, q) rows and their right-hand side of the same least-squares problem, from a few rows at a time."""
    count, columns = rows.shape
    stack, side = np.zeros((columns + ROWS, columns)), np.zeros(columns + ROWS)
    for start in range(0, count, ROWS):
        filled = columns + min(ROWS, count - start)
        for i in range(columns, filled):
            put(rows[start + i - columns], stack[i])
        put(right[start : start + ROWS], side[columns:filled])
        vectors, betas = householder(stack[:filled])
        reflect(side[:filled], vectors, betas, True)
        for i in range(columns):
            stack[i, :i] = 0.0
    return stack[:columns].copy(), side[:columns].copy()


@njit(nogil=True, cache=True)
def least_squares(rows, frame, right):
    """Return the coefficients with least |P a − b|, of them the least in the norm of `frame`, and the rank of P."""
    rows, right = reduce_rows(rows, right)
    vectors, betas, triangle, basis = restrict_tail(rows, frame)
    reflect(right, vectors, betas, True)
    reduced = right[: len(triangle)].copy()
    solve_triangle(triangle, reduced)
    return basis @ reduced, len(triangle)
