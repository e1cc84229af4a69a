"""The compiled loops of an octree: split cells in a hash table, leaves and the nodes on their boundaries.

A cell of level k is 2ᵏ steps of the finest lattice wide; it is named by the Morton key of its lower corner. The code of
a split cell, of level 1 or more, is that key with the bit 3k − 1 set, which is the lowest one: of no two cells alike.

Of a leaf's boundary 26 nodes may count: x + 3 y + 9 z, in halves of its side from 0 to 2. Its corners always do, the
middle of an edge or face where a cell beyond is half as wide; no smaller one touches it.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.isosurface.band.morton_loops import ALONG, coordinate, find_place

NODES = 27
CORNERS = np.array([0, 2, 6, 8, 18, 20, 24, 26])
"""The nodes of a leaf's corners."""

ALL_CORNERS = np.int64(sum(1 << int(node) for node in CORNERS))


class SplitCells(NamedTuple):
    """The split cells of an octree: rows by place in a hash table, codes by row, and the level of the largest cells."""

    table: npt.NDArray[np.int32]
    codes: npt.NDArray[np.int64]
    top: int


def _face_cycles() -> npt.NDArray[np.int64]:
    """Return (6, 5, 8) nodes around each face counter-clockwise seen from outside: all eight, and of its four quarters.

    −1 ends a quarter. Faces are the lower and the upper one along each axis; quarters rise along the next axis first.
    """
    cycles, around = np.full((6, 5, 8), -1), np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]])
    quarter = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    for face in range(6):
        axis, upper = face >> 1, face & 1
        along = np.array([3 ** ((axis + 1) % 3), 3 ** ((axis + 2) % 3)])
        turn = 1 if upper else -1
        cycles[face, 0] = (2 * upper * 3**axis + around @ along)[::turn]
        for part in range(4):
            cycles[face, 1 + part, :4] = (2 * upper * 3**axis + (quarter + np.array([part & 1, part >> 1])) @ along)[
                ::turn
            ]
    return cycles


