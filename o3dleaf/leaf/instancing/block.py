"""One flat period as a closed block: two sheets and four walls, opposite walls alike but for the shift.

For solvers with cyclic boundaries: every vertex and triangle of a wall has its like, one period on, in
the wall across from it. A file takes it block by block, as it takes a leaf (`assembly`).
"""

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks, run_blocks
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

    Attributes
    ----------
    tile : Tile
    names : (n,) ndarray of int64
        The edges and points of the window that vertices lie on, rising; the window has one column more to a row than
        the tile, and one row more.
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
        nodes = np.empty(len(tile.edges) + len(tile.beyond), dtype=np.int64)
        for start, stop in blocks(len(tile.edges), BATCH_SIZE):
            nodes[start:stop] = _rename(tile.edges[start:stop], tile.lattice.shape)
        nodes[len(tile.edges) :] = _rename(tile.beyond[:, 0], tile.lattice.shape, tile.beyond[:, 1])
        self.tile = tile
        self.names: IntArray = np.unique(np.concatenate([nodes, walls.ravel()]))
        self._nodes = np.empty(len(nodes), dtype=np.int32)
        for start, stop in blocks(len(nodes), BATCH_SIZE):
            self._nodes[start:stop] = np.searchsorted(self.names, nodes[start:stop])
        self._walls = np.searchsorted(self.names, walls).astype(np.int32)

    def __repr__(self) -> str:
        return f"FlatBlock({self.vertices:,} vertices, {self.triangles:,} triangles)"

    @property
    def vertices(self) -> int:
        """Number of vertices."""
        return len(self.names)

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return len(self.tile.nodes) + len(self._walls)

    def emit(self, sink: Sink) -> None:
        """Make every vertex, flat, and every triangle, labelled upper, lower, or rim for the walls; the walls last."""
        run_blocks(lambda start, stop: sink.put_vertices(start, self._places(start, stop)), self.vertices, BATCH_SIZE)
        count = len(self.tile.nodes)
        sides = np.concatenate([self.tile.sides, self.tile.beyond_sides])

        def put(start: int, stop: int) -> None:
            nodes = self.tile.nodes[start:stop]
            labels = np.where(sides[nodes[:, 0]] == ABOVE, UPPER, LOWER).astype(np.uint8)
            sink.put_triangles(start, self._nodes[nodes], labels)

        run_blocks(put, count, BATCH_SIZE)
        sink.put_triangles(count, self._walls, np.full(len(self._walls), RIM, dtype=np.uint8))

    def _places(self, start: int, stop: int) -> FloatArray:
        """Return the positions of the vertices from start to stop."""
        tile, names = self.tile, self.names[start:stop]
        nx, ny, nz = tile.lattice.shape
        fractions, crossed = np.zeros(len(names)), names & 7 > 0
        fractions[crossed] = tile.fractions[np.searchsorted(tile.edges, in_tile(names[crossed], (nx, ny, nz))[0])]
        return tile.lattice.positions(lattice_positions(names, fractions, (nx + 1, ny + 1, nz)))


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
