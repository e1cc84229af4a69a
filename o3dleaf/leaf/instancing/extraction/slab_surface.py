"""The surface in slabs of a period, and all slabs as one."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.resources.scratch import GrowingArray
from o3dleaf.leaf.instancing.extraction.samples import Alike, first_points
from o3dleaf.leaf.instancing.runs import Runs
from o3dleaf.leaf.instancing.tile import TINY, TileLattice
from o3dleaf.leaf.instancing.tile_loops import INSIDE, count_cells, mark_crossed, name_in_tile
from o3dleaf.surface.isosurface.polygonize import march


class Slab(NamedTuple):
    """Planes of a period, or rows of one plane.

    Attributes
    ----------
    first : (int, int)
        Place of its first column along and across.
    columns : (n + 1, m + 1) ndarray of int64
        Its columns, and those on its far sides.
    labels : (n + 1, m + 1, nz) ndarray of uint8
        Of their samples.
    """

    first: tuple[int, int]
    columns: IntArray
    labels: npt.NDArray[np.uint8]

    @classmethod
    def of(cls, runs: Runs, start: int, stop: int) -> "Slab":
        """Return the slab of the columns from start to stop, as `slabs_of` yields them."""
        nx, ny, nz = runs.shape
        (first, row), rows = divmod(start, ny), min(stop - start, ny)
        i, j = first + np.arange((stop - start) // rows + 1), row + np.arange(rows + 1)
        columns = i[:, np.newaxis] % nx * ny + j % ny
        return cls((first, row), columns, runs.expand(columns.ravel()).reshape(*columns.shape, nz))


def march_slab(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    method: int,
    alike: Alike | None,
    slab: Slab,
) -> tuple[npt.NDArray[np.generic], ...]:
    """Return the part of the tile that a slab adds.

    Of its own vertices edges, fractions, sides and ends; of all that its triangles use names and shifts; the triangles
    as rows of these; their number by cells.
    """
    (_, ny, nz), labels, (planes, rows) = lattice.shape, slab.labels, slab.columns.shape
    inside = labels == INSIDE
    needed = np.zeros(labels.shape, dtype=bool)
    mark_crossed(method, inside, needed)
    points = np.argwhere(needed)
    columns = slab.columns[points[:, 0], points[:, 1]]
    samples = field(lattice.positions(first_points(columns, points[:, 2], ny, alike)))
    values = np.where(inside, 1.0, -1.0)
    # What was filled or removed has the other sign: its size is what places the vertices beside it.
    values[needed] *= np.maximum(np.abs(require_finite(samples, "field values")), TINY)
    surface = march(values, inside, method)
    names, shifts = np.empty_like(surface.edges), np.empty_like(surface.edges)
    name_in_tile(surface.edges, surface.shape, slab.first, lattice.shape, names, shifts)
    point = surface.edges >> 3
    low = np.stack([point // (rows * nz), point // nz % rows, point % nz])
    is_own = (low[0] < planes - 1) & (low[1] < rows - 1)
    step = [surface.edges & 1, surface.edges >> 1 & 1, surface.edges >> 2 & 1]
    upward = inside[tuple(low)]
    outer = np.where(upward, low + step, low)
    sides = labels[tuple(outer[:, is_own])]
    cells = np.zeros((planes - 1, rows - 1), dtype=np.int64)
    count_cells(method, inside, cells)
    triangles = surface.triangles.astype(np.int32)
    parts = names[is_own], surface.fractions[is_own], sides, upward[is_own]
    return *parts, names, shifts.astype(np.uint8), triangles, cells.ravel()


class SlabSurfaces(NamedTuple):
    """The parts of a tile's surface that its slabs add, one after the other.

    Attributes
    ----------
    vertices : tuple of GrowingArray
        Of the tile's own vertices edges, fractions, sides and ends.
    names, shifts : GrowingArray
        Of the vertices that the triangles of each slab use: the edge in its tile, and how many periods on it lies.
    triangles : GrowingArray
        Rows of the slab's names.
    cells : GrowingArray
        Number of triangles over each cell of the plane.
    sizes : list of (int, int)
        Names and triangles of each slab.
    """

    vertices: tuple[GrowingArray, ...]
    names: GrowingArray
    shifts: GrowingArray
    triangles: GrowingArray
    cells: GrowingArray
    sizes: list[tuple[int, int]]

    @classmethod
    def of(cls, slabs: Iterator[tuple[npt.NDArray[Any], ...]]) -> "SlabSurfaces":
        """Gather what `march_slab` returns of each slab."""
        vertices = tuple(GrowingArray(kind) for kind in (np.int64, np.float64, np.uint8, np.bool_))
        others = GrowingArray(np.int64), GrowingArray(np.uint8), GrowingArray(np.int32, (3,)), GrowingArray(np.int64)
        found = cls(vertices, *others, [])
        for parts in slabs:
            for whole, part in zip((*vertices, *others), parts, strict=True):
                whole.append(part)
            found.sizes.append((len(parts[4]), len(parts[6])))
        return found


def nodes_of(edges: IntArray, found: SlabSurfaces) -> tuple[npt.NDArray[np.int32], IntArray]:
    """Return the corners as nodes of the tile, and the vertices of neighbors among them."""
    names, shifts, nodes = (part.whole() for part in (found.names, found.shifts, found.triangles))
    away = np.flatnonzero(shifts)
    beyond = np.unique(np.searchsorted(edges, names[away]) * 4 + shifts[away])
    name = row = 0
    for count, many in found.sizes:
        own, shift, rows = names[name : name + count], shifts[name : name + count], nodes[row : row + many]
        number = np.searchsorted(edges, own)
        node = np.where(shift, len(edges) + np.searchsorted(beyond, number * 4 + shift), number)
        rows[:] = node.astype(np.int32)[rows]
        name, row = name + count, row + many
    return nodes, np.stack([edges[beyond >> 2], beyond & 3], axis=1)
