"""The compiled loops over balls of oriented points: fits, what they say at points held out, and their spectra."""

import math

import numpy as np
from numba import njit

from o3dleaf.fitting.pu.weight_loops import wendland
from o3dleaf.fitting.rbf.evaluation_loops import put
from o3dleaf.fitting.rbf.potential_loops import (
    curl_free,
    gradient_spectrum,
    hermite,
    hermite_spectrum,
    moving_polynomial,
    oriented_tail,
)

FARTHER = 1.1
"""Radius of the weight of a ball that borrows points, over the distance of the farthest: as far as balls overlap."""

HERMITE, CURL_FREE, CORRECTED = 0, 1, 2
"""How `fit_potentials` fits."""


@njit(nogil=True, cache=True)
def gather_oriented(points, normals, rows, centre, radius):
    """Return the unit coordinates (d, n) of the points `rows` of a ball, and the gradients −normal (d, n)."""
    count, dimension = rows.size, centre.size
    local, gradients = np.empty((dimension, count)), np.empty((dimension, count))
    for j in range(count):
        for axis in range(dimension):
            local[axis, j] = (points[rows[j], axis] - centre[axis]) / radius
            gradients[axis, j] = -normals[rows[j], axis]
    return local, gradients


@njit(nogil=True, cache=True)
def norms(points):
    """Return the (n,) lengths of the columns (d, n)."""
    lengths = np.zeros(points.shape[1])
    for j in range(lengths.size):
        for axis in range(len(points)):
            lengths[j] += points[axis, j] ** 2
        lengths[j] = math.sqrt(lengths[j])
    return lengths


@njit(nogil=True, cache=True)
def sheet_spacing(points):
    """Return the spacing of points (d, n) on one sheet through the unit ball, or the larger one that they need.

    A sheet of n points in a ball of radius r has the spacing r √(π/n), a curve 2 r/n.
    """
    dimension, count = points.shape
    reach = max(1.0, FARTHER * np.max(norms(points)))
    return reach * (math.sqrt(math.pi / count) if dimension == 3 else 2.0 / count)


@njit(nogil=True, cache=True)
def fit_potential(method, local, gradients, exponents, power, ridge, step):
    """Fit one ball, its diagonal in unit coordinates: of `HERMITE` that of the values, with h = `step` spacings."""
    if method == HERMITE:
        length = step * sheet_spacing(local)
        return hermite(local, gradients, exponents, power, (ridge, ridge / length**2))
    return curl_free(local, gradients, exponents, power, ridge, method == CORRECTED)


@njit(nogil=True, cache=True)
def unit_ridge(method, amount, radius, power):
    """Return the number on the diagonal in unit coordinates: of values or, but for `HERMITE`, of slopes."""
    return amount / radius ** (power if method == HERMITE else power - 2)


@njit(nogil=True, cache=True)
def fit_potentials(start, stop, points, normals, cover, exponents, power, method, amount, step, model, dropped):
    """Fit the balls start:stop with the `amount` of smoothing, in the data's unit."""
    centres, radii, offsets, members = cover
    sites, weights, moments, tails = model
    dimension = centres.shape[1]
    for ball in range(start, stop):
        first, last, radius = offsets[ball], offsets[ball + 1], radii[ball]
        local, gradients = gather_oriented(points, normals, members[first:last], centres[ball], radius)
        ridge = unit_ridge(method, amount, radius, power)
        lam, moment, tail, lost = fit_potential(method, local, gradients, exponents, power, ridge, step)
        # F = R F̃(z) has unit slopes in both coordinates.
        put(local.ravel(), sites[dimension * first : dimension * last])
        put(radius * lam, weights[first:last])
        put(radius * moment.ravel(), moments[dimension * first : dimension * last])
        put(radius * tail, tails[ball])
        dropped[ball] = lost


@njit(nogil=True, cache=True)
def ball_spectrum(points, normals, rows, centre, radius, exponents, power, method, step):
    """Return the spectrum of one ball's system, both in the data's unit: of values and slopes, or of slopes alone."""
    local, gradients = gather_oriented(points, normals, rows, centre, radius)
    if method == HERMITE:
        found = hermite_spectrum(local, gradients, exponents, power, step * sheet_spacing(local))
        return found[0] / unit_ridge(method, 1.0, radius, power), found[1][0] * radius
    found = gradient_spectrum(local, gradients, exponents, power)
    return found[0] / unit_ridge(method, 1.0, radius, power), found[1][0]


@njit(nogil=True, cache=True)
def fit_polynomial(local, gradients, exponents, step):
    """Fit one ball by `moving_polynomial` with Wendland's weight of the ball that its points need; return all three."""
    distance = norms(local)
    reach = max(1.0, FARTHER * np.max(distance))
    trust = np.empty(distance.size)
    for j in range(distance.size):
        trust[j] = wendland(distance[j] / reach)
    tail, rank = moving_polynomial(local, gradients, trust, step * sheet_spacing(local), exponents)
    return tail, rank, trust


@njit(nogil=True, cache=True)
def fit_polynomials(start, stop, points, normals, cover, exponents, step, tails, ranks):
    """Fit the balls start:stop by `fit_polynomial`."""
    centres, radii, offsets, members = cover
    for ball in range(start, stop):
        rows, radius = members[offsets[ball] : offsets[ball + 1]], radii[ball]
        local, gradients = gather_oriented(points, normals, rows, centres[ball], radius)
        tail, ranks[ball], _ = fit_polynomial(local, gradients, exponents, step)
        put(radius * tail, tails[ball])


@njit(nogil=True, cache=True)
def polynomial_residual(points, normals, rows, centre, radius, exponents, step):
    """Return the weighted mean square of p/|∇p|, a distance, over the points of one ball that `fit_polynomial` fits."""
    local, gradients = gather_oriented(points, normals, rows, centre, radius)
    tail, _, trust = fit_polynomial(local, gradients, exponents, step)
    count, jets = rows.size, oriented_tail(local, exponents) @ tail
    values = slopes = 0.0
    for j in range(count):
        values += trust[j] * jets[j] ** 2
        for a in range(centre.size):
            slopes += trust[j] * jets[(1 + a) * count + j] ** 2
    return radius**2 * values / slopes if slopes > 0.0 else np.inf
