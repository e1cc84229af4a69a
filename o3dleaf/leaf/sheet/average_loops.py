"""The compiled loop that moves points onto the planes through their neighborhoods."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.cloud.cloud_loops import adjacent_runs, diagonalize


@njit(nogil=True, cache=True)
def project_onto_planes(points, radius, moves, number, first, last, shape, start, stop, moved, normal):
    """Write points (n, 3), moved along the normals of the weighted planes around them, and these normals (n, 3).

    `points` are sorted by cells of an edge no less than the largest `radius` (n,): cell number[c] contains rows
    first[c] to last[c]. A neighbor at distance r has the weight (1 - r²/R²)². Points of which `moves` is False get a
    normal only.
    """
    matrix, axes, values = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    center, lows, highs = np.empty(3), np.empty(9, np.int64), np.empty(9, np.int64)
    every = np.arange(len(points))
    for c in range(start, stop):
        runs = adjacent_runs(number[c], number, first, last, shape, every, lows, highs)
        for i in range(first[c], last[c]):
            square = radius[i] * radius[i]
            total = 0.0
            center[:] = 0.0
            matrix[:] = 0.0
            for run in range(runs):
                for j in range(lows[run], highs[run]):
                    x = points[j, 0] - points[i, 0]
                    y = points[j, 1] - points[i, 1]
                    z = points[j, 2] - points[i, 2]
                    rest = 1.0 - (x * x + y * y + z * z) / square
                    if rest <= 0.0:
                        continue
                    w = rest * rest
                    total += w
                    center[0] += w * x
                    center[1] += w * y
                    center[2] += w * z
                    matrix[0, 0] += w * x * x
                    matrix[0, 1] += w * x * y
                    matrix[0, 2] += w * x * z
                    matrix[1, 1] += w * y * y
                    matrix[1, 2] += w * y * z
                    matrix[2, 2] += w * z * z
            for a in range(3):
                center[a] /= total
            for a in range(3):
                for b in range(a, 3):
                    matrix[a, b] = matrix[a, b] / total - center[a] * center[b]
            least = diagonalize(matrix, axes, values)
            height = 0.0
            for a in range(3):
                normal[i, a] = axes[a, least]
                height += center[a] * axes[a, least]
            for a in range(3):
                moved[i, a] = points[i, a] + (height * axes[a, least] if moves[i] else 0.0)


@njit(nogil=True, cache=True)
def thin_cells(points, distance, row, number, first, last, shape, kept):
    """Write which points are `kept` (n,), by their `row`: in the order of rows, if no kept one is within `distance`.

    `points` are sorted by cells of an edge no less than the largest distance.
    """
    lows, highs = np.empty(9, np.int64), np.empty(9, np.int64)
    every = np.arange(len(points))
    place, cell = np.empty(len(points), np.int64), np.empty(len(points), np.int64)
    for c in range(len(number)):
        for i in range(first[c], last[c]):
            place[row[i]], cell[row[i]] = i, c
    for r in range(len(points)):
        i = place[r]
        runs = adjacent_runs(number[cell[r]], number, first, last, shape, every, lows, highs)
        free = True
        for run in range(runs):
            for j in range(lows[run], highs[run]):
                if kept[row[j]] and free:
                    x, y, z = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                    free = x * x + y * y + z * z >= distance[i] * distance[i]
        kept[r] = free
