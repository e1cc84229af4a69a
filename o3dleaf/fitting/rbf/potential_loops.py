r"""Potentials of one ball: splines of values and gradients at points, and the systems that they follow from.

.. math:: F(x) = \sum_j λ_j φ(x - x_j) - \sum_j c_j \cdot \nabla φ(x - x_j) + p(x)

The part of c is the potential of a curl-free field, Σ −∇∇ᵀφ(x − x_j) c_j. Its matrix is positive where that of φ is:
a functional Σ c_j · ∇δ_{x_j} annihilates constants, so a tail of gradients takes the place of the tail (Narcowich and
Ward 1994; Fuselier 2008). Unit coordinates as in `evaluation_loops`, φ = ±rᵏ with k odd and 3 or more. Vectors of all
points are stored axis after axis: (d, n), flat d n.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.evaluation_loops import lower_exponents, tail_jets
from o3dleaf.fitting.rbf.radial_loops import (
    REASSOCIATE,
    derivatives_over_r,
    dot,
    put,
    radial_values,
    second_derivatives_over_r,
    squared_distances,
)
from o3dleaf.fitting.rbf.solve_loops import least_squares, natural_monomials, radial_matrix, solve_system, tail_matrix
from o3dleaf.fitting.rbf.spectrum_loops import coefficients_of, decompose_system

TINY = 1e-18
"""Beside distances: at a data site rᵏ⁻⁴ multiplies zeros, and its inverse must be a float32."""


@njit(nogil=True, cache=True)
def oriented_matrix(points, power):
    """Return the (1 + d)n symmetric matrix of the functionals δ_{x_i}, then ∂_a δ_{x_i} axis by axis, of φ."""
    dimension, count = points.shape
    matrix = np.zeros(((1 + dimension) * count, (1 + dimension) * count))
    squared, value, first, second = (np.empty(count), np.empty(count), np.empty(count), np.empty(count))
    z = np.empty(dimension)
    for i in range(count):
        for axis in range(dimension):
            z[axis] = points[axis, i]
        squared_distances(z, points, count, squared)
        radial_values(power, squared, count, value)
        derivatives_over_r(power, squared, count, first)
        second_derivatives_over_r(power, squared, count, second)
        put(value, matrix[i, :count])
        for a in range(dimension):
            start = (1 + a) * count
            row, below = matrix[i, start : start + count], matrix[start + i]
            for j in range(count):
                row[j] = -first[j] * (z[a] - points[a, j])
                below[j] = -row[j]
            for b in range(dimension):
                block = below[(1 + b) * count : (2 + b) * count]
                for j in range(count):
                    block[j] = -second[j] * (z[a] - points[a, j]) * (z[b] - points[b, j])
                    if a == b:
                        block[j] -= first[j]
    return matrix


@njit(nogil=True, cache=True)
def oriented_tail(points, exponents):
    """Return the ((1 + d)n, q) values, then derivatives axis by axis, of the monomials at the points."""
    dimension, count = points.shape
    columns, lowered = len(exponents), lower_exponents(exponents)
    terms, jets = np.empty((columns, count)), np.empty((1 + dimension, count))
    coefficients = np.zeros((1 + dimension, columns))
    matrix = np.empty(((1 + dimension) * count, columns))
    for k in range(columns):
        coefficients[:] = 0.0
        coefficients[0, k] = 1.0
        for a in range(dimension):
            if lowered[a, k] >= 0:
                coefficients[1 + a, lowered[a, k]] = exponents[k, a]
        tail_jets(points, count, coefficients, lowered, terms, jets)
        for row in range(1 + dimension):
            for i in range(count):
                matrix[row * count + i, k] = jets[row, i]
    return matrix


@njit(nogil=True, cache=True)
def known_gradients(gradients):
    """Return the rows, among the d n of the gradients (d, n), of those that are known: of the others all are 0."""
    dimension, count = gradients.shape
    rows, found = np.empty(gradients.size, dtype=np.int64), 0
    for a in range(dimension):
        for j in range(count):
            if np.any(gradients[:, j] != 0.0):
                rows[found] = a * count + j
                found += 1
    return rows[:found].copy()


@njit(nogil=True, cache=True)
def scattered(values, rows, count):
    """Return values at rows of a vector (count,) of zeros."""
    out = np.zeros(count)
    for k in range(rows.size):
        out[rows[k]] = values[k]
    return out


@njit(nogil=True, cache=True)
def hermite(points, gradients, values, exponents, power, ridge):
    """Fit values (n,) and gradients (d, n) at once, with the two numbers `ridge` on the diagonal of each.

    A gradient that is 0 is not known: of its point the value alone is fitted.

    Returns
    -------
    weights (n,), moments (d, n), tail (q,), directions left out
    """
    count = points.shape[1]
    matrix, tail = oriented_matrix(points, power), oriented_tail(points, exponents)
    for i in range(len(matrix)):
        matrix[i, i] += ridge[0] if i < count else ridge[1]
    right = np.concatenate((values, gradients.ravel()))
    rows = np.concatenate((np.arange(count), count + known_gradients(gradients)))
    if rows.size < right.size:
        matrix, tail, right = matrix[rows][:, rows].copy(), tail[rows], right[rows]
    weights, coefficients, _, dropped = solve_system(matrix, tail, natural_monomials(points, exponents), right)
    weights = scattered(weights, rows, count + gradients.size)
    return weights[:count].copy(), weights[count:].copy().reshape(gradients.shape), coefficients, dropped


@njit(nogil=True, cache=True)
def curl_free(points, gradients, values, exponents, power, ridge, exact):
    """Fit the gradients (d, n) alone, with the number `ridge` on the diagonal, and put the potential's mean onto zero.

    Where `exact`, a spline of values takes off what is left of its heights at the points, above the values (n,) there.
    It has the least tail that its kernel needs: a quadric that vanishes on the points could take any gradient. Results,
    and gradients that are not known, as of `hermite`.
    """
    moments, tail, heights, dropped = potential(points, gradients, values, exponents, power, ridge)
    if not exact:
        return np.zeros(len(heights)), moments, tail, dropped
    few = exponents[: np.sum(np.sum(exponents, axis=1) <= power // 2)]
    parts = radial_matrix(points, power), tail_matrix(points, few), natural_monomials(points, few)
    weights, correction, _, lost = solve_system(*parts, -heights)
    for k in range(len(few)):
        tail[k] += correction[k]
    return weights, moments, tail, dropped + lost


@njit(nogil=True, cache=True)
def potential(points, gradients, values, exponents, power, ridge):
    """Return moments (d, n), tail (q,), heights (n,) above the values at the points, and the directions left out.

    The heights of the points whose gradients are known have the mean 0.
    """
    count = points.shape[1]
    matrix, tail = oriented_matrix(points, power), oriented_tail(points, exponents)
    inner, slopes, right = matrix[count:, count:].copy(), tail[count:, 1:].copy(), gradients.ravel()
    for i in range(len(inner)):
        inner[i, i] += ridge
    frame, rows = natural_monomials(points, exponents)[1:, 1:].copy(), known_gradients(gradients)
    if rows.size < right.size:
        inner, slopes, right = inner[rows][:, rows].copy(), slopes[rows], right[rows]
    moments, tail_weights, _, dropped = solve_system(inner, slopes, frame, right)
    moments = scattered(moments, rows, gradients.size)
    heights, coefficients = np.empty(count), np.zeros(len(exponents))
    put(tail_weights, coefficients[1:])
    for i in range(count):
        heights[i] = dot(matrix[i, count:], moments, moments.size) + dot(tail[i], coefficients, len(coefficients))
        heights[i] -= values[i]
    dimension = len(gradients)
    coefficients[0] = -np.mean(heights[rows[: rows.size // dimension]])
    return moments.reshape(gradients.shape), coefficients, heights + coefficients[0], dropped


@njit(nogil=True, cache=True)
def hermite_spectrum(points, gradients, values, exponents, power, step):
    """Return the spectrum of the joint system with h = `step`: the values count once, the gradients h² times."""
    count = points.shape[1]
    matrix, tail = oriented_matrix(points, power), oriented_tail(points, exponents)
    roots, right = np.full(len(matrix), step), np.zeros((1, len(matrix)))
    roots[:count] = 1.0
    put(values, right[0, :count])
    put(gradients.ravel(), right[0, count:])
    return coefficients_of(right, roots, decompose_system(matrix, tail, natural_monomials(points, exponents), roots))


@njit(nogil=True, cache=True)
def gradient_spectrum(points, gradients, exponents, power):
    """Return the spectrum of the gradients' own system."""
    count = points.shape[1]
    matrix = oriented_matrix(points, power)[count:, count:].copy()
    tail = oriented_tail(points, exponents)[count:, 1:].copy()
    frame = natural_monomials(points, exponents)[1:, 1:].copy()
    roots, right = np.ones(len(matrix)), gradients.copy().reshape(1, -1)
    return coefficients_of(right, roots, decompose_system(matrix, tail, frame, roots))


