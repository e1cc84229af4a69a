"""The compiled loops of this chapter: the tree of boxes, local fits over many balls, Shepard's blend.

Functions are serial and release the GIL; `o3dleaf.parallel` drives them over fixed blocks. The sum
at a query runs over the balls in the order of its leaf's list, so it does not depend on the blocks.
"""

import math

import numpy as np
from numba import njit

from o3dleaf.pu.weights import wendland, wendland_slope_over_tau
from o3dleaf.rbf.held_out import held_out
from o3dleaf.rbf.loops import local_gradient, local_value
from o3dleaf.rbf.solve import solve_local
from o3dleaf.rbf.spectrum import spectrum

LEAF_IMAGES = 8
"""A box that this few balls reach into is not split further."""

LEAF_SIDE = 0.5
"""Nor is one whose longest side is below this share of its smallest ball's radius."""

MOST_DEPTH = 60


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
def build_tree(centres, radii, low, high):
    """Halve the box until few balls reach into each part; return (axis, split, child, start, stop, items)."""
    axes, splits, children, starts, stops = [-1], [0.0], [-1], [0], [0]
    items = [np.int64(0)]
    items.pop()
    whole = within(np.arange(len(radii)), centres, radii, low, high)
    stack = [(0, low.copy(), high.copy(), whole, 0)]
    while len(stack) > 0:
        node, box_low, box_high, inside, depth = stack.pop()
        axis = int(np.argmax(box_high - box_low))
        side = box_high[axis] - box_low[axis]
        smallest = np.inf
        for item in inside:
            smallest = min(smallest, radii[item])
        if inside.size <= LEAF_IMAGES or side <= LEAF_SIDE * smallest or depth == MOST_DEPTH:
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


@njit(nogil=True, cache=True)
def locate(start, stop, points, tree, leaves):
    """Write the leaf of each point of the block."""
    axes, splits, children = tree[0], tree[1], tree[2]
    for i in range(start, stop):
        node = 0
        while axes[node] >= 0:
            node = children[node] + (1 if points[i, axes[node]] >= splits[node] else 0)
        leaves[i] = node


@njit(nogil=True, cache=True)
def holds(centre, radius, point):
    """Return whether a ball holds a point."""
    total = 0.0
    for axis in range(point.size):
        difference = point[axis] - centre[axis]
        total += difference * difference
    return total <= radius * radius


@njit(nogil=True, cache=True)
def count_members(points, leaves, tree, centres, radii, counts):
    """Count the points in image k into counts[k + 1]."""
    starts, stops, items = tree[3], tree[4], tree[5]
    for i in range(len(points)):
        for at in range(starts[leaves[i]], stops[leaves[i]]):
            if holds(centres[items[at]], radii[items[at]], points[i]):
                counts[items[at] + 1] += 1


@njit(nogil=True, cache=True)
def fill_members(points, leaves, tree, centres, radii, heads, rows):
    """Write the points in image k from rows[heads[k]] on."""
    starts, stops, items = tree[3], tree[4], tree[5]
    for i in range(len(points)):
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
def fit_balls(start, stop, points, values, trust, cover, exponents, power, smoothing, model, ranks, dropped):
    """Fit the balls start:stop; `smoothing` is each ball's diagonal in the data's unit, `trust` the points' weights."""
    centres, radii, offsets, members = cover
    sites, weights, tails = model
    dimension = centres.shape[1]
    for ball in range(start, stop):
        first, last = offsets[ball], offsets[ball + 1]
        local, data = gather(points, values, members[first:last], centres[ball], radii[ball])
        diagonal = smoothing[ball] / radii[ball] ** power / trust[members[first:last]]
        lam, tail, rank, lost = solve_local(local, data, exponents, power, diagonal)
        sites[dimension * first : dimension * last] = local.ravel()
        weights[first:last] = lam
        tails[ball] = tail
        ranks[ball] = rank
        dropped[ball] = lost


@njit(nogil=True, cache=True)
def ball_spectrum(ball, points, values, trust, cover, exponents, power):
    """Return the spectrum of one ball's weighted system, in unit coordinates."""
    centres, radii, offsets, members = cover
    rows = members[offsets[ball] : offsets[ball + 1]]
    local, data = gather(points, values, rows, centres[ball], radii[ball])
    return spectrum(local, data, np.sqrt(trust[rows]), exponents, power)


@njit(nogil=True, cache=True)
def ball_held_out(ball, points, values, trust, cover, exponents, power, smoothing, groups):
    """Return the held-out errors of one ball's fit at its own points; see `o3dleaf.rbf.held_out`."""
    centres, radii, offsets, members = cover
    rows = members[offsets[ball] : offsets[ball + 1]]
    local, data = gather(points, values, rows, centres[ball], radii[ball])
    diagonal = smoothing[ball] / radii[ball] ** power / trust[rows]
    return held_out(local, data, exponents, power, diagonal, groups[rows])


@njit(nogil=True, cache=True)
def blend(start, stop, order, queries, leaves, tree, images, model, values, gradients):
    """Fill Σ w_i F_i / Σ w_i, and its gradient where `gradients` has rows, at queries order[start:stop].

    `order` groups the queries by leaf, so that one ball's points stay in the cache for all of them.
    """
    starts, stops, items = tree[3], tree[4], tree[5]
    first = start
    while first < stop:
        leaf = leaves[order[first]]
        last = first + 1
        while last < stop and leaves[order[last]] == leaf:
            last += 1
        blend_leaf(order[first:last], items[starts[leaf] : stops[leaf]], queries, images, model, values, gradients)
        first = last


@njit(nogil=True, cache=True)
def blend_leaf(rows, items, queries, images, model, values, gradients):
    """Blend the images `items` at the queries `rows` of one leaf."""
    balls, shifts, radii, centres = images
    offsets, sites, weights, tails, steps, power = model
    count, dimension = rows.size, queries.shape[1]
    wanted = len(gradients) > 0
    sums, totals = np.zeros(count), np.zeros(count)
    slopes = np.zeros((count if wanted else 0, 2, dimension))
    z, slope = np.empty(dimension), np.empty(dimension)
    for item in items:
        ball = balls[item]
        first, last = offsets[ball], offsets[ball + 1]
        points = sites[dimension * first : dimension * last].reshape(dimension, last - first)
        strengths, tail = weights[first:last], tails[ball]
        scratch = np.empty((2, max(last - first, steps.shape[0])))
        radius = radii[item]
        for i in range(count):
            square = 0.0
            for axis in range(dimension):
                z[axis] = (queries[rows[i], axis] - shifts[item, axis] - centres[ball, axis]) / radius
                square += z[axis] * z[axis]
            if square >= 1.0:
                continue
            tau = math.sqrt(square)
            weight = wendland(tau)
            value = local_value(z, points, strengths, tail, steps, power, scratch)
            sums[i] += weight * value
            totals[i] += weight
            if wanted:
                local_gradient(z, points, strengths, tail, steps, power, scratch, slope)
                fall = wendland_slope_over_tau(tau)
                for axis in range(dimension):
                    slopes[i, 0, axis] += (fall * z[axis] * value + weight * slope[axis]) / radius
                    slopes[i, 1, axis] += fall * z[axis] / radius
    for i in range(count):
        value = sums[i] / totals[i]
        values[rows[i]] = value
        if wanted:
            for axis in range(dimension):
                gradients[rows[i], axis] = (slopes[i, 0, axis] - value * slopes[i, 1, axis]) / totals[i]
