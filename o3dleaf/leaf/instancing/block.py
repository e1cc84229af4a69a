"""One flat period as a closed block: two sheets and four walls, opposite walls alike but for the shift.

For solvers with cyclic boundaries: every vertex and triangle of a wall has its like, one period on, in
the wall across from it. A file takes it block by block, as it takes a leaf (`assembly`).
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.instancing.assembly import BATCH_SIZE, Sink
from o3dleaf.leaf.instancing.components import LOWER, RIM, UPPER
from o3dleaf.leaf.instancing.placement import in_tile
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.leaf.instancing.tile_loops import ABOVE, INSIDE
from o3dleaf.surface.isosurface.caps import square_triangles
from o3dleaf.surface.isosurface.polygonize import METHODS, lattice_positions

CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
"""Corners of a square of a wall, counter-clockwise in (along the wall, through the blade)."""


class FlatBlock:
    """The surface of a flat period and of its walls: its vertices numbered, its blocks made one by one.

    Vertices are numbered in the order of the edges and points of the window that they lie on; the window has one column
    more to a row than the tile, and one row more. The tile's own keep their order, so that the others alone are listed:
    the points and edges of the walls, and what neighbors' vertices are copies of.

    Attributes
    ----------
    tile : Tile
    others : (m,) ndarray of int64
        The edges and points of the window that the others lie on, rising.
    before : (m,) ndarray of int64
        How many of the tile's own vertices come before each of them.
    """

    def __init__(self, tile: Tile) -> None:
        """Give every vertex its number.

        Raises
        ------
        InputError
            If the tile was not polygonized by marching cubes.
        """
        if METHODS[tile.method] != "cubes":
            raise InputError("method: the walls of a block need marching cubes; use 'cubes'")
        walls = np.concatenate([_wall(tile, axis, far) for axis in range(2) for far in (False, True)])
        beyond = _rename(tile.beyond[:, 0], tile.lattice.shape, tile.beyond[:, 1])
        names, self.tile = np.unique(np.concatenate([beyond, walls.ravel()])), tile
        rows, own = _rows(tile, names)
        self.others, self.before = names[~own], rows[~own]
        numbers = np.empty(len(names), dtype=np.int32)
        numbers[own], numbers[~own] = self._numbers_of_own(rows[own]), self.before + np.arange(len(self.others))
        self._beyond, self._walls = (numbers[np.searchsorted(names, each)] for each in (beyond, walls))

    def __repr__(self) -> str:
        return f"FlatBlock({self.vertices:,} vertices, {self.triangles:,} triangles)"

    @property
    def vertices(self) -> int:
        """Number of vertices."""
        return len(self.tile.edges) + len(self.others)

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return len(self.tile.nodes) + len(self._walls)

    def emit(self, sink: Sink) -> None:
        """Make every vertex, flat, and every triangle, labelled upper, lower, or rim for the walls; the walls last."""
        run_blocks(lambda start, stop: sink.put_vertices(start, self._places(start, stop)), self.vertices, BATCH_SIZE)
        tile, own = self.tile, len(self.tile.edges)

        def put(start: int, stop: int) -> None:
            nodes = tile.nodes[start:stop]
            numbers, sides = np.empty(nodes.shape, dtype=np.int32), np.empty(nodes.shape, dtype=np.uint8)
            here = nodes < own
            numbers[here], sides[here] = self._numbers_of_own(nodes[here]), tile.sides[nodes[here]]
            numbers[~here], sides[~here] = self._beyond[nodes[~here] - own], tile.beyond_sides[nodes[~here] - own]
            sink.put_triangles(start, numbers, np.where(sides[:, 0] == ABOVE, UPPER, LOWER).astype(np.uint8))

        run_blocks(put, len(tile.nodes), BATCH_SIZE)
        sink.put_triangles(len(tile.nodes), self._walls, np.full(len(self._walls), RIM, dtype=np.uint8))

    def _numbers_of_own(self, rows: npt.NDArray[np.integer[Any]]) -> IntArray:
        """Return the numbers of some of the tile's own vertices."""
        return rows + np.searchsorted(self.before, rows, side="right")

    def _places(self, start: int, stop: int) -> FloatArray:
        """Return the positions of the vertices from start to stop."""
        tile, shape = self.tile, self.tile.lattice.shape
        others = self.before + np.arange(len(self.others))
        first, last = np.searchsorted(others, (start, stop))
        here = np.ones(stop - start, dtype=bool)
        here[others[first:last] - start] = False
        own = slice(start - first, stop - last)
        names, fractions = np.empty(len(here), dtype=np.int64), np.zeros(len(here))
        names[here], fractions[here] = _rename(tile.edges[own], shape), tile.fractions[own]
        names[~here] = added = self.others[first:last]
        crossed = added & 7 > 0
        rows = np.searchsorted(tile.edges, in_tile(added[crossed], shape)[0])
        fractions[np.flatnonzero(~here)[crossed]] = tile.fractions[rows]
        nx, ny, nz = shape
        return tile.lattice.positions(lattice_positions(names, fractions, (nx + 1, ny + 1, nz)))


