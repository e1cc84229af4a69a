"""Tiles mixed of two that agree but for some cells, each of which a place takes from the one or from the other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.instancing.sets.tile_set import TileSet
from o3dleaf.leaf.instancing.tile import Tile, TileColumns

Cells = Callable[[tuple[int, int]], tuple[BoolArray, BoolArray]]
"""Takes a place to two masks (nx, ny) of the cells of its tile: those that are the other tile's there, and all that may
be."""

BEYOND = 1 << 60
"""Above the numbers of all edges: vertices of neighbors come after a tile's own."""


@dataclass(frozen=True, eq=False)
class MixedSet(TileSet):
    """Tiles and others in their stead, which differ from them in some cells alone.

    The first half of `tiles` are as they are, the second half the others.

    Attributes
    ----------
    cells : Cells
    """

    cells: Cells

    def at(self, place: tuple[int, int]) -> tuple[Tile, int | None]:
        """Return the tile in a place, and which of `tiles` it is; None: none of them alone."""
        kind, half = self.kind(place), len(self.tiles) // 2
        other, may = self._around(place)
        if not other.any():
            return self.tiles[kind], kind
        if (other == may).all():
            return self.tiles[half + kind], half + kind
        return self._pairs[kind].mixed(other), None

    @cached_property
    def _pairs(self) -> list["TilePair"]:
        half = len(self.tiles) // 2
        return [TilePair.of(*both) for both in zip(self.tiles[:half], self.tiles[half:], strict=True)]

    def _around(self, place: tuple[int, int]) -> tuple[BoolArray, BoolArray]:
        """Return both masks of a place (nx + 1, ny + 1), with the first row and column of the tiles after it."""
        p, q = place
        around = [[self.cells((p + a, q + b)) for b in range(2)] for a in range(2)]
        masks = []
        for side in range(2):
            own, across = around[0][0][side], around[0][1][side][:, :1]
            along, both = around[1][0][side][:1], around[1][1][side][:1, :1]
            masks.append(np.block([[own, across], [along, both]]))
        return masks[0], masks[1]


@dataclass(frozen=True, eq=False)
class TilePair:
    """Two tiles of one lattice, side by side: all vertices of both, those of neighbors last, and their triangles.

    Attributes
    ----------
    one : Tile
        The first of them.
    columns : tuple of TileColumns
        Of both.
    edges, shifts : (v,) ndarrays of int64
        The edge of each vertex in its own tile, and which tile that is (bits: along, across).
    fractions, sides, upward : (v,) ndarrays
    cells : tuple of two (v,) ndarrays of int64
        The cell that each edge begins in, (nx + 1, ny + 1) of them.
    of_other : (v,) ndarray of bool
        Which are the second tile's.
    names : (v,) ndarray of int64
        From 0 on, rising: vertices of both tiles on one edge have one.
    nodes : (m, 3) ndarray of int64
        Names of the corners of all triangles, the second tile's last.
    first, count : (2, nx ny) ndarrays of int64
        First triangle over each cell and number of them, in both tiles.
    """

    one: Tile
    columns: tuple[TileColumns, TileColumns]
    edges: IntArray
    shifts: IntArray
    fractions: FloatArray
    sides: npt.NDArray[np.uint8]
    upward: BoolArray
    cells: tuple[IntArray, IntArray]
    of_other: BoolArray
    names: IntArray
    nodes: IntArray
    first: IntArray
    count: IntArray

    @classmethod
    def of(cls, one: Tile, other: Tile) -> "TilePair":
        """Put two tiles side by side."""
        nx, ny, nz = one.lattice.shape
        tiles, beyond = (one, other), [len(tile.beyond) for tile in (one, other)]
        edges = np.concatenate([part for tile in tiles for part in (tile.edges, tile.beyond[:, 0])])
        shifts = np.concatenate([part for tile in tiles for part in (np.zeros_like(tile.edges), tile.beyond[:, 1])])
        named = np.unique(np.where(shifts == 0, edges, BEYOND + 4 * edges + shifts), return_inverse=True)[1]
        order, column = np.argsort(named, kind="stable"), edges // (8 * nz)
        whole = [
            np.concatenate([part for tile in tiles for part in (getattr(tile, name), getattr(tile, f"beyond_{name}"))])
            for name in ("fractions", "sides")
        ]
        ends = [(tile.upward, np.zeros(more, dtype=bool)) for tile, more in zip(tiles, beyond, strict=True)]
        upward = np.concatenate([part for both in ends for part in both])
        start = len(one.edges) + beyond[0]
        cells = column // ny + nx * (shifts & 1), column % ny + ny * (shifts >> 1)
        return cls(
            one,
            (one.columns, other.columns),
            edges[order],
            shifts[order],
            whole[0][order],
            whole[1][order],
            upward[order],
            (cells[0][order], cells[1][order]),
            order >= start,
            named[order],
            named[np.concatenate([one.nodes, other.nodes.astype(np.int64) + start])],
            np.stack([one.cells[:-1], other.cells[:-1] + len(one.nodes)]),
            np.stack([np.diff(one.cells), np.diff(other.cells)]),
        )

    def mixed(self, chosen: BoolArray) -> Tile:
        """Return the first tile, but the second one over the chosen cells.

        Parameters
        ----------
        chosen : (nx + 1, ny + 1) ndarray of bool
            Cells of the tile, and the first ones of the tiles after it.

        Raises
        ------
        ReconstructionError
            If the two tiles are not the same at the edge of these cells.
        """
        # An edge lies in the cell that begins at its lower end, or between two.
        rows = np.flatnonzero(chosen[self.cells] == self.of_other)
        there = np.bincount(self.names[rows], minlength=int(self.names[-1]) + 1)
        which = chosen[:-1, :-1].ravel()
        first, count = np.where(which, self.first[1], self.first[0]), np.where(which, self.count[1], self.count[0])
        triangles = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        named = self.nodes[triangles]
        if there.max() > 1 or not there[named].all():
            raise ReconstructionError(
                "hair_density: the surface beside a hair is another one without it at this spacing; use a finer spacing"
            )
        nodes = (np.cumsum(there) - 1).astype(np.int32)[named]
        own, beyond = rows[self.shifts[rows] == 0], rows[self.shifts[rows] > 0]
        return replace(
            self.one,
            columns=MixedColumns(*self.columns, chosen),
            edges=self.edges[own],
            fractions=self.fractions[own],
            sides=self.sides[own],
            upward=self.upward[own],
            nodes=nodes,
            cells=np.concatenate([[0], np.cumsum(count)]),
            beyond=np.stack([self.edges[beyond], self.shifts[beyond]], axis=1),
            beyond_fractions=self.fractions[beyond],
            beyond_sides=self.sides[beyond],
        )


@dataclass(frozen=True, eq=False)
class MixedColumns:
    """Columns of two tiles: those that begin one of the `chosen` cells (nx + 1, ny + 1) are the second one's."""

    one: TileColumns
    other: TileColumns
    chosen: BoolArray

    def labels(self, columns: IntArray) -> npt.NDArray[np.uint8]:
        """Return the labels (m, nz) of the samples of some columns (m, 2)."""
        chosen = self.chosen[tuple(columns.T)][:, np.newaxis]
        return np.where(chosen, self.other.labels(columns), self.one.labels(columns))

    def samples(self, columns: IntArray) -> FloatArray:
        """Return these samples (m, nz)."""
        chosen = self.chosen[tuple(columns.T)][:, np.newaxis]
        return np.where(chosen, self.other.samples(columns), self.one.samples(columns))
