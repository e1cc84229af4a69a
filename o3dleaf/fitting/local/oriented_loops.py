"""The compiled loops over balls of oriented points: fits, their spectra and their residuals."""

import math
from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.cover.ball_loops import rows_of
from o3dleaf.fitting.local.weight_loops import wendland
from o3dleaf.fitting.rbf.potential_loops import (
    curl_free,
    gradient_spectrum,
    hermite,
    hermite_spectrum,
    known_gradients,
    moving_polynomial,
    oriented_tail,
)
from o3dleaf.fitting.rbf.radial_loops import put
from o3dleaf.fitting.rbf.tail import IntArray

FARTHER = 1.1
"""Radius of the weight of a ball that borrows points, over the distance of the farthest: as far as balls overlap."""

HERMITE, CURL_FREE, CORRECTED = 0, 1, 2
"""How `fit_potentials` fits."""


class OrientedPoints(NamedTuple):
    """Points (n, d), outward unit normals (n, d), which are 0 where there is none, and values (n,)."""

    points: FloatArray
    normals: FloatArray
    values: FloatArray


class PotentialKind(NamedTuple):
    """What is fitted in every ball.

    Attributes
    ----------
    exponents : (q, d) int64 ndarray
        Of the tail.
    power : int
        Of the kernel.
    method : int
        `HERMITE`, `CURL_FREE` or `CORRECTED`.
    step : float
        h of `HERMITE`, in spacings.
    """

    exponents: IntArray
    power: int
    method: int
    step: float


class PotentialArrays(NamedTuple):
    """Splines of values and gradients of all balls, end to end; see `LocalPotentials`."""

    sites: FloatArray
    weights: FloatArray
    moments: FloatArray
    tails: FloatArray
    dropped: IntArray


@njit(nogil=True, cache=True)
def gather_oriented(data, rows, center, radius):
    """Return the unit coordinates (d, n) of the points `rows` of a ball, the gradients −normal (d, n), and values (n,).

    Values are shares of the radius: F = R F̃(z) has unit gradients in both coordinates.
    """
    points, normals = data.points, data.normals
    count, dimension = rows.size, center.size
    local, gradients, values = np.empty((dimension, count)), np.empty((dimension, count)), np.empty(count)
    for j in range(count):
        values[j] = data.values[rows[j]] / radius
        for axis in range(dimension):
            local[axis, j] = (points[rows[j], axis] - center[axis]) / radius
            gradients[axis, j] = -normals[rows[j], axis]
    return local, gradients, values


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
def sheet_spacing(points, gradients):
    """Return the spacing of points (d, n) on one sheet through the unit ball, or the larger one that they need.

    A sheet of n points in a ball of radius r has the spacing r √(π/n), a curve 2 r/n. Points without a gradient (d, n)
    lie beside it.
    """
    dimension = len(points)
    count = max(known_gradients(gradients).size // dimension, 1)
    reach = max(1.0, FARTHER * np.max(norms(points)))
    return reach * (math.sqrt(math.pi / count) if dimension == 3 else 2.0 / count)


@njit(nogil=True, cache=True)
def fit_potential(kind, local, gradients, values, ridge):
    """Fit one ball, its diagonal in unit coordinates: of `HERMITE` that of the values, with h = `step` spacings."""
    if kind.method == HERMITE:
        length = kind.step * sheet_spacing(local, gradients)
        return hermite(local, gradients, values, kind.exponents, kind.power, (ridge, ridge / length**2))
    return curl_free(local, gradients, values, kind.exponents, kind.power, ridge, kind.method == CORRECTED)


@njit(nogil=True, cache=True)
def unit_ridge(kind, smoothing, radius):
    """Return the number on the diagonal in unit coordinates: of values or, but for `HERMITE`, of gradients."""
    return smoothing / radius ** (kind.power if kind.method == HERMITE else kind.power - 2)


@njit(nogil=True, cache=True)
def fit_potentials(start, stop, data, balls, kind, smoothing, fitted):
    """Fit the balls start:stop with the `smoothing` in the data's unit."""
    dimension = balls.centers.shape[1]
    for ball in range(start, stop):
        first, last, radius = balls.offsets[ball], balls.offsets[ball + 1], balls.radii[ball]
        local, gradients, values = gather_oriented(data, balls.members[first:last], balls.centers[ball], radius)
        ridge = unit_ridge(kind, smoothing, radius)
        lam, moment, tail, lost = fit_potential(kind, local, gradients, values, ridge)
        put(local.ravel(), fitted.sites[dimension * first : dimension * last])
        put(radius * lam, fitted.weights[first:last])
        put(radius * moment.ravel(), fitted.moments[dimension * first : dimension * last])
        put(radius * tail, fitted.tails[ball])
        fitted.dropped[ball] = lost


@njit(nogil=True, cache=True)
def ball_spectrum(ball, data, balls, kind):
    """Return the spectrum of one ball's system in the data's unit: of values and gradients, or of gradients alone."""
    radius = balls.radii[ball]
    local, gradients, values = gather_oriented(data, rows_of(balls, ball), balls.centers[ball], radius)
    if kind.method == HERMITE:
        length = kind.step * sheet_spacing(local, gradients)
        eigenvalues, coefficients = hermite_spectrum(local, gradients, values, kind.exponents, kind.power, length)
        return eigenvalues / unit_ridge(kind, 1.0, radius), coefficients[0] * radius
    eigenvalues, coefficients = gradient_spectrum(local, gradients, kind.exponents, kind.power)
    return eigenvalues / unit_ridge(kind, 1.0, radius), coefficients[0]


@njit(nogil=True, cache=True)
def fit_polynomial(local, gradients, values, exponents, step):
    """Fit one ball by `moving_polynomial` with Wendland's weight of the ball that its points need; return all three."""
    distance = norms(local)
    reach = max(1.0, FARTHER * np.max(distance))
    weights = np.empty(distance.size)
    for j in range(distance.size):
        weights[j] = wendland(distance[j] / reach)
    length = step * sheet_spacing(local, gradients)
    tail, rank = moving_polynomial(local, gradients, values, weights, length, exponents)
    return tail, rank, weights


@njit(nogil=True, cache=True)
def fit_polynomials(start, stop, data, balls, exponents, step, tails, ranks):
    """Fit the balls start:stop by `fit_polynomial`."""
    for ball in range(start, stop):
        radius = balls.radii[ball]
        local, gradients, values = gather_oriented(data, rows_of(balls, ball), balls.centers[ball], radius)
        tail, ranks[ball], _ = fit_polynomial(local, gradients, values, exponents, step)
        put(radius * tail, tails[ball])


@njit(nogil=True, cache=True)
def polynomial_residual(data, rows, center, radius, exponents, step):
    """Return the weighted mean square of p/|∇p|, a distance, over the points of one ball that `fit_polynomial` fits."""
    local, gradients, sought = gather_oriented(data, rows, center, radius)
    tail, _, weights = fit_polynomial(local, gradients, sought, exponents, step)
    count, jets = rows.size, oriented_tail(local, exponents) @ tail
    values = squares = 0.0
    for j in range(count):
        values += weights[j] * (jets[j] - sought[j]) ** 2
        for a in range(center.size):
            squares += weights[j] * jets[(1 + a) * count + j] ** 2
    return radius**2 * values / squares if squares > 0.0 else np.inf
