"""The compiled loops of the cross-fade: the copies of a tile that reach a point, and their windowed sum.

A copy is a row of ten numbers: the point of the patch that it shows there, along and across; ±1, whether
mirrored, for both; its window and the first two derivatives of that along, and the same across.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit

MAX_COPIES = 9
"""Copies of a point: in each direction its own tile's and, at most, both neighbors'."""


class Layout(NamedTuple):
    """Copies in the plane.

    Lower corner of the first tile (2,), size of a tile (2,), half width of the fade (2,), axes along which every
    second copy is mirrored (2,), and the share of a tile by which each row across is moved along.
    """

    corner: Any
    tile: Any
    fade: Any
    flip: Any
    shift: float


@njit(nogil=True, cache=True)
def step_jet(u):
    """Return S(u) = 6u⁵ − 15u⁴ + 10u³, 0 below 0 and 1 above 1, with its first two derivatives."""
    s = min(max(u, 0.0), 1.0)
    rest = s * (1.0 - s)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * rest * rest, 60.0 * rest * (1.0 - 2.0 * s)


@njit(nogil=True, cache=True)
def write(rows, row, numbers):
    """Write six numbers into a row, one by one: NumPy's way makes an array of them first."""
    for k in range(6):
        rows[row, k] = numbers[k]


@njit(nogil=True, cache=True, error_model="numpy")
def along_axis(x, axis, layout, tiles):
    """Write (number, place in the patch, sign, window, its two derivatives) of tiles along an axis; return how many."""
    low, size, reach = layout.corner[axis], layout.tile[axis], layout.fade[axis]
    if reach == 0.0:
        write(tiles, 0, (0.0, x, 1.0, 1.0, 0.0, 0.0))
        return 1
    count, home = 0, math.floor((x - low) / size)
    # Beyond the bands the tile is alone, and its window is one.
    alone = reach <= x - home * size - low <= size - reach
    for step in range(0 if alone else -1, 1 if alone else 2):
        number = float(home + step)
        z, sign = x - number * size, 1.0
        t = z - low
        if layout.flip[axis] and (home + step) % 2 != 0:
            sign, z = -1.0, 2.0 * low + size - z
        if alone:
            write(tiles, 0, (number, z, sign, 1.0, 0.0, 0.0))
            count = 1
        elif -reach < t < size + reach:
            half = 0.5 / reach
            rise, fall = step_jet(half * (t + reach)), step_jet(half * (t - size + reach))
            first, second = half * (rise[1] - fall[1]), half * half * (rise[2] - fall[2])
            write(tiles, count, (number, z, sign, rise[0] - fall[0], first, second))
            count += 1
    return count


@njit(nogil=True, cache=True)
def copies_at(x, y, layout, rows, columns, copies):
    """Write the copies that reach the point (x, y), one a row of ten; return how many."""
    count = 0
    for j in range(along_axis(y, 1, layout, rows)):
        for i in range(along_axis(x - layout.shift * layout.tile[0] * rows[j, 0], 0, layout, columns)):
            copies[count, 0], copies[count, 1] = columns[i, 1], rows[j, 1]
            copies[count, 2], copies[count, 3] = columns[i, 2], rows[j, 2]
            for k in range(3):
                copies[count, 4 + k], copies[count, 7 + k] = columns[i, 3 + k], rows[j, 3 + k]
            count += 1
    return count


@njit(nogil=True, cache=True)
def count_copies(start, stop, folded, layout, counts):
    """Count the copies that reach point i into counts[i + 1]."""
    rows, columns, copies = np.empty((3, 6)), np.empty((3, 6)), np.empty((MAX_COPIES, 10))
    for i in range(start, stop):
        counts[i + 1] = copies_at(folded[i, 0], folded[i, 1], layout, rows, columns, copies)


@njit(nogil=True, cache=True)
def place_copies(start, stop, folded, layout, heads, points):
    """Write the points of the patch that the copies of point i show, from points[heads[i]] on."""
    rows, columns, copies = np.empty((3, 6)), np.empty((3, 6)), np.empty((MAX_COPIES, 10))
    for i in range(start, stop):
        for k in range(copies_at(folded[i, 0], folded[i, 1], layout, rows, columns, copies)):
            for a in range(folded.shape[1]):
                points[heads[i] + k, a] = copies[k, a] if a < 2 else folded[i, a]


@njit(nogil=True, cache=True)
def sum_copies(start, stop, folded, layout, heads, jets, level, sums, first):
    """Write Σ ω F of point i, jets of all copies being given, to column first + i of `sums`."""
    dimension = folded.shape[1]
    rows, columns, copies = np.empty((3, 6)), np.empty((3, 6)), np.empty((MAX_COPIES, 10))
    gradient, hessian, sign = np.zeros(dimension), np.zeros((dimension, dimension)), np.ones(dimension)
    for i in range(start, stop):
        sums[:, first + i] = 0.0
        for k in range(copies_at(folded[i, 0], folded[i, 1], layout, rows, columns, copies)):
            sign[0], sign[1] = copies[k, 2], copies[k, 3]
            u, v = copies[k, 4:7], copies[k, 7:10]
            gradient[0], gradient[1] = u[1] * v[0], u[0] * v[1]
            hessian[0, 0], hessian[0, 1], hessian[1, 1] = u[2] * v[0], u[1] * v[1], u[0] * v[2]
            add_windowed(u[0] * v[0], gradient, hessian, sign, jets[:, heads[i] + k], level, sums[:, first + i])


@njit(nogil=True, cache=True)
def add_windowed(window, gradient, hessian, sign, jet, level, total):
    """Add the jet of ω F to `total`; `sign` turns the gradient of F at the mirrored point into that of its copy."""
    total[0] += window * jet[0]
    if level == 0:
        return
    dimension = gradient.size
    for a in range(dimension):
        total[1 + a] += gradient[a] * jet[0] + window * sign[a] * jet[1 + a]
    row = 1 + dimension
    for a in range(dimension if level == 2 else 0):
        for b in range(a, dimension):
            mixed = gradient[a] * sign[b] * jet[1 + b] + gradient[b] * sign[a] * jet[1 + a]
            total[row] += hessian[a, b] * jet[0] + mixed + window * sign[a] * sign[b] * jet[row]
            row += 1
