"""The placement of a tile that a margin cuts: its triangles clipped along it, alone or with the wall of the solid."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.instancing.cut.clip_loops import (
    CutVertices,
    MarginColumns,
    clip_triangles,
    list_cuts,
    place_cuts,
    use_by_sign,
)
from o3dleaf.leaf.instancing.cut.wall_loops import put_up_wall
from o3dleaf.leaf.instancing.footprint import EdgeThickness, Footprint
from o3dleaf.leaf.instancing.placement import Placement, place_whole, renumber, sheets_over
from o3dleaf.leaf.instancing.rim_loops import TileVertices, use_by_cells
from o3dleaf.leaf.instancing.tile import Tile

NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False, kw_only=True)
class CutPlacement(Placement):
    """A tile cut along a margin in one place; its rim's vertices are those of the cut, named by edges of triangles.

    Ends of edges are vertices of the tile, then those of neighbors (`Tile.beyond`).

    Attributes
    ----------
    cut_places : (e, 3) ndarray
        Their places in the window, in steps of the lattice.
    cut_shifts : (e,) ndarray
        The neighbor that each belongs to (bits: along, across), this tile's first.
    """

    cut_places: FloatArray
    cut_shifts: IntArray

    @property
    def rim_sides(self) -> npt.NDArray[np.uint8]:
        """(e,) the air that each vertex of the cut looks at."""
        first = self.ends(np.arange(len(self.rim_names)))[:, 0]
        return np.asarray(np.concatenate([self.tile.sides, self.tile.beyond_sides])[first])

    def rim_places(self, rows: IntArray) -> FloatArray:
        """Return the lattice coordinates (m, 3) of some of the cut's own vertices."""
        nx, ny, _ = self.tile.lattice.shape
        return np.asarray(self.cut_places[rows] + [self.place[0] * nx, self.place[1] * ny, 0])

    @cached_property
    def own_rim(self) -> IntArray:
        """(e,) names, rising, of the cut's vertices that are this tile's."""
        return self.rim_names[: self.rim_own]

    @cached_property
    def rim_beyond(self) -> tuple[IntArray, IntArray]:
        """Names, in this tile, and shifts of the others."""
        return self.rim_names[self.rim_own :], self.cut_shifts[self.rim_own :]

    def ends(self, rows: IntArray) -> IntArray:
        """Return the ends (m, 2) of the edges of triangles that some vertices of the cut lie on."""
        return _ends(self.rim_names[rows], self.tile)

    def rim_names_in(self, other: Placement, shift: int, rows: IntArray) -> IntArray:
        """Return the names, in the tile of the neighbor that owns them, of some vertices of the cut beyond this one."""
        count, tile = len(self.tile.edges), other.tile
        edge, neighbor = self.tile.beyond[self.ends(self.rim_own + rows) - count].transpose(2, 0, 1)
        left = neighbor & ~shift
        beyond = len(tile.edges) + np.searchsorted(tile.beyond_keys, edge * 4 + left)
        ends = np.where(left > 0, beyond, np.searchsorted(tile.edges, edge))
        size = 4 * (len(tile.edges) + len(tile.beyond))
        return np.asarray(4 * (ends.min(axis=1) * size + ends.max(axis=1)))


def place_cut(tile: Tile, footprint: Footprint, place: tuple[int, int], *, walled: bool) -> Placement | None:
    """Return the tile cut along the outline, closed by its wall or open there; None where there is nothing of it."""
    shape = np.array(tile.lattice.shape[:2])
    low = np.array(place) * shape
    distance = footprint.single_distances(low, low + shape + 1)
    in_window = footprint.in_holes(low - 1, low + shape)
    if in_window.any() and (distance > 0).all():
        return sheets_over(tile, ~in_window, place)
    return cut_tile(tile, distance, place, in_window, walled=walled, edge=footprint.edge)


def cut_tile(
    tile: Tile,
    distance: FloatArray,
    place: tuple[int, int],
    in_window: BoolArray,
    *,
    walled: bool,
    edge: EdgeThickness | None = None,
) -> Placement | None:
    """Return the tile where the `distance` of columns (nx + 1, ny + 1) is positive, cut where it is zero.

    Parameters
    ----------
    tile : Tile
    distance : (nx + 1, ny + 1) ndarray
    place : (2,) tuple of int
    in_window : (nx + 1, ny + 1) ndarray of bool
        Cells that are left out, whole ones; the row and the column before the tile first.
    walled : bool
        Whether the wall closes it to a solid, or it is open there.
    edge : EdgeThickness, optional

    Raises
    ------
    ReconstructionError
        If the wall has a gap.
    """
    inside = distance > 0
    if inside.all():
        return place_whole(tile, place)
    if not inside.any():
        return None
    corners = np.stack([inside[:-1, :-1], inside[1:, :-1], inside[:-1, 1:], inside[1:, 1:]])
    kept, cut = np.asarray(corners.all(axis=0)), corners.any(axis=0)
    columns = MarginColumns(distance, np.flatnonzero(cut & ~kept))
    vertices = _in_window(tile)
    used = np.empty(len(tile.edges), dtype=bool)
    use_by_sign(vertices, distance, used)
    if in_window.any():
        beside = np.empty_like(used)
        use_by_cells(tile.edges, tile.lattice.shape, ~in_window, beside)
        used &= beside
        kept &= ~in_window[1:, 1:]
    found, shifts = _cut_vertices(tile, vertices, columns)
    places, upright = _edge_places(tile, found.places, place, edge)
    nodes, on_wall = _cut_triangles(tile, vertices, columns, found, upright if walled else None)
    # This tile's own first.
    order = np.lexsort((found.names, shifts))
    renumber(nodes, order, len(vertices.edges))
    own = int(np.sum(shifts == 0))
    rim = found.names[order], np.empty(0), own, on_wall
    return CutPlacement(tile, place, used, kept, nodes, *rim, cut_places=places[order], cut_shifts=shifts[order])


