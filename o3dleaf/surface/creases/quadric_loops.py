"""The compiled loops of quadrics: z = q(u, v) over the mean plane of some points, and how far others lie off it."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import solve_triangle
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, put

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


@njit(nogil=True, cache=True)
def rows_where(chosen):
    """Return the rising numbers of what a mask chooses."""
    rows, count = np.empty(chosen.size, dtype=np.int64), 0
    for i in range(chosen.size):
        # Without a branch, which would be guessed wrongly half of the time.
        rows[count] = i
        count += chosen[i]
    return rows[:count]


@njit(nogil=True, cache=True, error_model="numpy")
def fit_quadric(points, normals, rows):
    """Return (center, frame, coefficients, scale) of z = q(u, v) over the mean plane of some of the points.

    Of none it is infinitely far from everywhere, of a single point the plane through it.
    """
    center, up, count = np.zeros(3), np.zeros(3), rows.size
    for i in rows:
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
    for i in rows:
        for axis in range(3):
            spread += (points[i, axis] - center[axis]) ** 2
    scale = math.sqrt(spread / count) if spread > 0.0 else 1.0
    places = np.empty((3, count))
    for k in range(count):
        places[0, k], places[1, k], places[2, k] = in_frame(center, frame, scale, points, rows[k])
    matrix, right = np.zeros((6, 6)), np.zeros(6)
    add_products(places[0], places[1], places[2], matrix, right)
    for k in range(6):
        matrix[k, k] += (RIDGE if k > 2 else MIN_RIDGE) * count
    eliminate(matrix, right)
    return center, frame, right, scale


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def add_products(u, v, z, matrix, right):
    """Write, above the diagonal, Σ t tᵀ of the terms t = (1, u, v, u², uv, v²) at some places, and Σ z t."""
    count = u.size
    su = sv = suu = suv = svv = suuu = suuv = suvv = svvv = suuuu = suuuv = suuvv = suvvv = svvvv = 0.0
    rz = ru = rv = ruu = ruv = rvv = 0.0
    for i in range(count):
        a, b, w = u[i], v[i], z[i]
        aa, ab, bb = a * a, a * b, b * b
        su += a
        sv += b
        suu += aa
        suv += ab
        svv += bb
        suuu += aa * a
        suuv += aa * b
        suvv += a * bb
        svvv += bb * b
        suuuu += aa * aa
        suuuv += aa * ab
        suuvv += aa * bb
        suvvv += ab * bb
        svvvv += bb * bb
        rz += w
        ru += w * a
        rv += w * b
        ruu += w * aa
        ruv += w * ab
        rvv += w * bb
    put((float(count), su, sv, suu, suv, svv), matrix[0])
    put((suu, suv, suuu, suuv, suvv), matrix[1, 1:])
    put((svv, suuv, suvv, svvv), matrix[2, 2:])
    put((suuuu, suuuv, suuvv), matrix[3, 3:])
    put((suuvv, suvvv), matrix[4, 4:])
    put((svvvv,), matrix[5, 5:])
    put((rz, ru, rv, ruu, ruv, rvv), right)


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
def in_frame(center, frame, scale, points, i):
    """Return the coordinates of one of the points (n, 3) in a frame."""
    share = 1.0 / scale
    x, y, z = share * (points[i, 0] - center[0]), share * (points[i, 1] - center[1]), share * (points[i, 2] - center[2])
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


@njit(nogil=True, cache=True, error_model="numpy")
def write_distances(quadric, points, distances):
    """Write the distances of points from a quadric to first order, above 0 outside: numbers alone, many at once."""
    center, frame, q, scale = quadric
    c0, c1, c2 = center[0], center[1], center[2]
    a0, a1, a2, b0, b1, b2 = frame[0, 0], frame[0, 1], frame[0, 2], frame[1, 0], frame[1, 1], frame[1, 2]
    n0, n1, n2 = frame[2, 0], frame[2, 1], frame[2, 2]
    q0, q1, q2, q3, q4, q5 = q[0], q[1], q[2], q[3], q[4], q[5]
    share = 1.0 / scale  # divisions take as long as all else
    for i in range(len(points)):
        x, y, z = share * (points[i, 0] - c0), share * (points[i, 1] - c1), share * (points[i, 2] - c2)
        u, v, w = a0 * x + a1 * y + a2 * z, b0 * x + b1 * y + b2 * z, n0 * x + n1 * y + n2 * z
        along, across = -q1 - 2 * q3 * u - q4 * v, -q2 - q4 * u - 2 * q5 * v
        height = w - (q0 + q1 * u + q2 * v + q3 * u * u + q4 * u * v + q5 * v * v)
        distances[i] = scale * height / math.sqrt(along * along + across * across + 1.0)


@njit(nogil=True, cache=True)
def write_normals(quadric, points, outward):
    """Write the normals (n, 3) of a quadric beside points."""
    center, frame, q, scale = quadric
    for i in range(len(points)):
        u, v, _ = in_frame(center, frame, scale, points, i)
        along, across = -q[1] - 2 * q[3] * u - q[4] * v, -q[2] - q[4] * u - 2 * q[5] * v
        length = math.sqrt(along * along + across * across + 1.0)
        for axis in range(3):
            outward[i, axis] = (frame[0, axis] * along + frame[1, axis] * across + frame[2, axis]) / length


@njit(nogil=True, cache=True, error_model="numpy")
def misfit(points, normals, chosen):
    """Return the root mean square distance of the chosen points from their quadric, and its scale."""
    rows = rows_where(chosen)
    quadric = fit_quadric(points, normals, rows)
    own, distances = np.empty((rows.size, 3)), np.empty(rows.size)
    for k in range(rows.size):
        for axis in range(3):
            own[k, axis] = points[rows[k], axis]
    write_distances(quadric, own, distances)
    return spread_of(distances, np.arange(rows.size)), quadric[3]


@njit(nogil=True, cache=True, error_model="numpy")
def spread_of(distances, rows):
    """Return the root of the mean square of some of the distances."""
    total = 0.0
    for i in rows:
        total += distances[i] ** 2
    return math.sqrt(total / rows.size)


@njit(nogil=True, cache=True, error_model="numpy")
def measure(points, normals, chosen, distances, outward):
    """Write distances of all points from the quadric of the chosen ones, and normals where `outward` has rows.

    Return the reach of the quadric.
    """
    rows = rows_where(chosen)
    quadric = fit_quadric(points, normals, rows)
    write_distances(quadric, points, distances)
    if len(outward):
        write_normals(quadric, points, outward)
    return OUTLIER * spread_of(distances, rows) + SLACK * quadric[3]
