"""Errors at points that a local fit has not seen, from one inverse instead of a refit for every group of them."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import SINGULAR, cholesky, invert_triangle, solve_positive_rows
from o3dleaf.fitting.rbf.radial_loops import put
from o3dleaf.fitting.rbf.reflector_loops import reflect
from o3dleaf.fitting.rbf.solve_loops import project


@njit(nogil=True, cache=True)
def inverse_root(matrix):
    """Return R with RᵀR the inverse of a positive semi-definite matrix, less the directions `solve_positive` leaves."""
    lower, fit = cholesky(matrix)
    if fit:
        return invert_triangle(lower)
    eigenvalues, vectors = np.linalg.eigh(matrix)
    least, root = SINGULAR * np.trace(matrix), vectors.T.copy()
    for i in range(len(matrix)):
        row = root[i]
        row *= 1 / math.sqrt(eigenvalues[i]) if eigenvalues[i] > least else 0.0
    return root


@njit(nogil=True, cache=True)
def held_out(points, values, exponents, power, diagonal, groups):
    """Return f − F⁽⁻ᴵ⁾ of rows of values (c, n) at every point, F⁽⁻ᴵ⁾ fitted without the whole group I of the point.

    NaN where too few are left. With B = RᵀR, (A + D)⁻¹ on the null space of Pᵀ and zero elsewhere, it is
    B_II⁻¹ (B f)_I: no refit, and of B no more than its blocks. Groups are runs of equal numbers in `groups` (n,).
    """
    matrix, vectors, betas, triangle, _ = project(points, exponents, power, diagonal)
    columns, count = values.shape
    rank = len(triangle)
    root = np.zeros((max(count - rank, 0), count))
    if rank < count:
        free = inverse_root(matrix[rank:, rank:].copy())
        for i in range(count - rank):
            put(free[i], root[i, rank:])
            reflect(root[i], vectors, betas, False)
    turned = root.T.copy()
    pulled = (values @ turned) @ root
    errors = np.full((columns, count), np.nan)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        if count - rows.size < 2 * rank:
            continue
        part, right = np.empty((rows.size, len(root))), np.empty((columns, rows.size))
        for i in range(rows.size):
            put(turned[rows[i]], part[i])
            for k in range(columns):
                right[k, i] = pulled[k, rows[i]]
        solve_positive_rows(part @ part.T, right)
        for i in range(rows.size):
            for k in range(columns):
                errors[k, rows[i]] = right[k, i]
    return errors
