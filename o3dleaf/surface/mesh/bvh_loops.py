"""The compiled loops of bounding volume hierarchies (BVH) over triangles, a tree for each class of size.

A tree over k triangles has 2^depth leaves; node j of a level holds the triangles from j k / 2^level on, so that the
tree is its order alone. Large triangles never widen a tree of small ones; between two trees the fewer triangles are
looked up among the more, and leave out what their own planes and sides miss.

Boxes are in single precision. Rounding never swaps two numbers: boxes that overlap still do.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.mesh.contact_loops import find_view, meet

LEAF_SIZE = 8
"""Triangles in a leaf at most."""

MAX_DEPTH = 64
"""Levels of a tree at most, and so the nodes that wait while it is searched."""


class Tree(NamedTuple):
    """A BVH over k triangles of a class of size.

    Attributes
    ----------
    rows : (k,) ndarray of int32 or int64
        The triangles, in the order of the leaves.
    boxes : (k, 6) ndarray of float32
        Lower, then upper corner of each, less an origin.
    nodes : (2^(depth + 1), 6) ndarray of float32
        Node 2^level + j is node j of a level.
    depth : int
    """

    rows: npt.NDArray[np.signedinteger[Any]]
    boxes: npt.NDArray[np.float32]
    nodes: npt.NDArray[np.float32]
    depth: int


@njit(nogil=True, cache=True)
def view_triangles(vertices, triangles, step, start, stop, view, size):
    """Fill rows start:stop of the views of triangles, and their classes of size: log of the box's longest side.

    Parameters
    ----------
    step : int
        Doublings of size in a class.
    view, size : (m,) ndarrays of int8 and int16
    """
    for t in range(start, stop):
        a = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        view[t] = find_view(vertices, a)
        longest = 0.0
        for axis in range(3):
            x, y, z = vertices[a[0], axis], vertices[a[1], axis], vertices[a[2], axis]
            longest = max(longest, max(x, y, z) - min(x, y, z))
        size[t] = math.frexp(longest)[1] // step


@njit(nogil=True, cache=True)
def box_triangles(vertices, triangles, origin, rows, start, stop, boxes):
    """Fill rows start:stop of the (k, 6) boxes, lower then upper corner less `origin`, of the triangles in `rows`."""
    for n in range(start, stop):
        t = rows[n]
        for axis in range(3):
            x, y, z = vertices[triangles[t, 0], axis], vertices[triangles[t, 1], axis], vertices[triangles[t, 2], axis]
            boxes[n, axis] = min(x, y, z) - origin[axis]
            boxes[n, 3 + axis] = max(x, y, z) - origin[axis]


@njit(nogil=True, cache=True)
def split_level(boxes, order, key, level, start, stop):
    """Split nodes start:stop of a level in two halves, along the axis on which their centres spread most."""
    for node in range(start, stop):
        low, high = node * len(order) >> level, (node + 1) * len(order) >> level
        best, axis = -1.0, 0
        for candidate in range(3):
            least, most = np.inf, -np.inf
            for n in range(low, high):
                centre = boxes[order[n], candidate] + boxes[order[n], 3 + candidate]
                least, most = min(least, centre), max(most, centre)
            if most - least > best:
                best, axis = most - least, candidate
        for n in range(low, high):
            key[n] = boxes[order[n], axis] + boxes[order[n], 3 + axis]
        _select(key, order, low, high - 1, (2 * node + 1) * len(order) >> (level + 1))


@njit(nogil=True, cache=True)
def _select(key, order, low, high, middle):
    """Reorder low..high so that what is before `middle` has no larger key than what is from there on (Hoare)."""
    while low < high:
        first, second, third = key[low], key[(low + high) >> 1], key[high]
        pivot = max(min(first, second), min(max(first, second), third))
        i, j = low, high
        while i <= j:
            while key[i] < pivot:
                i += 1
            while key[j] > pivot:
                j -= 1
            if i <= j:
                key[i], key[j] = key[j], key[i]
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@njit(nogil=True, cache=True)
def bound_leaves(boxes, depth, start, stop, nodes):
    """Fill the boxes of leaves start:stop; node 2^level + j of (2^(depth + 1), 6) `nodes` is node j of a level."""
    for leaf in range(start, stop):
        box = nodes[(1 << depth) + leaf]
        box[:3], box[3:] = np.inf, -np.inf
        for n in range(leaf * len(boxes) >> depth, (leaf + 1) * len(boxes) >> depth):
            _widen(box, boxes[n])


@njit(nogil=True, cache=True)
def bound_nodes(nodes):
    """Fill the boxes of all nodes above the leaves."""
    for node in range(len(nodes) // 2 - 1, 0, -1):
        for side in range(6):
            nodes[node, side] = nodes[2 * node, side]
        _widen(nodes[node], nodes[2 * node + 1])


@njit(nogil=True, cache=True)
def _widen(box, other):
    for axis in range(3):
        box[axis] = min(box[axis], other[axis])
        box[3 + axis] = max(box[3 + axis], other[3 + axis])


@njit(nogil=True, cache=True)
def _overlap(a, b):
    """Say whether two boxes share a point."""
    return (
        a[0] <= b[3] and b[0] <= a[3] and a[1] <= b[4] and b[1] <= a[4] and a[2] <= b[5] and b[2] <= a[5]
    )  # fmt: skip


@njit(nogil=True, cache=True)
def cross_within(vertices, triangles, view, tree, start, stop, crosses):
    """Mark the triangles of leaves start:stop that meet others of the same or a later leaf of their tree, and those."""
    rows, boxes, nodes, depth = tree
    many, waiting, levels = len(rows), np.empty(MAX_DEPTH, np.int64), np.empty(MAX_DEPTH, np.int64)
    for leaf in range(start, stop):
        box = nodes[(1 << depth) + leaf]
        waiting[0], levels[0], top = 1, 0, 1
        while top > 0:
            top -= 1
            node, level = waiting[top], levels[top]
            last = ((node - (1 << level) + 1) << (depth - level)) - 1
            if last < leaf or not _overlap(box, nodes[node]):
                continue
            if level < depth:
                waiting[top], waiting[top + 1] = 2 * node, 2 * node + 1
                levels[top] = levels[top + 1] = level + 1
                top += 2
                continue
            for n in range(leaf * many >> depth, (leaf + 1) * many >> depth):
                for m in range(max(n + 1, last * many >> depth), (last + 1) * many >> depth):
                    if _overlap(boxes[n], boxes[m]):
                        _mark(vertices, triangles, view, rows[n], rows[m], crosses)


@njit(nogil=True, cache=True)
def _mark(vertices, triangles, view, one, other, crosses):
    """Mark two triangles if they meet, unless both are marked."""
    if crosses[one] and crosses[other]:
        return
    a = triangles[one, 0], triangles[one, 1], triangles[one, 2]
    b = triangles[other, 0], triangles[other, 1], triangles[other, 2]
    if meet(vertices, a, view[one], b, view[other]):
        crosses[one] = crosses[other] = True


@njit(nogil=True, cache=True)
def cross_between(vertices, triangles, view, origin, slack, asking, start, stop, tree, crosses):
    """Mark the triangles start:stop of those asking that meet triangles of a tree of another size, and those.

    Parameters
    ----------
    asking, tree : Tree
    slack : float
        More than the rounding of a coordinate of a box.
    """
    rows, boxes, nodes, depth = tree
    many, waiting, corners = len(rows), np.empty(MAX_DEPTH, np.int64), np.empty((3, 3))
    for n in range(start, stop):
        box, t = asking.boxes[n], asking.rows[n]
        if not _overlap(box, nodes[1]):
            continue
        for corner in range(3):
            for axis in range(3):
                corners[corner, axis] = vertices[triangles[t, corner], axis] - origin[axis]
        waiting[0], top = 1, 1
        while top > 0:
            top -= 1
            node = waiting[top]
            if not _overlap(box, nodes[node]) or _misses(corners, nodes[node], slack):
                continue
            leaf = node - (1 << depth)
            if leaf < 0:
                waiting[top], waiting[top + 1] = 2 * node, 2 * node + 1
                top += 2
                continue
            for m in range(leaf * many >> depth, (leaf + 1) * many >> depth):
                if _overlap(box, boxes[m]):
                    _mark(vertices, triangles, view, t, rows[m], crosses)


@njit(nogil=True, cache=True)
def _misses(corners, box, slack):
    """Say whether the plane of a triangle, or one of its sides seen along an axis, has a box beyond it."""
    ux, uy, uz = corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1], corners[1, 2] - corners[0, 2]
    wx, wy, wz = corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1], corners[2, 2] - corners[0, 2]
    normal = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    distance, reach = 0.0, 0.0
    for axis in range(3):
        distance += normal[axis] * ((box[axis] + box[3 + axis]) / 2 - corners[0, axis])
        reach += abs(normal[axis]) * ((box[3 + axis] - box[axis]) / 2 + slack)
    if abs(distance) > reach:
        return True
    for axis in range(3):
        x, y = (axis + 1) % 3, (axis + 2) % 3
        for i in range(3):
            p, q, r = corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]
            across_x, across_y = p[y] - q[y], q[x] - p[x]
            third = across_x * (r[x] - p[x]) + across_y * (r[y] - p[y])
            distance = across_x * ((box[x] + box[3 + x]) / 2 - p[x]) + across_y * ((box[y] + box[3 + y]) / 2 - p[y])
            reach = abs(across_x) * ((box[3 + x] - box[x]) / 2 + slack) + abs(across_y) * (
                (box[3 + y] - box[y]) / 2 + slack
            )
            if distance > max(third, 0) + reach or distance < min(third, 0) - reach:
                return True
    return False
