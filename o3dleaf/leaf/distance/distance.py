"""The distance to the leaf: to the nearest point of its two rough faces, its pockets and its rim.

The leaf is where G > 0 and (along, across) is in the outline. Its surface is sampled once over one tile, and
the blade is cut into cells that show blocks of that tile, each seen in the world through the lift's Jacobian at
its middle. A tree of boxes over the cells finds the nearest sample, Newton's method the nearest point of the
surface beside it. The rim is a band of short flat strips under a tree of their own.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray, as_points
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.distance import projection_loops, search_loops
from o3dleaf.leaf.distance.boxes import grow_tree
from o3dleaf.leaf.distance.projection import lift, texture_jets, thickness
from o3dleaf.leaf.distance.rim_strips import rim_pieces, rim_strips
from o3dleaf.leaf.distance.solid import Solid
from o3dleaf.leaf.distance.tile_samples import Tile

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

CHUNK = 1 << 15
"""Points that are put in order together: 4 MB."""
BLOCK = 1 << 10
"""Points that a thread looks at together: 1 MB."""
RIM_BLOCK = 16
"""Cells at the rim that a thread looks at together."""
STRIP_STEPS = 2
"""Length of a strip of the rim, in steps of the sampling."""
SETTLED = 0.05
"""Length of Newton's step, of the sampling's, after which another one would not be seen in the distance."""
LONGEST = 3.0
"""Longest of Newton's steps, of the sampling's: the nearest sample may be some steps away where many are as near."""
MOST_ROUNDS = 5
"""Newton's steps to the closest point; two are usual."""
FAR = 1e4
"""Distance, in sizes of the leaf, from where it is seen as from infinity: points farther out are brought there."""
LEAST_VOLUME = 1e-3
"""Determinant of the lift's Jacobian below which a cell lies in a fold of the frame and is left out."""


