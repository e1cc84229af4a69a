"""The compiled loops that flip the diagonals of a triangulated polygon until each has the Delaunay property.

Cutting ears leaves slivers along borders that are straight but for a hair's breadth. The wall is plane in flat
coordinates only: in the world a sliver may turn over, and cross its neighbors.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit

BETTER = 1e-6
"""Sine of what two opposite angles must exceed a half turn by: corners on one circle may keep either diagonal."""


@njit(nogil=True, cache=True)
def angle_at(points, c, a, b):
    """Return cosine and sine, times the lengths of both sides, of the angle at c from a to b."""
    ux, uy = points[a, 0] - points[c, 0], points[a, 1] - points[c, 1]
    vx, vy = points[b, 0] - points[c, 0], points[b, 1] - points[c, 1]
    return ux * vx + uy * vy, ux * vy - uy * vx


@njit(nogil=True, cache=True)
def is_better(points, a, b, c, d):
    """Return whether the diagonal c-d is better than a-b, c on its left: what they span is convex, by Delaunay's test.

    The angles at c and d are more than a half turn together; a triangle without area has one of a half turn.
    """
    if angle_at(points, a, d, c)[1] <= 0.0 or angle_at(points, b, c, d)[1] <= 0.0:
        return False
    cos_c, sin_c = angle_at(points, c, a, b)
    cos_d, sin_d = angle_at(points, d, b, a)
    lengths = math.sqrt((cos_c * cos_c + sin_c * sin_c) * (cos_d * cos_d + sin_d * sin_d))
    return sin_c * cos_d + cos_c * sin_d < -BETTER * lengths


@njit(nogil=True, cache=True)
def may_join(names, sides, c, d):
    """Return whether a diagonal may join two corners: neither a vertex to itself nor two of one side of the cell."""
    return names[c] != names[d] and (sides[c] < 0 or sides[c] != sides[d])


@njit(nogil=True, cache=True)
def flip_diagonals(points, names, sides, triangles):
    """Flip diagonals of the triangles (n − 2, 3) of a polygon's corners (n, 2) until none would be better flipped.

    `names` (n,) tell corners in one place, ends of a bridge to a hole; `sides` (n,) those on one line.
    """
    count = len(points)
    # The corner beyond each edge, on its left, as it runs around its triangle.
    beyond = np.full((count, count), -1, dtype=np.int32)
    for a, b, c in triangles:
        beyond[a, b], beyond[b, c], beyond[c, a] = c, a, b
    # Each flip lowers the surface of the corners lifted to a paraboloid: there is an end, and rounding is kept out.
    for _ in range(count):
        flipped = False
        for a in range(count):
            for b in range(a + 1, count):
                c, d = beyond[a, b], beyond[b, a]
                if c < 0 or d < 0 or not may_join(names, sides, c, d) or not is_better(points, a, b, c, d):
                    continue
                beyond[a, b] = beyond[b, a] = -1
                beyond[c, a], beyond[a, d], beyond[d, c] = d, c, a
                beyond[d, b], beyond[b, c], beyond[c, d] = c, d, b
                flipped = True
        if not flipped:
            break
    row = 0
    for a in range(count):
        for b in range(a + 1, count):
            c = beyond[a, b]
            # Each triangle from its first corner.
            if c > a:
                triangles[row, 0], triangles[row, 1], triangles[row, 2] = a, b, c
                row += 1
