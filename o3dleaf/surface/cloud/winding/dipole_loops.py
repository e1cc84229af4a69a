"""The compiled loops of sums over dipoles by a binary tree (Barnes & Hut): winding numbers, their gradients and pulls.

Targets of a leaf are summed side by side: the innermost loop runs over them, so that a processor may take several at
once without changing the order of any sum.
"""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.tail import IntArray

LEAF = 16
"""Most points of a leaf."""
OPENING = 0.5
"""Radius of a node over its distance up to which its points are summed up as one: winding numbers err by 0.006."""


class Nodes(NamedTuple):
    """Nodes of a binary tree over sorted points: node k has the children 2k + 1 and 2k + 2, the leaves come last.

    Attributes
    ----------
    first, last : (m,) ndarray
        Node k contains the points ``first[k]`` to ``last[k]``.
    center : (m, 3) ndarray
        Mean of its points.
    radius : (m,) ndarray
        Distance of the farthest of them.
    """

    first: IntArray
    last: IntArray
    center: FloatArray
    radius: FloatArray


@njit(nogil=True, cache=True)
def build_nodes(points):
    """Return the `Nodes` of points (n, 3) that are sorted such that successive ones are near each other."""
    leaves = 1
    while leaves * LEAF < len(points):
        leaves *= 2
    count = 2 * leaves - 1
    first, last = np.zeros(count, np.int64), np.zeros(count, np.int64)
    center, radius = np.zeros((count, 3)), np.zeros(count)
    last[0] = len(points)
    for k in range(leaves - 1):
        middle = first[k] + (last[k] - first[k]) // 2
        first[2 * k + 1], last[2 * k + 1] = first[k], middle
        first[2 * k + 2], last[2 * k + 2] = middle, last[k]
    for k in range(count):
        size = max(last[k] - first[k], 1)
        for i in range(first[k], last[k]):
            for a in range(3):
                center[k, a] += points[i, a] / size
        square = 0.0
        for i in range(first[k], last[k]):
            x, y, z = points[i, 0] - center[k, 0], points[i, 1] - center[k, 1], points[i, 2] - center[k, 2]
            square = max(square, x * x + y * y + z * z)
        radius[k] = np.sqrt(square)
    return Nodes(first, last, center, radius)


@njit(nogil=True, cache=True)
def sum_nodes(points, nodes, values):
    """Return the moments (m, 4 c) of the rows of `values` (n, c) of each node's points: sums, and sums of e (x) value.

    e is the way from the node's center to the point; the first moments along x, y and z follow the sums.
    """
    count, c = len(nodes.radius), values.shape[1]
    total = np.zeros((count, 4 * c))
    for k in range(count - 1, -1, -1):
        if 2 * k + 1 >= count:
            for i in range(nodes.first[k], nodes.last[k]):
                for a in range(c):
                    total[k, a] += values[i, a]
                    for b in range(3):
                        total[k, (b + 1) * c + a] += (points[i, b] - nodes.center[k, b]) * values[i, a]
            continue
        for child in range(2 * k + 1, 2 * k + 3):
            for a in range(c):
                total[k, a] += total[child, a]
                for b in range(3):
                    arm = nodes.center[child, b] - nodes.center[k, b]
                    total[k, (b + 1) * c + a] += total[child, (b + 1) * c + a] + arm * total[child, a]
    return total


@njit(nogil=True, cache=True)
def partners(nodes, leaf, stack, far, near):
    """Write the nodes that a leaf takes as one, and the leaves that it takes point by point; return how many."""
    cx, cy, cz = nodes.center[leaf, 0], nodes.center[leaf, 1], nodes.center[leaf, 2]
    count = len(nodes.radius)
    fars, nears, depth = 0, 0, 1
    stack[0] = 0
    while depth > 0:
        depth -= 1
        k = stack[depth]
        x, y, z = nodes.center[k, 0] - cx, nodes.center[k, 1] - cy, nodes.center[k, 2] - cz
        least = nodes.radius[k] / OPENING + nodes.radius[leaf]
        if x * x + y * y + z * z > least * least:
            far[fars] = k
            fars += 1
        elif 2 * k + 1 >= count:
            near[nears] = k
            nears += 1
        else:
            stack[depth], stack[depth + 1] = 2 * k + 1, 2 * k + 2
            depth += 2
    return fars, nears


@njit(nogil=True, cache=True)
def gather_targets(points, wanted, first, last, rows, at):
    """Write the rows and places (3, LEAF) of the wanted points of a leaf; return how many."""
    count = 0
    for i in range(first, last):
        if wanted[i]:
            rows[count] = i
            for a in range(3):
                at[a, count] = points[i, a]
            count += 1
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def add_dipole(at, count, place, flux, square, total):
    """Add to `total` (4, LEAF) the softened winding number of a dipole at the targets `at`, and its gradient."""
    px, py, pz = place[0], place[1], place[2]
    fx, fy, fz = flux[0], flux[1], flux[2]
    for t in range(count):
        ex, ey, ez = px - at[0, t], py - at[1, t], pz - at[2, t]
        inverse = 1.0 / (ex * ex + ey * ey + ez * ez + square)
        cube = inverse * np.sqrt(inverse)
        along = (fx * ex + fy * ey + fz * ez) * cube
        bend = 3.0 * along * inverse
        total[0, t] += along
        total[1, t] += bend * ex - fx * cube
        total[2, t] += bend * ey - fy * cube
        total[3, t] += bend * ez - fz * cube


