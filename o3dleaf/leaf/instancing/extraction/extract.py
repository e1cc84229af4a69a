"""One period of a field sampled, its voids filled, and polygonized."""

from collections.abc import Callable
from functools import partial

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.processes.spread import each_block
from o3dleaf.core.resources.scratch import offsets_of
from o3dleaf.leaf.instancing.extraction.samples import Alike, find_inside, slabs_of
from o3dleaf.leaf.instancing.extraction.sharpened import sharpened_fractions
from o3dleaf.leaf.instancing.extraction.slab_surface import Slab, SlabSurfaces, march_slab, nodes_of
from o3dleaf.leaf.instancing.extraction.tile_cost import require_columns
from o3dleaf.leaf.instancing.tile import SampledColumns, Tile, TileLattice

SLAB_SIZE = 1 << 18
"""Samples in memory at once while a tile is made: 2 MiB of them, whatever the spacing."""


def extract_tile(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    method: int = 0,
    *,
    sharpen: tuple[int, int] | None = None,
    slab_size: int = SLAB_SIZE,
    alike: Alike | None = None,
) -> Tile:
    """Sample one period of a field, fill its voids, and polygonize it.

    Memory grows with the surface, not with the samples: a first pass over slabs notes what is inside, a
    second one evaluates the samples beside the surface again, and marches.

    Parameters
    ----------
    field : callable
        Values at (n, 3) points, > 0 inside, with the period of the lattice along the first two axes.
    lattice : TileLattice
    method : int
        Place in `o3dleaf.surface.isosurface.polygonize.METHODS`.
    sharpen : (2,) tuple of int, optional
        Put the vertices where the field itself is zero along their edges, not its linear interpolant. The steps along
        and across after which the field repeats: copies get the same bits.
    slab_size : int
        Samples in memory at once, if a column has no more.
    alike : Alike, optional
        Columns and edges at which the field is the same, within the period: they get the same bits, and are inside and
        outside together.

    Raises
    ------
    ReconstructionError
        If the surface is not two sheets, one above the other.
    MemoryBudgetError
        If the lattice is so fine that the tile does not fit into memory.
    """
    nx, ny, nz = lattice.shape
    require_columns(nx * ny, max(lattice.spacing[:2]), layers=nz)
    places = list(slabs_of(lattice.shape, slab_size))
    runs = find_inside(field, lattice, places, alike)
    march = partial(march_slab, field, lattice, method, alike)
    labelled = (Slab.of(runs, *place) for place in places)
    found = SlabSurfaces.of(each_block(march, labelled))
    edges, fractions, sides, upward = (part.whole() for part in found.vertices)
    nodes, beyond = nodes_of(edges, found)
    if sharpen is not None:
        fractions = sharpened_fractions(field, lattice, edges, fractions, upward, sharpen, alike)
    origins = np.searchsorted(edges, beyond[:, 0])
    return Tile(
        lattice,
        method,
        runs,
        SampledColumns(field, lattice, runs),
        edges,
        fractions,
        sides,
        upward,
        nodes,
        offsets_of(found.cells.whole()),
        beyond,
        fractions[origins],
        sides[origins],
    )