def _rows(tile: Tile, names: IntArray) -> tuple[IntArray, BoolArray]:
    """Return how many of a tile's vertices come before names in the window, and which of these are vertices of it."""
    nx, ny, nz = tile.lattice.shape
    column, rest = names // (8 * nz), names % (8 * nz)
    i, j = column // (ny + 1), column % (ny + 1)
    inside = (i < nx) & (j < ny)
    # What lies beyond the tile comes before all of the next row.
    named = (i * ny + j) * 8 * nz + np.where(inside, rest, 0)
    rows = np.searchsorted(tile.edges, named)
    return rows, inside & (tile.edges[np.minimum(rows, len(tile.edges) - 1)] == named)


def _wall(tile: Tile, axis: int, far: bool) -> IntArray:  # noqa: FBT001 - one wall or the one across from it
    """Return the triangles (m, 3), by names in the window, of the wall at the beginning or end of an axis."""
    nx, ny, nz = tile.lattice.shape
    length = (ny, nx)[axis]
    number = np.arange(length + 1) % length
    columns = number if axis == 0 else number * ny
    inside = tile.runs.expand(columns) == INSIDE
    u, v = np.meshgrid(np.arange(length), np.arange(nz - 1), indexing="ij")
    corners = [(u + a, v + b) for a, b in CORNERS]
    code = sum(inside[corner].astype(np.int64) << k for k, corner in enumerate(corners))
    wall = (nx, ny)[axis] if far else 0

    def name(u: IntArray, v: IntArray, direction: int) -> IntArray:
        i, j = (wall, u) if axis == 0 else (u, wall)
        return ((i * (ny + 1) + j) * nz + v) * 8 + direction

    sideways = 2 if axis == 0 else 1
    vertices = np.stack(
        [name(*corner, 0) for corner in corners]
        + [name(u, v, sideways), name(u + 1, v, 4), name(u, v + 1, sideways), name(u, v, 4)],
        axis=-1,
    )
    parts = []
    for kind in range(1, 16):
        squares = vertices[code == kind]
        parts += [squares[:, list(triangle)] for triangle in square_triangles(kind)]
    triangles = np.concatenate(parts)
    # (across, up) and (along, up) turn about along and minus across.
    outward = far if axis == 0 else not far
    return triangles if outward else triangles[:, ::-1]


def _rename(names: IntArray, shape: tuple[int, int, int], shifts: IntArray | int = 0) -> IntArray:
    """Return names in the window, with one column more to a row, of edges named in the tile, some periods on."""
    nx, ny, nz = shape
    column, rest = names // (8 * nz), names % (8 * nz)
    return np.asarray(
        ((column // ny + nx * (shifts & 1)) * (ny + 1) + column % ny + ny * (shifts >> 1)) * 8 * nz + rest
    )
