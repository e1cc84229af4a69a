"""The compiled loops that evaluate one interpolant; those that solve for it are in `solve.py`.

Everything works in a ball's unit coordinates z = (x − c)/R, in which the tail's monomials are well
scaled and φ stays of order one. Points are stored (d, n), so that the loop over n vectorises.
Functions are serial and release the GIL; `o3dleaf.parallel` drives them.
"""

import math

import numpy as np
from numba import njit

REASSOCIATE = {"reassoc", "contract", "nsz"}
"""What the sums need to vectorise; NaN and infinity keep their meaning."""


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
def radial_values(power, squared, count):
    """Turn squared distances into φ(r), in place."""
    if power == 1:
        for j in range(count):
            squared[j] = -math.sqrt(squared[j])
    elif power == 3:
        for j in range(count):
            squared[j] *= math.sqrt(squared[j])
    else:
        half = power // 2
        sign = 1.0 if half % 2 else -1.0
        for j in range(count):
            r2 = squared[j]
            value = sign
            for _ in range(half):
                value *= r2
            if power % 2:
                squared[j] = value * math.sqrt(r2)
            elif r2 > 0.0:
                squared[j] = 0.5 * value * math.log(r2)
            else:
                squared[j] = 0.0


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def radial_slopes(power, squared, count):
    """Turn squared distances into φ′(r)/r, in place; 0 at r = 0, where it multiplies the vector z − z_j = 0."""
    if power == 3:
        for j in range(count):
            squared[j] = 3.0 * math.sqrt(squared[j])
        return
    half = power // 2
    sign = 1.0 if half % 2 else -1.0
    for j in range(count):
        r2 = squared[j]
        if r2 > 0.0:
            value = sign
            for _ in range(half - 1):
                value *= r2
            if power == 1:
                squared[j] = -1.0 / math.sqrt(r2)
            elif power % 2:
                squared[j] = power * value * math.sqrt(r2)
            else:
                squared[j] = value * (0.5 * power * math.log(r2) + 1.0)


@njit(nogil=True, cache=True)
def monomial(z, exponent):
    """Return the monomial z^exponent."""
    value = 1.0
    for axis in range(z.size):
        for _ in range(exponent[axis]):
            value *= z[axis]
    return value


@njit(nogil=True, cache=True)
def tail_steps(exponents):
    """Return (q, 2) numbers: monomial k is monomial steps[k, 0] times coordinate steps[k, 1]; the first is 1."""
    steps = np.zeros((len(exponents), 2), dtype=np.int64)
    for k in range(1, len(exponents)):
        axis = int(np.argmax(exponents[k]))
        parent = exponents[k].copy()
        parent[axis] -= 1
        for j in range(k):
            if np.all(exponents[j] == parent):
                steps[k, 0], steps[k, 1] = j, axis
    return steps


@njit(nogil=True, cache=True)
def tail_value(z, tail, steps, terms):
    """Return Σ a_k p_k(z), and leave the p_k(z) in `terms`."""
    if tail.size == 0:
        return 0.0
    terms[0] = 1.0
    value = tail[0]
    for k in range(1, tail.size):
        terms[k] = terms[steps[k, 0]] * z[steps[k, 1]]
        value += tail[k] * terms[k]
    return value


@njit(nogil=True, cache=True)
def tail_slope(z, along, tail, steps, terms, slopes):
    """Return Σ a_k ∂p_k/∂z along one axis, by the product rule on `terms` as `tail_value` left them."""
    value = 0.0
    slopes[0] = 0.0
    for k in range(1, tail.size):
        parent, axis = steps[k, 0], steps[k, 1]
        slopes[k] = slopes[parent] * z[axis]
        if axis == along:
            slopes[k] += terms[parent]
        value += tail[k] * slopes[k]
    return value


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def dot(a, b, count):
    """Return Σ a_j b_j over the first `count` entries."""
    total = 0.0
    for j in range(count):
        total += a[j] * b[j]
    return total


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_sum(z, points, weights):
    """Return Σ λ_j r_j³ in two or three dimensions, in one pass: the sum that nearly all of the time goes into."""
    total = 0.0
    if z.size == 3:
        for j in range(weights.size):
            x, y, w = z[0] - points[0, j], z[1] - points[1, j], z[2] - points[2, j]
            square = x * x + y * y + w * w
            total += weights[j] * square * math.sqrt(square)
    else:
        for j in range(weights.size):
            x, y = z[0] - points[0, j], z[1] - points[1, j]
            square = x * x + y * y
            total += weights[j] * square * math.sqrt(square)
    return total


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_slopes(z, points, weights, out):
    """Write Σ 3 λ_j r_j (z − z_j) into `out`, in two or three dimensions, in one pass."""
    along_x = along_y = along_z = 0.0
    if z.size == 3:
        for j in range(weights.size):
            x, y, w = z[0] - points[0, j], z[1] - points[1, j], z[2] - points[2, j]
            slope = 3.0 * weights[j] * math.sqrt(x * x + y * y + w * w)
            along_x += slope * x
            along_y += slope * y
            along_z += slope * w
        out[2] = along_z
    else:
        for j in range(weights.size):
            x, y = z[0] - points[0, j], z[1] - points[1, j]
            slope = 3.0 * weights[j] * math.sqrt(x * x + y * y)
            along_x += slope * x
            along_y += slope * y
    out[0] = along_x
    out[1] = along_y


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def local_value(z, points, weights, tail, steps, power, scratch):
    """Return Σ λ_j φ(|z − z_j|) + Σ a_k p_k(z) of one interpolant at one point."""
    count = points.shape[1]
    if power == 3 and 2 <= z.size <= 3:
        value = cubic_sum(z, points, weights)
    else:
        squared_distances(z, points, count, scratch[0])
        radial_values(power, scratch[0], count)
        value = dot(weights, scratch[0], count)
    return value + tail_value(z, tail, steps, scratch[0])


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def local_gradient(z, points, weights, tail, steps, power, scratch, out):
    """Write Σ λ_j φ′(r_j)/r_j (z − z_j) + Σ a_k ∇p_k(z) into `out`."""
    count = points.shape[1]
    if power == 3 and 2 <= z.size <= 3:
        cubic_slopes(z, points, weights, out)
    else:
        slopes = scratch[0]
        squared_distances(z, points, count, slopes)
        radial_slopes(power, slopes, count)
        for j in range(count):
            slopes[j] *= weights[j]
        for axis in range(z.size):
            total = 0.0
            for j in range(count):
                total += slopes[j] * (z[axis] - points[axis, j])
            out[axis] = total
    if tail.size:
        tail_value(z, tail, steps, scratch[0])
        for axis in range(z.size):
            out[axis] += tail_slope(z, axis, tail, steps, scratch[0], scratch[1])


@njit(nogil=True, cache=True)
def evaluate(start, stop, queries, points, weights, tail, exponents, power, values, gradients):
    """Fill values[start:stop] and, where `gradients` has rows, gradients[start:stop] of one interpolant."""
    scratch = np.empty((2, max(points.shape[1], tail.size)))
    steps = tail_steps(exponents)
    for i in range(start, stop):
        values[i] = local_value(queries[i], points, weights, tail, steps, power, scratch)
        if len(gradients):
            local_gradient(queries[i], points, weights, tail, steps, power, scratch, gradients[i])