@njit(nogil=True, cache=True, error_model="numpy")
def add_node(at, count, place, moment, square, total):
    """Add to `total` (4, LEAF) what the dipoles of a node make, by their sum and its first moments (12,)."""
    add_dipole(at, count, place, moment, square, total)
    px, py, pz = place[0], place[1], place[2]
    trace = moment[3] + moment[7] + moment[11]
    xy, yz, zx = moment[4] + moment[6], moment[8] + moment[10], moment[5] + moment[9]
    for t in range(count):
        ex, ey, ez = px - at[0, t], py - at[1, t], pz - at[2, t]
        inverse = 1.0 / (ex * ex + ey * ey + ez * ez + square)
        bent = moment[3] * ex * ex + moment[7] * ey * ey + moment[11] * ez * ez
        bent += xy * ex * ey + yz * ey * ez + zx * ez * ex
        total[0, t] += (trace - 3.0 * bent * inverse) * inverse * np.sqrt(inverse)


@njit(nogil=True, cache=True)
def wind(points, flux, soft, nodes, sums, softness, wanted, start, stop, total):
    """Write the winding number that dipoles make at the wanted points of leaves, and its gradient (n, 4).

    w(x) = sum over j of f_j . e / (4 pi (|e|^2 + s_j)^(3/2)), e = x_j - x, f_j the normal of x_j times its area.
    """
    count = len(nodes.radius)
    stack, far, near = np.empty(128, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    rows, at, sum_of = np.empty(LEAF, np.int64), np.empty((3, LEAF)), np.empty((4, LEAF))
    for leaf in range(start + count // 2, stop + count // 2):
        targets = gather_targets(points, wanted, nodes.first[leaf], nodes.last[leaf], rows, at)
        if targets == 0:
            continue
        fars, nears = partners(nodes, leaf, stack, far, near)
        sum_of[:] = 0.0
        for f in range(fars):
            add_node(at, targets, nodes.center[far[f]], sums[far[f]], softness[far[f]], sum_of)
        for k in near[:nears]:
            for j in range(nodes.first[k], nodes.last[k]):
                add_dipole(at, targets, points[j], flux[j], soft[j], sum_of)
        for t in range(targets):
            for a in range(4):
                total[rows[t], a] = sum_of[a, t] / (4 * np.pi)


@njit(nogil=True, cache=True, error_model="numpy")
def add_pull(at, square, count, place, error, total):
    """Add to `total` (3, LEAF) how an error at a place pulls at dipoles at the targets `at`, softened by `square`."""
    px, py, pz = place[0], place[1], place[2]
    for t in range(count):
        ex, ey, ez = at[0, t] - px, at[1, t] - py, at[2, t] - pz
        inverse = 1.0 / (ex * ex + ey * ey + ez * ez + square[t])
        cube = error * inverse * np.sqrt(inverse)
        total[0, t] += cube * ex
        total[1, t] += cube * ey
        total[2, t] += cube * ez


@njit(nogil=True, cache=True, error_model="numpy")
def add_node_pull(at, square, count, place, moment, total):
    """Add to `total` (3, LEAF) how the errors of a node pull, by their sum and its first moments (4,)."""
    add_pull(at, square, count, place, moment[0], total)
    px, py, pz = place[0], place[1], place[2]
    mx, my, mz = moment[1], moment[2], moment[3]
    for t in range(count):
        ex, ey, ez = at[0, t] - px, at[1, t] - py, at[2, t] - pz
        inverse = 1.0 / (ex * ex + ey * ey + ez * ez + square[t])
        cube = inverse * np.sqrt(inverse)
        along = 3.0 * (mx * ex + my * ey + mz * ez) * inverse
        total[0, t] += cube * (along * ex - mx)
        total[1, t] += cube * (along * ey - my)
        total[2, t] += cube * (along * ez - mz)


@njit(nogil=True, cache=True)
def pull(points, error, soft, nodes, sums, wanted, start, stop, total):
    """Write the derivative (n, 3) of sum over i of error_i w(x_i) for the dipole of each wanted point of leaves."""
    count = len(nodes.radius)
    stack, far, near = np.empty(128, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    rows, at, sum_of, square = np.empty(LEAF, np.int64), np.empty((3, LEAF)), np.empty((3, LEAF)), np.empty(LEAF)
    for leaf in range(start + count // 2, stop + count // 2):
        targets = gather_targets(points, wanted, nodes.first[leaf], nodes.last[leaf], rows, at)
        if targets == 0:
            continue
        for t in range(targets):
            square[t] = soft[rows[t]]
        fars, nears = partners(nodes, leaf, stack, far, near)
        sum_of[:] = 0.0
        for f in range(fars):
            add_node_pull(at, square, targets, nodes.center[far[f]], sums[far[f]], sum_of)
        for k in near[:nears]:
            for j in range(nodes.first[k], nodes.last[k]):
                if wanted[j]:
                    add_pull(at, square, targets, points[j], error[j], sum_of)
        for t in range(targets):
            for a in range(3):
                total[rows[t], a] = sum_of[a, t] / (4 * np.pi)
