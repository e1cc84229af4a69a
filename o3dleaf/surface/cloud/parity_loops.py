"""The compiled loops of sides: points joined with a sign, normals and noise of one side, and the winding number."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, dot
from o3dleaf.surface.cloud.cloud_loops import diagonalize, mirrored

LEVELS = 64
"""Grades of confidence in which edges are joined."""

MEANS = 3
"""Times that the side of a patch is found: a mean of the normals on a side, then those on the side of the mean."""

INDEPENDENT = 1e-12
"""Share of the square of a quadric's term that those before it must leave: of points on a line they leave rounding."""

TINY = 1e-200
"""Added to squared distances: a place divides by no zero where it is a source's own, and its cube is no zero either."""


@njit(nogil=True, cache=True)
def mirrored_agreements(points, normals, rows, edges, start, stop, agreement, sure):
    """Write for each edge to a neighbor how normals agree (n, edges), from -1 to 1, mirrored; and if straight too."""
    for i in range(start, stop):
        for m in range(edges):
            j = rows[i, m + 1]
            agreement[i, m] = mirrored(points, normals, i, j)
            straight = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
            sure[i, m] = min(abs(straight), abs(agreement[i, m])) if straight * agreement[i, m] > 0 else 0.0


@njit(nogil=True, cache=True)
def plane_normals(points, normals, rows, noise, least, start, stop, found):
    """Write the unit normals (n, 3) that fit points `rows` (n, k) around each, and their normals, of its own side.

    With the weights w_j = max(n_i . n_j, 0), C the covariance of the points and m the mean of the normals:
    n = (C + s^2)^-1 m, up to its length, s the `noise`, which has the least n.C n + s^2 |n - m|^2. Where fewer than
    `least` points have a weight it is n_i.
    """
    matrix, mean, toward = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(start, stop):
        matrix[:], mean[:], toward[:], total, counted = 0.0, 0.0, 0.0, 0.0, 0
        for m in range(rows.shape[1]):
            j = rows[i, m]
            weight = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
            if weight <= 0.0:
                continue
            total += weight
            counted += 1
            for a in range(3):
                mean[a] += weight * (points[j, a] - points[i, a])
                toward[a] += weight * normals[j, a]
                for b in range(3):
                    matrix[a, b] += weight * (points[j, a] - points[i, a]) * (points[j, b] - points[i, b])
        for a in range(3):
            for b in range(3):
                matrix[a, b] = matrix[a, b] / total - mean[a] * mean[b] / total**2
            matrix[a, a] += noise * noise
        length = 0.0
        for a in range(3):  # the adjugate has the inverse's directions
            b, c, value = (a + 1) % 3, (a + 2) % 3, 0.0
            for d in range(3):
                e, f = (d + 1) % 3, (d + 2) % 3
                value += (matrix[b, e] * matrix[c, f] - matrix[b, f] * matrix[c, e]) * toward[d]
            found[i, a] = value
            length += value * value
        length = np.sqrt(length)
        for a in range(3):
            found[i, a] = found[i, a] / length if counted >= least and length > 0 else normals[i, a]


@njit(nogil=True, cache=True)
def measure_patches(points, normals, places, rows, least, start, stop, noise, area, counts):
    """Write the standard deviations (m,) of patches off their quadrics, their areas, and how many points count.

    Patch i has the points `rows[i]` (m, k) around the point `places[i]`. Where there are normals, those on its side
    count. Patches of fewer than `least` have neither, NaN. Points all over an ellipse of area A have along its axes the
    variances v and w with A = 4 pi sqrt(v w).
    """
    kept, variance = np.empty(rows.shape[1], dtype=np.int64), np.empty(3)
    local, terms, matrix, axes = np.empty((3, kept.size)), np.empty((6, kept.size)), np.empty((3, 3)), np.empty((3, 3))
    for i in range(start, stop):
        counts[i] = count = on_one_side(normals, places[i], rows[i], kept)
        noise[i] = area[i] = np.nan
        if count >= least:
            center_patch(points, kept, count, local, matrix)
            across = diagonalize(matrix, axes, variance)
            area[i] = 4 * np.pi * np.sqrt(variance[1] * variance[2])
            noise[i] = off_quadric(local, count, axes, across, terms)


