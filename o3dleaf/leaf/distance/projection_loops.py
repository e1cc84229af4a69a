"""Compiled: mean curvatures, and Newton's steps in z towards the closest point in the world.

Names as in `o3dleaf.leaf.blade.lifted_loops`.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.blade.lifted_loops import pull, reciprocal
from o3dleaf.leaf.blade.vector_loops import cross3, dot3

MIN_EIGENVALUE = 0.1
"""Least eigenvalue of the second variation of the distance: 0 at a focus, where Newton's step has no end."""


@njit(nogil=True, cache=True)
def mean_curvatures(start, stop, columns, inner, hessians, lift_hessians, curvatures):
    r"""Write div n/2, n = −∇G/|∇G|, from F's gradient and Hessian by z and the lift's second derivatives.

    With N = ∇G the Hessian in the world is A⁻ᵀ (Hess F − Σ_k N_k Hess X_k) A⁻¹.
    """
    cofactors, pulled, corrected = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for i in range(start, stop):
        reciprocal(columns[i], cofactors)
        square = pull(inner[i], cofactors, pulled)
        curvatures[i] = 0.0
        if square == 0.0:
            continue
        for a in range(3):
            for b in range(3):
                corrected[a, b] = hessians[i, a, b] - dot3(pulled, lift_hessians[i, a, b])
        trace = along = 0.0
        for a in range(3):
            for b in range(3):
                metric = dot3(cofactors[a], cofactors[b])
                trace += corrected[a, b] * metric
                along += corrected[a, b] * dot3(cofactors[a], pulled) * dot3(cofactors[b], pulled)
        curvatures[i] = -0.5 * (trace - along / square) / math.sqrt(square)


@njit(nogil=True, cache=True)
def closest_steps(points, world, columns, values, inner, hessians, max_step, steps):
    r"""Write Newton's steps in z towards the point of F = 0 that is closest to x in the world.

    With r = X − x, N = ∇G, B the Hessian of G but for the blade's own small part, μ = −r·N/|N|², the step δ goes
    −F N/|N|² along N, and t in the tangent plane with (I + μB) t = −r − μ B δ_N there. Where the plane's matrix is
    not safely positive, x lies near a focus, and it is lifted to least eigenvalue `MIN_EIGENVALUE`; t is at most
    `max_step` long.
    """
    cofactors, normal, step, product = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    u, v, pushed = np.empty(3), np.empty(3), np.empty((2, 3))
    for i in range(len(points)):
        reciprocal(columns[i], cofactors)
        square = pull(inner[i], cofactors, normal)
        steps[i] = 0.0
        if square == 0.0:
            continue
        length = math.sqrt(square)
        for k in range(3):
            normal[k] /= length
        tangents(normal, u, v)
        along = 0.0
        for k in range(3):
            along += (world[i, k] - points[i, k]) * normal[k]
        mu, push = -along / length, -values[i] / length
        # B = A⁻ᵀ Hess F A⁻¹: vectors are taken to z, multiplied there, and multiplied from the left by vectors in z.
        for k in range(3):
            pushed[0, k], pushed[1, k] = dot3(cofactors[k], u), dot3(cofactors[k], v)
            step[k] = dot3(cofactors[k], normal)
        for k in range(3):
            product[k] = mu * dot3(hessians[i, k], pushed[0])
        uu, uv, un = 1.0 + dot3(product, pushed[0]), dot3(product, pushed[1]), dot3(product, step)
        for k in range(3):
            product[k] = mu * dot3(hessians[i, k], pushed[1])
        vv, vn = 1.0 + dot3(product, pushed[1]), dot3(product, step)
        a, b = -un * push, -vn * push
        for k in range(3):
            a -= (world[i, k] - points[i, k]) * u[k]
            b -= (world[i, k] - points[i, k]) * v[k]
        lift = MIN_EIGENVALUE - (0.5 * (uu + vv) - math.sqrt(0.25 * (uu - vv) ** 2 + uv * uv))
        if lift > 0.0:
            uu += lift
            vv += lift
        determinant = uu * vv - uv * uv
        a, b = (vv * a - uv * b) / determinant, (uu * b - uv * a) / determinant
        size = math.sqrt(a * a + b * b)
        if size > max_step:
            a, b = a * max_step / size, b * max_step / size
        push = min(max(push, -max_step), max_step)
        for k in range(3):
            step[k] = push * normal[k] + a * u[k] + b * v[k]
        for k in range(3):
            steps[i, k] = dot3(cofactors[k], step)


@njit(nogil=True, cache=True)
def tangents(normal, u, v):
    """Write two unit vectors that make a right-handed frame with a unit normal."""
    least = 0
    for k in range(1, 3):
        if abs(normal[k]) < abs(normal[least]):
            least = k
    for k in range(3):
        u[k] = (1.0 if k == least else 0.0) - normal[least] * normal[k]
    size = math.sqrt(dot3(u, u))
    for k in range(3):
        u[k] /= size
    cross3(normal, u, v)
