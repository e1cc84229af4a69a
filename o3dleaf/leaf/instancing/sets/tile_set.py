"""A set of tiles whose borders match, polygonized together once, and which of them lies in each place."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.instancing.tile import Tile, TileColumns, TileLattice

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

    def samples(self, columns: IntArray) -> FloatArray:
        """Return the samples (m, nz) of columns (m, 2) of the plane, > 0 inside, voids filled and islands removed."""
        nx, ny, nz = self.lattice.shape
        places, within = np.divmod(columns, np.array([nx, ny]))
        places, number = np.unique(places, axis=0, return_inverse=True)
        tiles = [self.at((p, q))[0] for p, q in places.tolist()]
        samples = np.empty((len(columns), nz))
        for tile in dict.fromkeys(tiles):
            rows = np.flatnonzero(np.array([each is tile for each in tiles])[number.ravel()])
            samples[rows] = tile.columns.samples(within[rows])
        return samples


class Tiles(NamedTuple):
    """The tiles that are set down over a blade.

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


@dataclass(frozen=True, eq=False)
class PartColumns:
    """Columns of a part of what was polygonized together, which begin at its column `first` (2,)."""

    whole: TileColumns
    first: IntArray

    def labels(self, columns: IntArray) -> npt.NDArray[np.uint8]:
        """Return the labels (m, nz) of the samples of some columns (m, 2)."""
        return self.whole.labels(columns + self.first)

    def samples(self, columns: IntArray) -> FloatArray:
        """Return these samples (m, nz)."""
        return self.whole.samples(columns + self.first)


def split_torus(torus: Tile, shape: tuple[int, int]) -> dict[tuple[int, int], Tile]:
    """Return the tiles that lie on a torus, by place, from the surface of all of it.

    Their columns are looked up in the torus, and `Tile.runs` stay its own.

    Parameters
    ----------
    torus : Tile
    shape : (2,) tuple of int
        Steps of the lattice in a tile.
    """
    counts = [whole // part for whole, part in zip(torus.lattice.shape[:2], shape, strict=True)]
    copies = torus.beyond_rows
    return {(p, q): _part(torus, copies, shape, (p, q)) for p in range(counts[0]) for q in range(counts[1])}


def _part(torus: Tile, copies: IntArray, shape: tuple[int, int], place: tuple[int, int]) -> Tile:
    """Return the tile in one place of a torus; `copies` are the vertices that those beyond it are copies of."""
    (nx, ny), (_, wide, nz) = shape, torus.lattice.shape
    row = nx * wide * 8 * nz
    start, stop = np.searchsorted(torus.edges, [place[0] * row, (place[0] + 1) * row])
    own = start + np.flatnonzero(torus.edges[start:stop] // (8 * nz) % wide // ny == place[1])
    own_names = _named(torus.edges[own], torus, shape, place)[0]
    cells = (place[0] * nx + np.arange(nx))[:, np.newaxis] * wide + place[1] * ny + np.arange(ny)
    size = torus.cells[cells + 1] - torus.cells[cells]
    starts, stops = torus.cells[cells[:, 0]], torus.cells[cells[:, -1] + 1]
    nodes = np.concatenate([torus.nodes[start:stop] for start, stop in zip(starts, stops, strict=True)])
    rows, away = nodes.astype(np.int64), nodes >= len(torus.edges)
    rows[away] = copies[rows[away] - len(torus.edges)]
    names, shifts = _named(torus.edges[rows], torus, shape, place)
    keys, elsewhere = names * 4 + shifts, shifts > 0
    beyond, first = np.unique(keys[elsewhere], return_index=True)
    sources = rows[elsewhere][first]
    local = np.where(elsewhere, len(own) + np.searchsorted(beyond, keys), np.searchsorted(own_names, names))
    return replace(
        torus,
        lattice=replace(torus.lattice, shape=(nx, ny, nz)),
        columns=PartColumns(torus.columns, np.array(place) * [nx, ny]),
        edges=own_names,
        fractions=torus.fractions[own],
        sides=torus.sides[own],
        upward=torus.upward[own],
        nodes=local.astype(np.int32),
        cells=np.concatenate([[0], np.cumsum(size.ravel())]),
        beyond=np.stack([beyond >> 2, beyond & 3], axis=1),
        beyond_fractions=torus.fractions[sources],
        beyond_sides=torus.sides[sources],
    )


def _named(edges: IntArray, torus: Tile, shape: tuple[int, int], place: tuple[int, int]) -> tuple[IntArray, IntArray]:
    """Return the names of a torus' edges in the tiles that they lie in, and where these lie, seen from one place.

    Vertices are used by their own tile and by those before it: what lies elsewhere is a step on.
    """
    (nx, ny), (_, wide, nz) = shape, torus.lattice.shape
    column, rest = edges // (8 * nz), edges % (8 * nz)
    i, j = column // wide, column % wide
    shifts = (i // nx != place[0]) + 2 * (j // ny != place[1])
    return ((i % nx) * ny + j % ny) * 8 * nz + rest, shifts