@njit(nogil=True, cache=True)
def on_one_side(normals, place, rows, kept):
    """Write those of the points `rows` (k,) that are on the side of a place, without normals all; return how many.

    Single normals of a noisy cloud may point anywhere into their half of space; their mean knows which it is.
    """
    if not len(normals):
        kept[:] = rows
        return rows.size
    x, y, z = normals[place, 0], normals[place, 1], normals[place, 2]
    for _ in range(MEANS):
        a = b = c = 0.0
        for j in rows:
            along = max(x * normals[j, 0] + y * normals[j, 1] + z * normals[j, 2], 0.0)
            a, b, c = a + along * normals[j, 0], b + along * normals[j, 1], c + along * normals[j, 2]
        x, y, z = a, b, c
    count = 0
    for j in rows:
        kept[count] = j
        count += x * normals[j, 0] + y * normals[j, 1] + z * normals[j, 2] > 0.0
    return count


@njit(nogil=True, cache=True)
def center_patch(points, rows, count, local, matrix):
    """Write the first `count` of the points `rows`, less their mean, in columns (3, ·), and their covariance."""
    for a in range(3):
        mean = 0.0
        for j in range(count):
            local[a, j] = points[rows[j], a] - points[rows[0], a]
            mean += local[a, j]
        for j in range(count):
            local[a, j] -= mean / count
        for b in range(a + 1):
            matrix[b, a] = dot(local[a], local[b], count) / count


@njit(nogil=True, cache=True)
def off_quadric(local, count, axes, across, terms):
    """Return the standard deviation of `count` columns of `local` (3, ·) off z = q(u, v) along their axes' columns.

    Its terms 1, u, v, u², uv and v² are made upright to one another, in `terms` (6, ·), and taken off z one by one.
    """
    u, v, height = terms[1], terms[2], terms[0]
    one, other = (across + 1) % 3, (across + 2) % 3
    square = 0.0
    for j in range(count):
        x, y, z = local[0, j], local[1, j], local[2, j]
        u[j] = x * axes[0, one] + y * axes[1, one] + z * axes[2, one]
        v[j] = x * axes[0, other] + y * axes[1, other] + z * axes[2, other]
        height[j] = x * axes[0, across] + y * axes[1, across] + z * axes[2, across]
        square += u[j] * u[j] + v[j] * v[j]
    scale = np.sqrt(count / max(square, TINY))
    rest = local[0]
    for j in range(count):
        u[j], v[j] = scale * u[j], scale * v[j]
        terms[3, j], terms[4, j], terms[5, j] = u[j] * u[j], u[j] * v[j], v[j] * v[j]
        rest[j], height[j] = height[j], 1.0
    for k in range(6):
        term, before = terms[k], dot(terms[k], terms[k], count)
        for m in range(k):
            take_off(terms[m], term, count)
        square = dot(term, term, count)
        length = np.sqrt(square) if square > INDEPENDENT * before else np.inf
        for j in range(count):
            term[j] /= length
        take_off(term, rest, count)
    return np.sqrt(dot(rest, rest, count) / (count - 6))


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def take_off(unit, vector, count):
    """Take what a unit vector, or 0, has of another one off that one, of `count` numbers each."""
    share = dot(unit, vector, count)
    for j in range(count):
        vector[j] -= share * unit[j]


