"""The compiled loops that evaluate interpolants; those that solve for them are in `solve_loops`.

Everything works in a ball's unit coordinates z = (x − c)/R, in which the tail's monomials are well
scaled and φ stays of order one. Points are stored (d, n), so that the loop over n vectorizes.
Functions are serial and release the GIL; `o3dleaf.core.parallel` drives them.

What is computed at a point is its *jet*: the value, the gradient of d components, the d(d + 1)/2 second derivatives
∂_a∂_b with a <= b, in this order, up to the `order` that is asked for (0, 1 or 2). Jets of many points are the
columns of one array, one row a component.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.radial_loops import (
    REASSOCIATE,
    derivatives_over_r,
    dot,
    radial_values,
    second_derivatives_over_r,
    square_root,
    squared_distances,
)


@njit(nogil=True, cache=True)
def jet_size(dimension, order):
    """Return the number of components of a jet: 1, 1 + d, or 1 + d + d(d + 1)/2."""
    if order == 0:
        return 1
    return 1 + dimension + (dimension * (dimension + 1) // 2 if order == 2 else 0)


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
def cubic_gradient(x, y, z, xs, ys, zs, weights):
    """Return Σ λ_j r_j³ and Σ λ_j r_j (z − z_j), a third of its gradient, in one pass."""
    total = along_x = along_y = along_z = weights.dtype.type(0)
    for j in range(weights.size):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        square = a * a + b * b + c * c
        scaled = weights[j] * np.sqrt(square)
        total += scaled * square
        along_x += scaled * a
        along_y += scaled * b
        along_z += scaled * c
    return total, (along_x, along_y, along_z)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE, error_model="numpy")
def cubic_hessian(x, y, z, xs, ys, zs, weights):
    """Return Σ λ_j r_j and Σ λ_j d dᵀ/r_j, d = z − z_j (xx, xy, xz, yy, yz, zz): a third of the second derivatives."""
    total = xx = xy = xz = yy = yz = zz = weights.dtype.type(0)
    tiny = weights.dtype.type(1e-18)  # λ_j/tiny must be a float32
    for j in range(weights.size):
        a, b, c = x - xs[j], y - ys[j], z - zs[j]
        root = np.sqrt(a * a + b * b + c * c)
        total += weights[j] * root
        # At a data site d is zero, and so is d dᵀ/r.
        scaled = weights[j] / (root + tiny)
        xx += scaled * a * a
        xy += scaled * a * b
        xz += scaled * a * c
        yy += scaled * b * b
        yz += scaled * b * c
        zz += scaled * c * c
    return total, (xx, xy, xz, yy, yz, zz)


@njit(nogil=True, cache=True)
def add_cubic_jets(z, count, points, weights, order, nought, jets):
    """Add the jets of Σ λ_j r_j³, in up to three dimensions, to those of the columns of z; `nought` are n zeros."""
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
        total, gradient = cubic_gradient(x, y, w, xs, ys, zs, weights)
        jets[0, i] += total
        for a in range(dimension):
            jets[1 + a, i] += 3.0 * gradient[a]
        if order == 2:
            trace, hessian = cubic_hessian(x, y, w, xs, ys, zs, weights)
            row = 1 + dimension
            for a in range(dimension):
                jets[row, i] += 3.0 * trace
                for b in range(a, dimension):
                    jets[row, i] += 3.0 * hessian[a * (5 - a) // 2 + b]
                    row += 1


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def add_radial_jets(z, count, points, weights, power, order, scratch, jets):
    """Add the jets of Σ λ_j φ(r_j) to those of the columns of z, for any power and dimension."""
    dimension, sites = points.shape
    squared, radial = scratch[0], scratch[1]
    for i in range(count):
        place = z[:, i]
        squared_distances(place, points, sites, squared)
        radial_values(power, squared, sites, radial)
        jets[0, i] += dot(weights, radial, sites)
        if order == 0:
            continue
        derivatives_over_r(power, squared, sites, radial)
        trace = dot(weights, radial, sites)
        for a in range(dimension):
            total = 0.0
            for j in range(sites):
                total += weights[j] * radial[j] * (place[a] - points[a, j])
            jets[1 + a, i] += total
        if order == 2:
            second_derivatives_over_r(power, squared, sites, radial)
            row = 1 + dimension
            for a in range(dimension):
                jets[row, i] += trace
                for b in range(a, dimension):
                    total = 0.0
                    for j in range(sites):
                        total += weights[j] * radial[j] * (place[a] - points[a, j]) * (place[b] - points[b, j])
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
        Working space; scratch[2] is zero.
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
