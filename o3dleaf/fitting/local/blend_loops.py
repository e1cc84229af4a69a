"""The compiled blend: Shepard's sum over the balls that contain a point.

The sum at a query runs over the balls in the order of its leaf's list, so it does not depend on the blocks. What is
in the balls is a record: `blend` knows of it the `exponents` of its tails, the `sites`, of whose type its sums are,
and how many sites the `widest` ball has; the rest is known to the overload of `ball_jets` for its type.
"""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.local.jet_loops import add_product, divide, scale_jets, stretch, stretch_jets
from o3dleaf.fitting.local.weight_loops import weight_jets
from o3dleaf.fitting.rbf.evaluation_loops import jet_size, local_jets, lower_exponents, tail_derivatives
from o3dleaf.fitting.rbf.potential_loops import potential_jets

STRIP = 256
"""Points of one leaf that are blended at once: what is known of them stays in the nearest cache."""

FAR, FAR_SINGLE = 2.0**20, 2.0**10
"""Radii of a ball beyond the box, along an axis, after which its fit stays as it is, in double and single precision:
of r³ and a value that grows as r rounding has left no digit long before, and r⁷ times a weight must not overflow."""


class SplineBalls(NamedTuple):
    """What the blend reads of splines of values, all balls end to end; see `o3dleaf.fitting.local.splines`."""

    offsets: Any
    places: Any
    sites: Any
    weights: Any
    tails: Any
    exponents: Any
    power: Any
    widest: Any


class StretchedBalls(NamedTuple):
    """The same of splines in unit coordinates that are multiplied with the matrices `stretches` (M, d, d)."""

    splines: Any
    stretches: Any
    sites: Any
    exponents: Any
    widest: Any

    @classmethod
    def of(cls, splines: SplineBalls, stretches: FloatArray) -> "StretchedBalls":
        """Return splines with the stretches of their balls."""
        return cls(splines, stretches, splines.sites, splines.exponents, splines.widest)


class PotentialBalls(NamedTuple):
    """The same of splines of values and gradients, whose `moments` lie as the sites do."""

    offsets: Any
    places: Any
    sites: Any
    weights: Any
    tails: Any
    exponents: Any
    power: Any
    widest: Any
    moments: Any


class Workspace(NamedTuple):
    """The arrays that `blend_strip` works in: a quarter of a megabyte at most, in three dimensions.

    Attributes
    ----------
    points, away : (d, STRIP)
        The points of a strip, and how far the queries lie outside the box, if any does.
    unit, place, stretched : (d, STRIP)
        The unit coordinates of those of them that a ball contains, and those at which its fit is asked for: the same,
        but outside the box; and the latter stretched.
    squared, inside : (STRIP,)
        Squared distances from a center, and numbers of the points that its ball contains.
    weight, local, sums, totals, spare : (jet, STRIP)
        Jets of a ball's weight and of its fit, the sums of both, and room for one more fit.
    lowered, terms, coefficients, radial
        As `local_jets` needs them.
    """

    points: Any
    away: Any
    unit: Any
    place: Any
    stretched: Any
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
    radial: Any


@njit(nogil=True, cache=True)
def blend(start, stop, order, queries, folded, period, leaves, tree, images, model, level, jets):
    """Fill the jets, to derivatives of `level`, of Σ w_i F_i / Σ w_i at the points order[start:stop].

    `order` groups the points by leaf, so that one ball's data stay in the cache for all of them. `queries` has rows if
    some of them lie outside the box, whose nearest point `folded` is: the weights are those of the nearest point, and
    the fits go on. Along axes with a `period` nothing is outside.
    """
    space = workspace(images, model, level)
    first = start
    while first < stop:
        leaf = leaves[order[first]]
        last = first + 1
        while last < stop and last - first < STRIP and leaves[order[last]] == leaf:
            last += 1
        listed = tree.images[tree.starts[leaf] : tree.stops[leaf]]
        blend_strip(order[first:last], listed, queries, folded, period, images, model, level, space, jets)
        first = last


@njit(nogil=True, cache=True)
def workspace(images, model, level):
    """Return the arrays that `blend_strip` works in."""
    dimension, terms = images.centers.shape[1], len(model.exponents)
    size = jet_size(dimension, level)
    return Workspace(
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty(STRIP),
        np.empty(STRIP, dtype=np.int64),
        np.empty((size, STRIP)),
        np.empty((size, STRIP)),
        np.empty((size, STRIP)),
        np.empty((size, STRIP)),
        np.empty((size, STRIP)),
        lower_exponents(model.exponents),
        np.empty((terms, STRIP)),
        np.empty((size, terms)),
        np.zeros((3, model.widest), dtype=model.sites.dtype),
    )


@njit(nogil=True, inline="always")  # a view: those that take it have no array of their own
def block(flat, model, ball, dimension):
    """Return the (d, N) block of one ball in an array that lies as the sites do."""
    count = model.offsets[ball + 1] - model.offsets[ball]
    return flat[model.places[ball] : model.places[ball] + dimension * count].reshape(dimension, count)


def ball_jets(model, ball, z, count, space, level, local):
    """Write the jets of one ball's fit at the first `count` columns of z (d, ·): Numba chooses by the model's type."""
    raise NotImplementedError


@overload(ball_jets, jit_options={"nogil": True})
def ball_jets_of_splines(model, ball, z, count, space, level, local):  # noqa: ARG001 - types, of which one chooses
    """Return the function for splines of values."""
    return spline_jets if model.instance_class is SplineBalls else None


