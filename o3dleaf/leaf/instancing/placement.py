"""The part of a tile that one place uses: all of it, the cells inside an outline, or a solid that it cuts."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.instancing.footprint import Footprint
from o3dleaf.leaf.instancing.rim_loops import (
    CutColumns,
    RimVertices,
    TileVertices,
    cut_cells,
    find_component_roots,
    gather_cells,
    rim_edges,
    use_by_cells,
    use_by_distance,
)
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.leaf.instancing.tile_loops import ABOVE
from o3dleaf.surface.isosurface.polygonize import lattice_positions

Nodes = npt.NDArray[np.int32]
NO_NODES = np.empty((0, 3), dtype=np.int32)


@dataclass(frozen=True, eq=False)
class VertexNumbers:
    """Numbers of a placement's own vertices (n + e,), read as an array; whole tiles share all but the first one.

    Attributes
    ----------
    rank : (n + e,) ndarray of int32
        Added to `start`; −1: not there.
    start : int
    """

    rank: npt.NDArray[np.int32]
    start: int

    def __len__(self) -> int:
        return len(self.rank)

    def __getitem__(self, rows: IntArray | slice) -> npt.NDArray[np.int32]:
        rank = self.rank[rows]
        return np.where(rank >= 0, rank + self.start, -1)


@dataclass(frozen=True, eq=False)
class Placement:
    """A tile in one place.

    The nodes of its triangles are, one after the other: the tile's vertices, those of neighbors
    (`Tile.beyond`), the rim's own vertices, and those of neighbors on the rim.

    Attributes
    ----------
    tile : Tile
    place : (2,) tuple of int
        Number of the tile along and across.
    used : (n,) ndarray of bool or None
        Which of the tile's vertices are there; None: all.
    cells : (nx, ny) ndarray of bool or None
        Which cells have the tile's triangles; None: all.
    cut : (c, 3) ndarray of int32
        The other triangles.
    rim_names, rim_fractions : (e,) ndarrays
        Edges of the window that the rim's vertices lie on, this tile's first, and how far along.
    rim_own : int
        How many of them are this tile's.
    cut_on_rim : (c,) ndarray of bool or None
        Which of the other triangles belong to the rim; None: none.
    inner : (e, 3) ndarray or None
        Instead of a rim: flat positions, in tile (0, 0), of vertices inside a whole tile that was reduced.
    is_whole : bool
        Whether it stands for all of the tile.
    """

    tile: Tile
    place: tuple[int, int]
    used: BoolArray | None
    cells: BoolArray | None
    cut: Nodes
    rim_names: IntArray
    rim_fractions: FloatArray
    rim_own: int = 0
    cut_on_rim: BoolArray | None = None
    inner: FloatArray | None = None
    is_whole: bool = False

    @property
    def nodes(self) -> Nodes:
        """(m, 3) all triangles, gathered when they are requested: what is kept of a place is small."""
        if self.cells is None:
            return self.tile.nodes
        plain = _kept_triangles(self.tile, self.cells)
        return np.concatenate([plain, self.cut]) if len(self.cut) else plain

    @property
    def on_rim(self) -> BoolArray | None:
        """(m,) which triangles belong to the rim; None: none."""
        if self.cells is None or self.cut_on_rim is None:
            return None
        plain = int(np.diff(self.tile.cells)[self.cells.ravel()].sum())
        return np.concatenate([np.zeros(plain, dtype=bool), self.cut_on_rim])

    @property
    def rim_sides(self) -> npt.NDArray[np.uint8]:
        """(e,) the air that each vertex of the rim looks at, `ABOVE` where nobody asks."""
        return np.full(len(self.rim_names), ABOVE, dtype=np.uint8)

    @property
    def present(self) -> BoolArray:
        """(n + e,) which of the tile's vertices and the rim's own ones are there."""
        used = np.ones(len(self.tile.edges), dtype=bool) if self.used is None else self.used
        return np.concatenate([used, np.ones(self.rim_own, dtype=bool)])

    def positions(self, rows: IntArray) -> FloatArray:
        """Return the (m, 3) flat positions of some rows, rising, of the own vertices (n + e,)."""
        tile, count = self.tile, len(self.tile.edges)
        nx, ny, _ = tile.lattice.shape
        start = self.place[0] * nx, self.place[1] * ny, 0
        own, rim = np.split(rows, np.searchsorted(rows, [count]))
        places = lattice_positions(tile.edges[own], tile.fractions[own], tile.lattice.shape, start)
        if self.inner is not None:
            shift = np.array(self.place) * tile.lattice.period
            inner = self.inner[rim - count] + [shift[0], shift[1], 0.0]
            return np.concatenate([tile.lattice.positions(places), inner])
        if len(rim):
            places = np.concatenate([places, self.rim_places(rim - count)])
        return tile.lattice.positions(places)

    def rim_places(self, rows: IntArray) -> FloatArray:
        """Return the lattice coordinates (m, 3) of some of the rim's own vertices."""
        nx, ny, nz = self.tile.lattice.shape
        start = self.place[0] * nx, self.place[1] * ny, 0
        return lattice_positions(self.rim_names[rows], self.rim_fractions[rows], (nx + 1, ny + 1, nz), start)

    def common_vertices(self, shift: int, other: "Placement") -> tuple[IntArray, IntArray]:
        """Return the nodes that are vertices of a neighbor (bits of its shift: along, across), and its rows of them.

        Rows are of the neighbor's own vertices (n + e,).
        """
        vertices, beyond = len(self.tile.edges), self.tile.beyond
        there = np.flatnonzero(beyond[:, 1] == shift)
        nodes, rows = vertices + there, np.searchsorted(other.tile.edges, beyond[there, 0])
        on_rim = np.flatnonzero(self.rim_beyond[1] == shift)
        if not len(on_rim):
            return nodes, rows
        of_rim = np.searchsorted(other.own_rim, self.rim_names_in(other, shift, on_rim))
        nodes = np.concatenate([nodes, vertices + len(beyond) + self.rim_own + on_rim])
        return nodes, np.concatenate([rows, len(other.tile.edges) + of_rim])

    @cached_property
    def own_rim(self) -> IntArray:
        """(e,) names in the tile, rising, of the rim's vertices that are this tile's."""
        return in_tile(self.rim_names[: self.rim_own], self.tile.lattice.shape)[0]

    @cached_property
    def rim_beyond(self) -> tuple[IntArray, IntArray]:
        """Names, in their own tiles, and shifts of the rim's vertices that are not this tile's."""
        return in_tile(self.rim_names[self.rim_own :], self.tile.lattice.shape)

    def rim_names_in(self, other: "Placement", shift: int, rows: IntArray) -> IntArray:  # noqa: ARG002 - of edges
        """Return the names, in the placement that owns them, of some of the rim's vertices that are not this tile's."""
        return self.rim_beyond[0][rows]

    @property
    def node_count(self) -> int:
        """Number of nodes, used or not."""
        return len(self.tile.edges) + len(self.tile.beyond) + len(self.rim_names)

    def component_roots(self) -> IntArray:
        """Return for every node the first node of its component in this tile."""
        return np.asarray(find_component_roots(self.nodes, self.node_count))


