"""The compiled loops over distances: φ, φ′/r and (φ′/r)′/r of polyharmonic kernels, sums, roots.

Functions are serial and release the GIL; `o3dleaf.core.parallel` drives them.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit

REASSOCIATE = {"reassoc", "contract", "nsz"}
"""What the sums need to vectorize; NaN and infinity keep their meaning."""

HALVED_EXPONENT = 0x5FE6EB50C7B537A9
"""Less half of the bits of a double, the bits of its inverse root to 3.5 % (Lomont 2003)."""


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def squared_distances(z, points, count, out):
    """Write |z − z_j|² into out[:count]."""
    for j in range(count):
        difference = z[0] - points[0, j]
        out[j] = difference * difference
    for axis in range(1, points.shape[0]):
        coordinate = z[axis]
        for j in range(count):
            difference = coordinate - points[axis, j]
            out[j] += difference * difference


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def radial_values(power, squared, count, out):
    """Write φ(r) of squared distances; `out` may be `squared`."""
    if power == 1:
        for j in range(count):
            out[j] = -math.sqrt(squared[j])
    elif power == 3:
        for j in range(count):
            out[j] = squared[j] * math.sqrt(squared[j])
    else:
        half = power // 2
        sign = 1.0 if half % 2 else -1.0
        for j in range(count):
            r2 = squared[j]
            value = sign
            for _ in range(half):
                value *= r2
            if power % 2:
                out[j] = value * math.sqrt(r2)
            elif r2 > 0.0:
                out[j] = 0.5 * value * math.log(r2)
            else:
                out[j] = 0.0


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def derivatives_over_r(power, squared, count, out):
    """Write ψ = φ′(r)/r of squared distances; 0 at r = 0, where it multiplies the vector z − z_j = 0."""
    half = power // 2
    sign = 1.0 if half % 2 else -1.0
    for j in range(count):
        r2 = squared[j]
        out[j] = 0.0
        if r2 > 0.0:
            value = sign
            for _ in range(half - 1):
                value *= r2
            if power == 1:
                out[j] = -1.0 / math.sqrt(r2)
            elif power % 2:
                out[j] = power * value * math.sqrt(r2)
            else:
                out[j] = value * (0.5 * power * math.log(r2) + 1.0)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def second_derivatives_over_r(power, squared, count, out):
    """Write ψ′(r)/r, ψ = φ′/r, of squared distances, for a power of 3 or more; 0 at r = 0, as `derivatives_over_r`."""
    half = power // 2
    sign = 1.0 if half % 2 else -1.0
    for j in range(count):
        r2 = squared[j]
        out[j] = 0.0
        if r2 > 0.0:
            value = sign
            for _ in range(half - 2):
                value *= r2
            if power == 3:
                out[j] = 3.0 / math.sqrt(r2)
            elif power % 2:
                out[j] = power * (power - 2) * value * math.sqrt(r2)
            else:
                out[j] = value * (0.5 * power * (power - 2) * math.log(r2) + 2 * power - 2)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def square_root(square):
    """Return √s to a rounding by multiplications alone: 1/√s from the bits of s, refined twice by its Taylor series."""
    inverse = np.int64(HALVED_EXPONENT - (np.float64(square).view(np.int64) >> 1)).view(np.float64)
    rest = 1.0 - square * inverse * inverse
    inverse += inverse * rest * (0.5 + rest * (0.375 + rest * 0.3125))
    root = square * inverse
    rest = 1.0 - root * inverse
    return root + root * rest * (0.5 + rest * 0.375)


@njit(nogil=True, cache=True)
def put(source, target):
    """Copy `source` (n,) into `target`.

    Numba compiles a message about shapes into every function that assigns to a slice, and into all that call it.
    """
    for i in range(len(source)):
        target[i] = source[i]


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def dot(a, b, count):
    """Return Σ a_j b_j over the first `count` entries."""
    total = 0.0
    for j in range(count):
        total += a[j] * b[j]
    return total
