"""The compiled loops that evaluate interpolants; those that solve for them are in `solve.py`.

Everything works in a ball's unit coordinates z = (x − c)/R, in which the tail's monomials are well
scaled and φ stays of order one. Points are stored (d, n), so that the loop over n vectorises.
Functions are serial and release the GIL; `o3dleaf.core.parallel` drives them.

What is found at a point is its *jet*: the value, the d slopes, the d(d + 1)/2 second derivatives
∂_a∂_b with a <= b, in this order, up to the `order` that is asked for (0, 1 or 2). Jets of many points are the
columns of one array, one row a component.
"""

import math

import numpy as np
from numba import njit

REASSOCIATE = {"reassoc", "contract", "nsz"}
"""What the sums need to vectorise; NaN and infinity keep their meaning."""


HALVED_EXPONENT = 0x5FE6EB50C7B537A9
"""Less half of the bits of a double, the bits of its inverse root to 3.5 % (Lomont 2003)."""


@njit(nogil=True, cache=True)
def jet_size(dimension, order):
    """Return the number of components of a jet: 1, 1 + d, or 1 + d + d(d + 1)/2."""
    if order == 0:
        return 1
    return 1 + dimension + (dimension * (dimension + 1) // 2 if order == 2 else 0)


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
def radial_slopes(power, squared, count, out):
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
def radial_bends(power, squared, count, out):
    """Write ψ′(r)/r, ψ = φ′/r, of squared distances, for a power of 3 or more; 0 at r = 0, as `radial_slopes`."""
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


@njit(nogil=True, cache=True)
def monomial(z, exponent):
    """Return the monomial z^exponent."""
    value = 1.0
    for axis in range(exponent.size):
        for _ in range(exponent[axis]):
            value *= z[axis]
    return value


@njit(nogil=True, cache=True)
def lower_exponents(exponents):
    """Return (d, q) numbers: the monomial that is monomial k divided by the coordinate of the axis, −1 for none."""
    lowered = np.full((exponents.shape[1], len(exponents)), -1)
    for axis in range(exponents.shape[1]):
        for k in range(len(exponents)):
            wanted = exponents[k].copy()
            wanted[axis] -= 1
            for j in range(k):
                if np.all(exponents[j] == wanted):
                    lowered[axis, k] = j
    return lowered


@njit(nogil=True, cache=True)
def tail_derivatives(tail, exponents, lowered, order, coefficients):
    """Write the (jet, q) coefficients of a tail and of its derivatives, polynomials in the same monomials."""
    dimension, terms = lowered.shape
    for k in range(terms):
        coefficients[0, k] = tail[k]
    if order == 0:
        return
    coefficients[1:] = 0.0
    row = 1 + dimension
    for a in range(dimension):
        for k in range(terms):
            if lowered[a, k] >= 0:
                coefficients[1 + a, lowered[a, k]] += exponents[k, a] * tail[k]
    for a in range(dimension if order == 2 else 0):
        for b in range(a, dimension):
            for k in range(terms):
                if lowered[b, k] >= 0:
                    coefficients[row, lowered[b, k]] += exponents[k, b] * coefficients[1 + a, k]
            row += 1


@njit(nogil=True, cache=True)
def tail_jets(z, count, coefficients, lowered, terms, jets):
    """Write the jets of a tail at the columns of z (d, ·); `terms` (q, ·) is scratch.

    Without fast-math: a column's bits do not depend on its place among the others.
    """
    dimension, columns = lowered.shape
    for row in range(len(coefficients)):
        jets[row, :count] = 0.0
    for k in range(columns):
        axis = 0
        while axis < dimension and lowered[axis, k] < 0:
            axis += 1
        term = terms[k]
        if axis == dimension:
            term[:count] = 1.0
        else:
            coordinate, parent = z[axis], terms[lowered[axis, k]]
            for i in range(count):
                term[i] = parent[i] * coordinate[i]
        for row in range(len(coefficients)):
            coefficient, jet = coefficients[row, k], jets[row]
            if coefficient != 0.0:
                for i in range(count):
                    jet[i] += coefficient * term[i]


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


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def square_root(square):
    """Return √s to a rounding by multiplications alone: 1/√s from the bits of s, refined twice by its Taylor series."""
    inverse = np.int64(HALVED_EXPONENT - (np.float64(square).view(np.int64) >> 1)).view(np.float64)
    rest = 1.0 - square * inverse * inverse
    inverse += inverse * rest * (0.5 + rest * (0.375 + rest * 0.3125))
    root = square * inverse
    rest = 1.0 - root * inverse
    return root + root * rest * (0.5 + rest * 0.375)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_value(x, y, z, xs, ys, zs, weights):
    """Return Σ λ_j r_j³ in one pass: the sum that nearly all of the time goes into.

    Half of the roots are taken by the processor's divider and half by its multipliers, which work
    side by side: a fifth faster than either alone.
    """
    total = 0.0
    half = weights.size // 2
    for j in range(half):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        square = a * a + b * b + c * c
        total += weights[j] * square * math.sqrt(square)
        k = half + j
        a, b, c = x - xs[k], y - ys[k], z - zs[k]
        square = a * a + b * b + c * c
        total += weights[k] * square * square_root(square)
    for j in range(2 * half, weights.size):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        square = a * a + b * b + c * c
        total += weights[j] * square * math.sqrt(square)
    return total


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_value_single(x, y, z, xs, ys, zs, weights):
    """Return Σ λ_j r_j³ in one pass and in float32, whose roots are cheap."""
    total = np.float32(0)
    for j in range(weights.size):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        square = a * a + b * b + c * c
        total += weights[j] * square * np.sqrt(square)
    return total


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_slopes(x, y, z, xs, ys, zs, weights):
    """Return Σ λ_j r_j³ and Σ λ_j r_j (z − z_j), a third of its slopes, in one pass."""
    total = along_x = along_y = along_z = weights.dtype.type(0)
    for j in range(weights.size):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        square = a * a + b * b + c * c
        slope = weights[j] * np.sqrt(square)
        total += slope * square
        along_x += slope * a
        along_y += slope * b
        along_z += slope * c
    return total, (along_x, along_y, along_z)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE, error_model="numpy")