@njit(nogil=True, cache=True, fastmath=REASSOCIATE, error_model="numpy")
def odd_powers(power, squared, count, out):
    """Write rᵏ⁻⁴ of squared distances, k odd."""
    tiny = out.dtype.type(TINY)
    if power == 3:
        for j in range(count):
            out[j] = 1 / (np.sqrt(squared[j]) + tiny)
        return
    for j in range(count):
        out[j] = np.sqrt(squared[j])
    for _ in range((power - 5) // 2):
        for j in range(count):
            out[j] *= squared[j]


@njit(nogil=True, cache=True, fastmath=REASSOCIATE, error_model="numpy")
def add_potential_jets(z, count, points, weights, moments, power, order, scratch, jets):
    """Add the jets of Σ λ_j φ − c_j · ∇φ at the first `count` columns of z to `jets`; `scratch` (3, n) is overwritten.

    With ψ = φ′/r, β = ψ′/r, γ = β′/r, y = z − z_j and h = c · y the terms are λφ − ψh; (λψ − βh) y − ψc; and
    (λβ − γh) y yᵀ + (λψ − βh) I − β (c yᵀ + y cᵀ).
    """
    dimension, sites = points.shape
    kind = weights.dtype.type
    sign = kind(1.0 if power // 2 % 2 else -1.0)
    first, second = sign * kind(power), sign * kind(power * (power - 2))
    third = second * kind(power - 4)
    squared, base, along = scratch[0], scratch[1], scratch[2]
    place = np.empty(dimension, dtype=weights.dtype)
    for i in range(count):
        for a in range(dimension):
            place[a] = z[a, i]
        squared_distances(place, points, sites, squared)
        odd_powers(power, squared, sites, base)
        along[:sites] = kind(0)
        for a in range(dimension):
            c, x, w = moments[a], points[a], place[a]
            for j in range(sites):
                along[j] += c[j] * (w - x[j])
        value = trace = kind(0)
        for j in range(sites):
            lower = squared[j] * base[j]
            value += sign * weights[j] * squared[j] * lower - first * lower * along[j]
            trace += first * weights[j] * lower - second * base[j] * along[j]
        jets[0, i] += value
        if order == 0:
            continue
        for a in range(dimension):
            c, x, w = moments[a], points[a], place[a]
            total = kind(0)
            for j in range(sites):
                lower = squared[j] * base[j]
                total += (first * weights[j] * lower - second * base[j] * along[j]) * (w - x[j]) - first * lower * c[j]
            jets[1 + a, i] += total
        if order < 2:
            continue
        tiny = kind(TINY)
        row = 1 + dimension
        for a in range(dimension):
            jets[row, i] += trace
            for b in range(a, dimension):
                total = kind(0)
                for j in range(sites):
                    ya, yb = place[a] - points[a, j], place[b] - points[b, j]
                    outer = second * weights[j] - third * along[j] / (squared[j] + tiny)
                    total += base[j] * (outer * ya * yb - second * (moments[a, j] * yb + ya * moments[b, j]))
                jets[row, i] += total
                row += 1


@njit(nogil=True, cache=True)
def potential_jets(z, count, points, weights, moments, coefficients, lowered, power, order, terms, scratch, jets):
    """Write the jets of a potential at the first `count` columns of z (d, ·); `local_jets` says what the rest is."""
    tail_jets(z, count, coefficients, lowered, terms, jets)
    add_potential_jets(z, count, points, weights, moments, power, order, scratch, jets)


@njit(nogil=True, cache=True)
def moving_polynomial(points, gradients, values, weights, step, exponents):
    """Fit a polynomial with values (n,) and gradients (d, n) at the points (d, n) by weighted least squares.

    It minimizes Σ w_j ((p(z_j) − v_j)² + h² |∇p(z_j) − g_j|²), the second term only where g_j is not 0. Where the
    points do not determine it, it is the least such in the norm of `natural_monomials`.

    Returns
    -------
    tail (q,), rank
    """
    dimension, count = points.shape
    rows, right = oriented_tail(points, exponents), np.zeros((1 + dimension) * count)
    for j in range(count):
        root = math.sqrt(weights[j])
        row = rows[j]
        row *= root
        right[j] = root * values[j]
        slope = root * step if np.any(gradients[:, j] != 0.0) else 0.0
        for a in range(dimension):
            k = (1 + a) * count + j
            row = rows[k]
            row *= slope
            right[k] = slope * gradients[a, j]
    return least_squares(rows, natural_monomials(points, exponents), right)
