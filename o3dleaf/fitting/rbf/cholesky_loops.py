"""Compiled Cholesky factors, systems of triangles, and products by symmetric matrices."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, dot, put

SINGULAR = 3e-14
"""Share of the trace below which an eigenvalue is rounding: coinciding points leave at most half of this,
points 10⁻⁶ of the ball apart leave five times as much."""

BLOCK = 16
"""Rows of the blocks of a triangle that are inverted row by row: all else comes by products of matrices."""


@njit(nogil=True, cache=True)
def cholesky(matrix):
    """Return the lower factor, and whether the matrix was fit for it."""
    lower = matrix
    try:
        lower = np.linalg.cholesky(matrix)
    except Exception:  # noqa: BLE001 - Numba knows this one class only; it is LinAlgError
        return lower, False
    least = SINGULAR * np.trace(matrix)
    for i in range(len(matrix)):
        if lower[i, i] * lower[i, i] <= least:
            return lower, False
    return lower, True


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def multiply_symmetric(matrix, vector, product):
    """Write M x of a symmetric matrix (n, n), of which nothing above the diagonal is read.

    Each entry serves the two that it stands for while it is at hand, and four rows are taken at once: a product by the
    whole matrix is as slow as its entries are read.
    """
    count = len(vector)
    whole = count - count % 4
    for i in range(0, whole, 4):
        a, b, c, d = matrix[i], matrix[i + 1], matrix[i + 2], matrix[i + 3]
        x0, x1, x2, x3 = vector[i], vector[i + 1], vector[i + 2], vector[i + 3]
        s0 = s1 = s2 = s3 = 0.0
        for j in range(i):
            x = vector[j]
            s0 += a[j] * x
            s1 += b[j] * x
            s2 += c[j] * x
            s3 += d[j] * x
            product[j] += a[j] * x0 + b[j] * x1 + c[j] * x2 + d[j] * x3
        product[i] = s0 + a[i] * x0 + b[i] * x1 + c[i] * x2 + d[i] * x3
        product[i + 1] = s1 + b[i] * x0 + b[i + 1] * x1 + c[i + 1] * x2 + d[i + 1] * x3
        product[i + 2] = s2 + c[i] * x0 + c[i + 1] * x1 + c[i + 2] * x2 + d[i + 2] * x3
        product[i + 3] = s3 + d[i] * x0 + d[i + 1] * x1 + d[i + 2] * x2 + d[i + 3] * x3
    for i in range(whole, count):
        row, total = matrix[i], matrix[i, i] * vector[i]
        for j in range(i):
            total += row[j] * vector[j]
            product[j] += row[j] * vector[i]
        product[i] = total


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cholesky_solve(matrix, right):
    """Solve the positive definite system in place of `right`; return whether it was fit for it."""
    count = len(matrix)
    lower, fit = cholesky(matrix)
    if not fit:
        return False
    for i in range(count):
        right[i] = (right[i] - dot(lower[i], right, i)) / lower[i, i]
    for i in range(count - 1, -1, -1):
        right[i] /= lower[i, i]
        for j in range(i):
            right[j] -= lower[i, j] * right[i]
    return True


@njit(nogil=True, cache=True)
def solve_positive(matrix, right):
    """Solve the positive semi-definite system in place of `right`; return how many directions it left out.

    Coinciding points make the matrix singular, each in the direction of their difference. Without
    it their weights come out equal, and the fit goes through their mean: the limit of a vanishing
    smoothing.
    """
    if len(matrix) == 0 or cholesky_solve(matrix, right):
        return 0
    eigenvalues, vectors = np.linalg.eigh(matrix)
    coefficients = np.ascontiguousarray(vectors.T) @ right
    least, dropped = SINGULAR * np.trace(matrix), 0
    for i in range(len(matrix)):
        if eigenvalues[i] > least:
            coefficients[i] /= eigenvalues[i]
        else:
            coefficients[i] = 0.0
            dropped += 1
    put(vectors @ coefficients, right)
    return dropped


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def solve_rows(lower, right):
    """Solve L Lᵀ x = b in place of each row of `right` (c, n): a row of L is read once for all of them.

    Those of `column_loops` are for hundreds of columns, which this is not.
    """
    count, columns = len(lower), len(right)
    for i in range(count):
        for k in range(columns):
            right[k, i] = (right[k, i] - dot(lower[i], right[k], i)) / lower[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(columns):
            right[k, i] /= lower[i, i]
            for j in range(i):
                right[k, j] -= lower[i, j] * right[k, i]


@njit(nogil=True, cache=True)
def solve_positive_rows(matrix, right):
    """Do what `solve_positive` does, for each row of `right` (c, n)."""
    lower, fit = cholesky(matrix)
    if fit:
        solve_rows(lower, right)
        return
    for k in range(len(right)):  # not `for row in right`: Numba takes such rows for strided ones, and warns
        solve_positive(matrix, right[k])


@njit(nogil=True, cache=True)
def solve_few(matrix, right):
    """Do what `solve_positive` does for a few unknowns, for which calling LAPACK takes longer than solving."""
    count, least, lower = len(matrix), SINGULAR * np.trace(matrix), matrix.copy()
    for i in range(count):
        for j in range(i + 1):
            for k in range(j):
                lower[i, j] -= lower[i, k] * lower[j, k]
            if j < i:
                lower[i, j] /= lower[j, j]
            elif lower[i, i] > least:
                lower[i, i] = math.sqrt(lower[i, i])
            else:
                return solve_positive(matrix, right)
    for i in range(count):
        for k in range(i):
            right[i] -= lower[i, k] * right[k]
        right[i] /= lower[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= lower[k, i] * right[k]
        right[i] /= lower[i, i]
    return 0


@njit(nogil=True, cache=True)
def solve_triangle(triangle, right):
    """Solve R x = b, R above the diagonal, in place of `right`."""
    for k in range(len(triangle) - 1, -1, -1):
        for j in range(k + 1, len(triangle)):
            right[k] -= triangle[k, j] * right[j]
        right[k] /= triangle[k, k]


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def invert_triangle(lower):
    """Return the inverse of a lower triangle: of blocks on its diagonal, and of twice as large ones by products.

    What stands below two inverses is −C⁻¹ B A⁻¹.
    """
    count = len(lower)
    inverse = np.zeros((count, count))
    for start in range(0, count, BLOCK):
        stop = min(start + BLOCK, count)
        for i in range(start, stop):
            row = inverse[i]
            row[i] = 1.0
            for k in range(start, i):
                factor, other = lower[i, k], inverse[k]
                for j in range(start, k + 1):
                    row[j] -= factor * other[j]
            for j in range(start, i + 1):
                row[j] /= lower[i, i]
    size = BLOCK
    while size < count:
        for start in range(0, count - size, 2 * size):
            middle, stop = start + size, min(start + 2 * size, count)
            first, last = inverse[start:middle, start:middle].copy(), inverse[middle:stop, middle:stop].copy()
            below = last @ (lower[middle:stop, start:middle].copy() @ first)
            for i in range(middle, stop):
                for j in range(start, middle):
                    inverse[i, j] = -below[i - middle, j - start]
        size *= 2
    return inverse
