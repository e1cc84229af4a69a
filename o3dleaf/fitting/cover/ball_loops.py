"""The compiled loops of covers: the tree of boxes, points folded into the box, points sorted into balls.

Functions are serial and release the GIL; `o3dleaf.core.parallel` drives them over fixed blocks.
"""

import math
from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.tail import IntArray

LEAF_IMAGES = 32
"""A box that this few balls reach into is not split further: what a point asks of balls that do not contain it costs
less than points that meet a ball by ones and twos."""

LEAF_SIDE = 2.0
"""Nor is one whose longest side is below this many radii of its smallest ball: smaller boxes have shorter lists, but
their many lists and nodes cost more to make and to fetch, and queries come in shorter strips."""

ABREAST = 8

LEAF_BITS = 11
"""Of the numbers of leaves, by which rows are sorted at once: so many counts lie in the first cache."""
LEAF_MASK = (1 << LEAF_BITS) - 1


class Balls(NamedTuple):
    """Balls and the points that each is fitted to: ball i to ``members[offsets[i]:offsets[i + 1]]``.

    Where there are `stretches` (M, d, d), the unit coordinates of a ball are multiplied with its own.
    """

    centers: FloatArray
    radii: FloatArray
    offsets: IntArray
    members: IntArray
    stretches: FloatArray


class Images(NamedTuple):
    """Balls where they are needed: the number of the ball of each image, and where the image lies."""

    balls: IntArray
    centers: FloatArray
    radii: FloatArray


class BoxTree(NamedTuple):
    """A tree of boxes over the images of balls.

    Attributes
    ----------
    axes, splits : (K,) int64, (K,) ndarrays
        Axis that a node is split across (−1: a leaf), and where.
    children : (K,) int64 ndarray
        The first of a node's two children.
    starts, stops : (K,) int64 ndarrays
        A leaf lists the images ``images[starts[k]:stops[k]]``.
    images : (total,) int64 ndarray
    """

    axes: IntArray
    splits: FloatArray
    children: IntArray
    starts: IntArray
    stops: IntArray
    images: IntArray


@njit(nogil=True, cache=True)
def reaches(center, radius, low, high):
    """Return whether a ball meets a box."""
    total = 0.0
    for axis in range(low.size):
        gap = max(low[axis] - center[axis], center[axis] - high[axis], 0.0)
        total += gap * gap
    return total <= radius * radius


@njit(nogil=True, cache=True)
def within(items, centers, radii, low, high):
    """Return those of `items` whose balls meet the box."""
    kept = np.empty(items.size, dtype=np.int64)
    count = 0
    for item in items:
        if reaches(centers[item], radii[item], low, high):
            kept[count] = item
            count += 1
    return kept[:count].copy()


@njit(nogil=True, cache=True)
def build_tree(centers, radii, low, high, candidates, max_depth):
    """Return the `BoxTree` of a box that is halved until few balls reach into each part."""
    axes, splits, children, starts, stops = [-1], [0.0], [-1], [0], [0]
    items = [np.int64(0)]
    items.pop()
    whole = within(candidates, centers, radii, low, high)
    stack = [(0, low.copy(), high.copy(), whole, 0)]
    while len(stack) > 0:
        node, box_low, box_high, inside, depth = stack.pop()
        axis = int(np.argmax(box_high - box_low))
        side = box_high[axis] - box_low[axis]
        smallest = np.inf
        for item in inside:
            smallest = min(smallest, radii[item])
        if inside.size <= LEAF_IMAGES or side <= LEAF_SIDE * smallest or depth == max_depth:
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
            reaching = within(inside, centers, radii, part_low, part_high)
            stack.append((len(axes), part_low, part_high, reaching, depth + 1))
            axes.append(-1)
            splits.append(0.0)
            children.append(-1)
            starts.append(0)
            stops.append(0)
    nodes = np.array(axes), np.array(splits), np.array(children)
    return BoxTree(nodes[0], nodes[1], nodes[2], np.array(starts), np.array(stops), np.array(items))


@njit(nogil=True, cache=True, error_model="numpy")
def fold(start, stop, points, bounds, period, tree, folded, leaves):
    """Move the points of the block into the box, by whole periods or to its nearest point; write the leaf of each."""
    axes, splits, children = tree.axes, tree.splits, tree.children
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
def order_by_leaf(leaves, count):
    """Return the rows in the order of their leaves (of `count`), rising within each.

    By counting sorts of some bits of their numbers: what that holds does not grow with the leaves.
    """
    order, before = np.arange(leaves.size), np.empty(leaves.size, dtype=np.int64)
    shift = 0
    while count >> shift > 0:
        order, before = before, order
        heads = np.zeros((1 << LEAF_BITS) + 1, dtype=np.int64)
        for row in before:
            heads[(leaves[row] >> shift & LEAF_MASK) + 1] += 1
        for digit in range(1 << LEAF_BITS):
            heads[digit + 1] += heads[digit]
        for row in before:
            digit = leaves[row] >> shift & LEAF_MASK
            order[heads[digit]] = row
            heads[digit] += 1
        shift += LEAF_BITS
    return order


@njit(nogil=True, cache=True)
def contains(center, radius, point):
    """Return whether a ball contains a point."""
    total = 0.0
    for axis in range(point.size):
        difference = point[axis] - center[axis]
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
def room_for_images(tree):
    """Return an array that has room for all images of any leaf, and one more."""
    widest = 0
    for leaf in range(tree.starts.size):
        widest = max(widest, tree.stops[leaf] - tree.starts[leaf])
    return np.empty(widest + 1, dtype=np.int64)


@njit(nogil=True, cache=True)
def find_images(point, listed, images, found):
    """Write which of the images `listed` contain a point, in their order; return how many."""
    count = 0
    for image in listed:
        # Without a branch, which would be guessed wrongly once for each that contains it.
        found[count] = image
        count += contains(images.centers[image], images.radii[image], point)
    return count


@njit(nogil=True, cache=True)
def count_members(start, stop, points, leaves, tree, images, counts):
    """Count those of the points start:stop in image k into counts[k]."""
    found = room_for_images(tree)
    for i in range(start, stop):
        listed = tree.images[tree.starts[leaves[i]] : tree.stops[leaves[i]]]
        for k in range(find_images(points[i], listed, images, found)):
            counts[found[k]] += 1


@njit(nogil=True, cache=True)
def fill_members(start, stop, points, leaves, tree, images, heads, rows):
    """Write those of the points start:stop in image k from rows[heads[k]] on."""
    found = room_for_images(tree)
    for i in range(start, stop):
        listed = tree.images[tree.starts[leaves[i]] : tree.stops[leaves[i]]]
        for k in range(find_images(points[i], listed, images, found)):
            rows[heads[found[k]]] = i
            heads[found[k]] += 1


@njit(nogil=True, cache=True)
def mark_members(start, stop, points, leaves, tree, images, chosen, inside):
    """Write which of the points start:stop lie in one of the images that a mask has `chosen`."""
    for i in range(start, stop):
        inside[i] = False
        for k in range(tree.starts[leaves[i]], tree.stops[leaves[i]]):
            image = tree.images[k]
            if chosen[image] and contains(images.centers[image], images.radii[image], points[i]):
                inside[i] = True
                break


@njit(nogil=True, cache=True)
def rows_of(balls, ball):
    """Return the points that a ball is fitted to."""
    return balls.members[balls.offsets[ball] : balls.offsets[ball + 1]]
