"""The compiled loops over the points of a cloud: planes through neighbors, empty balls, agreement of normals."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit

SWEEPS = 12
"""Of Jacobi's method on 3 x 3 matrices; it converges quadratically, five are the rule."""


@njit(nogil=True, cache=True)
def principal_axes(points, rows, start, stop, normal, variance):
    """Write the unit normal (n, 3) and the variances along the axes (n, 3), least first, of neighborhoods `rows`."""
    matrix, axes = np.empty((3, 3)), np.empty((3, 3))
    center = np.empty(3)
    k = rows.shape[1]
    for i in range(start, stop):
        center[:] = 0.0
        for j in range(k):
            for a in range(3):
                center[a] += points[rows[i, j], a] - points[rows[i, 0], a]
        matrix[:] = 0.0
        for j in range(k):
            dx = points[rows[i, j], 0] - points[rows[i, 0], 0] - center[0] / k
            dy = points[rows[i, j], 1] - points[rows[i, 0], 1] - center[1] / k
            dz = points[rows[i, j], 2] - points[rows[i, 0], 2] - center[2] / k
            matrix[0, 0] += dx * dx
            matrix[0, 1] += dx * dy
            matrix[0, 2] += dx * dz
            matrix[1, 1] += dy * dy
            matrix[1, 2] += dy * dz
            matrix[2, 2] += dz * dz
        least = diagonalize(matrix, axes, variance[i])
        for a in range(3):
            variance[i, a] /= k
            normal[i, a] = axes[a, least]


@njit(nogil=True, cache=True)
def diagonalize(matrix, axes, values):
    """Write the eigenvalues of a symmetric 3 x 3 matrix (its upper half), least first; return the least one's column.

    Cyclic Jacobi rotations (Golub & Van Loan, section 8.5), which keep the axes orthonormal to rounding.
    """
    for a in range(3):
        for b in range(3):
            axes[a, b] = 1.0 if a == b else 0.0
        for b in range(a):
            matrix[a, b] = matrix[b, a]
    for _ in range(SWEEPS):
        size = abs(matrix[0, 0]) + abs(matrix[1, 1]) + abs(matrix[2, 2])
        if abs(matrix[0, 1]) + abs(matrix[0, 2]) + abs(matrix[1, 2]) <= 1e-16 * size:
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if matrix[p, q] == 0.0:
                    continue
                theta = (matrix[q, q] - matrix[p, p]) / (2 * matrix[p, q])
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0:
                    t = -t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for a in range(3):
                    x, y = matrix[a, p], matrix[a, q]
                    matrix[a, p], matrix[a, q] = c * x - s * y, s * x + c * y
                for a in range(3):
                    x, y = matrix[p, a], matrix[q, a]
                    matrix[p, a], matrix[q, a] = c * x - s * y, s * x + c * y
                    x, y = axes[a, p], axes[a, q]
                    axes[a, p], axes[a, q] = c * x - s * y, s * x + c * y
    least, most = 0, 0
    for a in range(1, 3):
        if matrix[a, a] < matrix[least, least]:
            least = a
        if matrix[a, a] >= matrix[most, most]:
            most = a
    middle = matrix[0, 0] + matrix[1, 1] + matrix[2, 2] - matrix[least, least] - matrix[most, most]
    values[0], values[1], values[2] = max(matrix[least, least], 0.0), max(middle, 0.0), max(matrix[most, most], 0.0)
    return least


@njit(nogil=True, cache=True)
def put_rows(order, far, near, distance, row, start, stop):
    """Write rows start:stop of (n, k) arrays `far` and `near` into the rows `order` (n,) of two others."""
    for n in range(start, stop):
        for m in range(far.shape[1]):
            distance[order[n], m], row[order[n], m] = far[n, m], near[n, m]


