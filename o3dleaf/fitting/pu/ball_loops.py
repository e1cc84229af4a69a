"""The compiled loops of this chapter: the tree of boxes, local fits over many balls, Shepard's blend.

Functions are serial and release the GIL; `o3dleaf.core.parallel` drives them over fixed blocks. The sum
at a query runs over the balls in the order of its leaf's list, so it does not depend on the blocks.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload

from o3dleaf.fitting.pu.jet_loops import add_product, divide, scale_jets
from o3dleaf.fitting.pu.weight_loops import weight_jets
from o3dleaf.fitting.rbf.evaluation_loops import jet_size, local_jets, lower_exponents, put, tail_derivatives
from o3dleaf.fitting.rbf.held_out_loops import held_out
from o3dleaf.fitting.rbf.potential_loops import potential_jets
from o3dleaf.fitting.rbf.shared_error_loops import shared_squares
from o3dleaf.fitting.rbf.solve_loops import solve_local
from o3dleaf.fitting.rbf.spectrum_loops import held_out_squares, spectra

LEAF_IMAGES = 32
"""A box that this few balls reach into is not split further: what a point asks of balls that do not hold it costs less
than points that meet a ball by ones and twos."""

LEAF_SIDE = 2.0
"""Nor is one whose longest side is below this many radii of its smallest ball: smaller boxes have shorter lists, but
their many lists and nodes cost more to make and to fetch, and queries come in shorter strips."""

ABREAST = 8

STRIP = 256
"""Points of one leaf that are blended at once: what is known of them stays in the nearest cache."""


class SplineBalls(NamedTuple):
    """What the blend reads of splines of values, all balls end to end; see `o3dleaf.fitting.pu.local.LocalSplines`."""

    offsets: Any
    places: Any
    sites: Any
    weights: Any
    tails: Any
    exponents: Any
    power: Any
    widest: Any


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


class CreasedBalls(NamedTuple):
    """Splines of values, several to a ball, and how they are joined; see `CreasedSplines`."""

    splines: Any
    first: Any
    joins: Any


@njit(nogil=True, cache=True)
def reaches(centre, radius, low, high):
    """Return whether a ball meets a box."""
    total = 0.0
    for axis in range(low.size):
        gap = max(low[axis] - centre[axis], centre[axis] - high[axis], 0.0)
        total += gap * gap
    return total <= radius * radius


@njit(nogil=True, cache=True)
def within(items, centres, radii, low, high):
    """Return those of `items` whose balls meet the box."""
    kept = np.empty(items.size, dtype=np.int64)
    count = 0
    for item in items:
        if reaches(centres[item], radii[item], low, high):
            kept[count] = item
            count += 1
    return kept[:count].copy()


@njit(nogil=True, cache=True)
def build_tree(centres, radii, low, high, candidates, most_depth):
    """Halve the box until few balls reach into each part; return (axis, split, child, start, stop, items)."""
    axes, splits, children, starts, stops = [-1], [0.0], [-1], [0], [0]
    items = [np.int64(0)]
    items.pop()
    whole = within(candidates, centres, radii, low, high)
    stack = [(0, low.copy(), high.copy(), whole, 0)]
    while len(stack) > 0:
        node, box_low, box_high, inside, depth = stack.pop()
        axis = int(np.argmax(box_high - box_low))
        side = box_high[axis] - box_low[axis]
        smallest = np.inf
        for item in inside:
            smallest = min(smallest, radii[item])
        if inside.size <= LEAF_IMAGES or side <= LEAF_SIDE * smallest or depth == most_depth:
            starts[node] = len(items)
            for item in inside:
                items.append(item)
            stops[node] = len(items)
            continue
        middle = 0.5 * (box_low[axis] + box_high[axis])
        axes[node], splits[node], children[node] = axis, middle, len(axes)
        for part in range(2):
            part_low, part_high = box_low.copy(), box_high.copy()
            if part == 0:
                part_high[axis] = middle
            else:
                part_low[axis] = middle
            reaching = within(inside, centres, radii, part_low, part_high)
            stack.append((len(axes), part_low, part_high, reaching, depth + 1))
            axes.append(-1)
            splits.append(0.0)
            children.append(-1)
            starts.append(0)
            stops.append(0)
    return np.array(axes), np.array(splits), np.array(children), np.array(starts), np.array(stops), np.array(items)


@njit(nogil=True, cache=True, error_model="numpy")
def fold(start, stop, points, bounds, period, tree, folded, leaves):
    """Move the points of the block into the box, by whole periods or to its nearest point; write the leaf of each."""
    axes, splits, children = tree[0], tree[1], tree[2]
    for i in range(start, stop):
        for axis in range(period.size):
            x, low, high = points[i, axis], bounds[0, axis], bounds[1, axis]
            if period[axis] > 0.0:
                x -= math.floor((x - low) / period[axis]) * period[axis]
            folded[i, axis] = min(max(x, low), high)
        leaves[i] = 0
    # Several descents side by side: each waits for memory at every step.
    for first in range(start, stop, ABREAST):
        last = min(first + ABREAST, stop)
        descending = True
        while descending:
            descending = False
            for i in range(first, last):
                node = leaves[i]
                axis = axes[node]
                if axis >= 0:
                    leaves[i] = children[node] + (1 if folded[i, axis] >= splits[node] else 0)
                    descending = True


@njit(nogil=True, cache=True)
def group(leaves, count):
    """Return the rows in the order of their leaves (of `count`), rising within each: a counting sort."""
    heads = np.zeros(count + 1, dtype=np.int64)
    for leaf in leaves:
        heads[leaf + 1] += 1
    for leaf in range(count):
        heads[leaf + 1] += heads[leaf]
    order = np.empty(leaves.size, dtype=np.int64)
    for row in range(leaves.size):
        order[heads[leaves[row]]] = row
        heads[leaves[row]] += 1
    return order


@njit(nogil=True, cache=True)
def holds(centre, radius, point):
    """Return whether a ball holds a point."""
    total = 0.0
    for axis in range(point.size):
        difference = point[axis] - centre[axis]
        total += difference * difference
    return total <= radius * radius


@njit(nogil=True, cache=True)
def count_cells(cells, count):
    """Return how many of the points lie in each cell; those in cell −1 do not matter."""
    counts = np.zeros(count, dtype=np.int64)
    for cell in cells:
        if cell >= 0:
            counts[cell] += 1
    return counts


@njit(nogil=True, cache=True)
def move_to_halves(cells, points, rows, axis, middle):
    """Replace each point's cell by rows[cell], its number among the cells that are halved, plus theirs if above."""
    for i in range(cells.size):
        if cells[i] >= 0:
            row = rows[cells[i]]
            cells[i] = row
            if row >= 0 and points[i, axis[row]] >= middle[row]:
                cells[i] = row + middle.size


