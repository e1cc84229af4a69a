"""The compiled loops of quadrics: z = q(u, v) over the mean plane of some points, and how far others lie off it."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import solve_triangle

RIDGE = 1e-3
"""Share of the points' number added to the curvatures' diagonal: planes stay planes where few points say more."""
MIN_RIDGE = 1e-12
"""The same for the plane, so that points on a line have one."""

OUTLIER = 3.0
"""Root mean square distances of a sheet's smooth points within which a doubtful point has a say in its quadric."""

SLACK = 0.005
"""Share of a sheet's scale that is no distance from it: a third of what planes at 30 degrees leave."""


@njit(nogil=True, cache=True)
def product(a, b):
    """Return the product of two vectors of three coordinates; a call of BLAS would take longer than all of it."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(nogil=True, cache=True, error_model="numpy")
def fit_quadric(points, normals, chosen):
    """Return (center, frame, coefficients, scale) of z = q(u, v) over the mean plane of the chosen points.

    Of none it is infinitely far from everywhere, of a single point the plane through it.
    """
    center, up = np.zeros(3), np.zeros(3)
    count = 0
    for i in range(len(points)):
        if chosen[i]:
            count += 1
            for axis in range(3):
                center[axis] += points[i, axis]
                up[axis] += normals[i, axis]
    if count == 0 or product(up, up) == 0.0:
        nowhere = np.zeros(6)
        nowhere[0] = np.inf
        return center, np.eye(3), nowhere, 1.0
    center /= count
    frame = frame_over(up / math.sqrt(product(up, up)))
    spread = 0.0
    for i in range(len(points)):
        if chosen[i]:
            for axis in range(3):
                spread += (points[i, axis] - center[axis]) ** 2
    scale = math.sqrt(spread / count) if spread > 0.0 else 1.0
    matrix, right, terms = np.zeros((6, 6)), np.zeros(6), np.ones(6)
    for i in range(len(points)):
        if chosen[i]:
            u, v, z = in_frame(center, frame, scale, points[i])
            terms[1], terms[2], terms[3], terms[4], terms[5] = u, v, u * u, u * v, v * v
            for row in range(6):
                right[row] += z * terms[row]
                for column in range(row, 6):
                    matrix[row, column] += terms[row] * terms[column]
    for k in range(6):
        matrix[k, k] += (RIDGE if k > 2 else MIN_RIDGE) * count
    eliminate(matrix, right)
    return center, frame, right, scale


@njit(nogil=True, cache=True)
def frame_over(up):
    """Return the (3, 3) rows of a right-handed orthonormal frame whose last one is `up`."""
    frame = np.zeros((3, 3))
    frame[2] = up
    frame[0, np.argmin(np.abs(up))] = 1.0
    frame[0] -= product(frame[0], up) * up
    frame[0] /= math.sqrt(product(frame[0], frame[0]))
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        frame[1, axis] = up[one] * frame[0, other] - up[other] * frame[0, one]
    return frame


@njit(nogil=True, cache=True, error_model="numpy")
def eliminate(matrix, right):
    """Solve the positive definite system, of which the upper triangle is read, in place of `right`."""
    size = len(right)
    for k in range(size):
        for i in range(k + 1, size):
            factor = matrix[k, i] / matrix[k, k]
            right[i] -= factor * right[k]
            for j in range(i, size):
                matrix[i, j] -= factor * matrix[k, j]
    solve_triangle(matrix, right)


@njit(nogil=True, cache=True)
def in_frame(center, frame, scale, point):
    """Return the coordinates of a point in a frame."""
    x, y, z = (point[0] - center[0]) / scale, (point[1] - center[1]) / scale, (point[2] - center[2]) / scale
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


@njit(nogil=True, cache=True)
def distance(quadric, point, outward):
    """Return the distance of a point from a quadric to first order, above 0 outside; write the normal there."""
    center, frame, q, scale = quadric
    u, v, z = in_frame(center, frame, scale, point)
    along, across = -q[1] - 2 * q[3] * u - q[4] * v, -q[2] - q[4] * u - 2 * q[5] * v
    length = math.sqrt(along * along + across * across + 1.0)
    for axis in range(3):
        outward[axis] = (frame[0, axis] * along + frame[1, axis] * across + frame[2, axis]) / length
    height = z - (q[0] + q[1] * u + q[2] * v + q[3] * u * u + q[4] * u * v + q[5] * v * v)
    return scale * height / length


@njit(nogil=True, cache=True, error_model="numpy")
def misfit(points, normals, chosen):
    """Return the root mean square distance of the chosen points from their quadric, and its scale."""
    quadric = fit_quadric(points, normals, chosen)
    total, outward = 0.0, np.empty(3)
    for i in range(len(points)):
        if chosen[i]:
            total += distance(quadric, points[i], outward) ** 2
    return math.sqrt(total / np.sum(chosen)), quadric[3]


@njit(nogil=True, cache=True, error_model="numpy")
def measure(points, normals, chosen, distances, outward):
    """Write distances of all points from the quadric of the chosen ones, and its normals there; return its reach."""
    quadric = fit_quadric(points, normals, chosen)
    total = 0.0
    for i in range(len(points)):
        distances[i] = distance(quadric, points[i], outward[i])
        total += distances[i] ** 2 if chosen[i] else 0.0
    return OUTLIER * math.sqrt(total / np.sum(chosen)) + SLACK * quadric[3]
