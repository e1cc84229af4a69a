"""The cells of the blade: each shows a block of the tile through the lift's Jacobian at its middle."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, UniqueRows
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.distance.boxes import grow_tree
from o3dleaf.leaf.distance.cell_parts import CellParts, divide_cells
from o3dleaf.leaf.distance.rim_strips import rim_pieces
from o3dleaf.leaf.distance.search_loops import BladeCells
from o3dleaf.leaf.distance.solid import LeafSolid
from o3dleaf.leaf.distance.tile_samples import TileSamples
from o3dleaf.leaf.textured_blade import TexturedBlade

BLOCK = 1 << 10
"""Cells that a thread looks at together: 1 MB."""
VIEW_BLOCK = 16
"""The same where a cell does not show all samples."""
MIN_VOLUME = 1e-3
"""Determinant of the lift's Jacobian below which a cell lies in a fold of the frame and is left out."""


@dataclass(frozen=True, eq=False)
class CellTree:
    """The cells that the leaf's surface lies in, and a tree over them.

    Attributes
    ----------
    corners : (n, 2) int64 ndarray
        Each cell's place in the plane, in cells from the tile's corner.
    cells : BladeCells
    mask : (m,) uint8 ndarray
        Which samples cells show, a bit each, where they do not show all of their block's.
    boxes : (2k, 15) float32 ndarray
        The tree; see `o3dleaf.leaf.distance.boxes`.
    """

    corners: IntArray
    cells: BladeCells
    mask: npt.NDArray[np.uint8]
    boxes: npt.NDArray[np.float32]

    @classmethod
    def build(cls, leaf: TexturedBlade, solid: LeafSolid, tile: TileSamples) -> "CellTree":
        """Lay cells over a solid."""
        corners, at_rim = _cells_in(solid, tile)
        block = tile.blocks_at(corners)
        kept = tile.bricks[block + 1] > tile.bricks[block]
        corners, at_rim, block = corners[kept], at_rim[kept], block[kept]
        # Neighbors in a row are neighbors on the leaf.
        order = morton_order(corners - corners.min(axis=0), 31)
        corners, at_rim, block = corners[order], at_rim[order], block[order]
        parts = divide_cells(leaf, tile, corners)
        corners, at_rim, block = corners[parts.cells], at_rim[parts.cells], block[parts.cells]
        offsets = parts.offsets * tile.cell
        centers, columns = _lifted_middles(leaf, tile, corners, offsets)
        mask, bits, ends = _shown_samples(leaf, solid, tile, corners, at_rim, block, parts=parts)
        kept = (ends[0, :, 0] <= ends[1, :, 0]) & (np.abs(np.linalg.det(columns)) > MIN_VOLUME)
        corners, ends, offsets = corners[kept], ends[:, kept], offsets[kept]

        def hulls(start: int, stop: int) -> tuple[FloatArray, FloatArray]:
            return _hulls(leaf, tile, corners[start:stop], ends[:, start:stop], offsets[start:stop])

        cells = BladeCells(block[kept], bits[kept], centers[kept], columns[kept])
        return cls(corners, cells, mask, grow_tree(len(corners), hulls))


def morton_order(places: IntArray, bits: int) -> IntArray:
    """Return the order along Morton's curve, which fills space, of places (n, d) from 0 on, of so many bits."""
    number = np.zeros(len(places), dtype=np.int64)
    dimension = places.shape[1]
    for bit in range(bits):
        for axis in range(dimension):
            number |= ((places[:, axis] >> bit) & 1) << (dimension * bit + axis)
    return np.argsort(number, kind="stable")


def _cells_in(solid: LeafSolid, tile: TileSamples) -> tuple[IntArray, BoolArray]:
    """Return the cells (n, 2) that the outline contains or cuts, and which it may cut."""
    bounds = np.reshape(solid.outline.bounds, (2, 2))
    first, last = np.floor((bounds - tile.origin) / tile.cell).astype(np.int64)
    first, shape = first - 2, last - first + 5
    i, j = np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij")
    corners = np.stack([i, j], axis=-1).reshape(-1, 2) + first
    cut = np.zeros(shape, dtype=bool)
    edge, half = rim_pieces(solid.outline, tile.step)
    ends = np.floor((edge + half - tile.origin) / tile.cell).astype(np.int64) - first
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):  # a piece may cut the corner of a cell that contains neither of its ends
            cut[ends[:, 0] + di, ends[:, 1] + dj] = True
    kept = solid.contains(tile.origin + (corners + 0.5) * tile.cell) | cut.ravel()
    return corners[kept], cut.ravel()[kept]


def _middles(tile: TileSamples, corners: IntArray) -> FloatArray:
    """Return the flat coordinates (n, 3) of the cells' middles at height 0."""
    return np.column_stack([tile.origin + (corners + 0.5) * tile.cell, np.zeros(len(corners))])


