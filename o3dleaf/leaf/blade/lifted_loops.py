"""Compiled: gradients pulled back through the lift's Jacobian, and Newton's steps in its metric.

Flat coordinates z and the world are joined by the lift X(z); its Jacobian's columns are a, b, c = ∂X/∂z. A
gradient g by z is n = (g₁ b×c + g₂ c×a + g₃ a×b)/det in the world; a step δ in the world is
((b×c)·δ, (c×a)·δ, (a×b)·δ)/det in z.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.blade.vector_loops import cross3, dot3

FOLD = 1e-9
"""Least volume of the Jacobian's columns, of the product of their lengths: beyond it the lift folds, and steps would
have no end."""


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
def gradient_steps(start, stop, columns, values, inner, max_step, steps):
    """Write Newton's steps in z towards F = 0, −F n/|n|² in the world, at most `max_step` long there."""
    cofactors, pulled, step = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(start, stop):
        reciprocal(columns[i], cofactors)
        square = pull(inner[i], cofactors, pulled)
        if square == 0.0:
            steps[i] = 0.0
            continue
        # |F|/|n| is the length of the step.
        length = abs(values[i]) / math.sqrt(square)
        factor = -values[i] / square if length <= max_step else -math.copysign(max_step, values[i]) / math.sqrt(square)
        for k in range(3):
            step[k] = factor * pulled[k]
        for k in range(3):
            steps[i, k] = dot3(cofactors[k], step)
