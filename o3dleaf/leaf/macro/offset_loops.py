"""Compiled: the blade's surface and its normal, with the derivatives of both.

A surface S(y₁, y₂) = m(y₁) + y₂ A(y₁) + H(y₁, y₂) V(y₁) has the unit normal N; a point at height y₃
over it is S + y₃ N, whose Jacobian needs the second derivatives of the axis, of the frame and of H.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.blade.vector_loops import cross3, dot3
from o3dleaf.leaf.macro.frame_loops import axis_at, segment, spline


@njit(nogil=True, cache=True)
def unit_jet(w, w1, w2, unit, first, second):
    """Write u = w/|w| and its first two derivatives, from w, w′ and w″.

    u′ = (w′ − g u)/|w| with g = |w|′ = w′·u, and u″ = (w″ − g′ u − 2 g u′)/|w|.
    """
    length = math.sqrt(dot3(w, w))
    for k in range(3):
        unit[k] = w[k] / length
    growth = dot3(w1, unit)
    for k in range(3):
        first[k] = (w1[k] - growth * unit[k]) / length
    growth1 = dot3(w2, unit) + dot3(w1, first)
    for k in range(3):
        second[k] = (w2[k] - growth1 * unit[k] - 2.0 * growth * first[k]) / length


@njit(nogil=True, cache=True)
def third_derivative(t, breaks, coefficients, out):
    """Write the third derivative of a spline at t, 0 past its ends."""
    out[:] = 0.0
    if breaks[0] <= t <= breaks[-1]:
        s = segment(t, breaks)
        u = t - breaks[s]
        for k in range(coefficients.shape[1] - 1, 2, -1):
            for axis in range(3):
                out[axis] = out[axis] * u + k * (k - 1) * (k - 2) * coefficients[s, k, axis]


@njit(nogil=True, cache=True)
def station_jet(t, splines, jets, scratch):
    """Write m, T, V, A and their first two derivatives into `jets` (4, 3, 3): which one, order, component."""
    m, tangent, up, side = jets
    breaks = splines.breaks
    axis_at(t, splines, m)
    third_derivative(t, breaks, splines.axis, scratch[0])
    unit_jet(m[1], m[2], scratch[0], tangent[0], tangent[1], tangent[2])
    n, w = scratch[1:4], scratch[4:7]
    spline(t, breaks, splines.normal, n)
    if not breaks[0] <= t <= breaks[-1]:
        n[1:] = 0.0
    lean = dot3(n[0], tangent[0])
    lean1 = dot3(n[1], tangent[0]) + dot3(n[0], tangent[1])
    lean2 = dot3(n[2], tangent[0]) + 2.0 * dot3(n[1], tangent[1]) + dot3(n[0], tangent[2])
    for k in range(3):
        w[0, k] = n[0, k] - lean * tangent[0, k]
        w[1, k] = n[1, k] - lean1 * tangent[0, k] - lean * tangent[1, k]
        w[2, k] = n[2, k] - lean2 * tangent[0, k] - 2.0 * lean1 * tangent[1, k] - lean * tangent[2, k]
    unit_jet(w[0], w[1], w[2], up[0], up[1], up[2])
    cross3(up[0], tangent[0], side[0])
    side[1:] = 0.0
    for order, i, factor in ((1, 1, 1.0), (1, 0, 1.0), (2, 2, 1.0), (2, 1, 2.0), (2, 0, 1.0)):
        cross3(up[i], tangent[order - i], scratch[0])
        for k in range(3):
            side[order, k] += factor * scratch[0, k]


@njit(nogil=True, cache=True)
def surface_jet(y, heights, splines, jets, sheet, scratch):
    """Write S, S₁, S₂, S₁₁, S₁₂, S₂₂ of S = m + y₂ A + H V into the rows of `sheet` (6, 3).

    `heights` are H, H₁, H₂, H₁₁, H₁₂, H₂₂ at (y₁, y₂).
    """
    station_jet(y[0], splines, jets, scratch)
    m, _, up, side = jets
    h, h1, h2, h11, h12, h22 = heights
    for k in range(3):
        sheet[0, k] = m[0, k] + y[1] * side[0, k] + h * up[0, k]
        sheet[1, k] = m[1, k] + y[1] * side[1, k] + h1 * up[0, k] + h * up[1, k]
        sheet[2, k] = side[0, k] + h2 * up[0, k]
        sheet[3, k] = m[2, k] + y[1] * side[2, k] + h11 * up[0, k] + 2.0 * h1 * up[1, k] + h * up[2, k]
        sheet[4, k] = side[1, k] + h12 * up[0, k] + h2 * up[1, k]
        sheet[5, k] = h22 * up[0, k]


@njit(nogil=True, cache=True)
def fill_offsets(start, stop, flat, heights, splines, points, jacobians, curvatures):
    """Fill points[start:stop] with S + y₃ N, N = S₁ × S₂ / |S₁ × S₂|, and jacobians[start:stop] with its ∂/∂y (3, 3).

    `curvatures` (n, 2) get the principal ones of S, least first; the map folds where 1 − y₃ κ = 0 for one of them.
    """
    jets, scratch, sheet = np.empty((4, 3, 3)), np.empty((7, 3)), np.empty((6, 3))
    unit, product = np.empty(3), np.empty(3)
    turn, dual = np.empty((2, 3)), np.empty((2, 3))
    for i in range(start, stop):
        surface_jet(flat[i], heights[i], splines, jets, sheet, scratch)
        cross3(sheet[1], sheet[2], unit)
        size = math.sqrt(dot3(unit, unit))
        for k in range(3):
            unit[k] /= size
        for a in range(2):
            cross3(sheet[3 + a], sheet[2], turn[a])
            cross3(sheet[1], sheet[4 + a], product)
            for k in range(3):
                turn[a, k] += product[k]
            growth = dot3(turn[a], unit)
            for k in range(3):
                turn[a, k] = (turn[a, k] - growth * unit[k]) / size
        cross3(sheet[2], unit, dual[0])
        cross3(unit, sheet[1], dual[1])
        # The shape operator in the basis S₁, S₂, whose dual vectors these are, times −1.
        a11, a12 = dot3(dual[0], turn[0]) / size, dot3(dual[0], turn[1]) / size
        a21, a22 = dot3(dual[1], turn[0]) / size, dot3(dual[1], turn[1]) / size
        mean, spread = -0.5 * (a11 + a22), math.sqrt(max(0.25 * (a11 - a22) ** 2 + a12 * a21, 0.0))
        curvatures[i, 0], curvatures[i, 1] = mean - spread, mean + spread
        for k in range(3):
            points[i, k] = sheet[0, k] + flat[i, 2] * unit[k]
            jacobians[i, k, 0] = sheet[1, k] + flat[i, 2] * turn[0, k]
            jacobians[i, k, 1] = sheet[2, k] + flat[i, 2] * turn[1, k]
            jacobians[i, k, 2] = unit[k]
