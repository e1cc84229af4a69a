"""Compiled: a surface S(u, v) in space, blended from splines of three components that share their sites.

The kernel φ = r³, Shepard's weights and the search for balls are done once for the three. A jet is S, S_u, S_v, S_uu,
S_uv, S_vv, one row each. Outside the box of the balls S goes on linearly along each axis, with one derivative
continuous; of second derivatives there, those that third ones of S add are left out.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from o3dleaf.fitting.cover.ball_loops import order_by_leaf
from o3dleaf.fitting.local.weight_loops import wendland, wendland_derivative_over_tau
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE
from o3dleaf.leaf.blade.vector_loops import dot3

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


@njit(nogil=True, cache=True, error_model="numpy")
def divide(i, level, jets, totals):
    """Replace the jet of N = Σ w S in jets[i] by that of N/W."""
    for k in range(3):
        jets[i, 0, k] /= totals[i, 0]
        if level > 0:
            jets[i, 1, k] = (jets[i, 1, k] - jets[i, 0, k] * totals[i, 1]) / totals[i, 0]
            jets[i, 2, k] = (jets[i, 2, k] - jets[i, 0, k] * totals[i, 2]) / totals[i, 0]
        if level > 1:
            value, first, second = jets[i, 0, k], jets[i, 1, k], jets[i, 2, k]
            jets[i, 3, k] = (jets[i, 3, k] - value * totals[i, 3] - 2.0 * first * totals[i, 1]) / totals[i, 0]
            mixed = first * totals[i, 2] + second * totals[i, 1]
            jets[i, 4, k] = (jets[i, 4, k] - value * totals[i, 4] - mixed) / totals[i, 0]
            jets[i, 5, k] = (jets[i, 5, k] - value * totals[i, 5] - 2.0 * second * totals[i, 2]) / totals[i, 0]


@njit(nogil=True, cache=True)
def leaf_of(u, v, axes, splits, children):
    """Return the leaf of the tree in whose box a place of the whole box lies."""
    node = 0
    while axes[node] >= 0:
        node = children[node] + (1 if (u if axes[node] == 0 else v) >= splits[node] else 0)
    return node


@njit(nogil=True, cache=True)
def jets_at(plane, balls, level, jets):
    """Write the jets of S, to derivatives of `level`, at the (n, 2) places of one block into `jets` (n, rows, 3).

    The places are grouped by the boxes of the tree, so that one ball's data are fetched once for all of them. Where
    one lies outside the bounds, second derivatives are found at all of them: the continuation needs those.
    """
    count, bounds = len(plane), balls.bounds
    folded, leaves, outside = np.empty((count, 2)), np.empty(count, dtype=np.int64), False
    axes, splits, children = balls.tree.axes, balls.tree.splits, balls.tree.children
    for i in range(count):
        for axis in range(2):
            folded[i, axis] = min(max(plane[i, axis], bounds[0, axis]), bounds[1, axis])
            outside = outside or folded[i, axis] != plane[i, axis]
        leaves[i] = leaf_of(folded[i, 0], folded[i, 1], axes, splits, children)
    order = order_by_leaf(leaves, len(axes))
    enough = level == 2 or not outside
    whole = jets if enough else np.empty((count, JET, 3))
    blend_jets(folded, leaves, order, balls, level if enough else 2, whole)
    if outside:
        continue_linearly(plane, folded, whole)
    if not enough:
        for i in range(count):
            for row in range(jets.shape[1]):
                for k in range(3):
                    jets[i, row, k] = whole[i, row, k]


@njit(nogil=True, cache=True)
def blend_jets(folded, leaves, order, balls, level, jets):
    """Write the jets of Shepard's sum at places (n, 2) inside the bounds, in the order of their leaves."""
    tree, centers, radii = balls.tree, balls.images.centers, balls.images.radii
    totals, weight = np.zeros((len(folded), JET)), np.empty(JET)
    jets[:] = 0.0
    first = 0
    while first < order.size:
        leaf = leaves[order[first]]
        last = first + 1
        while last < order.size and leaves[order[last]] == leaf:
            last += 1
        for k in range(tree.starts[leaf], tree.stops[leaf]):
            image = tree.images[k]
            ball = balls.images.balls[image]
            u, v, radius = centers[image, 0], centers[image, 1], radii[image]
            spline = spline_of(balls, ball)
            for place in range(first, last):
                i = order[place]
                p, q = folded[i, 0] - u, folded[i, 1] - v
                if p * p + q * q < radius * radius:
                    add_ball(i, p / radius, q / radius, radius, level, spline, weight, jets, totals)
        first = last
    for i in range(len(folded)):
        divide(i, level, jets, totals)


@njit(nogil=True, cache=True)
def spline_of(balls, ball):
    """Return the sites of one ball, u and v, its weights of three components, and its tails."""
    first, last = balls.offsets[ball], balls.offsets[ball + 1]
    us, vs = balls.sites[2 * first : first + last], balls.sites[first + last : 2 * last]
    weights = balls.weights
    return us, vs, weights[0, first:last], weights[1, first:last], weights[2, first:last], balls.tails[ball]


@njit(nogil=True, cache=True)
def continue_linearly(plane, folded, jets):
    """Turn the jets at the nearest points of the box into those of the surface's continuation."""
    for i in range(len(plane)):
        along, across = plane[i, 0] - folded[i, 0], plane[i, 1] - folded[i, 1]
        if along == 0.0 and across == 0.0:
            continue
        for k in range(3):
            mixed = jets[i, 4, k]
            jets[i, 0, k] += along * jets[i, 1, k] + across * jets[i, 2, k] + along * across * mixed
            jets[i, 1, k] += across * mixed
            jets[i, 2, k] += along * mixed
            if along != 0.0:
                jets[i, 3, k] = 0.0
            if across != 0.0:
                jets[i, 5, k] = 0.0


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