@njit(nogil=True, cache=True)
def take_rows(order, rank, far, near, distance, row, start, stop):
    """Write rows start:stop of (n, k) neighborhoods of points that are put in an `order` (n,), `rank` its inverse."""
    for n in range(start, stop):
        for m in range(far.shape[1]):
            distance[n, m], row[n, m] = far[order[n], m], rank[near[order[n], m]]


@njit(nogil=True, cache=True)
def cell_keys(points, low, size, shape):
    """Return the number (n,) of the cell of edge `size` that contains each point, z running fastest."""
    keys = np.empty(len(points), np.int64)
    for i in range(len(points)):
        key = 0
        for a in range(3):
            key = key * shape[a] + np.int64((points[i, a] - low[a]) / size)
        keys[i] = key
    return keys


@njit(nogil=True, cache=True)
def empty_balls(points, normals, first, last, cells, sampled, shape, turn, start, stop, radius):
    """Write the radii (n, 2: outward, inward) of the largest balls that touch each point along its normal, empty.

    A ball of radius r touches x_i along n_i and passes through x_j where r = |e|² / (2 |e · n_i|), e = x_j - x_i.
    Points whose normals have n_i . n_j > `turn` belong to the same sheet and are passed over. `points` and `normals`
    are sorted by cell; cell `cells[c]` contains rows `first[c]` to `last[c]`, of which the rows `sampled` are tested.
    """
    lows, highs = np.empty(9, np.int64), np.empty(9, np.int64)
    for c in range(start, stop):
        runs = adjacent_runs(cells[c], cells, first, last, shape, sampled, lows, highs)
        for i in range(first[c], last[c]):
            out, inner = np.inf, np.inf
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            for run in range(runs):
                for w in range(lows[run], highs[run]):
                    j = sampled[w]
                    if nx * normals[j, 0] + ny * normals[j, 1] + nz * normals[j, 2] > turn:
                        continue
                    ex, ey, ez = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                    t = ex * nx + ey * ny + ez * nz
                    square = ex * ex + ey * ey + ez * ez
                    if square < 2 * t * out:
                        out = square / (2 * t)
                    elif square < -2 * t * inner:
                        inner = square / (-2 * t)
            radius[i, 0], radius[i, 1] = out, inner


