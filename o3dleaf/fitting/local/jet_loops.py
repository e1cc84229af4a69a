"""Jets of many points at once: products and quotients.

A jet is a value, its gradient of d components and its d(d + 1)/2 second derivatives, one row each, as in
`o3dleaf.fitting.rbf.evaluation_loops`; Leibniz's rule is all that is needed to blend with them. No fast-math here: a
column's bits do not depend on its place among the others.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def scale_jets(jets, count, factor, dimension):
    """Turn derivatives by unit coordinates into derivatives by x = c + z/factor."""
    for row in range(1, len(jets)):
        power = factor if row <= dimension else factor * factor
        for i in range(count):
            jets[row, i] *= power


@njit(nogil=True, cache=True)
def stretch(matrix, rows, count, product):
    """Write the first columns of the rows (d, ·), multiplied with a matrix (d, d), into `product` (d, ·)."""
    for a in range(len(matrix)):
        for i in range(count):
            product[a, i] = matrix[a, 0] * rows[0, i]
        for b in range(1, len(matrix)):
            for i in range(count):
                product[a, i] += matrix[a, b] * rows[b, i]


@njit(nogil=True, cache=True)
def stretch_jets(matrix, jets, count):
    """Turn derivatives by stretched coordinates A z into derivatives by z: A g and A H A, in place."""
    dimension = len(matrix)
    if len(jets) > 1:
        stretch(matrix, jets[1 : 1 + dimension].copy(), count, jets[1 : 1 + dimension])
    if len(jets) <= 1 + dimension:
        return
    second, half = np.empty((dimension, dimension)), np.empty((dimension, dimension))
    for i in range(count):
        row = 1 + dimension
        for a in range(dimension):
            for b in range(a, dimension):
                second[a, b] = second[b, a] = jets[row, i]
                row += 1
        stretch(matrix, second, dimension, half)
        stretch(matrix, half.T, dimension, second)
        row = 1 + dimension
        for a in range(dimension):
            for b in range(a, dimension):
                jets[row, i] = second[a, b]
                row += 1


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
def unpack(start, stop, jets, values, gradients, hessians):
    """Write values (n,), gradients (n, d) and Hessians (n, d, d), as far as they have rows, of a block of columns."""
    dimension = gradients.shape[1]
    for i in range(start, stop):
        if len(values):
            values[i] = jets[0, i]
        for a in range(dimension if len(gradients) else 0):
            gradients[i, a] = jets[1 + a, i]
        row = 1 + dimension
        for a in range(dimension if len(hessians) else 0):
            for b in range(a, dimension):
                hessians[i, a, b] = jets[row, i]
                hessians[i, b, a] = jets[row, i]
                row += 1
