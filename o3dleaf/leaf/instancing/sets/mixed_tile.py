"""Tiles mixed of two that agree but for some cells, each of which a place takes from the one or from the other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.instancing.sets.tile_set import TileSet
from o3dleaf.leaf.instancing.tile import Tile

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
        return mix_tiles(self.tiles[kind], self.tiles[half + kind], other), None

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


def mix_tiles(one: Tile, other: Tile, chosen: BoolArray) -> Tile:
    """Return a tile that is `one`, but `other` over the chosen cells.

    Parameters
    ----------
    one, other : Tile
        Of one lattice; at the edge of the chosen cells they are the same.
    chosen : (nx + 1, ny + 1) ndarray of bool
        Cells of the tile, and the first ones of the tiles after it.

    Raises
    ------
    ReconstructionError
        If they are not the same there.
    """
    sources = _Vertices.of(one), _Vertices.of(other)
    rows = [np.flatnonzero(part.in_cells(mask)) for part, mask in zip(sources, (~chosen, chosen), strict=True)]
    keys = np.concatenate([part.keys[row] for part, row in zip(sources, rows, strict=True)])
    order = np.argsort(keys)
    keys = keys[order]
    if np.any(keys[1:] == keys[:-1]):
        raise _disagreement()

    def chosen_of(name: str) -> npt.NDArray[Any]:
        return np.concatenate([getattr(part, name)[row] for part, row in zip(sources, rows, strict=True)])[order]

    start, size = (np.where(chosen[:-1, :-1].ravel(), *pair) for pair in _cells_of(one, other))
    triangles = np.repeat(start - np.cumsum(size) + size, size) + np.arange(size.sum())
    nodes = np.concatenate([np.searchsorted(keys, part.keys).astype(np.int32)[part.tile.nodes] for part in sources])
    wanted = np.concatenate([part.keys[part.tile.nodes] for part in sources])[triangles]
    nodes = nodes[triangles]
    if not np.array_equal(keys[np.minimum(nodes, len(keys) - 1)], wanted):
        raise _disagreement()
    edges, shifts, own = chosen_of("edges"), chosen_of("shifts"), int(np.searchsorted(keys, BEYOND))
    fractions, sides = chosen_of("fractions"), chosen_of("sides")
    return replace(
        one,
        edges=edges[:own],
        fractions=fractions[:own],
        sides=sides[:own],
        upward=chosen_of("upward")[:own],
        nodes=nodes,
        cells=np.concatenate([[0], np.cumsum(size)]),
        beyond=np.stack([edges[own:], shifts[own:]], axis=1),
        beyond_fractions=fractions[own:],
        beyond_sides=sides[own:],
    )


def _cells_of(one: Tile, other: Tile) -> tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]:
    """Return the first triangle over each cell, of the second tile and of the first, and their number, alike."""
    return (
        (other.cells[:-1] + len(one.nodes), one.cells[:-1]),
        (np.diff(other.cells), np.diff(one.cells)),
    )


def _disagreement() -> ReconstructionError:
    return ReconstructionError(
        "hair_density: the surface beside a hair is another one without it at this spacing; use a finer spacing"
    )


@dataclass(frozen=True, eq=False)
class _Vertices:
    """All vertices that a tile's triangles have, its own first, by rising keys.

    Attributes
    ----------
    tile : Tile
    edges, shifts, keys : (n,) ndarrays of int64
        The edge in its own tile, which tile that is (bits: along, across), and a number of both.
    fractions, sides, upward : (n,) ndarrays
    """

    tile: Tile
    edges: IntArray
    shifts: IntArray
    keys: IntArray
    fractions: FloatArray
    sides: npt.NDArray[np.uint8]
    upward: BoolArray

    @classmethod
    def of(cls, tile: Tile) -> "_Vertices":
        edges = np.concatenate([tile.edges, tile.beyond[:, 0]])
        shifts = np.concatenate([np.zeros(len(tile.edges), dtype=np.int64), tile.beyond[:, 1]])
        upward = np.concatenate([tile.upward, np.zeros(len(tile.beyond), dtype=bool)])
        keys = np.where(shifts == 0, edges, BEYOND + 4 * edges + shifts)
        fractions = np.concatenate([tile.fractions, tile.beyond_fractions])
        return cls(tile, edges, shifts, keys, fractions, np.concatenate([tile.sides, tile.beyond_sides]), upward)

    def in_cells(self, mask: BoolArray) -> BoolArray:
        """Return which vertices lie in the cells of a mask (nx + 1, ny + 1); an edge in that of its lower end."""
        nx, ny, nz = self.tile.lattice.shape
        column = self.edges // (8 * nz)
        return np.asarray(mask[column // ny + nx * (self.shifts & 1), column % ny + ny * (self.shifts >> 1)])
