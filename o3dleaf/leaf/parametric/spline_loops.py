"""Compiled: the sums of r³ and linear tails of one ball of the plane, for three components that share their sites.

Of a jet, S, S_u, S_v, S_uu, S_uv, S_vv, each is one row.
"""

import math
from typing import Any, NamedTuple

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.local.weight_loops import wendland, wendland_derivative_over_tau
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE

TINY = 1e-18
"""Added to a distance that is divided by: at a data site what is divided is 0."""
JET = 6
"""Rows of a jet: value, two first and three second derivatives."""


class VectorBalls(NamedTuple):
    """Splines of three components in balls of the plane, end to end, and how the balls of a place are found.

    Attributes
    ----------
    offsets : (M + 1,)
    sites : (2 total,)
        A (2, N) block a ball, in its unit coordinates.
    weights : (3, total)
    tails : (M, 3, 3)
        Component, then the coefficients of 1, u, v, in unit coordinates.
    bounds : (2, 2)
    images, tree
        Of the index of the balls.
    """

    offsets: Any
    sites: Any
    weights: Any
    tails: Any
    bounds: Any
    images: Any
    tree: Any


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_values(u, v, us, vs, first, second, third):
    """Return Σ λ_j r_j³ for three rows of λ."""
    a = b = c = 0.0
    for j in range(us.size):
        p, q = u - us[j], v - vs[j]
        square = p * p + q * q
        cube = square * math.sqrt(square)
        a += first[j] * cube
        b += second[j] * cube
        c += third[j] * cube
    return a, b, c


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cubic_slopes(u, v, us, vs, first, second, third):
    """Return Σ λ_j r_j³ and a third of its two derivatives, for three rows of λ."""
    a = b = c = au = bu = cu = av = bv = cv = 0.0
    for j in range(us.size):
        p, q = u - us[j], v - vs[j]
        square = p * p + q * q
        root = math.sqrt(square)
        cube, along, across = square * root, p * root, q * root
        a += first[j] * cube
        b += second[j] * cube
        c += third[j] * cube
        au += first[j] * along
        bu += second[j] * along
        cu += third[j] * along
        av += first[j] * across
        bv += second[j] * across
        cv += third[j] * across
    return (a, b, c), (au, bu, cu), (av, bv, cv)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE, error_model="numpy")
def cubic_bends(u, v, us, vs, first, second, third):
    """Return what `cubic_slopes` does, and Σ λ_j d dᵀ/r_j (uu, uv, vv), d = z − z_j; its trace is Σ λ_j r_j."""
    a = b = c = au = bu = cu = av = bv = cv = 0.0
    auu = buu = cuu = auv = buv = cuv = avv = bvv = cvv = 0.0
    for j in range(us.size):
        p, q = u - us[j], v - vs[j]
        square = p * p + q * q
        root = math.sqrt(square)
        # At a data site d is zero, and so is d dᵀ/r.
        inverse = 1.0 / (root + TINY)
        cube, along, across = square * root, p * root, q * root
        uu, uv, vv = p * p * inverse, p * q * inverse, q * q * inverse
        a += first[j] * cube
        b += second[j] * cube
        c += third[j] * cube
        au += first[j] * along
        bu += second[j] * along
        cu += third[j] * along
        av += first[j] * across
        bv += second[j] * across
        cv += third[j] * across
        auu += first[j] * uu
        buu += second[j] * uu
        cuu += third[j] * uu
        auv += first[j] * uv
        buv += second[j] * uv
        cuv += third[j] * uv
        avv += first[j] * vv
        bvv += second[j] * vv
        cvv += third[j] * vv
    slopes = (a, b, c), (au, bu, cu), (av, bv, cv)
    return slopes, (auu, buu, cuu), (auv, buv, cuv), (avv, bvv, cvv)


