"""The compiled loops of points (i, j, k) of a lattice in a hash table, named by their Morton keys.

A key has the bits of i, j and k in turn, so that points with the same key >> 6 are one brick of 4 × 4 × 4. A point's
place in the table is drawn for the brick and counted on within it: what lies close on the lattice lies close in memory.
A row is the number of a point in the order in which points came.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit

BITS = 20
"""Bits of a coordinate: a key and the two bits of an axis are one int64."""

ALONG = np.array([0x1249249249249249, 0x2492492492492492, 0x4924924924924924])
"""The bits of a key that belong to each axis."""

MIX = np.int64(-7046029254386353131)
"""2⁶⁴ over the golden ratio: keys that differ little are spread over the table (Fibonacci hashing)."""


@njit(nogil=True, cache=True)
def encode(indices, keys):
    """Write the (n,) Morton keys of (n, 3) whole numbers from 0 to 2²⁰ − 1."""
    for n in range(len(keys)):
        key = np.int64(0)
        for axis in range(3):
            v = indices[n, axis]
            v = (v | v << 32) & 0x1F00000000FFFF
            v = (v | v << 16) & 0x1F0000FF0000FF
            v = (v | v << 8) & 0x100F00F00F00F00F
            v = (v | v << 4) & 0x10C30C30C30C30C3
            v = (v | v << 2) & 0x1249249249249249
            key |= v << axis
        keys[n] = key


@njit(nogil=True, cache=True)
def coordinate(key, axis):
    """Return the whole number that a key has along an axis."""
    v = key >> axis & 0x1249249249249249
    v = (v | v >> 2) & 0x10C30C30C30C30C3
    v = (v | v >> 4) & 0x100F00F00F00F00F
    v = (v | v >> 8) & 0x1F0000FF0000FF
    v = (v | v >> 16) & 0x1F00000000FFFF
    return (v | v >> 32) & 0x1FFFFF


@njit(nogil=True, cache=True)
def place_points(start, stop, keys, shift, base, step, points):
    """Write the (n, 3) positions of points, `shift` of a step (3,) beyond them."""
    for n in range(start, stop):
        for axis in range(3):
            points[n, axis] = (base[axis] + coordinate(keys[n], axis) + shift[axis]) * step[axis]


@njit(nogil=True, cache=True)
def ahead(key, axis):
    """Return the key of the next point along an axis."""
    others = ~ALONG[axis]
    return (((key | others) + (np.int64(1) << axis)) & ALONG[axis]) | (key & others)


@njit(nogil=True, cache=True)
def behind(key, axis):
    """Return the key of the point before along an axis."""
    return (((key & ALONG[axis]) - (np.int64(1) << axis)) & ALONG[axis]) | (key & ~ALONG[axis])


@njit(nogil=True, cache=True)
def find_place(table, keys, key):
    """Return where in the table the row of a key stands, or the empty place (−1) where it would."""
    mixed = (key >> 6) * MIX
    place = ((mixed ^ mixed >> 32) << 6 | (key & 63)) & (len(table) - 1)
    while table[place] >= 0 and keys[table[place]] != key:
        place = (place + 1) & (len(table) - 1)
    return place


@njit(nogil=True, cache=True)
def fill_table(table, keys, count):
    """Enter the first `count` keys into an empty table."""
    for row in range(count):
        table[find_place(table, keys, keys[row])] = row
