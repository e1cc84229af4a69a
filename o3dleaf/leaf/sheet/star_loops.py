"""The compiled loops of triangles between points: Delaunay stars in tangent planes, and those that fit together."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.cloud.cloud_loops import adjacent_runs

MAX_STAR = 24
"""Triangles of a star at most; of random points six are the mean, and fourteen were the most in a million."""
MAX_NEAR = 512
"""Neighbors of a star that are looked at together; where sparse points lie beside dense ones there are many more, and
the nearest half of them is kept."""
SPARSE = 1.25
"""Times the least reach from which on a point is sparse. The others see their own kind, of which it does not matter
that some far ones are not looked at; where three sheets meet and there are twice as many, what is not joined for it
shows the line."""
MAX_CORNERS = 64
"""Corners of a Voronoi cell at most."""


@njit(nogil=True, cache=True)
def find_stars(points, normals, reach, slope, number, first, last, shape, start, stop, corners, radius):
    """Write the other two corners (n, 24, 2) of each point's Delaunay triangles in its tangent plane, -1 for none.

    `points` are sorted by cells of an edge no less than twice the largest `reach` (n,), the largest circumradius of
    a point's triangles; those of the triangles are written to `radius` (n, 24). Neighbors count that lie less than
    asin(`slope`), (n,), off both tangent planes; they are laid into the plane at their true distance.
    """
    lows, highs = np.empty(9, np.int64), np.empty(9, np.int64)
    every, least = np.arange(len(points)), np.min(reach)
    near, far = np.empty(MAX_NEAR, np.int64), np.empty(MAX_NEAR)
    u, v = np.empty(MAX_NEAR), np.empty(MAX_NEAR)
    one, other, place = np.empty(3), np.empty(3), np.empty(4)
    px, py, label = np.empty(MAX_CORNERS), np.empty(MAX_CORNERS), np.empty(MAX_CORNERS, np.int64)
    qx, qy, name = np.empty(MAX_CORNERS), np.empty(MAX_CORNERS), np.empty(MAX_CORNERS, np.int64)
    for c in range(start, stop):
        runs = adjacent_runs(number[c], number, first, last, shape, every, lows, highs)
        for i in range(first[c], last[c]):
            corners[i] = -1
            tangents(normals, i, one, other)
            count, farthest = 0, np.inf
            for run in range(runs):
                for j in range(lows[run], highs[run]):
                    if (
                        j != i
                        and lay_out(points, normals, i, j, reach[i], slope[i], slope[j], place)
                        and place[3] < farthest
                    ):
                        s, t = across(place, one, other)
                        length = np.sqrt(s * s + t * t)
                        near[count], far[count] = j, place[3]
                        u[count], v[count] = s * place[3] / length, t * place[3] / length
                        count += 1
                        if count == MAX_NEAR:
                            count, farthest = keep_nearest(near, far, u, v, reach[i] > SPARSE * least)
            order = np.argsort(far[:count])
            size = 4
            h = 1.001 * reach[i]
            px[0], py[0], px[1], py[1], px[2], py[2], px[3], py[3] = -h, -h, h, -h, h, h, -h, h
            label[:4] = -1
            most = 2 * h * h
            for m in range(count):
                k = order[m]
                if far[k] * far[k] > 4 * most:
                    break
                size = clip(px, py, label, size, u[k], v[k], near[k], qx, qy, name)
                most = 0.0
                for a in range(size):
                    most = max(most, px[a] * px[a] + py[a] * py[a])
            made = 0
            for a in range(size):
                before = label[a - 1] if a > 0 else label[size - 1]
                square = px[a] * px[a] + py[a] * py[a]
                if before >= 0 and label[a] >= 0 and square <= reach[i] * reach[i] and made < MAX_STAR:
                    corners[i, made, 0], corners[i, made, 1] = before, label[a]
                    radius[i, made] = np.sqrt(square)
                    made += 1


@njit(nogil=True, cache=True)
def across(way, one, other):
    """Return the parts of a vector along two others."""
    s, t = 0.0, 0.0
    for a in range(3):
        s += way[a] * one[a]
        t += way[a] * other[a]
    return s, t


@njit(nogil=True, cache=True)
def keep_nearest(near, far, u, v, is_sparse):
    """Move the nearer half of full lists (n,) to their front; return how many are kept, and how near others must be.

    Of a point that is not sparse all are kept, and no others.
    """
    if not is_sparse:
        return len(far), 0.0
    order = np.argsort(far)
    half = len(order) // 2
    n, f, s, t = near[order], far[order], u[order], v[order]
    for k in range(half):
        near[k], far[k], u[k], v[k] = n[k], f[k], s[k], t[k]
    return half, f[half]


@njit(nogil=True, cache=True)
def lay_out(points, normals, i, j, reach, here, there, place):
    """Write where j lies as seen from i, and how far; return whether it is a neighbor on the same sheet."""
    square, up, down = 0.0, 0.0, 0.0
    for a in range(3):
        place[a] = points[j, a] - points[i, a]
        square += place[a] * place[a]
        up += place[a] * normals[i, a]
        down += place[a] * normals[j, a]
    place[3] = np.sqrt(square)
    return 0.0 < place[3] <= 2 * reach and abs(up) <= here * place[3] and abs(down) <= there * place[3]


@njit(nogil=True, cache=True)
def clip(px, py, label, size, u, v, j, qx, qy, name):
    """Cut a convex polygon (edge a runs from corner a to the next one) off beyond the bisector of 0 and (u, v)."""
    limit = (u * u + v * v) / 2
    made = 0
    cut = False
    for a in range(size):
        b = a + 1 if a + 1 < size else 0
        here, there = px[a] * u + py[a] * v - limit, px[b] * u + py[b] * v - limit
        if here <= 0:
            qx[made], qy[made], name[made] = px[a], py[a], label[a]
            made += 1
        if (here <= 0) != (there <= 0):
            t = here / (here - there)
            qx[made], qy[made] = px[a] + t * (px[b] - px[a]), py[a] + t * (py[b] - py[a])
            name[made] = j if here <= 0 else label[a]
            made += 1
            cut = True
    if not cut or made > MAX_CORNERS - 2:
        return size
    for a in range(made):
        px[a], py[a], label[a] = qx[a], qy[a], name[a]
    return made


@njit(nogil=True, cache=True)
def tangents(normals, i, one, other):
    """Write two unit vectors across normal i, with it right-handed."""
    x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        one[0], one[1], one[2] = 0.0, -z, y
    elif abs(y) <= abs(z):
        one[0], one[1], one[2] = z, 0.0, -x
    else:
        one[0], one[1], one[2] = -y, x, 0.0
    length = np.sqrt(one[0] ** 2 + one[1] ** 2 + one[2] ** 2)
    one /= length
    other[0] = y * one[2] - z * one[1]
    other[1] = z * one[0] - x * one[2]
    other[2] = x * one[1] - y * one[0]


@njit(nogil=True, cache=True)
def choose_triangles(points, normals, triangles, steep, chosen):
    """Write which of (m, 3) triangles are `chosen`, the first ones first: those that overlap no earlier one.

    At each corner a triangle covers a sector of the tangent plane there; sectors of two chosen triangles may touch.
    A triangle whose normal has a cosine below `steep` to that of one of its corners is not chosen.
    """
    head = np.full(len(points), -1)
    following = np.full(3 * len(triangles), -1)
    low, wide = np.zeros(3 * len(triangles)), np.zeros(3 * len(triangles))
    one, other = np.empty(3), np.empty(3)
    full = 2 * np.pi
    for t in range(len(triangles)):
        fits = is_along(points, normals, triangles[t], steep)
        for corner in range(3):
            if not fits:
                break
            a, b, c = triangles[t, corner], triangles[t, (corner + 1) % 3], triangles[t, (corner + 2) % 3]
            tangents(normals, a, one, other)
            begin, end = direction(points, a, b, one, other), direction(points, a, c, one, other)
            turn = (end - begin) % full
            if turn > np.pi:
                begin, turn = end, full - turn
            low[3 * t + corner], wide[3 * t + corner] = begin, turn
            k = head[a]
            while k >= 0:
                if (begin - low[k]) % full < wide[k] - 1e-7 or (low[k] - begin) % full < turn - 1e-7:
                    fits = False
                    break
                k = following[k]
        chosen[t] = fits
        if fits:
            for corner in range(3):
                a = triangles[t, corner]
                following[3 * t + corner] = head[a]
                head[a] = 3 * t + corner


@njit(nogil=True, cache=True)
def direction(points, i, j, one, other):
    """Return the angle of j as seen from i in the plane of two unit vectors, rounded so that equal ones stay equal."""
    s, t = 0.0, 0.0
    for a in range(3):
        s += (points[j, a] - points[i, a]) * one[a]
        t += (points[j, a] - points[i, a]) * other[a]
    return np.arctan2(t, s)


@njit(nogil=True, cache=True)
def is_along(points, normals, triangle, steep):
    """Return whether the normal of a triangle has a cosine of at least `steep` to those of all its corners."""
    a, b, c = triangle
    p, q = points[b] - points[a], points[c] - points[a]
    x, y, z = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
    length = np.sqrt(x * x + y * y + z * z)
    for v in triangle:
        if not abs(x * normals[v, 0] + y * normals[v, 1] + z * normals[v, 2]) >= steep * length:
            return False
    return length > 0.0
