"""The compiled loops of kernels with a shape: φ as a function of s = (εr)², smooth in the coordinates everywhere.

Points are in unit coordinates, as for the kernels without one (`evaluation_loops`); `shape` is ε times their radius.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.evaluation_loops import jet_size, lower_exponents, tail_derivatives, tail_jets
from o3dleaf.fitting.rbf.radial_loops import dot, squared_distances
from o3dleaf.fitting.rbf.reflector_loops import mirror


@njit(nogil=True, cache=True)
def profile(kind, square):
    """Return φ and its first and second derivative by s at s = `square`; for the numbers see `PROFILES`."""
    if kind == 0:
        value = math.exp(-square)
        return value, -value, value
    base = 1.0 + square
    root = math.sqrt(base)
    if kind == 1:
        return -root, -0.5 / root, 0.25 / (base * root)
    if kind == 2:
        return 1.0 / root, -0.5 / (base * root), 0.75 / (base * base * root)
    return 1.0 / base, -1.0 / (base * base), 2.0 / (base * base * base)


@njit(nogil=True, cache=True)
def shaped_matrix(points, kind, shape):
    """Return A with A_ij = φ(shape |z_i − z_j|), symmetric, of points (d, n)."""
    count = points.shape[1]
    matrix = np.empty((count, count))
    z, squared = np.empty(points.shape[0]), np.empty(count)
    for i in range(count):
        for axis in range(z.size):
            z[axis] = points[axis, i]
        squared_distances(z, points, i, squared)
        for j in range(i):
            matrix[i, j] = profile(kind, shape * shape * squared[j])[0]
        matrix[i, i] = profile(kind, 0.0)[0]
    mirror(matrix)
    return matrix


@njit(nogil=True, cache=True)
def shaped_jets(place, points, kind, shape, order, squared, jets):
    """Write the jets (jet, n) of φ(shape |z − z_j|) at one place z (d,), a column for each of the points (d, n)."""
    dimension, sites = points.shape
    scale = shape * shape
    squared_distances(place, points, sites, squared)
    for j in range(sites):
        value, first, second = profile(kind, scale * squared[j])
        jets[0, j] = value
        if order == 0:
            continue
        for a in range(dimension):
            jets[1 + a, j] = 2.0 * scale * first * (place[a] - points[a, j])
        row = 1 + dimension
        for a in range(dimension if order == 2 else 0):
            for b in range(a, dimension):
                bend = 4.0 * scale * scale * second * (place[a] - points[a, j]) * (place[b] - points[b, j])
                jets[row, j] = bend + (2.0 * scale * first if a == b else 0.0)
                row += 1


@njit(nogil=True, cache=True)
def evaluate_shaped(start, stop, queries, points, weights, tails, exponents, kind, shape, order, jets):
    """Fill the (m, jet, ·) jets of m columns, of weights (m, n) and tails (m, q), at the columns start:stop."""
    lowered, size = lower_exponents(exponents), jet_size(len(points), order)
    coefficients, terms = np.empty((size, len(exponents))), np.empty((len(exponents), stop - start))
    squared, radial = np.empty(points.shape[1]), np.empty((size, points.shape[1]))
    for k in range(len(weights)):
        tail_derivatives(tails[k], exponents, lowered, order, coefficients)
        tail_jets(queries[:, start:stop], stop - start, coefficients, lowered, terms, jets[k, :, start:stop])
    for i in range(start, stop):
        shaped_jets(queries[:, i], points, kind, shape, order, squared, radial)
        for k in range(len(weights)):
            for row in range(size):
                jets[k, row, i] += dot(weights[k], radial[row], points.shape[1])
