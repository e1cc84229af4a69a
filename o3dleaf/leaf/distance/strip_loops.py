"""Compiled: the nearest strip of the leaf's rim."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.distance.search_loops import DEPTH, GROUP, near_first


class Strips(NamedTuple):
    """The strips of the rim: the points center + s edge + z up, −1 <= s <= 1 and z between the ends.

    Attributes
    ----------
    centers, edges, ups : (n, 3) ndarrays
    ends : (n, 2) ndarray
    """

    centers: npt.NDArray[Any]
    edges: npt.NDArray[Any]
    ups: npt.NDArray[Any]
    ends: npt.NDArray[Any]


@njit(nogil=True, cache=True)
def nearest_strips(points, boxes, strips, feet, distances):
    """Write the points of the rim that are nearer to the points than √distances, and their squared distances."""
    stack, bounds = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    leaves = len(boxes) // 2
    foot = np.empty(3)
    for i in range(len(points)):
        best = distances[i]
        stack[0], bounds[0], top = 1, 0.0, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if bounds[top] >= best:
                continue
            if node < leaves:
                top = near_first(points[i], boxes, node, best, stack, bounds, top)
                continue
            for strip in range(GROUP * (node - leaves), min(GROUP * (node - leaves + 1), len(strips.centers))):
                distance = strip_distance(points[i], strip, strips, foot)
                if distance < best:
                    best = distance
                    feet[i] = foot
        distances[i] = best


@njit(nogil=True, cache=True)
def strip_distance(x, strip, strips, foot):
    """Return the squared distance of x to a strip, and write the nearest point: the best of four edges and the inside.

    |up| = 1.
    """
    center, edge, up, ends = strips.centers[strip], strips.edges[strip], strips.ups[strip], strips.ends[strip]
    ee = eu = er = ur = 0.0
    for k in range(3):
        gap = x[k] - center[k]
        ee += edge[k] * edge[k]
        eu += edge[k] * up[k]
        er += edge[k] * gap
        ur += up[k] * gap
    determinant = ee - eu * eu
    best = np.inf
    for case in range(5):
        if case == 0:
            s = (er - eu * ur) / determinant
            z = ur - eu * s
            if abs(s) > 1.0 or z < ends[0] or z > ends[1]:
                continue
        elif case < 3:
            s = -1.0 if case == 1 else 1.0
            z = min(max(ur - eu * s, ends[0]), ends[1])
        else:
            z = ends[case - 3]
            s = min(max((er - eu * z) / ee, -1.0), 1.0)
        total = 0.0
        for k in range(3):
            gap = x[k] - center[k] - s * edge[k] - z * up[k]
            total += gap * gap
        if total < best:
            best = total
            for k in range(3):
                foot[k] = center[k] + s * edge[k] + z * up[k]
        if case == 0:
            break
    return best