def cubic_bends(x, y, z, xs, ys, zs, weights):
    """Return Σ λ_j r_j and Σ λ_j d dᵀ/r_j, d = z − z_j (xx, xy, xz, yy, yz, zz): a third of the second derivatives."""
    total = xx = xy = xz = yy = yz = zz = weights.dtype.type(0)
    tiny = weights.dtype.type(1e-18)  # float32 must hold λ_j/tiny
    for j in range(weights.size):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        root = np.sqrt(a * a + b * b + c * c)
        total += weights[j] * root
        # At a data site d is zero, and so is d dᵀ/r.
        slope = weights[j] / (root + tiny)
        xx += slope * a * a
        xy += slope * a * b
        xz += slope * a * c
        yy += slope * b * b
        yz += slope * b * c
        zz += slope * c * c
    return total, (xx, xy, xz, yy, yz, zz)


@njit(nogil=True, cache=True)
def add_cubic_jets(z, count, points, weights, order, nought, jets):
    """Add the jets of Σ λ_j r_j³, in up to three dimensions, to those of the columns of z; `nought` holds n zeros."""
    dimension = len(points)
    kind = weights.dtype.type
    xs, ys, zs = points[0], nought, nought
    if dimension > 1:
        ys = points[1]
    if dimension > 2:
        zs = points[2]
    for i in range(count):
        x = kind(z[0, i])
        y = kind(z[1, i]) if dimension > 1 else kind(0)
        w = kind(z[2, i]) if dimension > 2 else kind(0)
        if order == 0:
            if weights.itemsize == 4:
                jets[0, i] += cubic_value_single(x, y, w, xs, ys, zs, weights)
            else:
                jets[0, i] += cubic_value(x, y, w, xs, ys, zs, weights)
            continue
        total, slopes = cubic_slopes(x, y, w, xs, ys, zs, weights)
        jets[0, i] += total
        for a in range(dimension):
            jets[1 + a, i] += 3.0 * slopes[a]
        if order == 2:
            trace, bends = cubic_bends(x, y, w, xs, ys, zs, weights)
            row = 1 + dimension
            for a in range(dimension):
                jets[row, i] += 3.0 * trace
                for b in range(a, dimension):
                    jets[row, i] += 3.0 * bends[a * (5 - a) // 2 + b]
                    row += 1


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def add_radial_jets(z, count, points, weights, power, order, scratch, jets):
    """Add the jets of Σ λ_j φ(r_j) to those of the columns of z, for any power and dimension."""
    dimension, sites = points.shape
    squared, radial = scratch[0], scratch[1]
    for i in range(count):
        at = z[:, i]
        squared_distances(at, points, sites, squared)
        radial_values(power, squared, sites, radial)
        jets[0, i] += dot(weights, radial, sites)
        if order == 0:
            continue
        radial_slopes(power, squared, sites, radial)
        trace = dot(weights, radial, sites)
        for a in range(dimension):
            total = 0.0
            for j in range(sites):
                total += weights[j] * radial[j] * (at[a] - points[a, j])
            jets[1 + a, i] += total
        if order == 2:
            radial_bends(power, squared, sites, radial)
            row = 1 + dimension
            for a in range(dimension):
                jets[row, i] += trace
                for b in range(a, dimension):
                    total = 0.0
                    for j in range(sites):
                        total += weights[j] * radial[j] * (at[a] - points[a, j]) * (at[b] - points[b, j])
                    jets[row, i] += total
                    row += 1


@njit(nogil=True, cache=True)
def local_jets(z, count, points, weights, coefficients, lowered, power, order, terms, scratch, jets):
    """Write the jets of Σ λ_j φ(|z − z_j|) + Σ a_k p_k(z) at the first `count` columns of z (d, ·).

    Parameters
    ----------
    points, weights : (d, n), (n,)
        Of one kind, float64 or float32, in which the sums over the points are formed.
    coefficients : (jet, q)
        See `tail_derivatives`.
    terms, scratch : (q, ·), (3, n or more)
        Working space; scratch[2] holds zeros.
    jets : (jet, ·)
    """
    tail_jets(z, count, coefficients, lowered, terms, jets)
    if power == 3 and len(points) <= 3:
        add_cubic_jets(z, count, points, weights, order, scratch[2], jets)
    else:
        add_radial_jets(z, count, points, weights, power, order, scratch, jets)


@njit(nogil=True, cache=True)
def evaluate(start, stop, queries, points, weights, tail, exponents, power, order, jets):
    """Fill the jets of one interpolant at the columns start:stop of `queries` (d, n)."""
    lowered = lower_exponents(exponents)
    coefficients = np.empty((jet_size(len(points), order), tail.size))
    tail_derivatives(tail, exponents, lowered, order, coefficients)
    terms = np.empty((len(exponents), stop - start))
    scratch = np.zeros((3, points.shape[1]), dtype=points.dtype)
    z, part = queries[:, start:stop], jets[:, start:stop]
    local_jets(z, stop - start, points, weights, coefficients, lowered, power, order, terms, scratch, part)
