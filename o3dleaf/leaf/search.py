"""The compiled search for the nearest sample of the leaf's surface and the nearest strip of its rim.

A tree is a heap of boxes in the world: node k has the children 2k and 2k + 1, and the last ``leaves``
nodes hold `GROUP` items each, in order. Empty boxes run from ∞ to −∞ and are never nearest.
"""

import math

import numpy as np
from numba import njit

GROUP = 4
"""Items that a leaf of the tree holds."""
DEPTH = 64
"""More than a tree of all the memory there is has levels."""


@njit(nogil=True, cache=True)
def box_distance(x, box):
    """Return the squared distance of x to a box (2, 3)."""
    total = 0.0
    for k in range(3):
        gap = max(box[0, k] - x[k], x[k] - box[1, k], 0.0)
        total += gap * gap
    return total


@njit(nogil=True, cache=True)
def near_first(x, boxes, node, best, stack, bounds, top):
    """Put the children of a node that may be nearer than `best` on the stack, the nearer one last; return its top."""
    child = 2 * node
    first, second = box_distance(x, boxes[child]), box_distance(x, boxes[child + 1])
    far, bound = child + 1, second
    if second < first:
        child, first, far, bound = child + 1, second, child, first
    if bound < best:
        stack[top], bounds[top] = far, bound
        top += 1
    if first < best:
        stack[top], bounds[top] = child, first
        top += 1
    return top


@njit(nogil=True, cache=True)
def nearest_samples(start, stop, points, boxes, cells, tile, cell_found, sample_found, distances):
    """Write for each point the cell and the sample that are nearest, and the squared distance to it.

    cells: (block, mask, origin (n, 3), columns (n, 3, 3), shrink) - the block of the tile that a cell shows, the
    place of its first sample in the mask or −1, its centre and Jacobian in the world, and the least factor by which
    the Jacobian stretches. tile: (bricks, boxes, places, samples, mask) - the first brick of each block, each brick's
    box in z and its first sample, the samples relative to their block's centre, and which of them are in the outline.
    """
    blocks, masks, origins, columns, shrink = cells
    stack, bounds = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    leaves = len(boxes) // 2
    for i in range(start, stop):
        best = np.inf
        cell_found[i], sample_found[i] = -1, -1
        stack[0], bounds[0], top = 1, 0.0, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if bounds[top] >= best:
                continue
            if node < leaves:
                top = near_first(points[i], boxes, node, best, stack, bounds, top)
                continue
            for cell in range(GROUP * (node - leaves), min(GROUP * (node - leaves + 1), len(blocks))):
                found, distance = nearest_in_cell(
                    points[i], blocks[cell], masks[cell], origins[cell], columns[cell], shrink[cell], tile, best
                )
                if found >= 0:
                    best, cell_found[i], sample_found[i] = distance, cell, found
        distances[i] = best


@njit(nogil=True, cache=True)
def nearest_in_cell(x, block, mask, origin, columns, shrink, tile, best):
    """Return the nearest sample of one cell, −1 if none is nearer than √`best`, and its squared distance."""
    bricks, boxes, places, samples, inside = tile
    rx, ry, rz = x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]
    a0, a1, a2 = float(columns[0, 0]), float(columns[0, 1]), float(columns[0, 2])
    b0, b1, b2 = float(columns[1, 0]), float(columns[1, 1]), float(columns[1, 2])
    c0, c1, c2 = float(columns[2, 0]), float(columns[2, 1]), float(columns[2, 2])
    p0, p1, p2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
    q0, q1, q2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
    s0, s1, s2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    determinant = a0 * p0 + a1 * p1 + a2 * p2
    z0 = (p0 * rx + p1 * ry + p2 * rz) / determinant
    z1 = (q0 * rx + q1 * ry + q2 * rz) / determinant
    z2 = (s0 * rx + s1 * ry + s2 * rz) / determinant
    found = -1
    for brick in range(bricks[block], bricks[block + 1]):
        d0 = max(boxes[brick, 0, 0] - z0, z0 - boxes[brick, 1, 0], 0.0)
        d1 = max(boxes[brick, 0, 1] - z1, z1 - boxes[brick, 1, 1], 0.0)
        d2 = max(boxes[brick, 0, 2] - z2, z2 - boxes[brick, 1, 2], 0.0)
        if (d0 * d0 + d1 * d1 + d2 * d2) * shrink * shrink >= best:
            continue
        for sample in range(places[brick], places[brick + 1]):
            g0, g1, g2 = z0 - samples[sample, 0], z1 - samples[sample, 1], z2 - samples[sample, 2]
            e0, e1, e2 = a0 * g0 + b0 * g1 + c0 * g2, a1 * g0 + b1 * g1 + c1 * g2, a2 * g0 + b2 * g1 + c2 * g2
            distance = e0 * e0 + e1 * e1 + e2 * e2
            if distance < best and (mask < 0 or inside[mask + sample - places[bricks[block]]]):
                best, found = distance, sample
    return found, best


