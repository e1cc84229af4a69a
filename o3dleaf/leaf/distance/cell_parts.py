"""Parts of the cells beside a tapered rim, each as good as straight: there a cell's copy of a block bends too much."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.distance.tile_samples import STRAIGHT, TileSamples
from o3dleaf.leaf.margin.taper import Taper
from o3dleaf.leaf.textured_blade import TexturedBlade

QUARTERS = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
PROBES = np.stack(np.meshgrid([-0.5, 0, 0.5], [-0.5, 0, 0.5], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
"""Places of a part that its straight copy is compared at, from its middle in its sides, and the bottom or the top."""


class CellParts(NamedTuple):
    """Squares that cells of the plane are divided into.

    Attributes
    ----------
    cells : (p,) ndarray
        The cell that each belongs to.
    low, side : (p, 2), (p,) ndarrays
        Its lower corner and side, in cells; 0 and 1: it is all of the cell.
    """

    cells: IntArray
    low: FloatArray
    side: FloatArray

    @property
    def is_whole(self) -> BoolArray:
        """(p,) whether it is all of its cell."""
        return np.asarray(self.side == 1)

    @property
    def offsets(self) -> FloatArray:
        """(p, 2) the middles of parts from those of their cells, in cells."""
        return np.asarray(self.low + self.side[:, np.newaxis] / 2 - 0.5)

    def rows(self, chosen: BoolArray | IntArray) -> "CellParts":
        """Return some of the parts."""
        return CellParts(self.cells[chosen], self.low[chosen], self.side[chosen])

    def quartered(self) -> "CellParts":
        """Return the quarters of all parts."""
        half = np.repeat(self.side / 2, 4)
        low = np.repeat(self.low, 4, axis=0) + np.tile(QUARTERS, (len(self.cells), 1)) * half[:, np.newaxis]
        return CellParts(np.repeat(self.cells, 4), low, half)

    def contains(self, part: int, shares: FloatArray) -> BoolArray:
        """Return which of (n, 2) places of a cell, 0 to 1 along its sides, lie in a part of it."""
        count = round(1 / self.side[part])
        number = np.clip(np.floor(shares * count), 0, count - 1)
        return np.asarray((number == np.round(self.low[part] * count)).all(axis=1))


def divide_cells(leaf: TexturedBlade, tile: TileSamples, corners: IntArray) -> CellParts:
    """Return the parts of cells (n, 2): all of each, or, where the thickness falls, quarters of quarters.

    They end where they are as good as straight, or as small as samples are apart.
    """
    parts = CellParts(np.arange(len(corners)), np.zeros((len(corners), 2)), np.ones(len(corners)))
    rim = leaf.blade.rim
    if rim is None:
        return parts
    band = Taper(leaf.blade.outline.polygon, rim.radius + float(np.linalg.norm(tile.cell)))
    middles, finished = tile.origin + (corners + 0.5) * tile.cell, []
    near = band.values(middles) < 1
    finished.append(parts.rows(~near))
    parts = parts.rows(near)
    while len(parts.cells):
        side = float(tile.cell.max()) * parts.side
        bent = (side > rim.radius) | (_bend(leaf.blade, leaf.heights, tile, corners, parts) > STRAIGHT * tile.step)
        bent &= side > tile.step
        finished.append(parts.rows(~bent))
        parts = parts.rows(bent).quartered()
    cells, low, sides = (np.concatenate(each) for each in zip(*finished, strict=True))
    order = np.lexsort((low[:, 1], low[:, 0], cells))
    return CellParts(cells, low, sides).rows(order)


def _bend(blade: Blade, heights: FloatArray, tile: TileSamples, corners: IntArray, parts: CellParts) -> FloatArray:
    """Return by how much each part (p,) bends away from its straight copy."""
    base = np.column_stack(
        [tile.origin + (corners[parts.cells] + 0.5 + parts.offsets) * tile.cell, np.zeros(len(parts.cells))]
    )
    middle, bend = blade.lift_with_jacobian(base), np.zeros(len(base))
    for along, across, top in PROBES:
        off = np.empty_like(base)
        off[:, :2] = parts.side[:, np.newaxis] * tile.cell * [along, across]
        off[:, 2] = heights[int(top)]
        copy = middle.world + np.einsum("ni,nik->nk", off, middle.columns)
        bend = np.maximum(bend, np.linalg.norm(blade.lift(base + off) - copy, axis=1))
    return bend
