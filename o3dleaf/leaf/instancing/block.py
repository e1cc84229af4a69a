"""One flat period as a closed block: two sheets and four walls, opposite walls alike but for the shift.

For solvers with cyclic boundaries: every vertex and triangle of a wall has its like, one period on, in
the wall across from it. A file takes it block by block, as it takes a leaf (`assembly`).
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.resources.scratch import ROWS, GrowingArray, made_by_rows, scratch_array
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
    before, numbers : (m,) ndarrays of int64
        How many of the tile's own vertices come before each of them, and how many of all.
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
        self.tile, found = tile, GrowingArray(np.int64, (3,))
        for axis, far in product(range(2), (False, True)):
            for triangles in _wall(tile, axis, far):
                found.append(triangles)
        walls, beyond = found.whole(), _rename(tile.beyond[:, 0], tile.lattice.shape, tile.beyond[:, 1])
        self.others, self.before = _others(tile, beyond, walls.reshape(-1))
        self.numbers = made_by_rows(
            self.others.shape, lambda *part: self.before[slice(*part)] + np.arange(*part), np.int64
        )
        self._beyond = self._numbers_of(beyond)
        self._walls = made_by_rows(walls.shape, lambda *part: self._numbers_of(walls[slice(*part)]), np.int32)

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

        def put_walls(start: int, stop: int) -> None:
            rim = np.full(stop - start, RIM, dtype=np.uint8)
            sink.put_triangles(len(tile.nodes) + start, self._walls[start:stop], rim)

        run_blocks(put_walls, len(self._walls), BATCH_SIZE)

    def _numbers_of(self, names: IntArray) -> IntArray:
        """Return the numbers of vertices by their names in the window."""
        rows, own = _rows(self.tile, names)
        return np.where(own, self._numbers_of_own(rows), rows + np.searchsorted(self.others, names))

    def _numbers_of_own(self, rows: npt.NDArray[np.integer[Any]]) -> IntArray:
        """Return the numbers of some of the tile's own vertices."""
        return rows + np.searchsorted(self.before, rows, side="right")

    def _places(self, start: int, stop: int) -> FloatArray:
        """Return the positions of the vertices from start to stop."""
        tile, shape = self.tile, self.tile.lattice.shape
        first, last = np.searchsorted(self.numbers, (start, stop))
        here = np.ones(stop - start, dtype=bool)
        here[self.numbers[first:last] - start] = False
        own = slice(start - first, stop - last)
        names, fractions = np.empty(len(here), dtype=np.int64), np.zeros(len(here))
        names[here], fractions[here] = _rename(tile.edges[own], shape), tile.fractions[own]
        names[~here] = added = self.others[first:last]
        crossed = added & 7 > 0
        rows = np.searchsorted(tile.edges, in_tile(added[crossed], shape)[0])
        fractions[np.flatnonzero(~here)[crossed]] = tile.fractions[rows]
        nx, ny, nz = shape
        return tile.lattice.positions(lattice_positions(names, fractions, (nx + 1, ny + 1, nz)))


def _others(tile: Tile, *names: IntArray) -> tuple[IntArray, IntArray]:
    """Return the distinct names that are no vertices of a tile, rising, and how many of its vertices come before each.

    They are sorted where they lie: on the walls of a fine tile there are many.
    """
    every = scratch_array((sum(map(len, names)),), np.int64)
    np.concatenate(names, out=every)
    every.sort()
    others, before = GrowingArray(np.int64), GrowingArray(np.int64)
    for start, stop in blocks(len(every), ROWS):
        some = every[start:stop]
        some = some[some != np.concatenate([every[start - 1 : start] if start else [-1], some[:-1]])]
        rows, own = _rows(tile, some)
        others.append(some[~own])
        before.append(rows[~own])
    return others.whole(), before.whole()


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


def _wall(tile: Tile, axis: int, far: bool) -> Iterator[IntArray]:  # noqa: FBT001 - one wall or the one across from it
    """Yield the triangles (m, 3), by names in the window, of the wall at the beginning or end of an axis."""
    nx, ny, nz = tile.lattice.shape
    length = (ny, nx)[axis]
    number = np.arange(length + 1) % length
    columns = number if axis == 0 else number * ny
    inside = tile.runs.expand(columns) == INSIDE
    code = np.zeros((length, nz - 1), dtype=np.uint8)
    for k, (a, b) in enumerate(CORNERS):
        code |= inside[a : length + a, b : nz - 1 + b].astype(np.uint8) << k
    wall = (nx, ny)[axis] if far else 0

    def name(u: IntArray, v: IntArray, direction: int) -> IntArray:
        i, j = (wall, u) if axis == 0 else (u, wall)
        return ((i * (ny + 1) + j) * nz + v) * 8 + direction

    sideways = 2 if axis == 0 else 1
    vertices = [*((*corner, 0) for corner in CORNERS), (0, 0, sideways), (1, 0, 4), (0, 1, sideways), (0, 0, 4)]
    # (across, up) and (along, up) turn about along and minus across.
    turn = 1 if far == (axis == 0) else -1
    for kind in range(1, 16):
        squares = np.flatnonzero(code == kind)
        for triangle, (start, stop) in product(square_triangles(kind), blocks(len(squares), ROWS)):
            u, v = np.divmod(squares[start:stop], nz - 1)
            corners = [vertices[corner] for corner in triangle[::turn]]
            yield np.stack([name(u + a, v + b, direction) for a, b, direction in corners], axis=1)


def _rename(names: IntArray, shape: tuple[int, int, int], shifts: IntArray | int = 0) -> IntArray:
    """Return names in the window, with one column more to a row, of edges named in the tile, some periods on."""
    nx, ny, nz = shape
    column, rest = names // (8 * nz), names % (8 * nz)
    return np.asarray(
        ((column // ny + nx * (shifts & 1)) * (ny + 1) + column % ny + ny * (shifts >> 1)) * 8 * nz + rest
    )
