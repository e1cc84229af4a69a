"""The compiled loops of normals turned to where their points were seen from."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.cloud.cloud_loops import mirrored


@njit(nogil=True, cache=True)
def compare_seen(points, normals, viewpoint, rows, some, one_place, start, stop, agreement):
    """Write how normals of points `some` (m,) agree with their neighbors' (m, k - 1), from -1 to 1, where that is sure.

    That is the less of what they do mirrored and straight, where both have one sign, and 0 else. It is 0 too of points
    seen from elsewhere: whose viewpoints, seen from the point, have a cosine below `one_place`.
    """
    for m in range(start, stop):
        i = some[m]
        for edge in range(rows.shape[1] - 1):
            j = rows[i, edge + 1]
            along, own, other, straight = 0.0, 0.0, 0.0, 0.0
            for a in range(3):
                here, there = viewpoint[i, a] - points[i, a], viewpoint[j, a] - points[i, a]
                along, own, other = along + here * there, own + here * here, other + there * there
                straight += normals[i, a] * normals[j, a]
            across = mirrored(points, normals, i, j)
            agreement[m, edge] = 0.0
            if straight * across > 0.0 and along >= one_place * np.sqrt(own * other):
                agreement[m, edge] = straight if abs(straight) < abs(across) else across


@njit(nogil=True, cache=True)
def weigh_sides(rows, some, agreement, steepness, settled, rounds, facing):
    """Bring points `some` (m,) to the mean of their neighbors and what they show, till they move less than `settled`.

    A point that shows its side by the steepness t, its neighbors by agreements a, faces its viewpoint to a share of
    (sum a x_j / sum |a| + t) / (1 + t). Rounds run forth and back by turns: over the neighbors of what moved, and over
    all points where none did, for who has one among its neighbors need not be one of its own.

    Parameters
    ----------
    rows : (n, k) ndarray
        Neighbors, each point itself first.
    agreement : (m, k - 1) ndarray
    steepness : (m,) ndarray
    rounds : int
        At most.
    facing : (n,) ndarray
        Changed in place.
    """
    waiting, everywhere = np.zeros(len(facing), dtype=np.bool_), True
    for number in range(rounds):
        moved = False
        for step in range(len(some)):
            m = step if number % 2 == 0 else len(some) - 1 - step
            point = some[m]
            if not everywhere and not waiting[point]:
                continue
            waiting[point], total, weight = False, 0.0, 0.0
            for edge in range(agreement.shape[1]):
                total += agreement[m, edge] * facing[rows[point, edge + 1]]
                weight += abs(agreement[m, edge])
            if weight == 0.0:
                continue
            before, facing[point] = facing[point], (total / weight + steepness[m]) / (1.0 + steepness[m])
            if abs(facing[point] - before) >= settled:
                moved = True
                for edge in range(agreement.shape[1]):
                    waiting[rows[point, edge + 1]] = True
        if everywhere and not moved:
            return number
        everywhere = not moved
    return rounds
