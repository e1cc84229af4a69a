"""Shapes of triangles, compiled: normals, the sine of the smallest angle, the distance to a point."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def normal_of(p, q, r, normal):
    """Write the normal of a triangle, twice its area long, and return its length."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    normal[0], normal[1], normal[2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)


@njit(nogil=True, cache=True)
def square(p, q):
    """Return the squared distance of two points."""
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@njit(nogil=True, cache=True)
def roundness(p, q, r, double_area):
    """Return the sine of the smallest angle: twice the area over the two longest sides; 0 where a side is 0."""
    a, b, c = square(p, q), square(q, r), square(r, p)
    product = a * b * c / max(min(a, b, c), 1e-300)
    return double_area / math.sqrt(max(product, 1e-300))


@njit(nogil=True, cache=True)
def dot(u, v):
    """Return the scalar product."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@njit(nogil=True, cache=True)
def square_to_triangle(x, p, q, r):
    """Return the squared distance of a point from a triangle (Ericson 2005, Real-time collision detection, 5.1.5)."""
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        u[k], v[k], w[k] = q[k] - p[k], r[k] - p[k], x[k] - p[k]
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    s, t, area = vv * wu - uv * wv, uu * wv - uv * wu, uu * vv - uv * uv
    if area > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= area:
        s, t = s / area, t / area
        return max(dot(w, w) + s * (s * uu + 2 * t * uv - 2 * wu) + t * (t * vv - 2 * wv), 0.0)
    return min(square_to_segment(x, p, q), square_to_segment(x, q, r), square_to_segment(x, r, p))


@njit(nogil=True, cache=True)
def square_to_segment(x, p, q):
    """Return the squared distance of a point from a segment."""
    length, along = square(p, q), 0.0
    for k in range(3):
        along += (x[k] - p[k]) * (q[k] - p[k])
    share = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
    total = 0.0
    for k in range(3):
        total += (x[k] - p[k] - share * (q[k] - p[k])) ** 2
    return total
