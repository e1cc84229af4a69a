"""The compiled loop that triangulates a hole with the least area."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def triangulate_hole(corners, joined, triangles):
    """Write the n - 2 triangles, by places in the loop, of least area within a loop of `corners` (n, 3).

    Corners i and j that are `joined` (n, n) by an edge elsewhere are not joined again. Returns whether there is a way:
    dynamic programming over stretches of the loop (Barequet & Sharir 1995).
    """
    n = len(corners)
    cost, middle = np.zeros((n, n)), np.full((n, n), -1)
    for length in range(2, n):
        for i in range(n - length):
            k = i + length
            cost[i, k] = np.inf
            if joined[i, k] and length < n - 1:
                continue
            for j in range(i + 1, k):
                p, q = corners[j] - corners[i], corners[k] - corners[i]
                x, y, z = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
                whole = np.sqrt(x * x + y * y + z * z) / 2 + cost[i, j] + cost[j, k]
                if whole < cost[i, k]:
                    cost[i, k], middle[i, k] = whole, j
    if not np.isfinite(cost[0, n - 1]):
        return False
    stack, top, made = np.empty((n, 2), np.int64), 1, 0
    stack[0, 0], stack[0, 1] = 0, n - 1
    while top > 0:
        top -= 1
        i, k = stack[top, 0], stack[top, 1]
        j = middle[i, k]
        triangles[made, 0], triangles[made, 1], triangles[made, 2] = i, j, k
        made += 1
        for a, b in ((i, j), (j, k)):
            if b - a > 1:
                stack[top, 0], stack[top, 1] = a, b
                top += 1
    return True
