"""The compiled loops over balls of oriented points: fits, what they say at points held out, and their spectra."""

import math

import numpy as np
from numba import njit

from o3dleaf.pu.weights import wendland
from o3dleaf.rbf.loops import jet_size, lower_exponents, tail_derivatives
from o3dleaf.rbf.potential import (
    curl_free,
    gradient_spectrum,
    height_spectrum,
    hermite,
    hermite_spectrum,
    moving_polynomial,
    potential_jets,
)

FARTHER = 1.1
"""Radius of the weight of a ball that borrows points, over the distance of the farthest: as far as balls overlap."""

HERMITE, CURL_FREE = 0, 1
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
    """Return the spacing of points (d, n) that lie on one sheet through the unit ball, or the larger one that they need.

    A sheet of n points in a ball of radius r has the spacing r √(π/n), a curve 2 r/n.
    """
    dimension, count = points.shape
    reach = max(1.0, FARTHER * np.max(norms(points)))
    return reach * (math.sqrt(math.pi / count) if dimension == 3 else 2.0 / count)


@njit(nogil=True, cache=True)
def fit_potential(method, local, gradients, exponents, power, ridges, step):
    """Fit one ball; `ridges` (2,) are in unit coordinates, those of `HERMITE` for h = `step` spacings."""
    if method == HERMITE:
        length = step * sheet_spacing(local)
        return hermite(local, gradients, exponents, power, (ridges[0], ridges[0] / length**2))
    return curl_free(local, gradients, exponents, power, (ridges[0], ridges[1]))


@njit(nogil=True, cache=True)
def fit_potentials(start, stop, points, normals, cover, exponents, power, method, ridges, step, model, dropped):
    """Fit the balls start:stop; `ridges` (2,) are the diagonals of values and gradients in the data's unit."""
    centres, radii, offsets, members = cover
    sites, weights, moments, tails = model
    dimension = centres.shape[1]
    for ball in range(start, stop):
        first, last, radius = offsets[ball], offsets[ball + 1], radii[ball]
        local, gradients = gather_oriented(points, normals, members[first:last], centres[ball], radius)
        scaled = (ridges[0] / radius**power, ridges[1] / radius ** (power - 2))
        lam, moment, tail, lost = fit_potential(method, local, gradients, exponents, power, scaled, step)
        # F = R F̃(z) has unit slopes in both coordinates.
        sites[dimension * first : dimension * last] = local.ravel()
        weights[first:last] = radius * lam
        moments[dimension * first : dimension * last] = radius * moment.ravel()
        tails[ball] = radius * tail
        dropped[ball] = lost


@njit(nogil=True, cache=True)
def ball_spectrum(points, normals, rows, centre, radius, exponents, power, method, step, ridge):
    """Return the spectrum of one ball's system, in unit coordinates.

    Of `HERMITE` the joint one; of `CURL_FREE` that of the gradients or, for a `ridge` >= 0 of theirs in the data's
    unit, that of the heights.
    """
    local, gradients = gather_oriented(points, normals, rows, centre, radius)
    if method == HERMITE:
        found = hermite_spectrum(local, gradients, exponents, power, step * sheet_spacing(local))
    elif ridge < 0.0:
        found = gradient_spectrum(local, gradients, exponents, power)
    else:
        found = height_spectrum(local, gradients, exponents, power, ridge / radius ** (power - 2))
    return found[0], found[1][0]


@njit(nogil=True, cache=True)
def fit_polynomial(local, gradients, exponents, step):
    """Fit one ball by `moving_polynomial` with Wendland's weight of the ball that its points need."""
    distance = norms(local)
    reach = max(1.0, FARTHER * np.max(distance))
    trust = np.empty(distance.size)
    for j in range(distance.size):
        trust[j] = wendland(distance[j] / reach)
    return moving_polynomial(local, gradients, trust, step * sheet_spacing(local), exponents)


@njit(nogil=True, cache=True)
def fit_polynomials(start, stop, points, normals, cover, exponents, step, tails, ranks):
    """Fit the balls start:stop by `fit_polynomial`."""
    centres, radii, offsets, members = cover
    for ball in range(start, stop):
        rows, radius = members[offsets[ball] : offsets[ball + 1]], radii[ball]
        local, gradients = gather_oriented(points, normals, rows, centres[ball], radius)
        tail, ranks[ball] = fit_polynomial(local, gradients, exponents, step)
        tails[ball] = radius * tail
