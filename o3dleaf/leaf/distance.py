"""The distance to the leaf: to the nearest point of its two rough faces, its pockets and its rim.

The leaf is where G > 0 and (along, across) is in the outline. Its surface is sampled once over one tile, and
the blade is cut into cells that show blocks of that tile, each seen in the world through the lift's Jacobian at
its middle. A tree of boxes over the cells finds the nearest sample, Newton's method the nearest point of the
surface beside it. The rim is a band of short flat strips under a tree of their own.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray, as_points
from o3dleaf.leaf import newton, search
from o3dleaf.leaf.rim import rim_pieces, rim_strips
from o3dleaf.leaf.surface import lift, texture_jets, thickness
from o3dleaf.leaf.tile import Tile
from o3dleaf.parallel import blocks, run_blocks
from o3dleaf.rbf.tail import IntArray

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

BLOCK = 1 << 12
"""Points that a thread looks at together: 4 MB."""
ROUNDS = 2
"""Newton's steps to the closest point, from a sample that is half a step of the sampling away."""
FAR = 1e4
"""Distance, in sizes of the leaf, from where the leaf is seen as from infinity: nearer points are taken in its place."""
LEAST_VOLUME = 1e-3
"""Determinant of the lift's Jacobian below which a cell lies in a fold of the frame and is left out."""


