"""The compiled loops of the plane: an outline over the cells and columns of a lattice.

Sides (s, 4) are (x0, y0, x1, y1) in lattice coordinates.
"""

import math

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def mark_inside(sides, first, shift, inside):
    """Write which of the points first + (i, j) + shift have an odd number of sides before them along y.

    `first` are whole numbers, taken off last: a point has the same answer in every window, to the last bit.
    """
    rows, columns = inside.shape
    for s in range(len(sides)):
        x0, y0, x1, y1 = sides[s]
        if x0 > x1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        # Half-open, x0 <= x < x1, so that a common end counts once.
        for i in range(max(0, math.ceil(x0 - shift) - first[0]), min(rows, math.ceil(x1 - shift) - first[0])):
            y = y0 + (y1 - y0) * ((first[0] + i + shift - x0) / (x1 - x0))
            j = max(0, math.ceil(y - shift) - first[1])
            if j < columns:
                inside[i, j] = not inside[i, j]
    for i in range(rows):
        for j in range(1, columns):
            inside[i, j] = inside[i, j] != inside[i, j - 1]


@njit(nogil=True, cache=True)
def mark_touched(sides, first, touched):
    """Mark the cells [first + (i, j), + 1] that a side passes through."""
    rows, columns = touched.shape
    for s in range(len(sides)):
        x0, y0, x1, y1 = sides[s]
        if x0 > x1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        slope = (y1 - y0) / (x1 - x0) if x1 > x0 else 0.0
        for i in range(max(0, math.floor(x0) - first[0]), min(rows, math.floor(x1) - first[0] + 1)):
            low, high = y0, y1
            if x1 > x0:
                low = y0 + slope * (max(x0, first[0] + i) - x0)
                high = y0 + slope * (min(x1, first[0] + i + 1.0) - x0)
            if low > high:
                low, high = high, low
            for j in range(max(0, math.floor(low) - first[1]), min(columns, math.floor(high) - first[1] + 1)):
                touched[i, j] = True


@njit(nogil=True, cache=True)
def splat_distances(sides, first, spacing, distance):
    """Lower the distances of the points first + (i, j), in the unit of `spacing`, to those from the sides near them."""
    rows, columns = distance.shape
    reach = distance.max() if distance.size else 0.0
    wide, high = reach / spacing[0], reach / spacing[1]
    for s in range(len(sides)):
        x0, y0, x1, y1 = sides[s]
        along, across = (x1 - x0) * spacing[0], (y1 - y0) * spacing[1]
        square = along * along + across * across
        start = max(0, math.ceil(min(x0, x1) - wide - first[0]))
        stop = min(rows, math.floor(max(x0, x1) + wide - first[0]) + 1)
        begin = max(0, math.ceil(min(y0, y1) - high - first[1]))
        end = min(columns, math.floor(max(y0, y1) + high - first[1]) + 1)
        for i in range(start, stop):
            for j in range(begin, end):
                dx, dy = (first[0] + i - x0) * spacing[0], (first[1] + j - y0) * spacing[1]
                share = (dx * along + dy * across) / square if square > 0.0 else 0.0
                share = min(max(share, 0.0), 1.0)
                gap = math.hypot(dx - share * along, dy - share * across)
                distance[i, j] = min(distance[i, j], gap)
