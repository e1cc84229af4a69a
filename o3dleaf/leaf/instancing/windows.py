"""The plane row by row: what of the tile is in each place of the outline, kept for two rows of places at a time."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple, TypeVar, cast

from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.instancing.components import PlacedTile, TileParts
from o3dleaf.leaf.instancing.cut.cut_tile import place_cut
from o3dleaf.leaf.instancing.footprint import OUTSIDE, WHOLE, Footprint
from o3dleaf.leaf.instancing.placement import place_sheets, place_solid, place_whole
from o3dleaf.leaf.instancing.reduced import ReducedTile, place_reduced
from o3dleaf.leaf.instancing.sets.tile_set import TileSet

Place = tuple[int, int]
"""Number of a tile along and across."""

T = TypeVar("T")
R = TypeVar("R")


class PlacedRows(NamedTuple):
    """A row of places and the row after it, whose vertices the triangles of the first one use.

    Attributes
    ----------
    placed : dict
        The tile in each place of both rows, in order.
    row : list of places
        Those of the first row.
    """

    placed: dict[Place, PlacedTile]
    row: list[Place]

    def neighbors(self, place: Place) -> dict[int, Place]:
        """Return the neighbors that a tile's triangles use vertices of, by shift (bits: along, across)."""
        places = {shift: (place[0] + (shift & 1), place[1] + (shift >> 1)) for shift in (1, 2, 3)}
        return {shift: neighbor for shift, neighbor in places.items() if neighbor in self.placed}


class TilePlacer:
    """Places tiles, or their reduced forms, wherever an outline has room for them.

    Parameters
    ----------
    tiles : TileSet
    footprint : Footprint
    closed : bool
        Whether the outline cuts a solid, or two sheets.
    cut : bool
        Whether triangles are cut along the outline; else sheets are whole cells, and a solid is marched.
    reduced : sequence of ReducedTile, optional
        What stands for the tiles that the outline does not cut, one for each of the set.
    """

    def __init__(
        self, tiles: TileSet, footprint: Footprint, *, closed: bool, cut: bool, reduced: Sequence[ReducedTile] | None
    ) -> None:
        self.tiles, self.footprint, self.reduced = tiles, footprint, reduced
        self._placed_alone = partial(place_cut, walled=closed) if cut else place_solid if closed else place_sheets
        nx, ny, _ = tiles.lattice.shape
        (first_i, first_j), (last_i, last_j) = footprint.box.tolist()
        # Vertices in the last column belong to the tile that begins there.
        self._rows = range(first_i // nx, last_i // nx + 1)
        self._columns = range(first_j // ny, last_j // ny + 1)
        self._whole: dict[int, TileParts] = {}

    def windows(self) -> Iterator[PlacedRows]:
        """Yield every row of places with the row after it."""
        row = self._row(self._rows.start)
        for p in self._rows:
            following = self._row(p + 1)
            yield PlacedRows(row | following, list(row))
            row = following

    def _row(self, p: int) -> dict[Place, PlacedTile]:
        """Return the tiles in a row of places; what the outline leaves out or leaves whole is told at once."""
        nx, ny, _ = self.tiles.lattice.shape
        strip = self.footprint.strip(p * nx, (p + 1) * nx)
        coverage = dict(zip(self._columns, strip.coverage(p, self._columns, (nx, ny)).tolist(), strict=True))
        places = [(p, q) for q in self._columns if coverage[q] != OUTSIDE]
        tiles = map_in_threads(lambda place: self._place(strip, place, whole=coverage[place[1]] == WHOLE), places)
        return {place: tile for place, tile in zip(places, tiles, strict=True) if tile is not None}

    def _place(self, strip: Footprint, place: Place, *, whole: bool) -> PlacedTile | None:
        """Return the tile in one place; what is known of a whole tile is found once."""
        tile, kind = self.tiles.at(place)
        placement = place_whole(tile, place) if whole else self._placed_alone(tile, strip, place)
        if placement is None:
            return None
        if not placement.is_whole or kind is None:
            return PlacedTile(placement, TileParts(placement))
        if self.reduced is not None:
            placement = place_reduced(placement, self.reduced[kind])
        if kind not in self._whole:
            self._whole[kind] = TileParts(placement, shared=True)
        return PlacedTile(placement, self._whole[kind])


def map_in_threads(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Return the results of a function for each item, computed on all threads."""
    results: list[R | None] = [None] * len(items)

    def work(first: int, _: int) -> None:
        results[first] = function(items[first])

    run_blocks(work, len(items), 1)
    return cast("list[R]", results)