@njit(nogil=True, cache=True)
def weight_jet(u, v, radius, level, weight):
    """Write the jet of Wendland's weight at a ball's unit coordinates, by the plane's own, into `weight` (6,)."""
    tau = math.sqrt(u * u + v * v)
    weight[0] = wendland(tau)
    if level == 0:
        return
    slope = wendland_derivative_over_tau(tau)
    weight[1], weight[2] = slope * u / radius, slope * v / radius
    if level == 1:
        return
    rest = max(1.0 - tau, 0.0)
    # (w′/τ)′/τ grows as 1/τ at the center, where z zᵀ falls as τ².
    bend = 60.0 * rest * rest / tau if tau > 0.0 else 0.0
    square = radius * radius
    weight[3], weight[4] = (slope + bend * u * u) / square, bend * u * v / square
    weight[5] = (slope + bend * v * v) / square


@njit(nogil=True, cache=True)
def add_ball(i, u, v, radius, level, spline, weight, sums, totals):
    """Add the jet of w S of one ball at its unit coordinates (u, v) to sums[i] (6, 3), that of w to totals[i] (6,)."""
    us, vs, a, b, c, tail = spline
    weight_jet(u, v, radius, level, weight)
    totals[i, 0] += weight[0]
    if level == 0:
        values = cubic_values(u, v, us, vs, a, b, c)
        for k in range(3):
            sums[i, 0, k] += weight[0] * (values[k] + tail[k, 0] + tail[k, 1] * u + tail[k, 2] * v)
        return
    if level == 1:
        values, along, across = cubic_slopes(u, v, us, vs, a, b, c)
    else:
        slopes, uu, uv, vv = cubic_bends(u, v, us, vs, a, b, c)
        values, along, across = slopes
        add_bends(i, u, v, radius, slopes, (uu, uv, vv), tail, weight, sums, totals)
    totals[i, 1] += weight[1]
    totals[i, 2] += weight[2]
    for k in range(3):
        value = values[k] + tail[k, 0] + tail[k, 1] * u + tail[k, 2] * v
        sums[i, 0, k] += weight[0] * value
        sums[i, 1, k] += weight[1] * value + weight[0] * (3.0 * along[k] + tail[k, 1]) / radius
        sums[i, 2, k] += weight[2] * value + weight[0] * (3.0 * across[k] + tail[k, 2]) / radius


@njit(nogil=True, cache=True)
def add_bends(i, u, v, radius, slopes, bends, tail, weight, sums, totals):
    """Add the second derivatives of w S of one ball to sums[i, 3:], those of w to totals[i, 3:]."""
    values, along, across = slopes
    uu, uv, vv = bends
    for row in range(3, 6):
        totals[i, row] += weight[row]
    scale = 3.0 / (radius * radius)
    for k in range(3):
        value = values[k] + tail[k, 0] + tail[k, 1] * u + tail[k, 2] * v
        first, second = (3.0 * along[k] + tail[k, 1]) / radius, (3.0 * across[k] + tail[k, 2]) / radius
        second_uu, second_vv = scale * (2.0 * uu[k] + vv[k]), scale * (uu[k] + 2.0 * vv[k])
        sums[i, 3, k] += weight[3] * value + 2.0 * weight[1] * first + weight[0] * second_uu
        sums[i, 4, k] += weight[4] * value + weight[1] * second + weight[2] * first + weight[0] * scale * uv[k]
        sums[i, 5, k] += weight[5] * value + 2.0 * weight[2] * second + weight[0] * second_vv


@njit(nogil=True, cache=True)
def spline_of(balls, ball):
    """Return the sites of one ball, u and v, its weights of three components, and its tails."""
    first, last = balls.offsets[ball], balls.offsets[ball + 1]
    us, vs = balls.sites[2 * first : first + last], balls.sites[first + last : 2 * last]
    weights = balls.weights
    return us, vs, weights[0, first:last], weights[1, first:last], weights[2, first:last], balls.tails[ball]
