"""The compiled loops of the leaf's surface: the lift's Jacobian, gradients pulled back, steps of Newton's method.

Flat coordinates z and the world are joined by the lift X(z); its Jacobian's columns are a, b, c = ∂X/∂z. A
gradient g by z is n = (g₁ b×c + g₂ c×a + g₃ a×b)/det in the world; a step δ in the world is
((b×c)·δ, (c×a)·δ, (a×b)·δ)/det in z.
"""

import math

import numpy as np
from numba import njit

from o3dleaf.leaf.macro.frame_loops import cross3, dot3, station

LEAST_FOCUS = 0.1
"""Least eigenvalue of the second variation of the distance: 0 at a focus, where Newton's step has no end."""
FOLD = 1e-9
"""Least volume of the Jacobian's columns, of the product of their lengths: beyond it the frame folds, and steps would
have no end."""


@njit(nogil=True, cache=True)
def fill_lift(start, stop, flat, heights, slopes, breaks, axis, normal, world, columns):
    """Write X(z) into world[start:stop] and the columns ∂X/∂z_k into columns[start:stop, k], from H and its slopes."""
    frame, slope, scratch = np.empty((4, 3)), np.empty((4, 3)), np.empty((7, 3))
    for i in range(start, stop):
        station(flat[i, 0], breaks, axis, normal, frame, slope, scratch)
        across, up = flat[i, 1], flat[i, 2] + heights[i]
        for k in range(3):
            world[i, k] = frame[0, k] + across * frame[2, k] + up * frame[3, k]
            columns[i, 0, k] = slope[0, k] + across * slope[2, k] + up * slope[3, k] + slopes[i, 0] * frame[3, k]
            columns[i, 1, k] = frame[2, k] + slopes[i, 1] * frame[3, k]
            columns[i, 2, k] = frame[3, k]


@njit(nogil=True, cache=True)
def reciprocal(columns, cofactors):
    """Write b×c, c×a, a×b over det into the rows of `cofactors` (3, 3): the inverse of [a b c]."""
    cross3(columns[1], columns[2], cofactors[0])
    cross3(columns[2], columns[0], cofactors[1])
    cross3(columns[0], columns[1], cofactors[2])
    determinant = dot3(columns[0], cofactors[0])
    product = 1.0
    for k in range(3):
        product *= math.sqrt(dot3(columns[k], columns[k]))
    least = max(FOLD * product, 1e-300)
    if abs(determinant) < least:
        determinant = math.copysign(least, determinant)
    for k in range(3):
        for j in range(3):
            cofactors[k, j] /= determinant


@njit(nogil=True, cache=True)
def pull(inner, cofactors, pulled):
    """Write the world gradient of a function of z with gradient `inner` (3,), and return the square of its length."""
    square = 0.0
    for k in range(3):
        pulled[k] = inner[0] * cofactors[0, k] + inner[1] * cofactors[1, k] + inner[2] * cofactors[2, k]
        square += pulled[k] * pulled[k]
    return square


@njit(nogil=True, cache=True)
def pull_back(start, stop, columns, inner, gradients):
    """Write the world gradients of functions of z whose gradients by z are `inner` (n, 3)."""
    cofactors = np.empty((3, 3))
    for i in range(start, stop):
        reciprocal(columns[i], cofactors)
        pull(inner[i], cofactors, gradients[i])


@njit(nogil=True, cache=True)
def gradient_steps(start, stop, columns, values, inner, most, steps):
    """Write Newton's steps in z towards F = 0 along the world gradient, −F n/|n|², at most `most` long in the world."""
    cofactors, pulled, step = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(start, stop):
        reciprocal(columns[i], cofactors)
        square = pull(inner[i], cofactors, pulled)
        if square == 0.0:
            steps[i] = 0.0
            continue
        # |F|/|n| is the length of the step.
        length = abs(values[i]) / math.sqrt(square)
        factor = -values[i] / square if length <= most else -math.copysign(most, values[i]) / math.sqrt(square)
        for k in range(3):
            step[k] = factor * pulled[k]
        for k in range(3):
            steps[i, k] = dot3(cofactors[k], step)


@njit(nogil=True, cache=True)
def mean_curvatures(start, stop, columns, inner, bends, lift_bends, curvatures):
    r"""Write div n/2, n = −∇G/|∇G|, from F's gradient and Hessian by z and the lift's second derivatives.

    With N = ∇G the Hessian in the world is A⁻ᵀ (Hess F − Σ_k N_k Hess X_k) A⁻¹.
    """
    cofactors, pulled, turned = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for i in range(start, stop):
        reciprocal(columns[i], cofactors)
        square = pull(inner[i], cofactors, pulled)
        curvatures[i] = 0.0
        if square == 0.0:
            continue
        for a in range(3):
            for b in range(3):
                turned[a, b] = bends[i, a, b] - dot3(pulled, lift_bends[i, a, b])
        trace = along = 0.0
        for a in range(3):
            for b in range(3):
                metric = dot3(cofactors[a], cofactors[b])
                trace += turned[a, b] * metric
                along += turned[a, b] * dot3(cofactors[a], pulled) * dot3(cofactors[b], pulled)
        curvatures[i] = -0.5 * (trace - along / square) / math.sqrt(square)


@njit(nogil=True, cache=True)
def closest_steps(points, world, columns, values, inner, bends, longest, steps):
    r"""Write Newton's steps in z towards the point of F = 0 that is closest to x in the world.

    With r = X − x, N = ∇G, B the Hessian of G but for the blade's own small part, μ = −r·N/|N|², the step δ goes
    −F N/|N|² along N, and t in the tangent plane with (I + μB) t = −r − μ B δ_N there. Where the plane's matrix is
    not safely positive, x lies near a focus, and it is lifted to least eigenvalue `LEAST_FOCUS`; t is at most
    `longest` long.
    """
    cofactors, normal, step, bent = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
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
        # B = A⁻ᵀ Hess F A⁻¹: vectors are taken to z, bent there, and multiplied from the left by vectors in z.
        for k in range(3):
            pushed[0, k], pushed[1, k] = dot3(cofactors[k], u), dot3(cofactors[k], v)
            step[k] = dot3(cofactors[k], normal)
        for k in range(3):
            bent[k] = mu * dot3(bends[i, k], pushed[0])
        uu, uv, un = 1.0 + dot3(bent, pushed[0]), dot3(bent, pushed[1]), dot3(bent, step)
        for k in range(3):
            bent[k] = mu * dot3(bends[i, k], pushed[1])
        vv, vn = 1.0 + dot3(bent, pushed[1]), dot3(bent, step)
        a, b = -un * push, -vn * push
        for k in range(3):
            a -= (world[i, k] - points[i, k]) * u[k]
            b -= (world[i, k] - points[i, k]) * v[k]
        lift = LEAST_FOCUS - (0.5 * (uu + vv) - math.sqrt(0.25 * (uu - vv) ** 2 + uv * uv))
        if lift > 0.0:
            uu += lift
            vv += lift
        determinant = uu * vv - uv * uv
        a, b = (vv * a - uv * b) / determinant, (uu * b - uv * a) / determinant
        size = math.sqrt(a * a + b * b)
        if size > longest:
            a, b = a * longest / size, b * longest / size
        push = min(max(push, -longest), longest)
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