@overload(ball_jets, jit_options={"nogil": True})
def ball_jets_of_stretched(model, ball, z, count, space, level, local):  # noqa: ARG001 - types, of which one chooses
    """Return the function for splines in stretched coordinates."""
    return stretched_jets if model.instance_class is StretchedBalls else None


@overload(ball_jets, jit_options={"nogil": True})
def ball_jets_of_potentials(model, ball, z, count, space, level, local):  # noqa: ARG001 - types, of which one chooses
    """Return the function for splines of values and gradients."""
    return potential_spline_jets if model.instance_class is PotentialBalls else None


def spline_jets(model, ball, z, count, space, level, local):
    """`ball_jets` of splines of values."""
    coefficients, lowered, terms = space.coefficients, space.lowered, space.terms
    tail_derivatives(model.tails[ball], model.exponents, lowered, level, coefficients)
    points = block(model.sites, model, ball, len(z))
    weights = model.weights[model.offsets[ball] : model.offsets[ball + 1]]
    local_jets(z, count, points, weights, coefficients, lowered, model.power, level, terms, space.radial, local)


def stretched_jets(model, ball, z, count, space, level, local):
    """`ball_jets` of splines in stretched coordinates."""
    matrix, stretched = model.stretches[ball], space.stretched
    stretch(matrix, z, count, stretched)
    ball_jets(model.splines, ball, stretched, count, space, level, local)
    stretch_jets(matrix, local, count)


def potential_spline_jets(model, ball, z, count, space, level, local):
    """`ball_jets` of splines of values and gradients."""
    coefficients, lowered, terms = space.coefficients, space.lowered, space.terms
    tail_derivatives(model.tails[ball], model.exponents, lowered, level, coefficients)
    points, moments = block(model.sites, model, ball, len(z)), block(model.moments, model, ball, len(z))
    weights = model.weights[model.offsets[ball] : model.offsets[ball + 1]]
    power, radial = model.power, space.radial
    potential_jets(z, count, points, weights, moments, coefficients, lowered, power, level, terms, radial, local)


@njit(nogil=True, cache=True)
def blend_strip(rows, listed, queries, folded, period, images, model, level, space, jets):
    """Blend the images `listed` at the points `rows` of one leaf."""
    points, unit, inside, far = space.points, space.unit, space.inside, far_of(model.sites)
    outside = len(queries) > 0
    place = space.place if outside else unit
    weight, local, sums, totals = space.weight, space.local, space.sums, space.totals
    dimension = folded.shape[1]
    for axis in range(dimension):
        for i in range(rows.size):
            points[axis, i] = folded[rows[i], axis]
            if outside:
                space.away[axis, i] = 0.0 if period[axis] > 0.0 else queries[rows[i], axis] - folded[rows[i], axis]
    sums[:, : rows.size] = 0.0
    totals[:, : rows.size] = 0.0
    for image in listed:
        ball, radius = images.balls[image], images.radii[image]
        count = select_inside(points, rows.size, images.centers[image], radius, space.squared, unit, inside)
        if count == 0:
            continue
        if outside:
            go_on(space.away, inside, count, radius, far, unit, place)
        ball_jets(model, ball, place, count, space, level, local)
        weight_jets(unit, count, level, weight)
        if outside and level > 0:
            hold(space.away, inside, count, radius, far, weight, local)
        scale_jets(local, count, 1.0 / radius, dimension)
        scale_jets(weight, count, 1.0 / radius, dimension)
        add_product(weight, local, inside, count, dimension, level, sums, totals)
    divide(sums, totals, rows.size, dimension, level)
    for row in range(len(jets)):
        for i in range(rows.size):
            jets[row, rows[i]] = sums[row, i]


@njit(nogil=True, cache=True)
def far_of(sites):
    """Return how many radii beyond the box a fit goes on, in the precision of its sums."""
    return FAR_SINGLE if sites.itemsize == 4 else FAR


@njit(nogil=True, cache=True, error_model="numpy")
def go_on(away, inside, count, radius, far, unit, place):
    """Write where a ball's fit is asked for: at the points themselves, and no farther than `far` radii outside."""
    for axis in range(len(unit)):
        for i in range(count):
            place[axis, i] = unit[axis, i]
            moved = away[axis, inside[i]]
            if moved != 0.0:
                place[axis, i] += min(max(moved / radius, -far), far)


@njit(nogil=True, cache=True, error_model="numpy")
def hold(away, inside, count, radius, far, weight, local):
    """Set the derivatives to zero along axes on which nothing changes outside: weights', and fits' where far away."""
    dimension = len(away)
    for i in range(count):
        row = 1 + dimension
        for a in range(dimension):
            one = abs(away[a, inside[i]]) / radius
            if one > 0.0:
                weight[1 + a, i] = 0.0
            if one > far:
                local[1 + a, i] = 0.0
            for b in range(a, dimension if len(weight) > 1 + dimension else 0):
                most = max(one, abs(away[b, inside[i]]) / radius)
                if most > 0.0:
                    weight[row, i] = 0.0
                if most > far:
                    local[row, i] = 0.0
                row += 1


@njit(nogil=True, cache=True, error_model="numpy")
def select_inside(points, count, center, radius, squared, unit, inside):
    """Write unit coordinates and numbers of those of the points (d, ·) that a ball contains; return how many."""
    squared[:count] = 0.0
    for axis in range(center.size):
        for i in range(count):
            difference = points[axis, i] - center[axis]
            squared[i] += difference * difference
    number = 0
    for i in range(count):
        # Without a branch, which would be guessed wrongly half of the time.
        inside[number] = i
        number += squared[i] < radius * radius
    for axis in range(center.size):
        for i in range(number):
            unit[axis, i] = (points[axis, inside[i]] - center[axis]) / radius
    return number
