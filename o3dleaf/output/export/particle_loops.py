"""Compiled loops: samples thinned to particles, and where columns of a lattice pass a closed mesh."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def thin_samples(points, normals, triangle, cell, starts, neighbors, order, radius, members, counts):
    """Keep more samples, visited in `order`, each unless a kept one of its face is nearer than `radius`.

    Samples are sorted by their cubes of edge `radius`. Those on the other face of a thin blade, their normals turned
    away, do not count.

    Parameters
    ----------
    points : (n, 3) array
    normals : (m, 3) array
        Of the triangles.
    triangle, cell : (n,) arrays of int
        The triangle and the cube of each sample.
    starts : (c,) array of int64
        The first sample of each cube.
    neighbors : (c, 27) array of int64
        The cubes around each cube and itself; −1 where there is none.
    order : (k,) array of int64
    members : (n,) array of int64
        The kept samples of cube c are members[starts[c]], ..., counts[c] of them; written to, as is `counts`.
    counts : (c,) array of int64
    """
    for rank in range(len(order)):
        i = order[rank]
        if nearest_kept(points, normals, triangle, i, neighbors[cell[i]], starts, members, counts, radius) < 0:
            c = cell[i]
            members[starts[c] + counts[c]] = i
            counts[c] += 1


@njit(nogil=True, cache=True)
def nearest_kept(points, normals, triangle, i, cubes, starts, members, counts, radius):
    """Return the kept sample of its face that is nearest to sample i, −1 if none is nearer than `radius`."""
    best, nearest_one = radius * radius, -1
    for n in range(len(cubes)):
        c = cubes[n]
        if c < 0:
            continue
        for m in range(starts[c], starts[c] + counts[c]):
            j = members[m]
            square, turned = 0.0, 0.0
            for axis in range(3):
                square += (points[i, axis] - points[j, axis]) ** 2
                turned += normals[triangle[i], axis] * normals[triangle[j], axis]
            if turned > 0.0 and square < best:
                best, nearest_one = square, j
    return nearest_one


@njit(nogil=True, cache=True)
def assign_samples(points, normals, triangle, cell, starts, neighbors, members, counts, radius, start, stop, nearest):
    """Write the nearest kept sample of samples start ... stop into `nearest`: of a maximal choice there is one."""
    for i in range(start, stop):
        nearest[i] = nearest_kept(points, normals, triangle, i, neighbors[cell[i]], starts, members, counts, radius)


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
