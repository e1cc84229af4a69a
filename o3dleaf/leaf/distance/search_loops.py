"""Compiled: the nearest sample of the leaf's surface.

A tree is a heap of boxes in the world: node k has the children 2k and 2k + 1, and the last ``leaves``
nodes have `GROUP` items each, in order. Empty boxes have half sides of −∞ and are never nearest. Boxes lie as the
blade does: one that stands along the world's axes would be far thicker than what it contains.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.blade.vector_loops import dot3

GROUP = 4
"""Items in a leaf of the tree."""
DEPTH = 64
"""More than a tree of all the memory there is has levels."""


class TileArrays(NamedTuple):
    """The samples of one tile, in blocks of the plane and bricks of each block.

    Attributes
    ----------
    bricks : (blocks + 1,) ndarray
        First brick of each block.
    boxes : (bricks, 2, 3) ndarray
        Middle and half sides of the box of each brick's samples.
    places : (bricks + 1,) ndarray
        First sample of each brick.
    samples : (3, n) ndarray
        Relative to their block's center.
    extents : (blocks, 2, 3) ndarray
        Middle and half sides of the box of each block's samples.
    """

    bricks: npt.NDArray[np.int64]
    boxes: npt.NDArray[np.float32]
    places: npt.NDArray[np.int64]
    samples: npt.NDArray[np.float32]
    extents: npt.NDArray[np.float32]


class BladeCells(NamedTuple):
    """The cells of the blade, each of which shows a block of the tile.

    Attributes
    ----------
    blocks : (n,) ndarray
        The block.
    bits : (n,) ndarray
        Place of its first sample in the mask, −1 where all samples show.
    centers : (n, 3) ndarray
        In the world.
    columns : (n, 3, 3) ndarray
        Of the lift's Jacobian there.
    """

    blocks: npt.NDArray[np.int64]
    bits: npt.NDArray[np.int64]
    centers: npt.NDArray[np.float64]
    columns: npt.NDArray[np.float32]


@njit(nogil=True, cache=True)
def box_distance(x, box):
    """Return the squared distance of x to a box: its center, three unit vectors along its sides, and half of them."""
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
def nearest_samples(points, boxes, cells, tile, mask, slack, nearest_cells, nearest, distances):
    """Write the cells and the samples that are nearer to the points than √distances, −1 where none is.

    mask: which of their block's samples cells show that do not show all, a bit each. slack: a length that is safely
    more than what cells' straight copies of a bent surface, and single precision, are off by.
    """
    stack, bounds = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    leaves = len(boxes) // 2
    scores = np.empty(np.diff(tile.places).max(), dtype=np.float32)
    last = np.inf
    for i in range(len(points)):
        best = distances[i]
        if i > 0 and nearest[i - 1] >= 0:
            # What was nearest to the point before is not farther from this one than there and back.
            moved = 0.0
            for k in range(3):
                moved += (points[i, k] - points[i - 1, k]) ** 2
            best = min(best, (math.sqrt(last) + math.sqrt(moved) + slack) ** 2)
        last = np.inf
        nearest_cells[i], nearest[i] = -1, -1
        stack[0], bounds[0], top = 1, 0.0, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if bounds[top] >= best:
                continue
            if node < leaves:
                top = near_first(points[i], boxes, node, best, stack, bounds, top)
                continue
            for cell in range(GROUP * (node - leaves), min(GROUP * (node - leaves + 1), len(cells.blocks))):
                sample, distance = nearest_in_cell(points[i], cell, cells, tile, mask, scores, best)
                if sample >= 0:
                    best, nearest_cells[i], nearest[i] = distance, cell, sample
                    last = distance


@njit(nogil=True, cache=True)
def shown(bits, number):
    """Return one of the bits that are packed eight a byte, the lowest first."""
    return (bits[number >> 3] >> (number & 7)) & 1


@njit(nogil=True, cache=True)
def brick_distance(r, a, b, c, boxes, brick):
    """Return a lower bound of the distance of r to a box of z, its middle and half sides, seen as a z₁ + b z₂ + c z₃.

    The box lies behind the plane across e, the way from its middle, that its farthest corner along e touches.
    """
    m0, m1, m2 = boxes[brick, 0, 0], boxes[brick, 0, 1], boxes[brick, 0, 2]
    e0 = r[0] - a[0] * m0 - b[0] * m1 - c[0] * m2
    e1 = r[1] - a[1] * m0 - b[1] * m1 - c[1] * m2
    e2 = r[2] - a[2] * m0 - b[2] * m1 - c[2] * m2
    size = math.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    if size == 0.0:
        return 0.0
    reach = (
        boxes[brick, 1, 0] * abs(e0 * a[0] + e1 * a[1] + e2 * a[2])
        + boxes[brick, 1, 1] * abs(e0 * b[0] + e1 * b[1] + e2 * b[2])
        + boxes[brick, 1, 2] * abs(e0 * c[0] + e1 * c[1] + e2 * c[2])
    )
    return max(size - reach / size, 0.0)


@njit(nogil=True, cache=True)
def nearest_in_cell(x, cell, cells, tile, mask, scores, best):
    """Return the nearest sample of one cell, −1 if none is nearer than √`best`, and its squared distance.

    |r − A s|² − |r|² = s·(AᵀA s − 2 Aᵀr): of the samples' size, and so right to a few nanometers in single precision.
    """
    block, first_bit, origin, columns = cells.blocks[cell], cells.bits[cell], cells.centers[cell], cells.columns[cell]
    bricks, places, samples = tile.bricks, tile.places, tile.samples
    r = (x[0] - origin[0], x[1] - origin[1], x[2] - origin[2])
    a = (float(columns[0, 0]), float(columns[0, 1]), float(columns[0, 2]))
    b = (float(columns[1, 0]), float(columns[1, 1]), float(columns[1, 2]))
    c = (float(columns[2, 0]), float(columns[2, 1]), float(columns[2, 2]))
    if brick_distance(r, a, b, c, tile.extents, block) ** 2 >= best:
        return -1, best
    square = dot3(r, r)
    aa, bb, cc = np.float32(dot3(a, a)), np.float32(dot3(b, b)), np.float32(dot3(c, c))
    ab, ac, bc = np.float32(2 * dot3(a, b)), np.float32(2 * dot3(a, c)), np.float32(2 * dot3(b, c))
    ar, br, cr = np.float32(2 * dot3(a, r)), np.float32(2 * dot3(b, r)), np.float32(2 * dot3(c, r))
    nearest = -1
    for brick in range(bricks[block], bricks[block + 1]):
        if brick_distance(r, a, b, c, tile.boxes, brick) ** 2 >= best:
            continue
        first, count = places[brick], places[brick + 1] - places[brick]
        xs, ys, zs = (
            samples[0, first : first + count],
            samples[1, first : first + count],
            samples[2, first : first + count],
        )
        for k in range(count):
            u, v, w = xs[k], ys[k], zs[k]
            scores[k] = u * (aa * u + ab * v + ac * w - ar) + v * (bb * v + bc * w - br) + w * (cc * w - cr)
        least = np.float32(best - square)
        for k in range(count):
            if scores[k] < least and (first_bit < 0 or shown(mask, first_bit + first + k - places[bricks[block]])):
                least, nearest = scores[k], first + k
                best = square + least
    return nearest, best


@njit(nogil=True, cache=True)
def look_up(places, values, codes, inside):
    """Write which points are inside: as the nearest corner of their cell at which the field has their sign is.

    places: (n, 3), in steps of the lattice. codes: (nx, ny, nz), 1 where the field is positive, plus 2 where the
    lattice is inside; the first two axes are periodic. Where no corner has the sign, the nearest one decides.
    """
    nx, ny, nz = codes.shape
    for i in range(len(places)):
        z = min(max(places[i, 2], 0.0), nz - 1.0)
        x0, y0, z0 = math.floor(places[i, 0]), math.floor(places[i, 1]), math.floor(z)
        best = np.inf
        for corner in range(8):
            x, y, k = x0 + (corner & 1), y0 + (corner >> 1 & 1), z0 + (corner >> 2)
            code = codes[int(x) % nx, int(y) % ny, min(int(k), nz - 1)]
            score = (x - places[i, 0]) ** 2 + (y - places[i, 1]) ** 2 + (k - z) ** 2
            if (code & 1) != (values[i] > 0.0):
                score += 4.0  # more than the square of a cell's diagonal
            if score < best:
                best, inside[i] = score, code > 1
