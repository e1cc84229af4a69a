"""The compiled loop that finds how high places lie over the surface of points around them."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import solve_few

TINY = np.finfo(np.float64).tiny
RIDGE = 1e-9
"""Of a point, added to the diagonal: points on a curve hold no quadric."""


@njit(nogil=True, cache=True)
def find_heights(at, axes, points, rows, corner, height, spread, start, stop):
    """Write the heights (n,) of places over quadrics through points around them, fitted by Huber's loss.

    Parameters
    ----------
    at, axes : (n, 3) and (n, 3, 3) ndarrays
        The places, and in rows two tangents and the normal of each.
    points, rows : (p, 3) and (n, k) ndarrays
        Points, and which of them are around each place, the farthest last.
    corner : float
        Medians of the residuals from which on a point counts less.
    height : (n,) ndarray
    spread : (n,) ndarray
        Distance, in the plane, of the mean of the points over their root mean square distance from the place.
    """
    count = rows.shape[1]
    terms, up = np.empty((count, 6)), np.empty(count)
    off, weight = np.empty(count), np.empty(count)
    normal, fit = np.empty((6, 6)), np.empty(6)
    for i in range(start, stop):
        size = max(lay_out(at[i], axes[i], points, rows[i], terms, up), TINY)
        x, y, square = 0.0, 0.0, 0.0
        for m in range(count):
            u, v = terms[m, 1] / size, terms[m, 2] / size
            terms[m, 0], terms[m, 1], terms[m, 2] = 1.0, u, v
            terms[m, 3], terms[m, 4], terms[m, 5] = u * u, u * v, v * v
            up[m] /= size
            x, y, square = x + u, y + v, square + u * u + v * v
        spread[i] = math.sqrt((x * x + y * y) / (count * square)) if square > 0 else np.inf
        weight[:] = 1.0
        fit_quadric(terms, up, weight, normal, fit)
        for m in range(count):
            off[m] = abs(up[m] - value_of(terms, m, fit))
        most = corner * np.median(off) + TINY
        for m in range(count):
            weight[m] = 1 / max(1.0, off[m] / most)
        fit_quadric(terms, up, weight, normal, fit)
        height[i] = -size * fit[0]


@njit(nogil=True, cache=True)
def lay_out(place, axes, points, rows, terms, up):
    """Write where points lie along two tangents, and how high, as seen from a place; return how far the last one is."""
    square = 0.0
    for m in range(len(rows)):
        x, y, z = points[rows[m], 0] - place[0], points[rows[m], 1] - place[1], points[rows[m], 2] - place[2]
        terms[m, 1] = x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2]
        terms[m, 2] = x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2]
        up[m] = x * axes[2, 0] + y * axes[2, 1] + z * axes[2, 2]
        square = x * x + y * y + z * z
    return math.sqrt(square)


@njit(nogil=True, cache=True)
def fit_quadric(terms, up, weight, normal, fit):
    """Write the six coefficients of a weighted fit of terms (k, 6) to heights (k,)."""
    normal[:] = 0.0
    fit[:] = 0.0
    for m in range(len(up)):
        for a in range(6):
            weighted = weight[m] * terms[m, a]
            fit[a] += weighted * up[m]
            for b in range(a + 1):
                normal[a, b] += weighted * terms[m, b]
    for a in range(6):
        normal[a, a] += RIDGE * len(up)
        for b in range(a):
            normal[b, a] = normal[a, b]
    solve_few(normal, fit)


@njit(nogil=True, cache=True)
def value_of(terms, row, fit):
    """Return the height of a quadric at a point."""
    value = 0.0
    for a in range(6):
        value += terms[row, a] * fit[a]
    return value
