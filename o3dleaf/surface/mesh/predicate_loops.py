"""On which side of a line or a plane a point lies: exactly, whatever the rounding.

A determinant in float64 decides where it is larger than its error bound; elsewhere it is summed as an expansion, a
sum of floats that do not overlap, whose largest has its sign (Shewchuk 1997, Discrete Comput. Geom. 18, 305). Exact
as long as no product of three coordinates leaves the range of float64: between 1e-90 and 1e90.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit

EPSILON = 2.0**-53
PLANE_BOUND = (7 + 56 * EPSILON) * EPSILON
LINE_BOUND = (3 + 16 * EPSILON) * EPSILON
"""Shewchuk's bounds on the error of the two determinants, relative to their permanents."""

SPLITTER = 2.0**27 + 1


@njit(nogil=True, cache=True)
def two_sum(a, b):
    """Return a + b as a float and what it lacks, exactly."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@njit(nogil=True, cache=True)
def two_product(a, b):
    """Return a · b as a float and what it lacks, exactly."""
    product = a * b
    big = SPLITTER * a
    a_high = big - (big - a)
    big = SPLITTER * b
    b_high = big - (big - b)
    a_low, b_low = a - a_high, b - b_high
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


@njit(nogil=True, cache=True)
def grow(expansion, size, addend):
    """Add a float to an expansion of `size` parts, in place, and return its new size."""
    kept = 0
    for k in range(size):
        addend, rest = two_sum(addend, expansion[k])
        if rest != 0:
            expansion[kept] = rest
            kept += 1
    if addend != 0:
        expansion[kept] = addend
        kept += 1
    return kept


@njit(nogil=True, cache=True)
def grow_product(expansion, size, factors, x, y, z):
    """Add x · y · z, three rows of sums of two `factors`, to an expansion, and return its new size."""
    for k in range(8):
        a, b, c = factors[x, k & 1], factors[y, k >> 1 & 1], factors[z, k >> 2]
        if a != 0 and b != 0 and c != 0:
            product, rest = two_product(a, b)
            for part in two_product(rest, c):
                size = grow(expansion, size, part)
            for part in two_product(product, c):
                size = grow(expansion, size, part)
    return size


@njit(nogil=True, cache=True)
def sign_of(expansion, size):
    """Return the sign of an expansion."""
    return 0 if size == 0 else 1 if expansion[size - 1] > 0 else -1


@njit(nogil=True, cache=True)
def plane_side(v, i, j, k, m):
    """Return the sign of det(v_i − v_m, v_j − v_m, v_k − v_m): on which side of a plane point m is; 0 for in it."""
    ax, ay, az = v[i, 0] - v[m, 0], v[i, 1] - v[m, 1], v[i, 2] - v[m, 2]
    bx, by, bz = v[j, 0] - v[m, 0], v[j, 1] - v[m, 1], v[j, 2] - v[m, 2]
    cx, cy, cz = v[k, 0] - v[m, 0], v[k, 1] - v[m, 1], v[k, 2] - v[m, 2]
    bc, cb, ca, ac, ab, ba = bx * cy, cx * by, cx * ay, ax * cy, ax * by, bx * ay
    determinant = az * (bc - cb) + bz * (ca - ac) + cz * (ab - ba)
    permanent = abs(az) * (abs(bc) + abs(cb)) + abs(bz) * (abs(ca) + abs(ac)) + abs(cz) * (abs(ab) + abs(ba))
    if abs(determinant) > PLANE_BOUND * permanent:
        return 1 if determinant > 0 else -1
    return 0 if permanent == 0 else _exact_plane_side(v, i, j, k, m)


@njit(nogil=True, cache=True)
def _exact_plane_side(v, i, j, k, m):
    """Return the same from six exact products of exact differences."""
    factors, expansion, size = np.empty((18, 2)), np.empty(256), 0
    for row, node in enumerate((i, j, k)):
        for axis in range(3):
            high, low = two_sum(v[node, axis], -v[m, axis])
            factors[3 * row + axis, 0], factors[3 * row + axis, 1] = high, low
            factors[9 + 3 * row + axis, 0], factors[9 + 3 * row + axis, 1] = -high, -low
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        size = grow_product(expansion, size, factors, axis, 3 + one, 6 + other)
        size = grow_product(expansion, size, factors, 9 + axis, 3 + other, 6 + one)
    return sign_of(expansion, size)


@njit(nogil=True, cache=True)
def sure_turn(ax, ay, bx, by):
    """Return the sign of det(a, b) for differences of coordinates that were rounded once; 0 where it is not sure."""
    left, right = ax * by, ay * bx
    determinant, bound = left - right, LINE_BOUND * (abs(left) + abs(right))
    return int(determinant > bound) - int(determinant < -bound)


@njit(nogil=True, cache=True)
def line_side(v, axis, i, j, k):
    """Return the sign of det(v_i − v_k, v_j − v_k), seen along an axis: 1 for counter-clockwise, 0 for in a line."""
    x, y = (axis + 1) % 3, (axis + 2) % 3
    left, right = (v[i, x] - v[k, x]) * (v[j, y] - v[k, y]), (v[i, y] - v[k, y]) * (v[j, x] - v[k, x])
    determinant, permanent = left - right, abs(left) + abs(right)
    if abs(determinant) > LINE_BOUND * permanent:
        return 1 if determinant > 0 else -1
    return 0 if permanent == 0 else _exact_line_side(v, x, y, i, j, k)


@njit(nogil=True, cache=True)
def _exact_line_side(v, x, y, i, j, k):
    """Return the same from two exact products of exact differences."""
    factors, expansion = np.empty((5, 2)), np.empty(64)
    factors[0, 0], factors[0, 1] = two_sum(v[i, x], -v[k, x])
    factors[1, 0], factors[1, 1] = two_sum(v[j, y], -v[k, y])
    factors[2, 0], factors[2, 1] = two_sum(v[k, y], -v[i, y])
    factors[3, 0], factors[3, 1] = two_sum(v[j, x], -v[k, x])
    factors[4, 0], factors[4, 1] = 1.0, 0.0
    size = grow_product(expansion, 0, factors, 0, 1, 4)
    return sign_of(expansion, grow_product(expansion, size, factors, 2, 3, 4))