def _lifted_middles(
    leaf: TexturedBlade, tile: TileSamples, corners: IntArray, offsets: FloatArray
) -> tuple[FloatArray, npt.NDArray[np.float32]]:
    """Return each cell's middle (n, 3) in the world, at height 0, and the lift's Jacobian in float32.

    Of a part of a cell, both are those that its own middle, an offset (n, 2) away, sees.
    """
    centers, columns = np.empty((len(corners), 3)), np.empty((len(corners), 3, 3), dtype=np.float32)

    def task(start: int, stop: int) -> None:
        off = np.pad(offsets[start:stop], ((0, 0), (0, 1)))
        middle = leaf.blade.lift_with_jacobian(_middles(tile, corners[start:stop]) + off)
        centers[start:stop] = middle.world - np.einsum("ni,nik->nk", off, middle.columns)
        columns[start:stop] = middle.columns

    run_blocks(task, len(corners), BLOCK)
    return centers, columns


def _hulls(
    leaf: TexturedBlade, tile: TileSamples, corners: IntArray, ends: FloatArray, offsets: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return points (n, 16, 3) whose hull contains each cell, and its Jacobian.

    They are the corners of its box as they are, and as its middle sees them: the surface bends between the two.
    """
    base, away = _middles(tile, corners), np.pad(offsets, ((0, 0), (0, 1)))
    middle, points = leaf.blade.lift_with_jacobian(base + away), np.empty((len(base), 16, 3))
    for number in range(8):
        off = np.column_stack([ends[number >> k & 1, :, k] for k in range(3)]).astype(np.float64)
        points[:, number] = leaf.blade.lift(base + off)
        points[:, 8 + number] = middle.world + np.einsum("ni,nik->nk", off - away, middle.columns)
    return points, middle.columns


def _shown_samples(
    leaf: TexturedBlade,
    solid: LeafSolid,
    tile: TileSamples,
    corners: IntArray,
    at_rim: BoolArray,
    block: IntArray,
    *,
    parts: CellParts,
) -> tuple[npt.NDArray[np.uint8], IntArray, FloatArray]:
    """Return which samples cells show, where that is not all, and of each cell its place there and its box.

    At the rim it is those in the outline, of a part of a cell those over it, over zones of hairs those of the hairs
    that stand there, or of what is there without them.

    Returns
    -------
    mask : (m,) uint8 ndarray
        Whole bytes for each cell, so that no two threads write the same one; cells with the same samples share them.
    bits : (n,) ndarray
        Where each cell's bits begin, −1: it shows all samples.
    ends : (2, n, 3) ndarray
        The box of the samples that it shows; ∞ and −∞ where there are none.
    """
    firsts = tile.places[tile.bricks]
    hairs = leaf.hairs
    removed, held = hairs.states(*(corners // tile.count).T), tile.pieces_in_blocks(hairs.zones.count)[block]
    alone = at_rim | ~parts.is_whole
    rows = np.flatnonzero(alone | held.any(axis=1))
    # A cell at the rim is like no other one, and no more is a part.
    alike = np.column_stack(
        [np.where(alone[rows], rows, -1), block[rows], np.packbits(removed[rows, :-1] & held[rows], axis=1)]
    )
    _, first, view = UniqueRows.of(alike)
    views = rows[first]
    sizes = -(-(firsts[block[views] + 1] - firsts[block[views]]) // 8)
    starts = np.cumsum(sizes) - sizes
    bits = np.full(len(corners), -1)
    bits[rows] = 8 * starts[view]
    mask, boxes = np.empty(sizes.sum(), dtype=np.uint8), np.empty((2, len(views), 3))

    def task(start: int, stop: int) -> None:
        for number in range(start, stop):
            cell = views[number]
            bricks = slice(*tile.bricks[block[cell] : block[cell] + 2])
            samples = tile.samples[:, firsts[block[cell]] : firsts[block[cell] + 1]]
            seen = removed[cell, tile.pieces[bricks]] == tile.bare[bricks]
            shown = np.repeat(seen, np.diff(tile.places[bricks.start : bricks.stop + 1]))
            if not parts.is_whole[cell]:
                shown &= parts.contains(cell, samples[:2].T / tile.cell + 0.5)
            if at_rim[cell]:
                shown &= solid.contains(samples[:2].T + (tile.origin + (corners[cell] + 0.5) * tile.cell))
            mask[starts[number] : starts[number] + sizes[number]] = np.packbits(shown, bitorder="little")
            part = samples[:, shown]
            boxes[:, number] = part.min(axis=1, initial=np.inf), part.max(axis=1, initial=-np.inf)

    run_blocks(task, len(views), VIEW_BLOCK)
    middle, half = tile.extents[block].transpose(1, 0, 2)
    ends = np.stack([middle - half, middle + half])
    ends[:, rows] = boxes[:, view]
    return mask, bits, ends
