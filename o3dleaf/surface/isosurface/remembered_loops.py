"""The compiled loops of a memory: places in a hash table, by all bits of their coordinates."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit

MIX = np.array([-7046029254386353131, -4417276706812531889, 1609587929392839161])
"""Odd numbers of random bits, one an axis: numbers that differ little are spread over the table (Fibonacci hashing)."""


@njit(nogil=True, cache=True)
def slot_of(table, known, place):
    """Return where in the table, of 2ⁿ slots, the row of a place (3,) stands, or the empty slot (−1) where it would."""
    mixed = place[0] * MIX[0] + place[1] * MIX[1] + place[2] * MIX[2]
    slot = (mixed ^ mixed >> 32) & (len(table) - 1)
    while table[slot] >= 0:
        row = known[table[slot]]
        if row[0] == place[0] and row[1] == place[1] and row[2] == place[2]:
            break
        slot = (slot + 1) & (len(table) - 1)
    return slot


@njit(nogil=True, cache=True)
def is_at(known, row, count, place):
    """Return whether a row is one of `count` and holds a place (3,)."""
    return row < count and known[row, 0] == place[0] and known[row, 1] == place[1] and known[row, 2] == place[2]


@njit(nogil=True, cache=True)
def find_rows(places, table, known, count, starts, rows):
    """Write the rows of places (n, 3), as bits, among `count` that are known; −1 for none.

    Places come again in their order, for the most part: the row after the last one is tried first, then the table or,
    where there is none, at the begin and where the order breaks off, the `starts` of what was added together.
    """
    row, lost = -1, False
    for i in range(len(places)):
        following = row + 1
        row = -1
        if not lost and i > 0 and is_at(known, following, count, places[i]):
            row = following
        elif len(table) > 0:
            row = table[slot_of(table, known, places[i])]
        elif not lost:
            for start in starts:
                if is_at(known, start, count, places[i]):
                    row = start
        lost = row < 0
        rows[i] = row


@njit(nogil=True, cache=True)
def enter_rows(first, last, table, known):
    """Enter the known places first:last (·, 3), as bits, into the table; one that is there stays as it is."""
    for row in range(first, last):
        slot = slot_of(table, known, known[row])
        if table[slot] < 0:
            table[slot] = row