@njit(nogil=True, cache=True)
def root_of(parent, sign, i):
    """Return the root of i and the sign of i relative to it, halving the path."""
    s = np.int8(1)
    while parent[i] != i:
        up = parent[i]
        sign[i] = sign[i] * sign[up] if parent[up] != up else sign[i]
        parent[i] = parent[up]
        s = np.int8(s * sign[i])
        i = parent[i]
    return i, s


@njit(nogil=True, cache=True)
def join(parent, sign, i, j, relative):
    """Join the sets of i and j so that their signs differ by `relative`; say whether they were apart."""
    a, s = root_of(parent, sign, i)
    b, t = root_of(parent, sign, j)
    if a == b:
        return False
    low, high = min(a, b), max(a, b)
    parent[high] = low
    sign[high] = np.int8(s * t * relative)
    return True


@njit(nogil=True, cache=True)
def join_sure(rows, agreement, sure, least, parent, sign):
    """Join points (Kruskal) along edges from the surest to those of confidence `least`."""
    n, edges = sure.shape
    count = np.zeros(LEVELS + 1, np.int64)
    for i in range(n):
        for m in range(edges):
            if sure[i, m] >= least:
                count[np.int64((1 - sure[i, m]) / (1 - least) * (LEVELS - 1)) + 1] += 1
    for level in range(LEVELS):
        count[level + 1] += count[level]
    order = np.empty(count[LEVELS], np.int64)
    for i in range(n):
        for m in range(edges):
            if sure[i, m] >= least:
                place = np.int64((1 - sure[i, m]) / (1 - least) * (LEVELS - 1))
                order[count[place]] = i * edges + m
                count[place] += 1
    for at in range(len(order)):
        i, m = order[at] // edges, order[at] % edges
        join(parent, sign, i, rows[i, m + 1], np.int8(1) if agreement[i, m] > 0 else np.int8(-1))


@njit(nogil=True, cache=True)
def join_near(rows, distance, most, parent, sign):
    """Join points to those of their neighbors `rows` that are no farther than `most`."""
    for i in range(len(rows)):
        for m in range(rows.shape[1]):
            if distance[i, m] <= most:
                join(parent, sign, i, rows[i, m], np.int8(1))


@njit(nogil=True, cache=True)
def flatten(parent, sign):
    """Make every point's parent its root, and its sign the one relative to it."""
    for i in range(len(parent)):
        root, s = root_of(parent, sign, i)
        parent[i], sign[i] = root, s


@njit(nogil=True, cache=True, fastmath=REASSOCIATE, error_model="numpy")
def winding_of(x, y, z, sources, flux, soft, start, stop):
    """Return Σ f_j · e / (|e| (|e|² + s_j)), e = x_j − x, over sources start:stop of (3, n); what coincides adds 0."""
    total = 0.0
    for j in range(start, stop):
        ex, ey, ez = sources[0, j] - x, sources[1, j] - y, sources[2, j] - z
        square = ex * ex + ey * ey + ez * ez + TINY
        along = flux[0, j] * ex + flux[1, j] * ey + flux[2, j] * ez
        total += along / ((square + soft[j]) * np.sqrt(square))
    return total


@njit(nogil=True, cache=True)
def winding(targets, sources, flux, first, soft, start, stop, number):
    """Write the winding number (m, pieces) that the sources (3, n) of each piece make at each target (m, 3).

    Piece k has the sources first[k]:first[k + 1].
    w(x) = sum over j of f_j . e / (4 pi |e| (|e|^2 + s_j)), e = x_j - x, f_j the normal of x_j times its area a_j: 1
    inside, 0 outside a closed surface, 1/2 on it. With s_j = a_j / (2 pi) a point makes 1/2 at most, as a disc of its
    area does where it is touched, however near to another one it lies.
    """
    for i in range(start, stop):
        x, y, z = targets[i, 0], targets[i, 1], targets[i, 2]
        for k in range(number.shape[1]):
            total = winding_of(x, y, z, sources, flux, soft, first[k], first[k + 1])
            number[i, k] = total / (4 * np.pi)
