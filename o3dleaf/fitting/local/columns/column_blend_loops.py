"""The compiled blend of several columns of values: distances and φ are found once for all of them.

The sum at a query runs over the balls in the order of its leaf's list, as in `blend_loops`, and does not depend on the
blocks.
"""

from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.local.blend_loops import STRIP, block, far_of, go_on, hold, select_inside
from o3dleaf.fitting.local.jet_loops import add_product, divide, scale_jets
from o3dleaf.fitting.local.weight_loops import weight_jets
from o3dleaf.fitting.rbf.evaluation_loops import jet_size, lower_exponents, tail_derivatives, tail_jets
from o3dleaf.fitting.rbf.radial_loops import (
    REASSOCIATE,
    derivatives_over_r,
    dot,
    radial_values,
    second_derivatives_over_r,
    squared_distances,
)


class ColumnBalls(NamedTuple):
    """What the blend reads of splines of c columns, all balls end to end: weights (c, total) and tails (M, c, q)."""

    offsets: Any
    places: Any
    sites: Any
    weights: Any
    tails: Any
    exponents: Any
    power: Any
    widest: Any


class ColumnSpace(NamedTuple):
    """The arrays that `blend_column_strip` works in; see `Workspace`, of which `local` and `sums` are (c, jet, STRIP).

    Attributes
    ----------
    scratch, radial : (3, n), (jet, n)
        Squared distances to a ball's points with φ′/r and (φ′/r)′/r, and the jets of φ.
    """

    points: Any
    away: Any
    unit: Any
    place: Any
    squared: Any
    inside: Any
    weight: Any
    local: Any
    sums: Any
    totals: Any
    spare: Any
    lowered: Any
    terms: Any
    coefficients: Any
    scratch: Any
    radial: Any


@njit(nogil=True, cache=True)
def blend_columns(start, stop, order, queries, folded, period, leaves, tree, images, model, level, jets):
    """Fill the (c, jet, n) jets, to derivatives of `level`, of Σ w_i F_i / Σ w_i at the points order[start:stop].

    `queries` has rows if some of them lie outside the box, as in `o3dleaf.fitting.local.blend_loops.blend`.
    """
    space = column_space(images, model, level)
    first = start
    while first < stop:
        leaf = leaves[order[first]]
        last = first + 1
        while last < stop and last - first < STRIP and leaves[order[last]] == leaf:
            last += 1
        listed = tree.images[tree.starts[leaf] : tree.stops[leaf]]
        blend_column_strip(order[first:last], listed, queries, folded, period, images, model, level, space, jets)
        first = last


@njit(nogil=True, cache=True)
def column_space(images, model, level):
    """Return the arrays that `blend_column_strip` works in."""
    dimension, terms, columns = images.centers.shape[1], len(model.exponents), len(model.weights)
    size, kind = jet_size(dimension, level), model.sites.dtype
    return ColumnSpace(
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty(STRIP),
        np.empty(STRIP, dtype=np.int64),
        np.empty((size, STRIP)),
        np.empty((columns, size, STRIP)),
        np.empty((columns, size, STRIP)),
        np.empty((size, STRIP)),
        np.empty((size, STRIP)),
        lower_exponents(model.exponents),
        np.empty((terms, STRIP)),
        np.empty((size, terms)),
        np.empty((3, model.widest), dtype=kind),
        np.empty((size, model.widest), dtype=kind),
    )


@njit(nogil=True, cache=True)
def blend_column_strip(rows, listed, queries, folded, period, images, model, level, space, jets):
    """Blend the images `listed` at the points `rows` of one leaf."""
    points, unit, inside, weight = space.points, space.unit, space.inside, space.weight
    dimension, columns = folded.shape[1], len(model.weights)
    outside, far = len(queries) > 0, far_of(model.sites)
    place = space.place if outside else unit
    for axis in range(dimension):
        for i in range(rows.size):
            points[axis, i] = folded[rows[i], axis]
            if outside:
                space.away[axis, i] = 0.0 if period[axis] > 0.0 else queries[rows[i], axis] - folded[rows[i], axis]
    space.sums[:, :, : rows.size] = 0.0
    space.totals[:, : rows.size] = 0.0
    space.spare[:, : rows.size] = 0.0
    for image in listed:
        ball, radius = images.balls[image], images.radii[image]
        count = select_inside(points, rows.size, images.centers[image], radius, space.squared, unit, inside)
        if count == 0:
            continue
        if outside:
            go_on(space.away, inside, count, radius, far, unit, place)
        column_jets(model, ball, place, count, level, space)
        weight_jets(unit, count, level, weight)
        if outside and level > 0:
            for k in range(columns):
                hold(space.away, inside, count, radius, far, weight, space.local[k])
        scale_jets(weight, count, 1.0 / radius, dimension)
        for k in range(columns):
            scale_jets(space.local[k], count, 1.0 / radius, dimension)
            # The weights are added up once.
            totals = space.totals if k == 0 else space.spare
            add_product(weight, space.local[k], inside, count, dimension, level, space.sums[k], totals)
    for k in range(columns):
        divide(space.sums[k], space.totals, rows.size, dimension, level)
        for row in range(jets.shape[1]):
            for i in range(rows.size):
                jets[k, row, rows[i]] = space.sums[k, row, i]


@njit(nogil=True, cache=True)
def column_jets(model, ball, z, count, level, space):
    """Write the jets of every column of one ball's fit at the first `count` columns of z (d, ·)."""
    local, coefficients, lowered = space.local, space.coefficients, space.lowered
    first, last = model.offsets[ball], model.offsets[ball + 1]
    points, sites = block(model.sites, model, ball, len(z)), last - first
    for k in range(len(local)):
        tail_derivatives(model.tails[ball, k], model.exponents, lowered, level, coefficients)
        tail_jets(z, count, coefficients, lowered, space.terms, local[k])
    for i in range(count):
        radial_jets(z[:, i], points, model.power, level, space.scratch, space.radial)
        for k in range(len(local)):
            weights = model.weights[k, first:last]
            for row in range(local.shape[1]):
                local[k, row, i] += dot(weights, space.radial[row], sites)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def radial_jets(place, points, power, order, scratch, jets):
    """Write the jets (jet, n or more) of φ(|z − z_j|) at one place z (d,), a column for each of the points (d, n)."""
    dimension, sites = points.shape
    squared, slope, bend = scratch[0], scratch[1], scratch[2]
    squared_distances(place, points, sites, squared)
    values = jets[0]
    if power == 3:
        for j in range(sites):
            root = np.sqrt(squared[j])
            values[j], slope[j] = squared[j] * root, 3 * root
    else:
        radial_values(power, squared, sites, values)
        if order > 0:
            derivatives_over_r(power, squared, sites, slope)
    if order == 0:
        return
    for a in range(dimension):
        row = jets[1 + a]
        for j in range(sites):
            row[j] = slope[j] * (place[a] - points[a, j])
    if order == 1:
        return
    second_derivatives_over_r(power, squared, sites, bend)
    number = 1 + dimension
    for a in range(dimension):
        for b in range(a, dimension):
            row = jets[number]
            for j in range(sites):
                row[j] = bend[j] * (place[a] - points[a, j]) * (place[b] - points[b, j])
                if a == b:
                    row[j] += slope[j]
            number += 1
