"""Samples that a level set is marched from: exact where it needs them, rough where their side of it is certain."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.field import Field, HasRough
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.parallel import blocks
from o3dleaf.surface.isosurface.boxed_lattice import BoxedLattice
from o3dleaf.surface.isosurface.cell_loops import DIRECTIONS

BATCH_SIZE = 1 << 18
"""Points at which a field is evaluated at once."""

PROBES, MAX_NEAR = 4096, 0.25
"""Samples by which it is judged whether rough values pay, and the share of them that may lie too near to the level."""

ROUNDINGS = 16
"""Of what a blend in single precision makes of its balls' values, at most."""


def sample_level(field: Field, lattice: BoxedLattice, level: float, method: int) -> FloatArray:
    """Return samples (nx, ny, nz) that are the field's own at both ends of each edge that crosses the level.

    A field with rough values is asked for those everywhere, and for its own where the rough ones lie within their error
    of the level, and beside the surface: sides and vertices are those of the field itself, to the last bit.

    Parameters
    ----------
    field : Field
    lattice : BoxedLattice
    level : float
    method : int
        Place in `METHODS`: which edges there are.
    """
    if not (isinstance(field, HasRough) and lattice.is_within(field.bounds)):
        return lattice.sample(field)
    error = field.rough_error
    if not np.isfinite(error) or _share_near(field, lattice, level, error) > MAX_NEAR:
        return lattice.sample(field)
    rough = field.rough_on(lattice.lattice)
    samples = lattice.sample(field.rough) if rough is None else rough.astype(np.float64)
    # The result itself is rounded too, and so are the products and sums of weights.
    known = np.abs(samples - level) <= 1.001 * error + ROUNDINGS * np.finfo(np.float32).eps * np.abs(samples).max()
    if rough is not None:
        known |= lattice.moved
    _ask(field, lattice, known, samples)
    beside = _ends(samples > level, method)
    _ask(field, lattice, beside & ~known, samples)
    return samples


def _share_near(field: Field, lattice: BoxedLattice, level: float, error: float) -> float:
    """Return the share of the samples whose side rough values would leave open, from some of them."""
    shape = lattice.lattice.shape
    some = np.arange(0, int(np.prod(shape)), max(1, int(np.prod(shape)) // PROBES))
    values = np.asarray(field(lattice.points(np.stack(np.unravel_index(some, shape), axis=1))))
    return float(np.mean(np.abs(values - level) <= error))


def _ask(field: Field, lattice: BoxedLattice, which: BoolArray, samples: FloatArray) -> None:
    """Write the field's own values at some points."""
    rows, flat = np.flatnonzero(which), samples.reshape(-1)
    for first, last in blocks(len(rows), BATCH_SIZE):
        part = rows[first:last]
        places = lattice.points(np.stack(np.unravel_index(part, which.shape), axis=1))
        flat[part] = require_finite(np.asarray(field(places), dtype=np.float64), "field values")


def _ends(inside: BoolArray, method: int) -> BoolArray:
    """Return the points at which an edge ends whose other end lies on the other side."""
    ends = np.zeros(inside.shape, dtype=bool)
    for direction in DIRECTIONS[method][DIRECTIONS[method] > 0]:
        steps = [int(direction) >> axis & 1 for axis in range(3)]
        here = tuple(slice(0, -1) if step else slice(None) for step in steps)
        there = tuple(slice(1, None) if step else slice(None) for step in steps)
        crossed = inside[here] != inside[there]
        ends[here] |= crossed
        ends[there] |= crossed
    return ends