@njit(nogil=True, cache=True)
def adjacent_runs(key, cells, first, last, shape, sampled, lows, highs):
    """Write the runs of `sampled` in the cell `key` and its 26 neighbors, three cells a run; return their number."""
    z = key % shape[2]
    y = (key // shape[2]) % shape[1]
    x = key // (shape[2] * shape[1])
    runs = 0
    for i in range(max(x - 1, 0), min(x + 2, shape[0])):
        for j in range(max(y - 1, 0), min(y + 2, shape[1])):
            line = (i * shape[1] + j) * shape[2]
            low = np.searchsorted(cells, line + max(z - 1, 0))
            high = np.searchsorted(cells, line + min(z + 1, shape[2] - 1), side="right")
            if low < high:
                lows[runs] = np.searchsorted(sampled, first[low])
                highs[runs] = np.searchsorted(sampled, last[high - 1])
                runs += 1
    return runs


@njit(nogil=True, cache=True)
def mirrored(points, normals, i, j):
    """Return how well n_j agrees with n_i mirrored in the plane midway between x_i and x_j, from -1 to 1.

    Exact on circles and across sharp edges, where n_i . n_j itself is small or has the wrong sign, and opposite for
    two sheets that face one another.
    """
    ex, ey, ez = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    square = ex * ex + ey * ey + ez * ez
    along_i = ex * normals[i, 0] + ey * normals[i, 1] + ez * normals[i, 2]
    along_j = ex * normals[j, 0] + ey * normals[j, 1] + ez * normals[j, 2]
    straight = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
    return straight - 2 * along_i * along_j / square if square > 0 else straight


@njit(nogil=True, cache=True)
def count_agreements(points, normals, rows, sure, start, stop, counts):
    """Write how many neighbors agree with each normal, and oppose it (n, 2), surely, mirrored between them or not."""
    for i in range(start, stop):
        counts[i, 0], counts[i, 1] = 0, 0
        for m in range(1, rows.shape[1]):
            j = rows[i, m]
            agreement = mirrored(points, normals, i, j)
            straight = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
            if min(agreement, straight) > sure:
                counts[i, 0] += 1
            elif max(agreement, straight) < -sure:
                counts[i, 1] += 1


@njit(nogil=True, cache=True)
def blend_planes(points, group, centers, normals, rows, start, stop, blended, height):
    """Write the unit mean of the normals of the surfels around each point, and its mean height over their planes.

    Surfels that face away from the point's own have no weight.

    Weights are exp(-4 d^2/R^2), R the distance from the point's surfel `group` to the farthest of its neighbors `rows`.
    """
    for i in range(start, stop):
        o = group[i]
        far = rows[o, rows.shape[1] - 1]
        reach, total, level = 0.0, 0.0, 0.0
        for a in range(3):
            reach += (centers[far, a] - centers[o, a]) ** 2
            blended[i, a] = 0.0
        for m in range(rows.shape[1]):
            j = rows[o, m]
            if normals[o, 0] * normals[j, 0] + normals[o, 1] * normals[j, 1] + normals[o, 2] * normals[j, 2] <= 0:
                continue
            square, h = 0.0, 0.0
            for a in range(3):
                square += (points[i, a] - centers[j, a]) ** 2
                h += (points[i, a] - centers[j, a]) * normals[j, a]
            weight = np.exp(-4 * square / reach)
            total += weight
            level += weight * h
            for a in range(3):
                blended[i, a] += weight * normals[j, a]
        length = np.sqrt(blended[i, 0] ** 2 + blended[i, 1] ** 2 + blended[i, 2] ** 2)
        height[i] = level / total if total > 0 else 0.0
        for a in range(3):
            blended[i, a] = blended[i, a] / length if length > 0 else normals[o, a]


@njit(nogil=True, cache=True)
def smooth_normals(points, normals, rows, noise, start, stop, smoothed):
    """Write the axis at each point that the normals of its neighbors are nearest to, whatever their signs.

    The axis a with the largest sum of w_j (a . n_j)^2, w_j = exp(-h^2 / (2 noise^2)), h the distance of x_i from the
    plane of x_j: points of another sheet have no weight.
    """
    matrix, axes, values = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(start, stop):
        matrix[:] = 0.0
        for m in range(rows.shape[1]):
            j = rows[i, m]
            h = 0.0
            for a in range(3):
                h += (points[i, a] - points[j, a]) * normals[j, a]
            weight = np.exp(-h * h / (2 * noise * noise))
            for a in range(3):
                for b in range(a, 3):
                    matrix[a, b] -= weight * normals[j, a] * normals[j, b]
        least = diagonalize(matrix, axes, values)
        for a in range(3):
            smoothed[i, a] = axes[a, least]


@njit(nogil=True, cache=True)
def find_isolated(normals, rows, least):
    """Return the points whose normals face against most of their neighbors', in patches of fewer than `least`.

    A patch is what can be reached from neighbor to neighbor whose normals face each other's way.
    """
    count, edges = rows.shape
    against = np.zeros(count, np.bool_)
    for i in range(count):
        opposed = 0
        for m in range(1, edges):
            if _facing(normals, i, rows[i, m]) < 0.0:
                opposed += 1
        against[i] = 2 * opposed > edges - 1
    isolated, patch = np.zeros(count, np.bool_), np.empty(least, np.int64)
    for center in np.flatnonzero(against):
        patch[0] = center
        size, at = 1, 0
        while at < size < least:
            for m in range(1, edges):
                j = rows[patch[at], m]
                if _facing(normals, patch[at], j) >= 0.0 and size < least and not (patch[:size] == j).any():
                    patch[size] = j
                    size += 1
            at += 1
        isolated[center] = size < least
    return np.flatnonzero(isolated)


@njit(nogil=True, inline="always")
def _facing(normals, i, j):
    return normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