@njit(nogil=True, cache=True)
def nearest_strips(start, stop, points, boxes, strips, feet, distances):
    """Write the nearest points of the rim to those points that are nearer to it than √distances, and the distances.

    strips: (centre (n, 3), edge (n, 3), up (n, 3), ends (n, 2)): the points centre + s edge + z up, −1 <= s <= 1 and
    z between the ends.
    """
    centres, edges, ups, ends = strips
    stack, bounds = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    leaves = len(boxes) // 2
    foot = np.empty(3)
    for i in range(start, stop):
        best = distances[i]
        stack[0], bounds[0], top = 1, 0.0, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if bounds[top] >= best:
                continue
            if node < leaves:
                top = near_first(points[i], boxes, node, best, stack, bounds, top)
                continue
            for strip in range(GROUP * (node - leaves), min(GROUP * (node - leaves + 1), len(centres))):
                distance = strip_distance(points[i], centres[strip], edges[strip], ups[strip], ends[strip], foot)
                if distance < best:
                    best = distance
                    feet[i] = foot
        distances[i] = best


@njit(nogil=True, cache=True)
def strip_distance(x, centre, edge, up, ends, foot):
    """Return the squared distance of x to a strip, and write the nearest point: the best of four edges and the inside.

    |up| = 1.
    """
    ee = eu = er = ur = 0.0
    for k in range(3):
        gap = x[k] - centre[k]
        ee += edge[k] * edge[k]
        eu += edge[k] * up[k]
        er += edge[k] * gap
        ur += up[k] * gap
    determinant = ee - eu * eu
    best = np.inf
    for case in range(5):
        if case == 0:
            s = (er - eu * ur) / determinant
            z = ur - eu * s
            if abs(s) > 1.0 or z < ends[0] or z > ends[1]:
                continue
        elif case < 3:
            s = -1.0 if case == 1 else 1.0
            z = min(max(ur - eu * s, ends[0]), ends[1])
        else:
            z = ends[case - 3]
            s = min(max((er - eu * z) / ee, -1.0), 1.0)
        total = 0.0
        for k in range(3):
            gap = x[k] - centre[k] - s * edge[k] - z * up[k]
            total += gap * gap
        if total < best:
            best = total
            for k in range(3):
                foot[k] = centre[k] + s * edge[k] + z * up[k]
        if case == 0:
            break
    return best


@njit(nogil=True, cache=True)
def least_stretches(columns, shrink):
    """Write the least singular value of each matrix of columns (n, 3, 3), from the largest eigenvalue of the inverse.

    The characteristic polynomial of a symmetric matrix in three dimensions has three real roots, in closed form.
    """
    for i in range(len(columns)):
        metric = np.zeros((3, 3))
        for a in range(3):
            for b in range(3):
                for k in range(3):
                    metric[a, b] += columns[i, a, k] * columns[i, b, k]
        mean = (metric[0, 0] + metric[1, 1] + metric[2, 2]) / 3
        off = metric[0, 1] ** 2 + metric[0, 2] ** 2 + metric[1, 2] ** 2
        spread = math.sqrt(
            ((metric[0, 0] - mean) ** 2 + (metric[1, 1] - mean) ** 2 + (metric[2, 2] - mean) ** 2 + 2 * off) / 6
        )
        if spread <= 1e-15 * mean:
            shrink[i] = math.sqrt(mean)
            continue
        d, e, f = metric[0, 0] - mean, metric[1, 1] - mean, metric[2, 2] - mean
        half = (
            d * (e * f - metric[1, 2] ** 2)
            - metric[0, 1] * (metric[0, 1] * f - metric[1, 2] * metric[0, 2])
            + metric[0, 2] * (metric[0, 1] * metric[1, 2] - e * metric[0, 2])
        ) / (2 * spread**3)
        angle = math.acos(min(max(half, -1.0), 1.0)) / 3
        shrink[i] = math.sqrt(max(mean + 2 * spread * math.cos(angle + 2 * math.pi / 3), 0.0))
