"""An octree whose leaves are as wide as the steps that points ask for: the finest step times powers of two."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.isosurface.band.band import BLOCK, distinct
from o3dleaf.surface.isosurface.band.morton_loops import encode, fill_table
from o3dleaf.surface.isosurface.octree import octree_loops as loops
from o3dleaf.surface.isosurface.octree.octree_loops import SplitCells

AROUND = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
"""A cell and the 26 that touch it."""

DIAGONALLY = AROUND[(AROUND != 0).all(axis=1)]
"""Those eight of them whose parents are the parents of all."""


class OctreeLeaves(NamedTuple):
    """Leaves of an octree: keys and levels (c,), nodes that count and nodes inside (c,), 27 bits each, and nodes' rows.

    `nodes` is (c, 27), −1 where none counts.
    """

    keys: IntArray
    levels: IntArray
    present: IntArray
    inside: IntArray
    nodes: npt.NDArray[np.int32]

    def take(self, rows: npt.NDArray[np.generic]) -> "OctreeLeaves":
        """Return some of them, by a mask or by their numbers."""
        return OctreeLeaves(*(each[rows] for each in self))


@dataclass(frozen=True, eq=False)
class Octree:
    """Which cells are split: those with a point that asks for leaves at most half as wide, in them or touching them.

    Cells are split too that touch the parent of a split cell's neighbor: of leaves that touch, one is at most twice as
    wide as the other (Ju et al. 2002 mesh any octree; this one's leaves have 26 nodes at most, and grow smoothly).

    Attributes
    ----------
    split : SplitCells
    """

    split: SplitCells

    @classmethod
    def of(cls, points: IntArray, levels: IntArray) -> "Octree":
        """Return that of points (n,), by their keys on the finest lattice, and the levels (n,) that they ask for."""
        top, cells = int(levels.max()), np.empty(0, dtype=np.int64)
        codes = [cells]
        for level in range(1, top + 1):
            # Where a cell is split its neighbors are cells, so that their parents are split.
            asking = _shifted(distinct(points[levels == level - 1] >> 3 * level), AROUND)
            cells = distinct(np.concatenate([asking, _shifted(cells, DIAGONALLY) >> 3]))
            codes.append(cells << 3 * level | np.int64(1) << 3 * level - 1)
        code = np.concatenate(codes)
        table = np.full(1 << (2 * len(code) + 1).bit_length(), -1, dtype=np.int32)
        fill_table(table, code, len(code))
        return cls(SplitCells(table, code, top))

    def leaves_at(self, points: IntArray) -> tuple[IntArray, IntArray]:
        """Return keys and levels (n,) of the leaves that contain points (n,), by their keys."""
        keys, levels = np.empty_like(points), np.empty_like(points)
        run_blocks(lambda i, j: loops.find_leaves(i, j, self.split, points, levels, keys), len(points), BLOCK)
        return keys, levels


def _shifted(cells: IntArray, steps: IntArray) -> IntArray:
    """Return the keys (n k,) of the cells of one level that lie some steps (k, 3) from cells (n,)."""
    places = np.empty((len(cells), 3), dtype=np.int64)
    loops.decode(cells, places)
    keys = np.empty(len(steps) * len(cells), dtype=np.int64)
    encode((places[:, np.newaxis] + steps).reshape(-1, 3), keys)
    return keys
