"""Compiled loops: samples thinned to particles, and where columns of a lattice pass a closed mesh."""

import numpy as np
from numba import njit


@njit(nogil=True, cache=True)
def thin_samples(points, normals, order, cell, strides, radius):
    """Return which samples are kept: visited in `order`, each is kept unless a kept one is nearer than `radius`.

    A kept sample on the other face of a thin blade, its normal turned away, does not count.

    Parameters
    ----------
    points, normals : (n, 3) arrays
    order : (n,) array of int64
    cell : (n,) array of int64
        The key of the cube of edge `radius` that each sample lies in, sorted: samples are in this order.
    strides : (3,) array of int64
        What a step along each axis adds to a key.
    radius : float
    """
    count = len(points)
    kept = np.zeros(count, dtype=np.bool_)
    # In each run of one cube, the kept samples are at its front, in `members`.
    first = np.zeros(count, dtype=np.int64)
    for i in range(1, count):
        first[i] = i if cell[i] != cell[i - 1] else first[i - 1]
    members = np.empty(count, dtype=np.int64)
    held = np.zeros(count, dtype=np.int64)
    for rank in range(count):
        i = order[rank]
        free = True
        for di in range(-1, 2):
            for dj in range(-1, 2):
                for dk in range(-1, 2):
                    key = cell[i] + di * strides[0] + dj * strides[1] + dk * strides[2]
                    start = first[i] if key == cell[i] else np.searchsorted(cell, key)
                    if start == count or cell[start] != key:
                        continue
                    for m in range(start, start + held[start]):
                        j = members[m]
                        x, y, z = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
                        turned = 0.0
                        for axis in range(3):
                            turned += normals[i, axis] * normals[j, axis]
                        if turned > 0.0 and x * x + y * y + z * z < radius * radius:
                            free = False
                            break
                    if not free:
                        break
                if not free:
                    break
            if not free:
                break
        if free:
            kept[i] = True
            start = first[i]
            members[start + held[start]] = i
            held[start] += 1
    return kept


@njit(nogil=True, cache=True)
def left_of(vertices, a, b, x, y):
    """Return whether (x, y) is left of the directed edge a → b in the plane, from one number for both directions.

    A point on the edge's line counts as moved by a vanishing amount along x and by a square of it along y, so that it
    lies in exactly one of the triangles that meet there.
    """
    low, high = (a, b) if a < b else (b, a)
    dx, dy = vertices[high, 0] - vertices[low, 0], vertices[high, 1] - vertices[low, 1]
    side = dx * (y - vertices[low, 1]) - dy * (x - vertices[low, 0])
    if side == 0.0:
        side = -dy if dy != 0.0 else dx
    left = side > 0.0
    return left if a < b else not left


@njit(nogil=True, cache=True)
def column_range(low, high, origin, step, count):
    """Return the first column at or above `low` and the one after the last at or below `high`, widened by one."""
    first = max(int(np.floor((low - origin) / step)), 0)
    last = min(int(np.ceil((high - origin) / step)), count - 1)
    return first, last + 1


@njit(nogil=True, cache=True)
def crossings(vertices, triangles, origin, step, shape, start, stop, found_column, found_height):
    """Find where the columns (along z) of a lattice pass triangles start ... stop; return how many times.

    Where `found_column` and `found_height` have a length, up to so many are kept: number of the column, i · ny + j,
    and the height. Sums of crossings below a point are odd inside a closed mesh.
    """
    total = 0
    for t in range(start, stop):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        ux, uy, uz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        vx, vy, vz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        area = ux * vy - uy * vx
        i0, i1 = column_range(min(ax, ax + ux, ax + vx), max(ax, ax + ux, ax + vx), origin[0], step, shape[0])
        j0, j1 = column_range(min(ay, ay + uy, ay + vy), max(ay, ay + uy, ay + vy), origin[1], step, shape[1])
        for i in range(i0, i1):
            x = origin[0] + i * step
            for j in range(j0, j1):
                y = origin[1] + j * step
                first = left_of(vertices, a, b, x, y)
                if left_of(vertices, b, c, x, y) != first or left_of(vertices, c, a, x, y) != first:
                    continue
                if total < len(found_column):
                    found_column[total] = i * shape[1] + j
                    # The triangle may be upright to the last bit: its middle height is as good as any.
                    height = az + (uz + vz) / 3.0
                    if area != 0.0:
                        s = ((x - ax) * vy - (y - ay) * vx) / area
                        r = (ux * (y - ay) - uy * (x - ax)) / area
                        height = az + min(max(s, 0.0), 1.0) * uz + min(max(r, 0.0), 1.0) * vz
                    found_height[total] = height
                total += 1
    return total