def _hanging() -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return (18, 3) the neighbors of a leaf across faces and edges, and (18,) nodes that count if one is split."""
    steps, nodes = [], []
    for x, y, z in np.ndindex(3, 3, 3):
        step = np.array([x, y, z]) - 1
        if not 0 < np.abs(step).sum() < 3:
            continue
        bits = 0
        for place in np.ndindex(3, 3, 3):
            if (np.array(place)[step != 0] == 1 + step[step != 0]).all():
                bits |= 1 << int(place[0] + 3 * place[1] + 9 * place[2])
        steps.append(step)
        nodes.append(bits)
    return np.array(steps), np.array(nodes)


FACE_CYCLES = _face_cycles()
NEIGHBORS, HANGING = _hanging()
FACE_CENTERS = np.array([12, 14, 10, 16, 4, 22])
"""The nodes in the middles of the faces, the lower and the upper one along each axis."""


@njit(nogil=True, cache=True)
def shift_along(key, axis, by):
    """Return the key of the point so many finest steps ahead along an axis, behind if negative."""
    spread = np.int64(abs(by))
    spread = (spread | spread << 32) & 0x1F00000000FFFF
    spread = (spread | spread << 16) & 0x1F0000FF0000FF
    spread = (spread | spread << 8) & 0x100F00F00F00F00F
    spread = (spread | spread << 4) & 0x10C30C30C30C30C3
    spread = (spread | spread << 2) & 0x1249249249249249
    spread <<= axis
    others = ~ALONG[axis]
    if by >= 0:
        return (((key | others) + spread) & ALONG[axis]) | (key & others)
    return (((key & ALONG[axis]) - spread) & ALONG[axis]) | (key & others)


@njit(nogil=True, cache=True)
def decode(keys, indices):
    """Write the (n, 3) whole numbers of (n,) Morton keys."""
    for n in range(len(keys)):
        for axis in range(3):
            indices[n, axis] = coordinate(keys[n], axis)


@njit(nogil=True, cache=True)
def is_split(split, key, level):
    """Return whether the cell of a level that contains a point is split."""
    if level == 0 or level > split.top:
        return level > 0
    code = (key >> 3 * level << 3 * level) | np.int64(1) << 3 * level - 1
    return split.table[find_place(split.table, split.codes, code)] >= 0


@njit(nogil=True, cache=True)
def leaf_level(split, key):
    """Return the level of the leaf that contains a point."""
    level = split.top
    while level > 0 and is_split(split, key, level):
        level -= 1
    return level


@njit(nogil=True, cache=True)
def find_leaves(start, stop, split, points, levels, leaves):
    """Write levels and keys of the leaves that contain points (n,), given by their keys."""
    for n in range(start, stop):
        levels[n] = leaf_level(split, points[n])
        leaves[n] = points[n] >> 3 * levels[n] << 3 * levels[n]


@njit(nogil=True, cache=True)
def find_nodes(start, stop, split, leaves, levels, present):
    """Write which nodes of leaves (c,) count, as 27 bits."""
    for n in range(start, stop):
        present[n] = ALL_CORNERS
        if levels[n] == 0:
            continue
        side = np.int64(1) << levels[n]
        for other in range(len(NEIGHBORS)):
            key = leaves[n]
            for axis in range(3):
                if NEIGHBORS[other, axis] != 0:
                    key = shift_along(key, axis, NEIGHBORS[other, axis] * side)
            if is_split(split, key, levels[n]):
                present[n] |= HANGING[other]


@njit(nogil=True, cache=True)
def add_leaves(leaves, levels, present, start, table, keys, known, count, nodes):
    """Enter the nodes of leaves, from leaf `start` on, until the keys are full; return (next leaf, rows in use).

    As `add_cells` of a band; `nodes` (c, 27) is filled with rows, −1 where none counts.
    """
    for leaf in range(start, len(leaves)):
        if count + NODES > len(keys):
            return leaf, count
        half = (np.int64(1) << levels[leaf]) >> 1
        for node in range(NODES):
            nodes[leaf, node] = -1
            if not present[leaf] >> node & 1:
                continue
            key = leaves[leaf]
            for axis, part in enumerate((node % 3, node // 3 % 3, node // 9)):
                if part:
                    key = shift_along(key, axis, (np.int64(1) << levels[leaf]) if part == 2 else half)
            place = find_place(table, keys, key)
            if table[place] < 0:
                table[place], keys[count] = count, key
                count += 1
            nodes[leaf, node] = table[place]
        known[nodes[leaf, 0]] = True
    return len(leaves), count


@njit(nogil=True, cache=True)
def read_insides(start, stop, values, nodes, inside):
    """Write which nodes of leaves are inside, as 27 bits."""
    for leaf in range(start, stop):
        bits = np.int64(0)
        for node in range(NODES):
            if nodes[leaf, node] >= 0 and values[nodes[leaf, node]] > 0.0:
                bits |= np.int64(1) << node
        inside[leaf] = bits


@njit(nogil=True, cache=True)
def is_mixed(cycle, present, inside):
    """Return whether nodes around a face that count lie on both sides."""
    some, none = False, False
    for node in cycle:
        if node >= 0 and present >> node & 1:
            if inside >> node & 1:
                some = True
            else:
                none = True
    return some and none


@njit(nogil=True, cache=True)
def cross_leaf_faces(start, stop, split, leaves, levels, present, inside, table, keys, known, beyond):
    """Write the (c, 24) keys of unknown leaves across the faces that the surface crosses; −1 is none."""
    for leaf in range(start, stop):
        level = levels[leaf]
        side = np.int64(1) << level
        for face in range(6):
            axis = face >> 1
            quarters = present[leaf] >> FACE_CENTERS[face] & 1
            for part in range(4):
                beyond[leaf, 4 * face + part] = -1
                if part and not quarters:
                    continue
                cycle = FACE_CYCLES[face, 1 + part if quarters else 0]
                if not is_mixed(cycle, present[leaf], inside[leaf]):
                    continue
                if quarters:
                    key = shift_along(leaves[leaf], axis, side if face & 1 else -(side >> 1))
                    if part & 1:
                        key = shift_along(key, (axis + 1) % 3, side >> 1)
                    if part & 2:
                        key = shift_along(key, (axis + 2) % 3, side >> 1)
                else:
                    key = shift_along(leaves[leaf], axis, side if face & 1 else -side)
                    if not is_split(split, key, level + 1):
                        key = key >> 3 * (level + 1) << 3 * (level + 1)
                row = table[find_place(table, keys, key)]
                if row < 0 or not known[row]:
                    beyond[leaf, 4 * face + part] = key


@njit(nogil=True, cache=True)
def place_in_leaves(start, stop, leaves, levels, shift, base, step, points):
    """Write the (n, 3) positions in leaves, a `shift` of their side from the lower corners."""
    for n in range(start, stop):
        for axis in range(3):
            points[n, axis] = (base[axis] + coordinate(leaves[n], axis) + shift * (1 << levels[n])) * step[axis]
