"""The compiled loop that finds what lies above and below the points of a sheet."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.cloud.cloud_loops import adjacent_runs


@njit(nogil=True, cache=True)
def find_layers(points, normals, reach, steep, asked, order, number, first, last, shape, start, stop, distance, row):
    """Write the distances (n, 2) and rows (n, 2) of the nearest points above and below those of cells start:stop.

    `points` and `normals` are sorted by cells of an edge no less than `reach`, and were in the rows `order`, by which
    is written; only those `asked` are looked from. Above and below is what lies within acos(`steep`) of the normal; of
    equally near ones that of the last row counts.
    """
    lows, highs, every = np.empty(9, np.int64), np.empty(9, np.int64), np.arange(len(points))
    for c in range(start, stop):
        runs = -1
        for i in range(first[c], last[c]):
            if not asked[i]:
                continue
            if runs < 0:
                runs = adjacent_runs(number[c], number, first, last, shape, every, lows, highs)
            here, nx, ny, nz = order[i], normals[i, 0], normals[i, 1], normals[i, 2]
            for run in range(runs):
                for j in range(lows[run], highs[run]):
                    ex, ey, ez = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                    length, height = np.sqrt(ex * ex + ey * ey + ez * ez), ex * nx + ey * ny + ez * nz
                    if length == 0 or length > reach or abs(height) < steep * length:
                        continue
                    side = int(height < 0)
                    best = distance[here, side]
                    if length < best or (length == best and order[j] > row[here, side]):
                        distance[here, side], row[here, side] = length, order[j]