def place_whole(tile: Tile, place: tuple[int, int]) -> Placement:
    """Return all of a tile."""
    none = np.empty(0, dtype=np.int64), np.empty(0)
    return Placement(tile, place, None, None, NO_NODES, *none, is_whole=True)


def place_sheets(tile: Tile, footprint: Footprint, place: tuple[int, int]) -> Placement | None:
    """Return the tile over the whole cells inside the outline, open at their edge; None where there are none."""
    shape = np.array(tile.lattice.shape[:2])
    low = np.array(place) * shape
    return sheets_over(tile, footprint.cells(low - 1, low + shape), place)


def sheets_over(tile: Tile, kept: BoolArray, place: tuple[int, int]) -> Placement | None:
    """Return the tile over its `kept` cells (nx + 1, ny + 1), the row and the column before it first."""
    if kept.all():
        return place_whole(tile, place)
    used = np.empty(len(tile.edges), dtype=bool)
    use_by_cells(tile.edges, tile.lattice.shape, kept, used)
    if not used.any():
        return None
    none = np.empty(0, dtype=np.int64), np.empty(0)
    return Placement(tile, place, used, np.ascontiguousarray(kept[1:, 1:]), NO_NODES, *none)


def place_solid(tile: Tile, footprint: Footprint, place: tuple[int, int]) -> Placement | None:
    """Return the solid of a tile cut by the outline, with its part of the rim; None where there is none."""
    shape = np.array(tile.lattice.shape[:2])
    low = np.array(place) * shape
    distance = footprint.distances(low - 1, low + shape + 1)
    in_hole = footprint.in_holes(low - 1, low + shape)
    if not in_hole.any():
        return solid_within(tile, distance[1:, 1:], place)
    if (distance > 0).all():
        return sheets_over(tile, ~in_hole, place)
    raise InputError("levels: a window lies in a tile that the rim cuts; move it inward by a tile, or mesh open sheets")