@njit(nogil=True, cache=True)
def count_members(start, stop, points, leaves, tree, centres, radii, counts):
    """Count those of the points start:stop in image k into counts[k]."""
    starts, stops, items = tree[3], tree[4], tree[5]
    for i in range(start, stop):
        for at in range(starts[leaves[i]], stops[leaves[i]]):
            if holds(centres[items[at]], radii[items[at]], points[i]):
                counts[items[at]] += 1


@njit(nogil=True, cache=True)
def fill_members(start, stop, points, leaves, tree, centres, radii, heads, rows):
    """Write those of the points start:stop in image k from rows[heads[k]] on."""
    starts, stops, items = tree[3], tree[4], tree[5]
    for i in range(start, stop):
        for at in range(starts[leaves[i]], stops[leaves[i]]):
            item = items[at]
            if holds(centres[item], radii[item], points[i]):
                rows[heads[item]] = i
                heads[item] += 1


@njit(nogil=True, cache=True)
def gather(points, values, rows, centre, radius):
    """Return the unit coordinates (d, n) and the values of the points `rows` of a ball."""
    count, dimension = rows.size, centre.size
    local = np.empty((dimension, count))
    data = np.empty(count)
    for j in range(count):
        data[j] = values[rows[j]]
        for axis in range(dimension):
            local[axis, j] = (points[rows[j], axis] - centre[axis]) / radius
    return local, data


@njit(nogil=True, cache=True)
def fit_balls(start, stop, points, values, trust, cover, tail, power, smoothing, model, ranks, dropped):
    """Fit the balls start:stop; `smoothing` is each ball's diagonal in the data's unit, `trust` the points' weights.

    `tail` is the exponents and how many of them each ball has; the coefficients of the others stay as they are.
    """
    exponents, terms = tail
    centres, radii, offsets, members = cover
    sites, weights, tails = model
    dimension = centres.shape[1]
    for ball in range(start, stop):
        first, last = offsets[ball], offsets[ball + 1]
        local, data = gather(points, values, members[first:last], centres[ball], radii[ball])
        diagonal = smoothing[ball] / radii[ball] ** power / trust[members[first:last]]
        lam, coefficients, rank, lost = solve_local(local, data, exponents[: terms[ball]], power, diagonal)
        put(local.ravel(), sites[dimension * first : dimension * last])
        put(lam, weights[first:last])
        put(coefficients, tails[ball])
        ranks[ball] = rank
        dropped[ball] = lost


