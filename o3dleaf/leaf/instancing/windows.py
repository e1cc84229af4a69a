"""The plane row by row: what of the tile is in each place of the outline, kept for two rows of places at a time."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple, TypeVar, cast

from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.instancing.components import PlacedTile, find_components
from o3dleaf.leaf.instancing.cut.cut_tile import place_cut
from o3dleaf.leaf.instancing.footprint import Footprint
from o3dleaf.leaf.instancing.placement import place_sheets, place_solid
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
        self._whole: dict[int, PlacedTile] = {}

    def windows(self) -> Iterator[PlacedRows]:
        """Yield every row of places with the row after it."""
        placed: dict[Place, PlacedTile] = {}
        for p in self._rows:
            places = [(row, q) for row in (p, p + 1) for q in self._columns if (row, q) not in placed]
            tiles = map_in_threads(self._place, places)
            placed = {place: tile for place, tile in placed.items() if place[0] >= p}
            placed |= {place: tile for place, tile in zip(places, tiles, strict=True) if tile is not None}
            placed = dict(sorted(placed.items()))
            yield PlacedRows(placed, [place for place in placed if place[0] == p])

    def _place(self, place: Place) -> PlacedTile | None:
        """Return the tile in one place with its components; those of a whole tile are found once."""
        tile, kind = self.tiles.at(place)
        placement = self._placed_alone(tile, self.footprint, place)
        if placement is None:
            return None
        if not placement.is_whole or kind is None:
            return find_components(placement)
        if self.reduced is not None:
            placement = place_reduced(placement, self.reduced[kind])
        if kind not in self._whole:
            self._whole[kind] = find_components(placement)
        return PlacedTile(placement, self._whole[kind].components, self._whole[kind].count, kind)


def map_in_threads(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Return the results of a function for each item, computed on all threads."""
    results: list[R | None] = [None] * len(items)

    def work(first: int, _: int) -> None:
        results[first] = function(items[first])

    run_blocks(work, len(items), 1)
    return cast("list[R]", results)
