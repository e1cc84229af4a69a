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
    """Planes of a period, and the labels (n, m, nz) of their samples and of those on their far sides."""

    start: int
    stop: int
    labels: npt.NDArray[np.uint8]


def labels_of(runs: Runs, start: int, stop: int) -> npt.NDArray[np.uint8]:
    """Return the labels of the samples of some planes, and of the next one."""
    nx, ny, nz = runs.shape
    i, j = np.arange(start, stop + 1) % nx, np.arange(ny + 1) % ny
    return runs.expand((i[:, np.newaxis] * ny + j).ravel()).reshape(len(i), len(j), nz)


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
    (nx, ny, nz), (start, stop, labels) = lattice.shape, slab
    i, j = np.arange(start, stop + 1) % nx, np.arange(ny + 1) % ny
    inside = labels == INSIDE
    needed = np.zeros(labels.shape, dtype=bool)
    mark_crossed(method, inside, needed)
    points = np.argwhere(needed)
    samples = field(lattice.positions(first_points(i[points[:, 0]] * ny + j[points[:, 1]], points[:, 2], ny, alike)))
    values = np.ones(labels.shape)
    # What was filled or removed has the other sign: its size is what places the vertices beside it.
    values[needed] = np.maximum(np.abs(require_finite(samples, "field values")), TINY)
    surface = march(np.where(inside, values, -values), inside, method)
    names, shifts = np.empty_like(surface.edges), np.empty_like(surface.edges)
    name_in_tile(surface.edges, surface.shape, start, lattice.shape, names, shifts)
    point = surface.edges >> 3
    is_own = (point // ((ny + 1) * nz) < stop - start) & (point // nz % (ny + 1) < ny)
    step = [surface.edges & 1, surface.edges >> 1 & 1, surface.edges >> 2 & 1]
    low = np.stack([point // ((ny + 1) * nz), point // nz % (ny + 1), point % nz])
    upward = inside[tuple(low)]
    outer = np.where(upward, low + step, low)
    sides = labels[tuple(outer[:, is_own])]
    cells = np.zeros((stop - start, ny), dtype=np.int64)
    count_cells(method, inside, cells)
    triangles = surface.triangles.astype(np.int32)
    parts = names[is_own], surface.fractions[is_own], sides, upward[is_own]
    return *parts, names, shifts.astype(np.uint8), triangles, cells.ravel()


class SlabSurfaces(NamedTuple):
    """What the slabs of a tile add to it, one after the other.

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