@njit(nogil=True, cache=True)
def ball_spectrum(ball, points, values, trust, cover, exponents, power):
    """Return the spectrum of one ball's weighted system, in unit coordinates."""
    centres, radii, offsets, members = cover
    rows = members[offsets[ball] : offsets[ball + 1]]
    local, data = gather(points, values, rows, centres[ball], radii[ball])
    eigenvalues, coefficients = spectra(local, data.reshape(1, -1), np.sqrt(trust[rows]), exponents, power)
    return eigenvalues, coefficients[0]


@njit(nogil=True, cache=True)
def own_rows(rows, owners):
    """Return the place in `rows`, rising, of each row's owner; −1 where it is not among them."""
    own = np.searchsorted(rows, owners[rows])
    for j in range(own.size):
        if own[j] == rows.size or rows[own[j]] != owners[rows[j]]:
            own[j] = -1
    return own


@njit(nogil=True, cache=True)
def ball_held_out_squares(ball, points, values, trust, cover, exponents, power, owners, amounts, most):
    """Return one ball's `held_out_squares`, and its sums of blocks of up to `most` rows and their numbers."""
    centres, radii, offsets, members = cover
    rows = members[offsets[ball] : offsets[ball + 1]]
    local, data = gather(points, values, rows, centres[ball], radii[ball])
    blocks, groups = np.zeros((most, amounts.size, most, most)), np.zeros(most)
    squares, judged = held_out_squares(
        local, data, np.sqrt(trust[rows]), exponents, power, own_rows(rows, owners), amounts, blocks, groups
    )
    return squares, judged, blocks, groups


@njit(nogil=True, cache=True)
def ball_shared_squares(ball, points, values, trust, cover, exponents, power, owners, amounts, inverses):
    """Return one ball's `shared_squares`."""
    centres, radii, offsets, members = cover
    rows = members[offsets[ball] : offsets[ball + 1]]
    local, data = gather(points, values, rows, centres[ball], radii[ball])
    own = own_rows(rows, owners)
    return shared_squares(local, data, np.sqrt(trust[rows]), exponents, power, own, amounts, inverses)


@njit(nogil=True, cache=True)
def ball_held_out(ball, points, values, trust, cover, exponents, power, smoothing, groups):
    """Return the held-out errors of one ball's fit at its own points; see `o3dleaf.fitting.rbf.held_out_loops`."""
    centres, radii, offsets, members = cover
    rows = members[offsets[ball] : offsets[ball + 1]]
    local, data = gather(points, values, rows, centres[ball], radii[ball])
    diagonal = smoothing[ball] / radii[ball] ** power / trust[rows]
    return held_out(local, data, exponents, power, diagonal, groups[rows])


@njit(nogil=True, cache=True)
def blend(start, stop, order, folded, leaves, tree, images, model, level, jets):
    """Fill the jets, to derivatives of `level`, of Σ w_i F_i / Σ w_i at the points order[start:stop].

    `order` groups the points by leaf, so that one ball's data stay in the cache for all of them.
    """
    starts, stops, items = tree[3], tree[4], tree[5]
    scratch = working_space(images, model, level)
    first = start
    while first < stop:
        leaf = leaves[order[first]]
        last = first + 1
        while last < stop and last - first < STRIP and leaves[order[last]] == leaf:
            last += 1
        blend_strip(order[first:last], items[starts[leaf] : stops[leaf]], folded, images, model, level, scratch, jets)
        first = last


@njit(nogil=True, cache=True)
def working_space(images, model, level):
    """Return the arrays that `blend_strip` works in: a quarter of a megabyte at most, in three dimensions."""
    dimension, splines = images[1].shape[1], splines_of(model)
    sites, exponents, widest = splines.sites, splines.exponents, splines.widest
    size = jet_size(dimension, level)
    return (
        np.empty((dimension, STRIP)),
        np.empty((dimension, STRIP)),
        np.empty(STRIP),
        np.empty(STRIP, dtype=np.int64),
        np.empty((5, size, STRIP)),
        lower_exponents(exponents),
        np.empty((len(exponents), STRIP)),
        np.empty((size, len(exponents))),
        np.zeros((3, widest), dtype=sites.dtype),
    )


@njit(nogil=True, cache=True)
def block(flat, model, ball, dimension):
    """Return the (d, N) block of one ball in an array that lies as the sites do."""
    count = model.offsets[ball + 1] - model.offsets[ball]
    return flat[model.places[ball] : model.places[ball] + dimension * count].reshape(dimension, count)


