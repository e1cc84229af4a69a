"""One period of a periodic surface, polygonized once to be set down everywhere."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.instancing.runs import Runs
from o3dleaf.leaf.instancing.tile_loops import INSIDE

TINY = 1e-300
"""Size of a sample that is zero: its sign is what says where it belongs."""


@dataclass(frozen=True)
class TileLattice:
    """The lattice that one period is sampled on; it divides the period.

    Attributes
    ----------
    origin : (3,) tuple of float
        Position of point (0, 0, 0) of tile (0, 0).
    spacing : (3,) tuple of float
    shape : (3,) tuple of int
        Steps in a period along the first two axes, points along the third.
    """

    origin: tuple[float, float, float]
    spacing: tuple[float, float, float]
    shape: tuple[int, int, int]

    @property
    def period(self) -> FloatArray:
        """(2,) lengths of a tile."""
        return np.asarray(np.array(self.spacing[:2]) * self.shape[:2], dtype=np.float64)

    def positions(self, lattice: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) positions of (n, 3) lattice coordinates, counted from tile (0, 0) on.

        The one function that makes positions: equal lattice coordinates give equal bits.
        """
        return np.asarray(np.asarray(self.origin) + np.asarray(lattice) * np.asarray(self.spacing), dtype=np.float64)


class TileColumns(Protocol):
    """Columns of samples of a tile and of the next ones along and across, (nx + 1, ny + 1) of them."""

    def labels(self, columns: IntArray) -> npt.NDArray[np.uint8]:
        """Return the labels (m, nz) of the samples of some columns (m, 2)."""

    def samples(self, columns: IntArray) -> FloatArray:
        """Return these samples (m, nz), > 0 inside, voids filled and islands removed."""


@dataclass(frozen=True, eq=False)
class SampledColumns:
    """Columns of what repeats, looked up or sampled again.

    Attributes
    ----------
    field : callable
        Values at (n, 3) points.
    lattice : TileLattice
    runs : Runs
        What is inside.
    """

    field: Callable[[FloatArray], FloatArray]
    lattice: TileLattice
    runs: Runs

    def labels(self, columns: IntArray) -> npt.NDArray[np.uint8]:
        """Return the labels (m, nz) of the samples of some columns (m, 2)."""
        there = self._folded(columns)
        return self.runs.expand(there[:, 0] * self.lattice.shape[1] + there[:, 1])

    def samples(self, columns: IntArray) -> FloatArray:
        """Return these samples (m, nz), > 0 inside, voids filled and islands removed."""
        nz = self.lattice.shape[2]
        points = np.column_stack([np.repeat(self._folded(columns), nz, axis=0), np.tile(np.arange(nz), len(columns))])
        size = np.maximum(np.abs(self.field(self.lattice.positions(points))), TINY).reshape(-1, nz)
        return np.where(self.labels(columns) == INSIDE, size, -size)

    def _folded(self, columns: IntArray) -> IntArray:
        return np.asarray(columns % np.array(self.lattice.shape[:2]))


@dataclass(frozen=True, eq=False)
class Tile:
    """The surface over one period, without the copies of its sides.

    Attributes
    ----------
    lattice : TileLattice
    method : int
        Place in `o3dleaf.surface.isosurface.polygonize.METHODS`.
    runs : Runs
        What is inside, voids filled, of all that was polygonized together.
    columns : TileColumns
        The tile's own samples.
    edges : (n,) ndarray of int64
        The edges that vertices lie on, 8 · (number of the lower point) + direction, rising.
    fractions : (n,) ndarray of float64
        How far along its edge each vertex lies.
    sides : (n,) ndarray of uint8
        `ABOVE` or `BELOW`: the air that each vertex looks at.
    upward : (n,) ndarray of bool
        Whether the lower end of the vertex's edge is the one inside.
    nodes : (m, 3) ndarray of int32
        Corners of the triangles, by cells: a vertex of this tile, or n + a row of `beyond`.
    cells : (nx ny + 1,) ndarray of int64
        First triangle over each cell of the plane.
    beyond : (h, 2) ndarray of int64
        Vertices of neighbors that triangles of this tile use: the edge in the neighbor's lattice, and the neighbor
        (bits: along, across); by edge, then by neighbor.
    beyond_fractions, beyond_sides : (h,) ndarrays
        Theirs.
    """

    lattice: TileLattice
    method: int
    runs: Runs
    columns: TileColumns
    edges: IntArray
    fractions: FloatArray
    sides: npt.NDArray[np.uint8]
    upward: npt.NDArray[np.bool_]
    nodes: npt.NDArray[np.int32]
    cells: IntArray
    beyond: IntArray
    beyond_fractions: FloatArray
    beyond_sides: npt.NDArray[np.uint8]

    @property
    def beyond_keys(self) -> IntArray:
        """(h,) numbers, rising, of vertices of neighbors: 4 · edge + neighbor."""
        return np.asarray(self.beyond[:, 0] * 4 + self.beyond[:, 1])

    @property
    def beyond_rows(self) -> IntArray:
        """(h,) vertices of this tile that those of its neighbors are copies of, where all places have this tile."""
        return np.searchsorted(self.edges, self.beyond[:, 0])
