"""Errors at points that a local fit has not seen, from one inverse instead of a refit for every group of them."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import SINGULAR, cholesky, solve_positive
from o3dleaf.fitting.rbf.radial_loops import put
from o3dleaf.fitting.rbf.reflector_loops import reflect_both_sides
from o3dleaf.fitting.rbf.solve_loops import project


@njit(nogil=True, cache=True)
def positive_inverse(matrix):
    """Return the inverse of a positive semi-definite matrix without the directions that `solve_positive` leaves out."""
    lower, fit = cholesky(matrix)
    if fit:
        half = np.linalg.inv(lower)
        return np.ascontiguousarray(half.T) @ half
    eigenvalues, vectors = np.linalg.eigh(matrix)
    least = SINGULAR * np.trace(matrix)
    half = vectors.copy()
    for i in range(len(matrix)):
        column = half[:, i]
        column *= 1 / math.sqrt(eigenvalues[i]) if eigenvalues[i] > least else 0.0
    return half @ np.ascontiguousarray(half.T)


@njit(nogil=True, cache=True)
def held_out(points, values, exponents, power, diagonal, groups):
    """Return f − F⁽⁻ᴵ⁾ at every point, F⁽⁻ᴵ⁾ fitted without the whole group I of the point; NaN where too few are left.

    With B = (A + D)⁻¹ on the null space of Pᵀ, zero elsewhere, it is B_II⁻¹ (B f)_I: no refit. Groups are
    runs of equal numbers in `groups` (n,).
    """
    matrix, vectors, betas, triangle, _ = project(points, exponents, power, diagonal)
    count, rank = len(values), len(triangle)
    inverse = np.zeros((count, count))
    if rank < count:
        free = positive_inverse(matrix[rank:, rank:].copy())
        for i in range(count - rank):
            put(free[i], inverse[rank + i, rank:])
    reflect_both_sides(inverse, vectors, betas, False)
    pulled = inverse @ values
    errors = np.full(count, np.nan)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        if count - rows.size < 2 * rank:
            continue
        block = np.empty((rows.size, rows.size))
        right = np.empty(rows.size)
        for i in range(rows.size):
            right[i] = pulled[rows[i]]
            for j in range(rows.size):
                block[i, j] = inverse[rows[i], rows[j]]
        solve_positive(block, right)
        for i in range(rows.size):
            errors[rows[i]] = right[i]
    return errors
