"""The compiled search for the nearest sample of the leaf's surface and the nearest strip of its rim.

A tree is a heap of boxes in the world: node k has the children 2k and 2k + 1, and the last ``leaves``
nodes hold `GROUP` items each, in order. Empty boxes have half sides of −∞ and are never nearest. Boxes lie as the
blade does: one that stands along the world's axes would be far thicker than what it holds.
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
    """Return the squared distance of x to a box: its centre, three unit vectors along its sides, and half of them."""
    r0, r1, r2 = x[0] - box[0], x[1] - box[1], x[2] - box[2]
    total = 0.0
    for k in range(3):
        along = abs(r0 * box[3 + 3 * k] + r1 * box[4 + 3 * k] + r2 * box[5 + 3 * k])
        gap = max(along - box[12 + k], 0.0)
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
def nearest_samples(points, boxes, cells, tile, cell_found, sample_found, distances):
    """Write the cells and the samples that are nearer to the points than √distances, −1 where none is.

    cells: (block, mask, origin (n, 3), columns (n, 3, 3)) - the block of the tile that a cell shows, the place of its
    first sample in the mask or −1, its centre and its Jacobian in the world. tile: (bricks, boxes, places, samples
    (3, m), mask, extents) - the first brick of each block, middle and half sides of each brick's box in z, its first
    sample, the samples relative to their block's centre, which of those of cells at the rim are in the outline, and
    middle and half sides of each block's box.
    """
    blocks, masks, origins, columns = cells
    stack, bounds = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    leaves = len(boxes) // 2
    scores = np.empty(np.diff(tile[2]).max(), dtype=np.float32)
    for i in range(len(points)):
        best = distances[i]
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
                    points[i], blocks[cell], masks[cell], origins[cell], columns[cell], tile, scores, best
                )
                if found >= 0:
                    best, cell_found[i], sample_found[i] = distance, cell, found


@njit(nogil=True, cache=True)
def brick_distance(r0, r1, r2, columns, box):
    """Return a lower bound of the distance from A⁻¹r to a box in z, its middle and half its sides, in the world.

    The box lies behind the plane across e, the way from its middle, that its farthest corner along e touches.
    """
    m0, m1, m2 = box[0, 0], box[0, 1], box[0, 2]
    e0 = r0 - columns[0, 0] * m0 - columns[1, 0] * m1 - columns[2, 0] * m2
    e1 = r1 - columns[0, 1] * m0 - columns[1, 1] * m1 - columns[2, 1] * m2
    e2 = r2 - columns[0, 2] * m0 - columns[1, 2] * m1 - columns[2, 2] * m2
    size = math.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    reach = 0.0
    for k in range(3):
        reach += box[1, k] * abs(e0 * columns[k, 0] + e1 * columns[k, 1] + e2 * columns[k, 2])
    return max(size - reach / size, 0.0) if size > 0.0 else 0.0


@njit(nogil=True, cache=True)
def nearest_in_cell(x, block, mask, origin, columns, tile, scores, best):
    """Return the nearest sample of one cell, −1 if none is nearer than √`best`, and its squared distance.

    |r − A s|² − |r|² = s·(AᵀA s − 2 Aᵀr): of the samples' size, and so right to a few nanometres in single precision.
    """
    bricks, boxes, places, samples, inside, extents = tile
    r0, r1, r2 = x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]
    if brick_distance(r0, r1, r2, columns, extents[block]) ** 2 >= best:
        return -1, best
    square = r0 * r0 + r1 * r1 + r2 * r2
    a0, a1, a2 = float(columns[0, 0]), float(columns[0, 1]), float(columns[0, 2])
    b0, b1, b2 = float(columns[1, 0]), float(columns[1, 1]), float(columns[1, 2])
    c0, c1, c2 = float(columns[2, 0]), float(columns[2, 1]), float(columns[2, 2])
    aa, bb, cc = (
        np.float32(a0 * a0 + a1 * a1 + a2 * a2),
        np.float32(b0 * b0 + b1 * b1 + b2 * b2),
        np.float32(c0 * c0 + c1 * c1 + c2 * c2),
    )
    ab, ac, bc = (
        np.float32(2 * (a0 * b0 + a1 * b1 + a2 * b2)),
        np.float32(2 * (a0 * c0 + a1 * c1 + a2 * c2)),
        np.float32(2 * (b0 * c0 + b1 * c1 + b2 * c2)),
    )
    ar, br, cr = (
        np.float32(2 * (a0 * r0 + a1 * r1 + a2 * r2)),
        np.float32(2 * (b0 * r0 + b1 * r1 + b2 * r2)),
        np.float32(2 * (c0 * r0 + c1 * r1 + c2 * r2)),
    )
    found = -1
    for brick in range(bricks[block], bricks[block + 1]):
        if brick_distance(r0, r1, r2, columns, boxes[brick]) ** 2 >= best:
            continue
        first, count = places[brick], places[brick + 1] - places[brick]
        xs, ys, zs = samples[0, first : first + count], samples[1, first : first + count], samples[2, first : first + count]
        for k in range(count):
            u, v, w = xs[k], ys[k], zs[k]
            scores[k] = u * (aa * u + ab * v + ac * w - ar) + v * (bb * v + bc * w - br) + w * (cc * w - cr)
        least = np.float32(best - square)
        for k in range(count):
            if scores[k] < least and (mask < 0 or inside[mask + first + k - places[bricks[block]]]):
                least, found = scores[k], first + k
                best = square + least
    return found, best


@njit(nogil=True, cache=True)
def nearest_strips(points, boxes, strips, feet, distances):
    """Write the points of the rim that are nearer to the points than √distances, and their squared distances.

    strips: (centre (n, 3), edge (n, 3), up (n, 3), ends (n, 2)): the points centre + s edge + z up, −1 <= s <= 1 and
    z between the ends.
    """
    centres, edges, ups, ends = strips
    stack, bounds = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    leaves = len(boxes) // 2
    foot = np.empty(3)
    for i in range(len(points)):
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
