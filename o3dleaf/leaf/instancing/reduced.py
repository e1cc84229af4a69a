"""A tile simplified or remeshed once, its border locked, so that copies fit one another and the tiles that are cut."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.instancing.placement import Nodes, Placement
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.surface.isosurface.polygonize import lattice_positions
from o3dleaf.surface.mesh.topology import EdgeTable

Reduce = Callable[[FloatArray, IntArray], tuple[FloatArray, IntArray]]
"""Takes (n, 3) vertices and (m, 3) triangles of an open mesh and returns others, those of the border bit for bit."""


@dataclass(frozen=True, eq=False)
class ReducedTile:
    """A simplified or remeshed surface that stands for a whole tile.

    Attributes
    ----------
    used : (n,) ndarray of bool
        Which of the tile's vertices are left: those of its border.
    inner : (k, 3) ndarray
        Flat positions, in tile (0, 0), of the vertices inside.
    nodes : (m, 3) ndarray of int32
        Triangles: vertices of the tile, of its neighbors, and inside, in the order of `Placement`.
    """

    used: BoolArray
    inner: FloatArray
    nodes: Nodes


def reduce_tile(tile: Tile, reduce: Reduce) -> ReducedTile:
    """Return the whole tile as `reduce` simplifies or remeshes it.

    Raises
    ------
    ReconstructionError
        If it moved or dropped a vertex of the border.
    """
    positions = _positions(tile)
    edges = EdgeTable.of(tile.nodes.astype(np.int64))
    border = np.unique(edges.ends[edges.count == 1])
    vertices, triangles = reduce(positions, tile.nodes.astype(np.int64))
    border_nodes = {row.tobytes(): int(node) for node, row in zip(border, positions[border], strict=True)}
    node = np.array([border_nodes.get(row.tobytes(), -1) for row in np.ascontiguousarray(vertices)])
    if np.unique(node[node >= 0]).size != len(border) or (node >= 0).sum() != len(border):
        raise ReconstructionError("simplifying changed the tile's border; simplify it less")
    inside = node < 0
    node[inside] = len(positions) + np.arange(inside.sum())
    used = np.zeros(len(tile.edges), dtype=bool)
    used[border[border < len(tile.edges)]] = True
    return ReducedTile(used, vertices[inside], node[triangles].astype(np.int32))


def place_reduced(placement: Placement, reduced: ReducedTile) -> Placement:
    """Return the placement of a whole tile with its reduced form in its stead."""
    count = len(reduced.inner)
    names = np.zeros(count, dtype=np.int64), np.zeros(count)
    tile, place = placement.tile, placement.place
    cells = np.zeros(tile.lattice.shape[:2], dtype=bool)
    return Placement(tile, place, reduced.used, cells, reduced.nodes, *names, count, inner=reduced.inner, is_whole=True)


def _positions(tile: Tile) -> FloatArray:
    """Return the flat positions of the tile's vertices and of those beyond it."""
    shape = tile.lattice.shape
    inner = lattice_positions(tile.edges, tile.fractions, shape)
    others = lattice_positions(tile.beyond[:, 0], tile.beyond_fractions, shape)
    others[:, 0] += (tile.beyond[:, 1] & 1) * shape[0]
    others[:, 1] += (tile.beyond[:, 1] >> 1) * shape[1]
    return tile.lattice.positions(np.concatenate([inner, others]))
