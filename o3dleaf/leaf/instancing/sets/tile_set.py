"""A set of tiles whose borders match, polygonized together once, and which of them lies in each place."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.instancing.tile import Tile, TileLattice

ALONG, ACROSS = 1, 2
"""Bits of the directions of edges."""


@dataclass(frozen=True, eq=False)
class TileSet:
    """Tiles of one lattice; where two lie beside one another, they have the border in common, bit for bit.

    Attributes
    ----------
    tiles : tuple of Tile
    kind : callable
        Takes a place, the number of a tile along and across, to the one of `tiles` that lies there.
    """

    tiles: tuple[Tile, ...]
    kind: Callable[[tuple[int, int]], int]

    @classmethod
    def of(cls, tile: "Tile | TileSet") -> "TileSet":
        """Return the set of a tile that lies everywhere; a set as it is."""
        return tile if isinstance(tile, TileSet) else cls((tile,), lambda _: 0)

    def at(self, place: tuple[int, int]) -> tuple[Tile, int | None]:
        """Return the tile in a place, and which of `tiles` it is; None: none of them, and in no other place."""
        kind = self.kind(place)
        return self.tiles[kind], kind

    @property
    def lattice(self) -> TileLattice:
        """The lattice of every tile."""
        return self.tiles[0].lattice


class Tiles(NamedTuple):
    """What is set down over a blade.

    Attributes
    ----------
    whole : Tile
    parts : TileSet
        The same as tiles.
    copies : int
        Of a period, in `whole`.
    bare : Tile or None
        The other one in its stead, where all hairs are removed.
    """

    whole: Tile
    parts: TileSet
    copies: int
    bare: Tile | None = None


TilesAhead: TypeAlias = dict[tuple[float, int, bool], Tiles]
"""Tiles that were polygonized before there was a blade to set them down on: by spacing, method, and whether small ones
are set down together."""


@dataclass(frozen=True, eq=False)
class MatchingBorders:
    """The borders of tiles that lie on a torus: those of one kind are alike.

    Attributes
    ----------
    shape : (2,) tuple of int
        Steps of the lattice in a tile.
    height : int
        Points in a column.
    colors : (n, m) ndarray of int64
        Of the corners of the tiles on the torus: borders are alike whose ends have one color.
    """

    shape: tuple[int, int]
    height: int
    colors: IntArray

    def columns(self, columns: IntArray) -> IntArray:
        """Return the first column like each one: on a corner, on a border, or itself inside a tile."""
        i, j = self._places(columns)[1]
        on_along, on_across = j == 0, i == 0
        return self._first(columns, np.where(on_along & on_across, 3, np.where(on_along, 1, np.where(on_across, 2, 0))))

    def edges(self, edges: IntArray) -> IntArray:
        """Return the first edge like each one: those that lie in a border's upright plane are."""
        columns, rest = edges // (8 * self.height), edges % (8 * self.height)
        _, (i, j) = self._places(columns)
        in_along = (j == 0) & (edges & ACROSS == 0)
        in_across = (i == 0) & (edges & ALONG == 0)
        # An upright edge over a corner lies in both.
        kind = np.where(in_along & in_across, 3, np.where(in_along, 1, np.where(in_across, 2, 0)))
        return np.asarray(self._first(columns, kind) * 8 * self.height + rest)

    def _places(self, columns: IntArray) -> tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]:
        """Return the tile that each column lies in, and where in it."""
        nx, ny = self.shape
        across = ny * self.colors.shape[1]
        i, j = columns // across, columns % across
        return (i // nx, j // ny), (i % nx, j % ny)

    def _first(self, columns: IntArray, kind: IntArray) -> IntArray:
        """Return the first columns like these, by kind: 1 on a border along, 2 on one across, 3 on a corner."""
        (p, q), (i, j) = self._places(columns)
        count = self.colors.shape
        ends = self.colors + 2 * np.roll(self.colors, -1, axis=0), self.colors + 2 * np.roll(self.colors, -1, axis=1)
        first = columns.copy()
        for number, pairs in ((1, ends[0]), (2, ends[1]), (3, self.colors)):
            seen, where = np.unique(pairs.ravel(), return_index=True)
            place = where[np.searchsorted(seen, pairs[p, q])]
            there = self._column(place // count[1], place % count[1], i, j)
            first = np.where(kind == number, there, first)
        return np.asarray(first)

    def _column(self, p: IntArray, q: IntArray, i: IntArray, j: IntArray) -> IntArray:
        nx, ny = self.shape
        return np.asarray((p * nx + i) * ny * self.colors.shape[1] + q * ny + j)


def split_torus(torus: Tile, shape: tuple[int, int]) -> dict[tuple[int, int], Tile]:
    """Return the tiles that lie on a torus, by place, from the surface of all of it.

    What is inside stays that of the torus: `Tile.runs` are its own.

    Parameters
    ----------
    torus : Tile
    shape : (2,) tuple of int
        Steps of the lattice in a tile.
    """
    counts = [whole // part for whole, part in zip(torus.lattice.shape[:2], shape, strict=True)]
    return {(p, q): _part(torus, shape, (p, q)) for p in range(counts[0]) for q in range(counts[1])}


def _part(torus: Tile, shape: tuple[int, int], place: tuple[int, int]) -> Tile:
    """Return the tile in one place of a torus."""
    (nx, ny), (_, wide, nz) = shape, torus.lattice.shape
    column, rest = torus.edges // (8 * nz), torus.edges % (8 * nz)
    i, j = column // wide, column % wide
    # Vertices are used by their own tile and by those before it: what lies elsewhere is a step on.
    shifts = (i // nx != place[0]) + 2 * (j // ny != place[1])
    names = ((i % nx) * ny + j % ny) * 8 * nz + rest
    own = np.flatnonzero(shifts == 0)
    cells = (place[0] * nx + np.arange(nx))[:, np.newaxis] * wide + place[1] * ny + np.arange(ny)
    size = torus.cells[cells + 1] - torus.cells[cells]
    starts, stops = torus.cells[cells[:, 0]], torus.cells[cells[:, -1] + 1]
    nodes = np.concatenate([torus.nodes[start:stop] for start, stop in zip(starts, stops, strict=True)])
    rows = np.concatenate([np.arange(len(torus.edges)), torus.beyond_rows])[nodes]
    keys = names[rows] * 4 + shifts[rows]
    beyond, first = np.unique(keys[shifts[rows] > 0], return_index=True)
    sources = rows[shifts[rows] > 0][first]
    local = np.where(
        shifts[rows] > 0, len(own) + np.searchsorted(beyond, keys), np.searchsorted(names[own], names[rows])
    )
    return replace(
        torus,
        lattice=replace(torus.lattice, shape=(nx, ny, nz)),
        edges=names[own],
        fractions=torus.fractions[own],
        sides=torus.sides[own],
        upward=torus.upward[own],
        nodes=local.astype(np.int32),
        cells=np.concatenate([[0], np.cumsum(size.ravel())]),
        beyond=np.stack([beyond >> 2, beyond & 3], axis=1),
        beyond_fractions=torus.fractions[sources],
        beyond_sides=torus.sides[sources],
    )
