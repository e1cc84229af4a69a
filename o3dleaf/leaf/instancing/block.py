"""One flat period as a closed block: two sheets and four walls, opposite walls alike but for the shift.

For solvers with cyclic boundaries: every vertex and triangle of a wall has its like, one period on, in
the wall across from it.
"""

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.instancing.components import LOWER, RIM, UPPER
from o3dleaf.leaf.instancing.placement import in_tile
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.leaf.instancing.tile_loops import ABOVE, INSIDE
from o3dleaf.surface.isosurface.caps import square_triangles
from o3dleaf.surface.isosurface.polygonize import METHODS, lattice_positions

CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
"""Corners of a square of a wall, counter-clockwise in (along the wall, through the blade)."""


def extract_block(tile: Tile) -> tuple[FloatArray, IntArray, npt.NDArray[np.uint8]]:
    """Return vertices (n, 3), flat, triangles (m, 3) and their labels (m,): upper, lower, or rim for the walls.

    Raises
    ------
    InputError
        If the tile was not polygonized by marching cubes.
    """
    if METHODS[tile.method] != "cubes":
        raise InputError("method: the walls of a block need marching cubes; use 'cubes'")
    nx, ny, nz = tile.lattice.shape
    nodes = np.concatenate([tile.edges, tile.beyond[:, 0]])
    shifts = np.concatenate([np.zeros(len(tile.edges), dtype=np.int64), tile.beyond[:, 1]])
    nodes = _rename(nodes, tile.lattice.shape, shifts)
    walls = [_wall(tile, axis, far) for axis in range(2) for far in (False, True)]
    names, triangles = np.unique(np.concatenate([nodes[tile.nodes], *walls]), return_inverse=True)
    fractions = np.zeros(len(names))
    crossed = names & 7 > 0
    fractions[crossed] = tile.fractions[np.searchsorted(tile.edges, in_tile(names[crossed], tile.lattice.shape)[0])]
    places = lattice_positions(names, fractions, (nx + 1, ny + 1, nz))
    sides = np.concatenate([tile.sides, tile.beyond_sides])[tile.nodes[:, 0]]
    labels = np.where(sides == ABOVE, UPPER, LOWER)
    labels = np.concatenate([labels, np.full(sum(map(len, walls)), RIM)]).astype(np.uint8)
    return tile.lattice.positions(places), triangles.reshape(-1, 3), labels


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


def _rename(names: IntArray, shape: tuple[int, int, int], shifts: IntArray) -> IntArray:
    """Return names in the window, with one column more to a row, of edges named in the tile, some periods on."""
    nx, ny, nz = shape
    column, rest = names // (8 * nz), names % (8 * nz)
    return np.asarray(
        ((column // ny + nx * (shifts & 1)) * (ny + 1) + column % ny + ny * (shifts >> 1)) * 8 * nz + rest
    )
