"""The compiled loops that put up the wall of a solid over its margin, one cell of the plane after the other.

In a cell the clipped triangles end in borders, and on its upright sides the solid is what lies between each second
pair of their ends, from below. Borders and these pieces close to loops, and the wall is what the loops enclose:
polygons in the upright plane over the margin, some with holes.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.instancing.cut.ear_loops import cut_ears
from o3dleaf.leaf.instancing.cut.flip_loops import flip_diagonals


@njit(nogil=True, cache=True)
def side_of(row, i, j, planes):
    """Return the upright side, 0 to 3, of cell (i, j) that a vertex of the cut lies on, −1: none."""
    for axis in range(2):
        for end in range(2):
            if planes[row, axis] == (j if axis else i) + end:
                return 2 * axis + end
    return -1


@njit(nogil=True, cache=True)
def join_sides(rows, sides, heights, following, leading):
    """Let each loop that ends on a side go on with the one that begins at the other end of the solid there.

    `rows` are the vertices of a cell; `following` and `leading` (e,) the next vertex and the one before, −1: none.
    """
    for side in range(4):
        count = 0
        for row in rows:
            count += side_of_loose(row, sides, following, leading) == side
        loose = np.empty(count, dtype=np.int64)
        count = 0
        for row in rows:
            if side_of_loose(row, sides, following, leading) == side:
                n = count
                while n > 0 and (heights[loose[n - 1]], loose[n - 1]) > (heights[row], row):
                    loose[n] = loose[n - 1]
                    n -= 1
                loose[n] = row
                count += 1
        for n in range(0, count - 1, 2):
            begins = following[loose[n]] >= 0
            other = n + 1
            # Of two ends in one place either may come first.
            while other < count - 1 and (following[loose[other]] >= 0) == begins:
                other += 1
            loose[n + 1], loose[other] = loose[other], loose[n + 1]
            start, stop = (loose[n], loose[n + 1]) if begins else (loose[n + 1], loose[n])
            following[stop], leading[start] = start, stop


@njit(nogil=True, cache=True)
def side_of_loose(row, sides, following, leading):
    """Return the side of a vertex with a border on one hand only, −1 of others."""
    return sides[row] if (following[row] < 0) != (leading[row] < 0) else -1


@njit(nogil=True, cache=True)
def trace_loops(rows, following, loops, ends):
    """Write the vertices of all loops, and where each one ends; return how many, −1 where one is open."""
    count, size = 0, 0
    for start in rows:
        if following[start] < 0:
            continue
        row = start
        while True:
            after = following[row]
            if after < 0:
                return -1
            loops[size] = row
            size += 1
            following[row], row = -1, after
            if row == start:
                break
        ends[count] = size
        count += 1
    return count


@njit(nogil=True, cache=True)
def outward(corners):
    """Return the direction (2,) that a wall over a cell faces: from larger distances (2, 2) to smaller ones."""
    along = corners[0, 0] + corners[0, 1] - corners[1, 0] - corners[1, 1]
    across = corners[0, 0] + corners[1, 0] - corners[0, 1] - corners[1, 1]
    return along, across


@njit(nogil=True, cache=True)
def facing(loop, places):
    """Return the horizontal direction (2,) that a loop is seen counter-clockwise from (Newell)."""
    along, across = 0.0, 0.0
    for n in range(len(loop)):
        p, q = places[loop[n - 1]], places[loop[n]]
        along += (p[1] - q[1]) * (p[2] + q[2])
        across += (p[2] - q[2]) * (p[0] + q[0])
    return along, across


@njit(nogil=True, cache=True)
def projected(loop, places, normal):
    """Return the corners (m, 2) of a loop, sideways and up, as seen from where a direction points to."""
    flat = np.empty((len(loop), 2))
    for n in range(len(loop)):
        flat[n, 0] = normal[0] * places[loop[n], 1] - normal[1] * places[loop[n], 0]
        flat[n, 1] = places[loop[n], 2]
    return flat


@njit(nogil=True, cache=True)
def signed_area(flat):
    """Return twice the area of a polygon, > 0 where it runs counter-clockwise."""
    total = 0.0
    for n in range(len(flat)):
        total += flat[n - 1, 0] * flat[n, 1] - flat[n, 0] * flat[n - 1, 1]
    return total


@njit(nogil=True, cache=True)
def encloses(flat, point):
    """Return whether a polygon contains a point."""
    inside = False
    for n in range(len(flat)):
        p, q = flat[n - 1], flat[n]
        if (p[1] > point[1]) != (q[1] > point[1]):
            if point[0] < p[0] + (point[1] - p[1]) / (q[1] - p[1]) * (q[0] - p[0]):
                inside = not inside
    return inside


@njit(nogil=True, cache=True)
def with_hole(outer, hole, places):
    """Return a loop around `outer` and, by a bridge between their nearest vertices and back, around `hole`."""
    m, n, least = 0, 0, np.inf
    for a in range(len(outer)):
        for b in range(len(hole)):
            gap = ((places[outer[a]] - places[hole[b]]) ** 2).sum()
            if gap < least:
                m, n, least = a, b, gap
    joined = np.empty(len(outer) + len(hole) + 2, dtype=np.int64)
    for k in range(len(joined)):
        if k <= m:
            joined[k] = outer[k]
        elif k <= m + 1 + len(hole):
            joined[k] = hole[(n + k - m - 1) % len(hole)]
        else:
            joined[k] = outer[k - len(hole) - 2]
    return joined


@njit(nogil=True, cache=True)
def fill_loop(loop, places, sides, triangles, start):
    """Write the triangles of the wall within one loop, in its own plane; return the row after them."""
    on_side = np.empty(len(loop), dtype=np.int64)
    for n in range(len(loop)):
        on_side[n] = sides[loop[n]]
    along, across = facing(loop, places)
    length = max(math.sqrt(along * along + across * across), 1e-300)
    flat = projected(loop, places, (along / length, across / length))
    ears = cut_ears(flat, loop, on_side)
    flip_diagonals(flat, loop, on_side, ears)
    for row in range(len(ears)):
        for corner in range(3):
            triangles[start + row, corner] = loop[ears[row, corner]]
    return start + len(ears)


@njit(nogil=True, cache=True)
def fill_cell(loops, ends, places, sides, normal, triangles, start):
    """Write the triangles of the wall over one cell; return the row after them."""
    areas = np.empty(len(ends))
    taken = np.zeros(len(ends), dtype=np.bool_)
    for n in range(len(ends)):
        areas[n] = signed_area(projected(loops[ends[n - 1] if n else 0 : ends[n]], places, normal))
    for n in range(len(ends)):
        if areas[n] <= 0.0:
            continue
        loop = loops[ends[n - 1] if n else 0 : ends[n]].copy()
        flat = projected(loop, places, normal)
        for k in range(len(ends)):
            hole = loops[ends[k - 1] if k else 0 : ends[k]]
            if areas[k] < 0.0 and not taken[k] and encloses(flat, projected(hole[:1], places, normal)[0]):
                loop = with_hole(loop, hole, places)
                taken[k] = True
        start = fill_loop(loop, places, sides, triangles, start)
        taken[n] = True
    for n in range(len(ends)):
        if not taken[n]:
            loop = loops[ends[n - 1] if n else 0 : ends[n]]
            start = fill_loop(loop, places, sides, triangles, start)
    return start


@njit(nogil=True, cache=True)
def put_up_wall(ny, columns, borders, ends, cut, places, triangles):
    """Write the triangles (m, 3), rows of the cut, of the wall over all cut cells; return how many, −1: it has a gap.

    Parameters are those of `clip_loops`; `places` (e, 3) are those of the vertices of the cut in a unit of length, as
    high as the wall is to be.
    """
    count = len(places)
    following, leading = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    sides, total = np.full(count, -1, dtype=np.int64), 0
    for cell in range(len(columns.cells)):
        part = borders[ends[cell] : ends[cell + 1]]
        if len(part) == 0:
            continue
        i, j = columns.cells[cell] // ny, columns.cells[cell] % ny
        rows = np.unique(part.ravel())
        for n in range(len(part)):
            following[part[n, 0]], leading[part[n, 1]] = part[n, 1], part[n, 0]
        for row in rows:
            sides[row] = side_of(row, i, j, cut.planes)
        join_sides(rows, sides, cut.places[:, 2], following, leading)
        loops, loop_ends = np.empty(len(rows), dtype=np.int64), np.empty(len(rows), dtype=np.int64)
        loop_count = trace_loops(rows, following, loops, loop_ends)
        if loop_count < 0:
            return -1
        normal = outward(columns.distance[i : i + 2, j : j + 2])
        total = fill_cell(loops, loop_ends[:loop_count], places, sides, normal, triangles, total)
        for row in rows:
            following[row], leading[row], sides[row] = -1, -1, -1
    return total