@dataclass(frozen=True, eq=False)
class SurfaceIndex:
    """The surface of one leaf, findable.

    Attributes
    ----------
    solid : Solid
        What it is the surface of.
    tile : Tile
    corners : (n, 2) int64 ndarray
        Each cell's place in the plane, in cells from the tile's corner.
    cells : tuple of ndarrays
        Block, place in the mask, centre and Jacobian; see `o3dleaf.leaf.distance.search_loops`.
    mask : (m,) uint8 ndarray
        A bit each: which samples of the cells at the rim are in the outline.
    boxes : (2k, 15) float32 ndarray
        The tree over the cells; see `o3dleaf.leaf.distance.boxes`.
    strips : tuple of ndarrays
        Centre, half edge and up of each strip of the rim, and its two ends along up.
    strip_boxes : (2k, 15) float32 ndarray
        The tree over the strips.
    middle, reach : (3,) ndarray, float
        Of the leaf: its box's centre, and the distance beyond which it is seen as from infinity.
    """

    solid: Solid
    tile: Tile
    corners: IntArray
    cells: tuple[npt.NDArray[np.generic], ...]
    mask: npt.NDArray[np.uint8]
    boxes: npt.NDArray[np.float32]
    strips: tuple[npt.NDArray[np.floating], ...]
    strip_boxes: npt.NDArray[np.float32]
    middle: FloatArray
    reach: float

    @classmethod
    def build(cls, leaf: "MultiscaleLeaf", *, closed: bool = False) -> "SurfaceIndex":
        """Sample the tile, lay the cells, and put up the rim, of the leaf or of the closed solid."""
        tile = Tile.sample(leaf, closed=closed)
        outline = leaf.blade.outline
        solid = Solid(outline.rounded if closed else outline.polygon, tile.filled)
        strips, strip_boxes = rim_strips(leaf, solid, STRIP_STEPS * tile.step)
        corners, at_rim = _cells_in(solid, tile)
        block = (corners[:, 0] % tile.shape[0]) * tile.shape[1] + corners[:, 1] % tile.shape[1]
        kept = tile.bricks[block + 1] > tile.bricks[block]
        corners, at_rim, block = corners[kept], at_rim[kept], block[kept]
        # Cells in the order of a curve that fills the plane: neighbours in a row are neighbours on the leaf.
        order = np.argsort(_morton(corners - corners.min(axis=0), 31), kind="stable")
        corners, at_rim, block = corners[order], at_rim[order], block[order]
        middles, columns = _seen(leaf, tile, corners)
        mask, places, ends = _shown(solid, tile, corners, at_rim, block)
        kept = (ends[0, :, 0] <= ends[1, :, 0]) & (np.abs(np.linalg.det(columns)) > LEAST_VOLUME)
        corners, ends = corners[kept], ends[:, kept]
        block, places, middles, columns = (part[kept] for part in (block, places, middles, columns))
        cells = (block, places, middles, columns)

        def hulls(start: int, stop: int) -> tuple[FloatArray, FloatArray]:
            return _hulls(leaf, tile, corners[start:stop], ends[:, start:stop])

        boxes = grow_tree(len(corners), hulls)
        low, high = cells[2].min(axis=0), cells[2].max(axis=0)
        middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
        return cls(solid, tile, corners, cells, mask, boxes, strips, strip_boxes, middle, FAR * size)

    def closest(self, leaf: "MultiscaleLeaf", points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the closest points (n, 3) of the surface, and the distances (n,) to them."""
        seen = self.brought_near(points)
        feet, square = np.empty_like(seen), np.full(len(seen), np.inf)
        search_loops.nearest_strips(seen, self.strip_boxes, self.strips, feet, square)
        cell, sample = np.empty(len(seen), dtype=np.int64), np.empty(len(seen), dtype=np.int64)
        parts = self.tile
        tile = (parts.bricks, parts.boxes, parts.places, parts.samples, self.mask, parts.extents)
        # A face may be nearer than the rim where its nearest sample is not.
        bound = (np.sqrt(square) + self.tile.step) ** 2
        search_loops.nearest_samples(seen, self.boxes, self.cells, tile, self.tile.step, cell, sample, bound)
        near = np.flatnonzero(sample >= 0)
        flat = self.tile.samples[:, sample[near]].T.astype(np.float64)
        flat[:, :2] += self.tile.origin + (self.corners[cell[near]] + 0.5) * self.tile.cell
        found = refine(leaf, self.solid, seen[near], flat, self.tile.step)
        nearer = np.sum((found - seen[near]) ** 2, axis=1) < square[near]
        feet[near[nearer]] = found[nearer]
        return feet, _lengths(points - feet)

    def brought_near(self, points: FloatArray) -> FloatArray:
        """Return the points, those beyond reach moved towards the leaf: squares of their distances stay finite."""
        # A quarter of the way has a length that floating point holds, whatever the point.
        quarter, reach = points / 4 - self.middle / 4, self.reach / 4
        length = _lengths(quarter)
        share = reach / np.maximum(length, reach)
        moved = self.middle + 4 * (quarter * share[:, np.newaxis])
        return np.where((length > reach)[:, np.newaxis], moved, points)


def refine(leaf: "MultiscaleLeaf", solid: Solid, points: FloatArray, start: FloatArray, step: float) -> FloatArray:
    """Return the points of the surface closest to `points`, by Newton's method from samples beside them.

    The first step's second derivatives are kept. Where it leads out of the outline, away from the surface, or
    farther away than it began, the start is the answer.
    """
    flat, feet = start.copy(), np.empty_like(start)
    values, inner, bends = texture_jets(leaf, start, 2)
    here, todo = lift(leaf.blade, start), np.arange(len(start))
    first = here.world
    for number in range(MOST_ROUNDS):
        if number > 0:
            values, inner = texture_jets(leaf, flat[todo], 1)
            here = lift(leaf.blade, flat[todo])
        moves = np.empty((len(todo), 3))
        projection_loops.closest_steps(
            points[todo], here.world, here.columns, values, inner, bends[todo], LONGEST * step, moves
        )
        flat[todo] += moves
        feet[todo] = here.world + np.einsum("nk,nkj->nj", moves, here.columns)
        todo = todo[(number == 0) | (np.abs(moves).max(axis=1, initial=0.0) > SETTLED * step)]
        if not len(todo):
            break
    good = np.sum((feet - points) ** 2, axis=1) <= np.sum((first - points) ** 2, axis=1)
    good &= solid.contains(flat[:, :2])
    good[todo] = False
    return np.where(good[:, np.newaxis], feet, first)


def closest_points(leaf: "MultiscaleLeaf", x: npt.ArrayLike, *, closed: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return the closest points of the leaf's surface to (n, 3) world points, and the distances to them."""
    points, index = as_points(x, "x", dim=3), leaf.index_of(closed=closed)
    feet, distances = np.empty_like(points), np.empty(len(points))

    def task(rows: IntArray) -> None:
        feet[rows], distances[rows] = index.closest(leaf, points[rows])

    _in_order(index, points, task)
    return feet, distances


def signed_distance(leaf: "MultiscaleLeaf", x: npt.ArrayLike, *, closed: bool = False) -> FloatArray:
    """Return the signed distances (n,) of (n, 3) world points; see `MultiscaleLeaf.signed_distance`."""
    points, index = as_points(x, "x", dim=3), leaf.index_of(closed=closed)
    distances = np.empty(len(points))

    def task(rows: IntArray) -> None:
        distances[rows] = index.closest(leaf, points[rows])[1]
        # Straight up from a point of the leaf its surface is not farther than the patch is thick.
        near = rows[distances[rows] <= 1.1 * thickness(leaf)]
        distances[near[index.solid.holds(leaf, points[near])]] *= -1

    _in_order(index, points, task)
    return distances


def _in_order(index: SurfaceIndex, points: FloatArray, task: Callable[[IntArray], None]) -> None:
    """Call ``task(rows)`` for all points, block by block, on all threads: neighbours in space one after another.

    What is near to one point is near to the next, and still in the cache.
    """
    for first, last in blocks(len(points), CHUNK):
        seen = index.brought_near(points[first:last])
        low = seen.min(axis=0)
        size = float(np.max(seen.max(axis=0) - low)) or 1.0
        order = first + np.argsort(_morton(((seen - low) * (255 / size)).astype(np.int64), 8), kind="stable")
        _run_rows(task, order)


def _run_rows(task: Callable[[IntArray], None], rows: IntArray) -> None:
    run_blocks(lambda start, stop: task(rows[start:stop]), len(rows), BLOCK)


def _lengths(vectors: FloatArray) -> FloatArray:
    """Return the lengths of (n, 3) vectors of any finite size."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    scale = np.where(largest > 0, largest, 1.0)
    with np.errstate(over="ignore"):  # a length beyond all numbers is infinite
        return np.asarray(np.linalg.norm(vectors / scale[:, np.newaxis], axis=1) * largest, dtype=np.float64)


def _cells_in(solid: Solid, tile: Tile) -> tuple[IntArray, npt.NDArray[np.bool_]]:
    """Return the cells (n, 2) that the outline holds or cuts, and which it may cut."""
    bounds = np.reshape(solid.outline.bounds, (2, 2))
    first, last = np.floor((bounds - tile.origin) / tile.cell).astype(np.int64)
    first, shape = first - 2, last - first + 5
    i, j = np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij")
    corners = np.stack([i, j], axis=-1).reshape(-1, 2) + first
    cut = np.zeros(shape, dtype=bool)
    edge, half = rim_pieces(solid.outline, tile.step)
    ends = np.floor((edge + half - tile.origin) / tile.cell).astype(np.int64) - first
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):  # a piece may cut the corner of a cell that holds neither of its ends
            cut[ends[:, 0] + di, ends[:, 1] + dj] = True
    held = solid.contains(tile.origin + (corners + 0.5) * tile.cell) | cut.ravel()
    return corners[held], cut.ravel()[held]


def _seen(leaf: "MultiscaleLeaf", tile: Tile, corners: IntArray) -> tuple[FloatArray, npt.NDArray[np.float32]]:
    """Return the middle (n, 3) of each cell in the world, at height 0, and the lift's Jacobian there in float32."""
    middles, columns = np.empty((len(corners), 3)), np.empty((len(corners), 3, 3), dtype=np.float32)

    def task(start: int, stop: int) -> None:
        middle = lift(leaf.blade, _middles(tile, corners[start:stop]))
        middles[start:stop], columns[start:stop] = middle.world, middle.columns

    run_blocks(task, len(corners), BLOCK)
    return middles, columns


def _middles(tile: Tile, corners: IntArray) -> FloatArray:
    """Return the flat coordinates (n, 3) of the cells' middles at height 0."""
    return np.column_stack([tile.origin + (corners + 0.5) * tile.cell, np.zeros(len(corners))])


def _hulls(leaf: "MultiscaleLeaf", tile: Tile, corners: IntArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (n, 16, 3) whose hull holds each cell, and its Jacobian.

    They are the corners of its box as they are, and as its middle sees them: the surface bends between the two.
    """
    base = _middles(tile, corners)
    middle, points = lift(leaf.blade, base), np.empty((len(base), 16, 3))
    for number in range(8):
        off = np.column_stack([ends[number >> k & 1, :, k] for k in range(3)]).astype(np.float64)
        points[:, number] = leaf.blade.lift(base + off)
        points[:, 8 + number] = middle.world + np.einsum("ni,nik->nk", off, middle.columns)
    return points, middle.columns


def _morton(places: IntArray, bits: int) -> IntArray:
    """Return the numbers along Morton's curve of places (n, d) from 0 on, of so many bits."""
    number = np.zeros(len(places), dtype=np.int64)
    dimension = places.shape[1]
    for bit in range(bits):
        for axis in range(dimension):
            number |= ((places[:, axis] >> bit) & 1) << (dimension * bit + axis)
    return number


def _shown(
    solid: Solid, tile: Tile, corners: IntArray, at_rim: npt.NDArray[np.bool_], block: IntArray
) -> tuple[npt.NDArray[np.uint8], IntArray, FloatArray]:
    """Return which samples of cells at the rim are in the outline, and of each cell its place there and its box.

    Returns
    -------
    mask : (m,) uint8 ndarray
        Whole bytes for each cell at the rim, so that no two threads write the same one.
    places : (n,) ndarray
        Where each cell's bits begin, −1: it shows all samples.
    ends : (2, n, 3) ndarray
        The box of the samples that it shows; ∞ and −∞ where there are none.
    """
    firsts, rows = tile.places[tile.bricks], np.flatnonzero(at_rim)
    sizes = np.where(at_rim, -(-(firsts[block + 1] - firsts[block]) // 8), 0)
    places = np.where(at_rim, 8 * (np.cumsum(sizes) - sizes), -1)
    mask = np.empty(sizes.sum(), dtype=np.uint8)
    middle, half = tile.extents[block].transpose(1, 0, 2)
    ends = np.stack([middle - half, middle + half])

    def task(start: int, stop: int) -> None:
        for cell in rows[start:stop]:
            samples = tile.samples[:, firsts[block[cell]] : firsts[block[cell] + 1]]
            held = solid.contains(samples[:2].T + (tile.origin + (corners[cell] + 0.5) * tile.cell))
            first = places[cell] >> 3
            mask[first : first + sizes[cell]] = np.packbits(held, bitorder="little")
            part = samples[:, held]
            ends[0, cell], ends[1, cell] = part.min(axis=1, initial=np.inf), part.max(axis=1, initial=-np.inf)

    run_blocks(task, len(rows), RIM_BLOCK)
    return mask, places, ends
