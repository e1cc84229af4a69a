"""Samples of a field over one period, and what is inside by them."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.lattice import BLOCK
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.processes.spread import each_block
from o3dleaf.core.resources.scratch import GrowingArray
from o3dleaf.leaf.instancing.runs import Runs, find_runs, solidify
from o3dleaf.leaf.instancing.tile import TileLattice


class Alike(Protocol):
    """Columns and edges of a lattice at which a field is the same: what is found at the first one stands for all."""

    def columns(self, columns: IntArray) -> IntArray:
        """Return the first column like each one, itself where there is none."""

    def edges(self, edges: IntArray) -> IntArray:
        """Return the first edge like each one."""


def slabs_of(shape: tuple[int, int, int], size: int) -> Iterator[tuple[int, int]]:
    """Yield (start, stop) of the columns of slabs: planes of about `size` samples together, or rows of one plane."""
    nx, ny, nz = shape
    planes, rows = max(1, size // (ny * nz)), min(ny, max(1, size // nz))
    for first, last in blocks(nx, planes):
        for start, stop in blocks((last - first) * ny, planes * rows):
            yield first * ny + start, first * ny + stop


def find_inside(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    places: list[tuple[int, int]],
    alike: Alike | None,
) -> Runs:
    """Return what is inside, voids filled, from the samples of slabs (start, stop) of columns."""
    nx, ny, _ = lattice.shape
    counts, begin, flooded = GrowingArray(np.int64), GrowingArray(np.int64), np.zeros(2, dtype=np.int64)
    slabs = each_block(partial(_find_slab, field, lattice, alike), places)
    for (_, stop), (*found, solid) in zip(places, slabs, strict=True):
        flooded += solid
        for whole, part in zip((counts, begin), found, strict=True):
            whole.append(part)
        progress.report(stop, nx * ny)
    # A hair may be cut by the top or bottom of a patch and is closed there; the blade itself may not.
    if flooded.max() > nx * ny / 2:
        raise ReconstructionError(
            "the surface is not two sheets (upper and lower side): the texture has no air above or below; "
            "use another threshold or a taller patch"
        )
    same = None if alike is None else alike.columns(np.arange(nx * ny))
    return solidify(lattice.shape, counts.whole(), begin.whole(), same)


def _find_slab(
    field: Callable[[FloatArray], FloatArray], lattice: TileLattice, alike: Alike | None, slab: tuple[int, int]
) -> tuple[npt.NDArray[Any], ...]:
    """Return the runs of a slab's columns, and how many of them are solid at the bottom and at the top."""
    inside = sample_columns(field, lattice, *slab, alike) > 0
    return *find_runs(inside), inside[:, [0, -1]].sum(axis=0)


def sample_columns(
    field: Callable[[FloatArray], FloatArray], lattice: TileLattice, start: int, stop: int, alike: Alike | None
) -> FloatArray:
    """Return the samples (stop − start, nz) of some columns of the period."""
    _, ny, nz = lattice.shape
    values = np.empty((stop - start) * nz)
    for first, last in blocks(len(values), BLOCK):
        point = np.arange(first, last)
        indices = first_points(start + point // nz, point % nz, ny, alike)
        values[first:last] = field(lattice.positions(indices))
    return require_finite(values, "field values").reshape(-1, nz)


def first_points(columns: IntArray, k: IntArray, ny: int, alike: Alike | None) -> IntArray:
    """Return the points (n, 3) of the first columns like these, at heights k."""
    first = columns if alike is None else alike.columns(columns)
    return np.stack([first // ny, first % ny, k], axis=1)
