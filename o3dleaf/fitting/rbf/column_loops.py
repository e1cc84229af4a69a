"""The compiled solution of a factored local system for many columns of values, without the interpreter's lock.

SciPy's triangular solvers keep that lock, so that threads would wait for each other.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit

BLOCK = 48
"""Rows of L that are solved for at once: all but the blocks on its diagonal are matrix products."""


@njit(nogil=True, cache=True)
def solve_lower(lower, right):
    """Solve L X = B in place of B, (n, m)."""
    for start in range(0, len(lower), BLOCK):
        stop = min(start + BLOCK, len(lower))
        if start > 0:
            rows = right[start:stop]
            rows -= np.ascontiguousarray(lower[start:stop, :start]) @ right[:start]
        for i in range(start, stop):
            row = right[i]
            for k in range(start, i):
                row -= lower[i, k] * right[k]
            row /= lower[i, i]


@njit(nogil=True, cache=True)
def solve_upper(lower, right):
    """Solve Lᵀ X = B in place of B, (n, m)."""
    for start in range((len(lower) - 1) // BLOCK * BLOCK, -1, -BLOCK):
        stop = min(start + BLOCK, len(lower))
        if stop < len(lower):
            rows = right[start:stop]
            rows -= np.ascontiguousarray(lower[stop:, start:stop].T) @ right[stop:]
        for i in range(stop - 1, start - 1, -1):
            row = right[i]
            for k in range(i + 1, stop):
                row -= lower[k, i] * right[k]
            row /= lower[i, i]


@njit(nogil=True, cache=True)
def solve_columns(reflectors, triangle, right, basis, above, cholesky, values):
    """Return the (n, m) λ and the (q, m) a of (n, m) values, which are overwritten."""
    rank = len(right)
    values -= reflectors.T @ (triangle.T @ (reflectors @ values))
    weights = values.copy()
    weights[:rank] = 0.0
    solve_lower(cholesky, weights[rank:])
    solve_upper(cholesky, weights[rank:])
    reduced = values[:rank] - above @ weights[rank:]
    for i in range(rank - 1, -1, -1):
        row = reduced[i]
        for k in range(i + 1, rank):
            row -= right[i, k] * reduced[k]
        row /= right[i, i]
    weights -= reflectors.T @ (triangle @ (reflectors @ weights))
    return weights, basis @ reduced
