"""The compiled loops of the leaf's surface: the lift's Jacobian, gradients pulled back, steps of Newton's method.

Flat coordinates z and the world are joined by the lift X(z); its Jacobian's columns are a, b, c = ∂X/∂z. A
gradient g by z is n = (g₁ b×c + g₂ c×a + g₃ a×b)/det in the world; a step δ in the world is
((b×c)·δ, (c×a)·δ, (a×b)·δ)/det in z.
"""

import math

import numpy as np
from numba import njit

from o3dleaf.leaf.loops import cross3, dot3, station

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
def pull_back(start, stop, columns, inner, gradients):
    """Write the world gradients of functions of z whose gradients by z are `inner` (n, 3)."""
    cofactors = np.empty((3, 3))
    for i in range(start, stop):
        reciprocal(columns[i], cofactors)
        for k in range(3):
            gradients[i, k] = (
                inner[i, 0] * cofactors[0, k] + inner[i, 1] * cofactors[1, k] + inner[i, 2] * cofactors[2, k]
            )


@njit(nogil=True, cache=True)
def gradient_steps(start, stop, columns, values, inner, most, steps):
    """Write Newton's steps in z towards F = 0 along the world gradient, −F n/|n|², at most `most` long in the world."""
    cofactors, pulled, step = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(start, stop):
        reciprocal(columns[i], cofactors)
        square = 0.0
        for k in range(3):
            pulled[k] = inner[i, 0] * cofactors[0, k] + inner[i, 1] * cofactors[1, k] + inner[i, 2] * cofactors[2, k]
            square += pulled[k] * pulled[k]
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
        square = 0.0
        for k in range(3):
            pulled[k] = inner[i, 0] * cofactors[0, k] + inner[i, 1] * cofactors[1, k] + inner[i, 2] * cofactors[2, k]
            square += pulled[k] * pulled[k]
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
