"""Compiled: a surface S(u, v) in space, blended from splines of three components that share their sites.

The kernel φ = r³, Shepard's weights and the search for balls are done once for the three. Outside the box of the balls
S goes on linearly along each axis, with one derivative continuous; of second derivatives there, those that third ones
of S add are left out.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.cover.ball_loops import order_by_leaf
from o3dleaf.leaf.parametric.spline_loops import JET, add_ball, spline_of


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