@dataclass(frozen=True, eq=False)
class SurfaceIndex:
    """The surface of one leaf, findable.

    Attributes
    ----------
    tile : Tile
    corners : (n, 2) int64 ndarray
        Each cell's place in the plane, in cells from the tile's corner.
    cells : tuple of ndarrays
        Block, place in the mask, centre, Jacobian and least stretch; see `o3dleaf.leaf.search`.
    mask : (m,) ndarray of bool
        Which samples of the cells at the rim are in the outline.
    boxes : (2k, 2, 3) float32 ndarray
        The tree over the cells.
    strips : tuple of ndarrays
        Centre, half edge and up of each strip of the rim, and its two ends along up.
    strip_boxes : (2k, 2, 3) float32 ndarray
        The tree over the strips.
    middle, reach : (3,) ndarray, float
        Of the leaf: its box's centre, and the distance beyond which it is seen as from infinity.
    """

    tile: Tile
    corners: IntArray
    cells: tuple[npt.NDArray[np.generic], ...]
    mask: npt.NDArray[np.bool_]
    boxes: FloatArray
    strips: tuple[FloatArray, ...]
    strip_boxes: FloatArray
    middle: FloatArray
    reach: float

    @classmethod
    def build(cls, leaf: "MultiscaleLeaf") -> "SurfaceIndex":
        """Sample the tile, lay the cells, and put up the rim."""
        tile = Tile.sample(leaf)
        corners, at_rim = _cells_in(leaf, tile)
        block = (corners[:, 0] % tile.shape[0]) * tile.shape[1] + corners[:, 1] % tile.shape[1]
        kept = tile.bricks[block + 1] > tile.bricks[block]
        corners, at_rim, block = corners[kept], at_rim[kept], block[kept]
        centres, columns, low, high = _seen(leaf, tile, corners, block)
        upright = np.abs(np.linalg.det(columns)) > LEAST_VOLUME
        # Cells in the order of a curve that fills the plane: neighbours in a row are neighbours on the leaf.
        order = np.flatnonzero(upright)[np.argsort(_morton(corners[upright]), kind="stable")]
        corners, at_rim, block = corners[order], at_rim[order], block[order]
        mask, places = _rim_mask(leaf, tile, corners, at_rim, block)
        shrink = np.empty(len(order))
        search.least_stretches(columns[order], shrink)
        cells = (block, places, centres[order], columns[order].astype(np.float32), 0.999 * shrink)
        strips, ends = rim_strips(leaf, tile.step)
        middle, size = (low.min(axis=0) + high.max(axis=0)) / 2, float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        boxes = _tree(low[order], high[order])
        return cls(tile, corners, cells, mask, boxes, strips, _tree(*ends), middle, FAR * size)

    def closest(self, leaf: "MultiscaleLeaf", points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the closest points (n, 3) of the surface, and the distances (n,) to them."""
        seen = self._brought_near(points)
        count = len(points)
        cell, sample, square = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64), np.empty(count)
        tile = (self.tile.bricks, self.tile.boxes, self.tile.places, self.tile.samples, self.mask)
        search.nearest_samples(0, count, seen, self.boxes, self.cells, tile, cell, sample, square)
        flat = self.tile.samples[sample].astype(np.float64)
        flat[:, :2] += self.tile.origin + (self.corners[cell] + 0.5) * self.tile.cell
        feet = refine(leaf, seen, flat, self.tile.step)
        square = np.sum((feet - seen) ** 2, axis=1)
        search.nearest_strips(0, count, seen, self.strip_boxes, self.strips, feet, square)
        return feet, _lengths(points - feet)

    def _brought_near(self, points: FloatArray) -> FloatArray:
        """Return the points, those beyond reach moved towards the leaf: squares of their distances stay finite."""
        half = points / 2 - self.middle / 2
        length = 2 * _lengths(half)
        far = np.minimum(1.0, self.reach / np.maximum(length, self.reach))
        return np.where((far < 1)[:, np.newaxis], self.middle + 2 * (half * far[:, np.newaxis]), points)


def refine(leaf: "MultiscaleLeaf", points: FloatArray, start: FloatArray, step: float) -> FloatArray:
    """Return the points of the surface closest to `points`, by Newton's method from flat coordinates near them.

    Where it leads out of the outline, away from the surface, or farther away, the start is the answer.
    """
    flat = start.copy()
    for _ in range(ROUNDS):
        values, inner, bends = texture_jets(leaf, flat, 2)
        here, moves = lift(leaf.blade, flat), np.empty_like(flat)
        newton.closest_steps(
            0, len(flat), points, here.world, here.columns, values, inner, bends, step, moves
        )
        flat += moves
    values, inner = texture_jets(leaf, flat, 1)
    here, moves = lift(leaf.blade, flat), np.empty_like(flat)
    newton.gradient_steps(0, len(flat), here.columns, values, inner, step, moves)
    flat += moves
    feet, first = leaf.blade.lift(flat), leaf.blade.lift(start)
    nearer = np.sum((feet - points) ** 2, axis=1) <= np.sum((first - points) ** 2, axis=1)
    on = np.abs(moves).max(axis=1, initial=0.0) <= 0.1 * step
    good = nearer & on & leaf.blade.outline.contains(flat[:, :2])
    return np.where(good[:, np.newaxis], feet, first)


def closest_points(leaf: "MultiscaleLeaf", x: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the closest points of the leaf's surface to (n, 3) world points, and the distances to them."""
    points, index = as_points(x, "x", dim=3), leaf.surface_index
    feet, distances = np.empty_like(points), np.empty(len(points))

    def task(start: int, stop: int) -> None:
        feet[start:stop], distances[start:stop] = index.closest(leaf, points[start:stop])

    run_blocks(task, len(points), BLOCK)
    return feet, distances


def signed_distance(leaf: "MultiscaleLeaf", x: npt.ArrayLike) -> FloatArray:
    """Return the signed distances (n,) of (n, 3) world points; see `MultiscaleLeaf.signed_distance`."""
    points, index = as_points(x, "x", dim=3), leaf.surface_index
    distances = np.empty(len(points))

    def task(start: int, stop: int) -> None:
        distances[start:stop] = index.closest(leaf, points[start:stop])[1]
        # Straight up from a point of the leaf its surface is not farther than the patch is thick.
        near = start + np.flatnonzero(distances[start:stop] <= 1.1 * thickness(leaf))
        distances[near[inside(leaf, points[near])]] *= -1

    run_blocks(task, len(points), BLOCK)
    return distances


def inside(leaf: "MultiscaleLeaf", points: FloatArray) -> npt.NDArray[np.bool_]:
    """Return whether the points lie in the leaf: G > 0, and in the outline."""
    flat = leaf.blade.flatten(points)
    held = leaf.blade.outline.contains(flat[:, :2])
    held[held] = texture_jets(leaf, flat[held], 0)[0] > 0
    return held


def _lengths(vectors: FloatArray) -> FloatArray:
    """Return the lengths of (n, 3) vectors of any finite size."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    scale = np.where(largest > 0, largest, 1.0)
    return np.asarray(np.linalg.norm(vectors / scale[:, np.newaxis], axis=1) * largest, dtype=np.float64)


def _cells_in(leaf: "MultiscaleLeaf", tile: Tile) -> tuple[IntArray, npt.NDArray[np.bool_]]:
    """Return the cells (n, 2) that the outline holds or cuts, and which it may cut."""
    outline = leaf.blade.outline
    first, last = np.floor((outline.bounds - tile.origin) / tile.cell).astype(np.int64)
    first, shape = first - 1, last - first + 3
    i, j = np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij")
    corners = np.stack([i, j], axis=-1).reshape(-1, 2) + first
    cut = np.zeros(shape, dtype=bool)
    edge, half = rim_pieces(outline.polygon, tile.step)
    ends = np.floor((edge + half - tile.origin) / tile.cell).astype(np.int64) - first
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):  # a piece may cut the corner of a cell that holds neither of its ends
            cut[ends[:, 0] + di, ends[:, 1] + dj] = True
    held = outline.contains(tile.origin + (corners + 0.5) * tile.cell) | cut.ravel()
    return corners[held], cut.ravel()[held]


def _seen(
    leaf: "MultiscaleLeaf", tile: Tile, corners: IntArray, block: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return each cell's middle and Jacobian in the world, and the lower and upper corners of its box there."""
    centres, columns = np.empty((len(corners), 3)), np.empty((len(corners), 3, 3))
    low, high = np.empty_like(centres), np.empty_like(centres)
    heights = tile.heights[block]
    for first, last in blocks(len(corners), BLOCK):
        part, plane = slice(first, last), tile.origin + (corners[first:last] + 0.5) * tile.cell
        middle = lift(leaf.blade, np.column_stack([plane, np.zeros(last - first)]))
        centres[part], columns[part] = middle.world, middle.columns
        low[part], high[part] = np.inf, -np.inf
        slack = np.zeros((last - first, 1))
        for along in (-0.5, 0.5):
            for across in (-0.5, 0.5):
                off = np.array([along, across]) * tile.cell
                for end in range(2):
                    z = np.column_stack([np.broadcast_to(off, plane.shape), heights[part, end]])
                    world = leaf.blade.lift(np.column_stack([plane + off, heights[part, end]]))
                    guess = middle.world + np.einsum("ni,nik->nk", z, middle.columns)
                    slack = np.maximum(slack, np.linalg.norm(world - guess, axis=1, keepdims=True))
                    low[part], high[part] = np.minimum(low[part], world), np.maximum(high[part], world)
        low[part] -= slack
        high[part] += slack
    return centres, columns, low, high


def _morton(corners: IntArray) -> IntArray:
    """Return the numbers of cells (n, 2) along Morton's curve."""
    place = np.zeros(len(corners), dtype=np.int64)
    moved = corners - corners.min(axis=0)
    for bit in range(31):
        for axis in range(2):
            place |= ((moved[:, axis] >> bit) & 1) << (2 * bit + axis)
    return place


def _rim_mask(
    leaf: "MultiscaleLeaf", tile: Tile, corners: IntArray, at_rim: npt.NDArray[np.bool_], block: IntArray
) -> tuple[npt.NDArray[np.bool_], IntArray]:
    """Return which samples of the cells at the rim are in the outline, and where each cell's begin there, −1: all are."""
    firsts = tile.first_samples()
    counts = np.where(at_rim, firsts[block + 1] - firsts[block], 0)
    places = np.where(at_rim, np.cumsum(counts) - counts, -1)
    mask = np.empty(counts.sum(), dtype=bool)
    rows = np.flatnonzero(at_rim)
    for first, last in blocks(len(rows), BLOCK // 16):
        part = rows[first:last]
        cell = np.repeat(part, counts[part])
        start = places[part[0]]
        offset = np.arange(start, start + len(cell)) - places[cell]
        at = tile.samples[firsts[block[cell]] + offset, :2] + (tile.origin + (corners[cell] + 0.5) * tile.cell)
        mask[start : start + len(cell)] = leaf.blade.outline.contains(at)
    return mask, places


def _tree(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the boxes of a heap over items in order, `GROUP` a leaf, from the items' own boxes (n, 3), (n, 3)."""
    groups = max(-(-len(low) // search.GROUP), 1)
    leaves = 1 << (groups - 1).bit_length()
    leaves = max(leaves, 2)
    boxes = np.empty((2 * leaves, 2, 3), dtype=np.float32)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    starts = np.arange(groups) * search.GROUP
    if len(low):
        # A box in single precision must not be smaller than the box in double.
        boxes[leaves : leaves + groups, 0] = np.nextafter(np.minimum.reduceat(low, starts).astype(np.float32), -np.inf)
        boxes[leaves : leaves + groups, 1] = np.nextafter(np.maximum.reduceat(high, starts).astype(np.float32), np.inf)
    level = leaves
    while level > 1:
        level //= 2
        children = boxes[2 * level : 4 * level].reshape(level, 2, 2, 3)
        boxes[level : 2 * level, 0] = children[:, :, 0].min(axis=1)
        boxes[level : 2 * level, 1] = children[:, :, 1].max(axis=1)
    return boxes
