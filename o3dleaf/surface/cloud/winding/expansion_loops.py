"""The compiled loops of winding numbers off the points: dipoles near one by one, nodes by moments up to the second."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.cloud.winding.dipole_loops import LEAF

OPENING = 0.35
"""Radius of a node over its distance up to which it is taken as one: winding numbers err by 0.0025 at most, and by
0.0006 mostly, on balls and figures of 20,000 to 100,000 points, near them and deep inside."""


@njit(nogil=True, cache=True)
def sum_moments(points, nodes, flux):
    """Return the moments of each node's dipoles f: the sums of f (m, 3), d (x) f (m, 3, 3) and d (x) d (x) f.

    d is the way from the node's center to a point.
    """
    count = len(nodes.radius)
    zeroth, first, second = np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3, 3, 3))
    way = np.empty(3)
    for k in range(count - 1, -1, -1):
        if 2 * k + 1 >= count:
            for i in range(nodes.first[k], nodes.last[k]):
                for a in range(3):
                    way[a] = points[i, a] - nodes.center[k, a]
                for a in range(3):
                    f = flux[i, a]
                    zeroth[k, a] += f
                    for b in range(3):
                        first[k, b, a] += way[b] * f
                        for c in range(3):
                            second[k, b, c, a] += way[b] * way[c] * f
            continue
        for child in range(2 * k + 1, 2 * k + 3):
            for a in range(3):
                way[a] = nodes.center[child, a] - nodes.center[k, a]
            for a in range(3):
                f = zeroth[child, a]
                zeroth[k, a] += f
                for b in range(3):
                    first[k, b, a] += first[child, b, a] + way[b] * f
                    for c in range(3):
                        arms = way[b] * first[child, c, a] + way[c] * first[child, b, a]
                        second[k, b, c, a] += second[child, b, c, a] + arms + way[b] * way[c] * f
    return zeroth, first, second


@njit(nogil=True, cache=True, error_model="numpy")
def expanded(terms, x, y, z, soft):
    """Return what a node's dipoles make, by its terms (23,), see `Dipoles`; its center is at (x, y, z)."""
    inverse = 1.0 / (x * x + y * y + z * z + soft)
    bent = terms[4] * x * x + terms[5] * y * y + terms[6] * z * z
    bent += terms[7] * x * y + terms[8] * y * z + terms[9] * z * x
    trace = terms[10] * x + terms[11] * y + terms[12] * z
    cubic = x * (terms[13] * x * x + terms[14] * x * y + terms[15] * x * z + terms[16] * y * z)
    cubic += y * (terms[17] * y * y + terms[18] * y * x + terms[19] * y * z)
    cubic += z * (terms[20] * z * z + terms[21] * z * x + terms[22] * z * y)
    along = terms[0] * x + terms[1] * y + terms[2] * z + terms[3]
    along -= inverse * (3.0 * bent + 1.5 * trace - 7.5 * inverse * cubic)
    return along * inverse * np.sqrt(inverse)


@njit(nogil=True, cache=True, error_model="numpy")
def wind_at(places, soft, points, flux, nodes, terms, start, stop, number):
    """Write the winding number that dipoles make at places (n, 3), distances softened by the root of `soft` (n,).

    Of an unsoftened dipole at the place itself it is 0.
    """
    count = len(nodes.radius)
    stack, each = np.empty(128, np.int64), np.empty(LEAF)
    for i in range(start, stop):
        px, py, pz, square = places[i, 0], places[i, 1], places[i, 2], soft[i]
        total, depth, stack[0] = 0.0, 1, 0
        while depth > 0:
            depth -= 1
            k = stack[depth]
            x, y, z = nodes.center[k, 0] - px, nodes.center[k, 1] - py, nodes.center[k, 2] - pz
            least = nodes.radius[k] / OPENING
            if x * x + y * y + z * z > least * least:
                total += expanded(terms[k], x, y, z, square)
            elif 2 * k + 1 < count:
                stack[depth], stack[depth + 1] = 2 * k + 1, 2 * k + 2
                depth += 2
            else:
                begin, size = nodes.first[k], nodes.last[k] - nodes.first[k]
                for j in range(size):  # apart from their sum, so that a processor takes several at once
                    x, y, z = points[begin + j, 0] - px, points[begin + j, 1] - py, points[begin + j, 2] - pz
                    far = x * x + y * y + z * z + square
                    along = flux[begin + j, 0] * x + flux[begin + j, 1] * y + flux[begin + j, 2] * z
                    each[j] = along / (far * np.sqrt(far)) if far > 0.0 else 0.0
                for j in range(size):
                    total += each[j]
        number[i] = total / (4 * np.pi)