def splines_of(model):
    """Return the balls that hold sites, weights and tails."""
    raise NotImplementedError


@overload(splines_of, jit_options={"nogil": True})
def splines_of_type(model):
    """Return the function for a type of model."""
    if model.instance_class is CreasedBalls:
        return lambda model: model.splines
    return lambda model: model


def ball_jets(model, ball, z, count, scratch, level, local):
    """Write the jets of one ball's fit at the first `count` columns of z (d, ·): Numba chooses by the model's type."""
    raise NotImplementedError


@overload(ball_jets, jit_options={"nogil": True})
def ball_jets_of(model, ball, z, count, scratch, level, local):  # noqa: ARG001 - types, of which one chooses
    """Return the function for a type of model."""
    if model.instance_class is CreasedBalls:
        return creased_ball_jets
    return spline_ball_jets if model.instance_class is SplineBalls else potential_ball_jets


def spline_ball_jets(model, ball, z, count, scratch, level, local):
    """`ball_jets` of splines of values."""
    coefficients, lowered, terms, radial, _ = scratch
    tail_derivatives(model.tails[ball], model.exponents, lowered, level, coefficients)
    points = block(model.sites, model, ball, len(z))
    weights = model.weights[model.offsets[ball] : model.offsets[ball + 1]]
    local_jets(z, count, points, weights, coefficients, lowered, model.power, level, terms, radial, local)


def potential_ball_jets(model, ball, z, count, scratch, level, local):
    """`ball_jets` of splines of values and gradients."""
    coefficients, lowered, terms, radial, _ = scratch
    tail_derivatives(model.tails[ball], model.exponents, lowered, level, coefficients)
    points, moments = block(model.sites, model, ball, len(z)), block(model.moments, model, ball, len(z))
    weights = model.weights[model.offsets[ball] : model.offsets[ball + 1]]
    potential_jets(z, count, points, weights, moments, coefficients, lowered, model.power, level, terms, radial, local)


def creased_ball_jets(model, ball, z, count, scratch, level, local):
    """`ball_jets` of sheets: where another is below (minimum) or above (maximum) the ones before, its jet is taken."""
    sheet = scratch[4]
    ball_jets(model.splines, model.first[ball], z, count, scratch, level, local)
    for piece in range(model.first[ball] + 1, model.first[ball + 1]):
        ball_jets(model.splines, piece, z, count, scratch, level, sheet)
        for i in range(count):
            if model.joins[piece] * (sheet[0, i] - local[0, i]) > 0.0:
                for row in range(len(local)):
                    local[row, i] = sheet[row, i]


@njit(nogil=True, cache=True)
def blend_strip(rows, items, folded, images, model, level, scratch, jets):
    """Blend the images `items` at the points `rows` of one leaf."""
    balls, centres, radii = images
    at, z, squared, held, (weight, local, sums, totals, sheet), lowered, terms, coefficients, radial = scratch
    dimension = folded.shape[1]
    for axis in range(dimension):
        for i in range(rows.size):
            at[axis, i] = folded[rows[i], axis]
    sums[:, : rows.size] = 0.0
    totals[:, : rows.size] = 0.0
    for item in items:
        ball, radius = balls[item], radii[item]
        count = hold(at, rows.size, centres[item], radius, squared, z, held)
        if count == 0:
            continue
        ball_jets(model, ball, z, count, (coefficients, lowered, terms, radial, sheet), level, local)
        weight_jets(z, count, level, weight)
        scale_jets(local, count, 1.0 / radius, dimension)
        scale_jets(weight, count, 1.0 / radius, dimension)
        add_product(weight, local, held, count, dimension, level, sums, totals)
    divide(sums, totals, rows.size, dimension, level)
    for row in range(len(jets)):
        for i in range(rows.size):
            jets[row, rows[i]] = sums[row, i]


@njit(nogil=True, cache=True, error_model="numpy")
def hold(at, count, centre, radius, squared, z, held):
    """Write unit coordinates and numbers of those of the points `at` (d, ·) that a ball holds; return how many."""
    squared[:count] = 0.0
    for axis in range(centre.size):
        for i in range(count):
            difference = at[axis, i] - centre[axis]
            squared[i] += difference * difference
    found = 0
    for i in range(count):
        # Without a branch, which would be guessed wrongly half of the time.
        held[found] = i
        found += squared[i] < radius * radius
    for axis in range(centre.size):
        for i in range(found):
            z[axis, i] = (at[axis, held[i]] - centre[axis]) / radius
    return found
