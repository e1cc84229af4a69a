"""Jets of many points at once: products, quotients, and what becomes of them outside the domain.

A jet is a value, its gradient of d components and its d(d + 1)/2 second derivatives, one row each, as in
`o3dleaf.fitting.rbf.evaluation_loops`; Leibniz's rule is all that is needed to blend with them. No fast-math here: a
column's bits do not depend on its place among the others.
"""

import math

from numba import njit


@njit(nogil=True, cache=True)
def scale_jets(jets, count, factor, dimension):
    """Turn derivatives by unit coordinates into derivatives by x = c + z/factor."""
    for row in range(1, len(jets)):
        power = factor if row <= dimension else factor * factor
        for i in range(count):
            jets[row, i] *= power


@njit(nogil=True, cache=True)
def add_product(weight, local, columns, count, dimension, level, sums, totals):
    """Add the jets of w F to `sums` and those of w to `totals`, column i to column columns[i]."""
    for row in range(len(weight)):
        for i in range(count):
            totals[row, columns[i]] += weight[row, i]
    for i in range(count):
        sums[0, columns[i]] += weight[0, i] * local[0, i]
    if level == 0:
        return
    for a in range(1, 1 + dimension):
        for i in range(count):
            sums[a, columns[i]] += weight[a, i] * local[0, i] + weight[0, i] * local[a, i]
    row = 1 + dimension
    for a in range(1, 1 + dimension if level == 2 else 1):
        for b in range(a, 1 + dimension):
            for i in range(count):
                mixed = weight[a, i] * local[b, i] + weight[b, i] * local[a, i]
                sums[row, columns[i]] += weight[row, i] * local[0, i] + mixed + weight[0, i] * local[row, i]
            row += 1


@njit(nogil=True, cache=True)
def divide(sums, totals, count, dimension, level):
    """Replace the jets of N by those of F = N/W: ∇F = (∇N − F ∇W)/W, and so on."""
    for i in range(count):
        sums[0, i] /= totals[0, i]
    if level == 0:
        return
    for a in range(1, 1 + dimension):
        for i in range(count):
            sums[a, i] = (sums[a, i] - sums[0, i] * totals[a, i]) / totals[0, i]
    row = 1 + dimension
    for a in range(1, 1 + dimension if level == 2 else 1):
        for b in range(a, 1 + dimension):
            for i in range(count):
                mixed = sums[a, i] * totals[b, i] + sums[b, i] * totals[a, i]
                sums[row, i] = (sums[row, i] - sums[0, i] * totals[row, i] - mixed) / totals[0, i]
            row += 1


@njit(nogil=True, cache=True)
def unpack(start, stop, jets, points, bounds, period, values, gradients, hessians):
    """Write values (n,), gradients (n, d) and Hessians (n, d, d), as far as they have rows, of a block of columns.

    The jets are those at the nearest points of the domain. Outside it the distance δ is taken off,
    with gradient δ/|δ| and Hessian (I − n nᵀ)/|δ| on the axes that moved, along which the field itself is
    constant.
    """
    dimension = period.size
    for i in range(start, stop):
        distance = 0.0
        for a in range(dimension):
            # A sum of squares would vanish at distances below 1e-162, and overflow beyond 1e154.
            distance = math.hypot(distance, offset(points[i, a], bounds, period, a))
        if len(values):
            values[i] = jets[0, i] - distance
        if len(gradients):
            for a in range(dimension):
                off = offset(points[i, a], bounds, period, a)
                gradients[i, a] = jets[1 + a, i] if off == 0.0 else -off / distance
        row = 1 + dimension
        for a in range(dimension if len(hessians) else 0):
            moved = offset(points[i, a], bounds, period, a)
            for b in range(a, dimension):
                also = offset(points[i, b], bounds, period, b)
                second = jets[row, i]
                if moved != 0.0 or also != 0.0:
                    second = (moved / distance * (also / distance) - (1.0 if a == b else 0.0)) / distance
                hessians[i, a, b] = second
                hessians[i, b, a] = second
                row += 1


@njit(nogil=True, cache=True)
def offset(x, bounds, period, axis):
    """Return how far a coordinate lies beyond the domain: 0 inside, and along an axis that repeats."""
    if period[axis] > 0.0:
        return 0.0
    return x - min(max(x, bounds[0, axis]), bounds[1, axis])