def _in_window(tile: Tile) -> TileVertices:
    """Return the vertices of a tile and those of neighbors, named as edges of the window, which is a column wider."""
    nx, ny, nz = tile.lattice.shape
    names = np.concatenate([tile.edges, tile.beyond[:, 0]])
    shifts = np.concatenate([np.zeros(len(tile.edges), dtype=np.int64), tile.beyond[:, 1]])
    column, rest = names // (8 * nz), names % (8 * nz)
    i, j = column // ny + nx * (shifts & 1), column % ny + ny * (shifts >> 1)
    fractions = np.concatenate([tile.fractions, tile.beyond_fractions])
    return TileVertices((nx + 1, ny + 1, nz), (i * (ny + 1) + j) * 8 * nz + rest, fractions, NONE)


def _ends(names: IntArray, tile: Tile) -> IntArray:
    """Return the ends (m, 2) of named edges of triangles: vertices of the tile, then those of neighbors."""
    return np.stack(np.divmod(names, 4 * (len(tile.edges) + len(tile.beyond))), axis=1) >> 2


def _cut_vertices(tile: Tile, vertices: TileVertices, columns: MarginColumns) -> tuple[CutVertices, IntArray]:
    """Return the vertices of the cut, and the neighbors that they belong to."""
    listed = vertices, tile.nodes, tile.cells, columns
    count = list_cuts(*listed, NONE, NONE)
    names, window = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    list_cuts(*listed, names, window)
    names = np.unique(names)
    # In the window all are its own.
    first = np.array([0, *[len(names)] * 4])
    found = CutVertices(names, first, np.empty((len(names), 3)), np.empty((len(names), 2), dtype=np.int64))
    place_cuts(vertices, columns.distance, found)
    neighbors = np.concatenate([np.zeros(len(tile.edges), dtype=np.int64), tile.beyond[:, 1]])[_ends(names, tile)]
    return found, neighbors[:, 0] & neighbors[:, 1]


def _edge_places(
    tile: Tile, places: FloatArray, place: tuple[int, int], edge: EdgeThickness | None
) -> tuple[FloatArray, FloatArray]:
    """Return places (e, 3) in the window that go to the world with the edge's thickness, and a wall's corners (e, 3).

    Those are in the unit of length, as high as they will be in the world: what is a polygon in the plane of heights
    before thickness is no longer cut into triangles by the same diagonals after it.
    """
    upright = places * np.array(tile.lattice.spacing)
    if edge is None:
        return places, upright
    (nx, ny, _), low, step = tile.lattice.shape, tile.lattice.origin[2], tile.lattice.spacing[2]
    flat = tile.lattice.positions(places + np.array([place[0] * nx, place[1] * ny, 0]))
    thickness, ratio = edge(flat[:, :2])
    heights = flat[:, 2] * ratio
    upright[:, 2] = heights * thickness
    return np.column_stack([places[:, :2], (heights - low) / step]), upright


def _cut_triangles(
    tile: Tile, vertices: TileVertices, columns: MarginColumns, found: CutVertices, upright: FloatArray | None
) -> tuple[npt.NDArray[np.int32], BoolArray | None]:
    """Return the clipped triangles and those of the wall, if it has corners, and which ones are the wall's."""
    most = int(np.diff(tile.cells)[columns.cells].sum())
    clipped, borders = np.empty((2 * most, 3), dtype=np.int32), np.empty((most, 2), dtype=np.int64)
    ends = np.empty(len(columns.cells) + 1, dtype=np.int64)
    count = clip_triangles(vertices, tile.nodes, tile.cells, columns, found, clipped, borders, ends)
    faces = clipped[:count].copy()
    if upright is None:
        return faces, None
    wall = np.empty((3 * int(ends[-1]), 3), dtype=np.int64)
    count = put_up_wall(tile.lattice.shape[1], columns, borders[: ends[-1]], ends, found, upright, wall)
    if count < 0:
        raise ReconstructionError("the wall over the outline has a gap at this spacing; use another spacing")
    start = len(tile.edges) + len(tile.beyond)
    nodes = np.concatenate([faces, (wall[:count] + start).astype(np.int32)])
    return nodes, np.arange(len(nodes)) >= len(faces)
