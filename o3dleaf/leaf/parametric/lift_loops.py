"""Compiled: the normal of a surface S(u, v), its slopes and curvatures, and the lift S + w τ n along it."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.blade.vector_loops import dot3
from o3dleaf.leaf.parametric.spline_loops import JET
from o3dleaf.leaf.parametric.surface_loops import jets_at


@njit(nogil=True, cache=True)
def unit_normal(i, jets, unit):
    """Write n = S_u × S_v / |S_u × S_v| and return |S_u × S_v|; where that is 0, so is n."""
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        unit[k] = jets[i, 1, a] * jets[i, 2, b] - jets[i, 1, b] * jets[i, 2, a]
    size = max(math.sqrt(dot3(unit, unit)), 1e-300)
    for k in range(3):
        unit[k] /= size
    return size


@njit(nogil=True, cache=True)
def normal_slope(i, axis, jets, unit, size, slope):
    """Write ∂n/∂u, of axis 0, or ∂n/∂v."""
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        turned = jets[i, 3 + axis, a] * jets[i, 2, b] - jets[i, 3 + axis, b] * jets[i, 2, a]
        slope[k] = turned + jets[i, 1, a] * jets[i, 4 + axis, b] - jets[i, 1, b] * jets[i, 4 + axis, a]
    growth = dot3(slope, unit)
    for k in range(3):
        slope[k] = (slope[k] - growth * unit[k]) / size


@njit(nogil=True, cache=True)
def lift(flat, tapers, balls, points):
    """Write S + w τ n at one block; `tapers` are τ, τ_u, τ_v (n, 3), or have no rows where τ is 1."""
    jets, unit = np.empty((len(flat), 3, 3)), np.empty(3)
    jets_at(flat[:, :2], balls, 1, jets)
    for i in range(len(flat)):
        unit_normal(i, jets, unit)
        height = flat[i, 2] * tapers[i, 0] if len(tapers) else flat[i, 2]
        for k in range(3):
            points[i, k] = jets[i, 0, k] + height * unit[k]


@njit(nogil=True, cache=True)
def lift_with_jacobian(flat, tapers, balls, points, columns):
    """Write S + w τ n of one block into `points`, and its derivatives by u, v and w into `columns`."""
    jets, unit, slope = np.empty((len(flat), JET, 3)), np.empty(3), np.empty(3)
    jets_at(flat[:, :2], balls, 2, jets)
    for i in range(len(flat)):
        size = unit_normal(i, jets, unit)
        taper = tapers[i, 0] if len(tapers) else 1.0
        height = flat[i, 2] * taper
        for k in range(3):
            points[i, k] = jets[i, 0, k] + height * unit[k]
            columns[i, 2, k] = taper * unit[k]
        for axis in range(2):
            normal_slope(i, axis, jets, unit, size, slope)
            growth = flat[i, 2] * tapers[i, 1 + axis] if len(tapers) else 0.0
            for k in range(3):
                columns[i, axis, k] = jets[i, 1 + axis, k] + height * slope[k] + growth * unit[k]


@njit(nogil=True, cache=True)
def curvatures(jets, found):
    """Write the principal curvatures of S (n, 2), positive where it bends towards n, least first, from its jets."""
    unit = np.empty(3)
    for i in range(len(jets)):
        area = unit_normal(i, jets, unit)
        e = f = g = bend_uu = bend_uv = bend_vv = 0.0
        for k in range(3):
            e += jets[i, 1, k] * jets[i, 1, k]
            f += jets[i, 1, k] * jets[i, 2, k]
            g += jets[i, 2, k] * jets[i, 2, k]
            bend_uu += jets[i, 3, k] * unit[k]
            bend_uv += jets[i, 4, k] * unit[k]
            bend_vv += jets[i, 5, k] * unit[k]
        mean = 0.5 * (e * bend_vv - 2.0 * f * bend_uv + g * bend_uu) / (area * area)
        gauss = (bend_uu * bend_vv - bend_uv * bend_uv) / (area * area)
        spread = math.sqrt(max(mean * mean - gauss, 0.0))
        found[i, 0], found[i, 1] = mean - spread, mean + spread
