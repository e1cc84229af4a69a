"""The compiled loops of a camera: how the triangles of a mesh lie, and which pixels they reach."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit

ROUNDING = 0.01
"""Pixels by which a ray in float32 may pass beside the middle of its sample."""


@njit(nogil=True, cache=True)
def sum_moments(vertices, triangles, origin, moments):
    """Add up the triangles of a mesh, each weighted by w, twice its area.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    origin : (3,) ndarray
        Near the mesh; what follows is relative to it.
    moments : (8, 3) ndarray
        Zero before. Row 0 is the sum of the normals w n, row 1 of w c, c the middle of a triangle; rows 2 to 4
        are the sum of w n nᵀ, rows 5 to 7 of w (Σ v vᵀ + 9 c cᵀ) / 12, the second moment over the triangles.
    """
    corner, normal, middle = np.empty((3, 3)), np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        for k in range(3):
            for axis in range(3):
                corner[k, axis] = vertices[triangles[t, k], axis] - origin[axis]
        for axis in range(3):
            one, two = (axis + 1) % 3, (axis + 2) % 3
            normal[axis] = (corner[1, one] - corner[0, one]) * (corner[2, two] - corner[0, two]) - (
                corner[1, two] - corner[0, two]
            ) * (corner[2, one] - corner[0, one])
            middle[axis] = (corner[0, axis] + corner[1, axis] + corner[2, axis]) / 3
        weight = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        if weight == 0:
            continue
        for i in range(3):
            moments[0, i] += normal[i]
            moments[1, i] += weight * middle[i]
            for j in range(3):
                moments[2 + i, j] += normal[i] * normal[j] / weight
                second = 9 * middle[i] * middle[j]
                for k in range(3):
                    second += corner[k, i] * corner[k, j]
                moments[5 + i, j] += weight * second / 12


@njit(nogil=True, cache=True)
def mark_covered(places, triangles, covered):
    """Mark every pixel that a triangle reaches into; one that it only comes near may be marked too.

    Parameters
    ----------
    places : (n, 2) ndarray
        Columns and rows of the vertices, in pixels from the upper left corner.
    triangles : (m, 3) ndarray of int64
    covered : (height, width) ndarray of bool
    """
    height, width = covered.shape
    for t in range(len(triangles)):
        ax, ay = places[triangles[t, 0], 0], places[triangles[t, 0], 1]
        bx, by = places[triangles[t, 1], 0], places[triangles[t, 1], 1]
        cx, cy = places[triangles[t, 2], 0], places[triangles[t, 2], 1]
        left = max(0, math.floor(min(ax, bx, cx) - ROUNDING))
        right = min(width - 1, math.floor(max(ax, bx, cx) + ROUNDING))
        top = max(0, math.floor(min(ay, by, cy) - ROUNDING))
        bottom = min(height - 1, math.floor(max(ay, by, cy) + ROUNDING))
        is_turned = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0
        if is_turned:
            bx, by, cx, cy = cx, cy, bx, by
        is_small = right - left < 2 and bottom - top < 2
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                if not covered[row, column]:
                    x, y = column + 0.5, row + 0.5
                    covered[row, column] = is_small or (
                        _reaches_inside(ax, ay, bx, by, x, y)
                        and _reaches_inside(bx, by, cx, cy, x, y)
                        and _reaches_inside(cx, cy, ax, ay, x, y)
                    )


@njit(nogil=True, cache=True)
def _reaches_inside(ax, ay, bx, by, x, y):
    """Return whether a pixel with its middle in (x, y) reaches over the edge from a to b to its inner side."""
    across, along = bx - ax, by - ay
    return across * (y - ay) - along * (x - ax) + (0.5 + ROUNDING) * (abs(across) + abs(along)) >= 0
