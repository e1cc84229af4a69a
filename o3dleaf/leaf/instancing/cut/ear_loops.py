"""The compiled loops that triangulate a polygon in the plane by cutting off its ears (Meisters 1975).

Corners (m, 2) run counter-clockwise around the polygon. Corners of one side of the cell, `sides` (m,) the same number
from 0 on, lie on one line: no diagonal joins them.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit

THIN = 1e-7
"""Height over its longest side of a triangle that is as good as none: facets that share a plane end in one line."""


@njit(nogil=True, cache=True)
def turn(points, a, b, c):
    """Return twice the area of the triangle of three corners, > 0 where it runs counter-clockwise."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    vx, vy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
    return ux * vy - uy * vx


@njit(nogil=True, cache=True)
def is_empty(points, names, left, ear):
    """Return whether no corner that is left lies in the triangle of three corners `ear`, or all but on its diagonal."""
    a, b, c = ear
    slack = THIN * ((points[a, 0] - points[c, 0]) ** 2 + (points[a, 1] - points[c, 1]) ** 2)
    for p in left:
        if names[p] in (names[a], names[b], names[c]):
            continue
        if turn(points, a, b, p) >= 0.0 and turn(points, b, c, p) >= 0.0 and turn(points, c, a, p) >= -slack:
            return False
    return True


@njit(nogil=True, cache=True)
def shape_of(points, a, b, c):
    """Return the area of a triangle over the square of its longest side: 0 for a sliver, 0.43 at most."""
    longest = 0.0
    for p, q in ((a, b), (b, c), (c, a)):
        longest = max(longest, (points[p, 0] - points[q, 0]) ** 2 + (points[p, 1] - points[q, 1]) ** 2)
    return turn(points, a, b, c) / (2.0 * longest) if longest > 0.0 else 0.0


@njit(nogil=True, cache=True)
def find_ear(points, names, sides, left):
    """Return the place in `left` of the corner to cut off: that of the ear of the best shape.

    Where rounding leaves no ear, the best of the corners whose diagonal joins no line to itself.
    """
    best, most, best_rank = 0, -np.inf, 3
    count = len(left)
    for n in range(count):
        a, b, c = left[n - 1], left[n], left[(n + 1) % count]
        rank, shape = 0, shape_of(points, a, b, c)
        if (sides[a] >= 0 and sides[a] == sides[c]) or names[a] == names[c]:
            rank = 2
        elif shape <= THIN or not is_empty(points, names, left, (a, b, c)):
            rank = 1
        if rank < best_rank or (rank == best_rank and shape > most):
            best, most, best_rank = n, shape, rank
    return best


@njit(nogil=True, cache=True)
def cut_ears(points, names, sides):
    """Return the triangles (m − 2, 3) of a polygon of m corners, rows of `points`."""
    left = np.arange(len(names))
    triangles = np.empty((max(len(left) - 2, 0), 3), dtype=np.int64)
    for row in range(len(triangles)):
        n = find_ear(points, names, sides, left) if len(left) > 3 else 1
        triangles[row, 0], triangles[row, 1], triangles[row, 2] = left[n - 1], left[n], left[(n + 1) % len(left)]
        fewer = np.empty(len(left) - 1, dtype=np.int64)
        for k in range(len(fewer)):
            fewer[k] = left[k + 1 if k >= n else k]
        left = fewer
    return triangles