def solid_within(tile: Tile, distance: FloatArray, place: tuple[int, int]) -> Placement | None:
    """Return the solid of a tile where the `distance` of columns (nx + 1, ny + 1) is positive, and its rim."""
    inside = distance > 0
    if inside.all():
        return place_whole(tile, place)
    if not inside.any():
        return None
    used = np.empty(len(tile.edges), dtype=bool)
    use_by_distance(tile.edges, tile.fractions, tile.upward, tile.lattice.shape, distance, used)
    fractions = np.concatenate([tile.fractions, tile.beyond_fractions])
    vertices = TileVertices(tile.lattice.shape, tile.edges, fractions, tile.beyond_keys)
    columns = CutColumns(distance, *_cut_columns(tile, inside))
    names, fractions = _rim(tile.method, vertices, columns)
    parts = vertices, RimVertices(names, fractions), columns
    count = cut_cells(tile.method, *parts, NO_NODES, np.empty(0, dtype=bool))
    cut, on_rim = np.empty((count, 3), dtype=np.int32), np.empty(count, dtype=bool)
    cut_cells(tile.method, *parts, cut, on_rim)
    kept = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
    is_own = in_tile(names, tile.lattice.shape)[1] == 0
    order = np.concatenate([np.flatnonzero(is_own), np.flatnonzero(~is_own)])
    renumber(cut, order, len(tile.edges) + len(tile.beyond))
    return Placement(tile, place, used, kept, cut, names[order], fractions[order], int(is_own.sum()), on_rim)


def renumber(nodes: Nodes, order: IntArray, start: int) -> None:
    """Give the nodes from `start` on the numbers that they have in a new order."""
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    late = nodes >= start
    nodes[late] = start + rank[nodes[late] - start]


def _kept_triangles(tile: Tile, kept: BoolArray) -> Nodes:
    """Return the triangles over the kept cells (nx, ny)."""
    count = int(np.diff(tile.cells)[kept.ravel()].sum())
    triangles = np.empty((count, 3), dtype=np.int32)
    gather_cells(kept, tile.cells, tile.nodes, triangles)
    return triangles


def _cut_columns(tile: Tile, inside: BoolArray) -> tuple[IntArray, npt.NDArray[np.uint8]]:
    """Return the row (nx + 1, ny + 1) of each column of a cut cell, −1 for others, and the labels of these columns."""
    nx, ny, _ = tile.lattice.shape
    corners = np.stack([inside[:-1, :-1], inside[1:, :-1], inside[:-1, 1:], inside[1:, 1:]])
    cut = corners.any(axis=0) & ~corners.all(axis=0)
    near = np.zeros(inside.shape, dtype=bool)
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        near[i : nx + i, j : ny + j] |= cut
    row_of = np.full(inside.shape, -1)
    row_of[near] = np.arange(near.sum())
    return row_of, tile.columns.labels(np.argwhere(near))


def _rim(method: int, tile: TileVertices, columns: CutColumns) -> tuple[IntArray, FloatArray]:
    """Return the names in the window, rising, and the fractions of the rim's vertices."""
    count = rim_edges(method, tile, columns, np.empty(0, dtype=np.int64), np.empty(0))
    names, fractions = np.empty(count, dtype=np.int64), np.empty(count)
    rim_edges(method, tile, columns, names, fractions)
    return names, fractions


def in_tile(names: IntArray, shape: tuple[int, int, int]) -> tuple[IntArray, IntArray]:
    """Return the names in the tile of edges named in its window, and how many periods on they lie."""
    nx, ny, nz = shape
    column, rest = names // (8 * nz), names % (8 * nz)
    i, j = column // (ny + 1), column % (ny + 1)
    return ((i % nx) * ny + j % ny) * 8 * nz + rest, (i >= nx) + 2 * (j >= ny)
