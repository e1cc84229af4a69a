"""The compiled loops of measures: angles, areas and lengths, triangle by triangle, without copies of the mesh."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def measure_triangles(vertices, triangles, middle, flat, start, stop, area, smallest, largest, solid, is_degenerate):
    """Fill the rows start:stop of the (m,) measures of triangles.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    middle : (3,) ndarray
        Where `solid` is measured from.
    flat : float
        A triangle is degenerate if its area is at most this times its longest edge squared.
    area, smallest, largest : (m,) ndarrays
        Angles in degrees, by the arc tangent, which keeps small ones exact.
    solid : (m,) ndarray
        det(a, b, c) / 6.
    is_degenerate : (m,) ndarray of bool
    """
    for t in range(start, stop):
        a, b, c = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        wx, wy, wz = c[0] - b[0], c[1] - b[1], c[2] - b[2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        twice = math.sqrt(nx * nx + ny * ny + nz * nz)
        at_a = math.atan2(twice, ux * vx + uy * vy + uz * vz)
        at_b = math.atan2(twice, -(ux * wx + uy * wy + uz * wz))
        at_c = math.atan2(twice, vx * wx + vy * wy + vz * wz)
        longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
        area[t] = twice / 2
        smallest[t], largest[t] = math.degrees(min(at_a, at_b, at_c)), math.degrees(max(at_a, at_b, at_c))
        solid[t] = ((a[0] - middle[0]) * nx + (a[1] - middle[1]) * ny + (a[2] - middle[2]) * nz) / 6
        is_degenerate[t] = area[t] <= flat * longest


@njit(nogil=True, cache=True)
def measure_edges(vertices, ends, start, stop, length):
    """Fill the rows start:stop of the (e,) lengths of edges with (e, 2) `ends`."""
    for e in range(start, stop):
        a, b = vertices[ends[e, 0]], vertices[ends[e, 1]]
        length[e] = math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(nogil=True, cache=True)
def share_areas(triangles, area, shared):
    """Add a third of each triangle's area to each of its corners in the (n,) `shared`."""
    for t in range(len(triangles)):
        for corner in range(3):
            shared[triangles[t, corner]] += area[t] / 3


@njit(nogil=True, cache=True)
def sum_angles(vertices, triangles, angles, turn):
    """Add the angles of triangles at their corners to the (n,) `angles`, and to `turn` each next corner less the last.

    Around a vertex inside a mesh each neighbor is the next of a triangle once and the last once: its turn is 0.
    """
    for t in range(len(triangles)):
        for k in range(3):
            corner, ahead, behind = triangles[t, k], triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
            a, b, c = vertices[corner], vertices[ahead], vertices[behind]
            ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            twice = math.sqrt(nx * nx + ny * ny + nz * nz)
            angles[corner] += math.atan2(twice, ux * vx + uy * vy + uz * vz)
            turn[corner] += ahead - behind


@njit(nogil=True, cache=True)
def mark_used(triangles, is_used):
    """Mark the (n,) vertices that triangles use."""
    for t in range(len(triangles)):
        for corner in range(3):
            is_used[triangles[t, corner]] = True


@njit(nogil=True, cache=True)
def bound_used(vertices, is_used):
    """Return the (2, 3) corners of the box around the used of (n, 3) vertices."""
    bounds = np.empty((2, 3))
    bounds[0], bounds[1] = np.inf, -np.inf
    for n in range(len(vertices)):
        if is_used[n]:
            for axis in range(3):
                bounds[0, axis] = min(bounds[0, axis], vertices[n, axis])
                bounds[1, axis] = max(bounds[1, axis], vertices[n, axis])
    return bounds
