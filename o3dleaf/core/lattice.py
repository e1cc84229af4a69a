"""A regular lattice over a box, on which fields are sampled block by block in bounded memory."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import as_answers
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.checks.voxels import as_step
from o3dleaf.core.errors import InputError, MemoryBudgetError
from o3dleaf.core.parallel import blocks
from o3dleaf.core.resources.needs import require_resources

BLOCK = 1 << 18
"""Points evaluated at once: 6 MiB of coordinates, and enough of them to keep a field's threads busy."""

MAX_SIZE = 1 << 29
"""Samples that a lattice may hold (4 GiB): beyond it, a spacing is more likely mistyped than meant."""

COLUMN_BYTES = 16
"""The place of a column of points."""


@dataclass(frozen=True)
class Lattice:
    """A regular lattice of points: point (i, j, k) lies at origin + spacing * (i, j, k).

    Attributes
    ----------
    origin : (d,) tuple of float
        Position of point (0, 0, 0).
    spacing : (d,) tuple of float
        Step along each axis, in the unit of `origin`.
    shape : (d,) tuple of int
        Number of points along each axis.
    """

    origin: tuple[float, ...]
    spacing: tuple[float, ...]
    shape: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse steps that are not positive and lattices without a cell or beyond all memory."""
        for step in self.spacing:
            require_positive(step, "spacing")
        if min(self.shape) < 2:
            raise InputError(f"lattice: has shape {self.shape}; a cell needs two points per axis, refine the spacing")
        if self.size > MAX_SIZE:
            raise MemoryBudgetError(
                f"spacing: {self.size:.2g} lattice points are too many; coarsen the spacing or crop the box"
            )

    @classmethod
    def covering(cls, bounds: npt.ArrayLike, spacing: float | npt.ArrayLike, *, dimension: int = 3) -> "Lattice":
        r"""Return the lattice of whole multiples of `spacing` that covers a box.

        The points lie at spacing * k for integers floor(lower / spacing) <= k <= ceil(upper / spacing),
        so that two boxes share the points, and hence the surface, of their common part.

        Parameters
        ----------
        bounds : (2, d) array_like
            Lower, then upper corner.
        spacing : float or (d,) array_like
            Step, in the unit of `bounds`; one number for all axes or one each.
        dimension : int
            d.

        Raises
        ------
        InputError, MemoryBudgetError
            If a step is not positive, or there would be too many points.
        """
        lower, upper = as_bounds(bounds, dimension)
        step = as_step(spacing, dimension)
        # A corner that is a multiple but for rounding must not cost a layer more.
        first, last = np.floor(lower / step + 1e-9), np.ceil(upper / step - 1e-9)
        count = np.maximum(last - first, 1.0) + 1.0
        return cls(tuple((first * step).tolist()), tuple(step.tolist()), tuple(int(n) for n in count))

    @property
    def size(self) -> int:
        """Number of lattice points."""
        return int(np.prod(self.shape, dtype=object))

    @property
    def bounds(self) -> FloatArray:
        """(2, d) first and last point of the lattice."""
        return self.positions(np.array([np.zeros(len(self.shape)), np.array(self.shape) - 1.0]))

    def positions(self, indices: npt.ArrayLike) -> FloatArray:
        """Return the (n, d) positions of (n, d) lattice coordinates, whole or fractional."""
        return np.asarray(np.asarray(self.origin) + np.asarray(indices) * np.asarray(self.spacing), dtype=np.float64)

    def ticks(self, axis: int) -> FloatArray:
        """Return the coordinates of the points along one axis."""
        return np.asarray(self.origin[axis] + np.arange(self.shape[axis]) * self.spacing[axis], dtype=np.float64)

    def columns(self) -> FloatArray:
        """Return the (nx * ny, 2) positions (x, y) of the lattice's columns, y running fastest.

        In d dimensions a column is what has its first d − 1 coordinates in common.
        """
        shape = self.shape[:-1]
        columns = np.empty((*shape, len(shape)))
        for axis, ticks in enumerate(np.ix_(*[self.ticks(axis) for axis in range(len(shape))])):
            columns[..., axis] = ticks
        return columns.reshape(math.prod(shape), len(shape))


def sample_lattice(
    field: Callable[[FloatArray], npt.NDArray[Any]],
    lattice: Lattice,
    *,
    dtype: npt.DTypeLike = np.float64,
    block: int = BLOCK,
) -> npt.NDArray[Any]:
    """Return the values of a field at the points of a lattice.

    Parameters
    ----------
    field : Field or callable
        Called with about `block` points at a time from this thread; it spreads them over threads itself.
    lattice : Lattice
        The points, in the unit of the field.
    dtype : float64 or float32
        Of the result.
    block : int
        Points evaluated at once; the result does not depend on it.

    Returns
    -------
    (nx, ny, nz) ndarray
        F at point (i, j, k).

    Raises
    ------
    InputError
        If the field returns NaN.
    """
    depth = lattice.ticks(-1)
    what, cure = f"spacing: {lattice.size:,} lattice points", "crop the box or coarsen it"
    held = lattice.size * np.dtype(dtype).itemsize + math.prod(lattice.shape[:-1]) * COLUMN_BYTES
    require_resources(held, what, cure, step=max(lattice.spacing), power=3)
    columns = lattice.columns()
    samples = np.empty((len(columns), len(depth)), dtype)
    run = min(block, len(depth))
    for first, last in blocks(len(columns), max(block // run, 1)):
        for start, stop in blocks(len(depth), run):
            points = np.empty((last - first, stop - start, len(lattice.shape)))
            points[..., :-1] = columns[first:last, np.newaxis]
            points[..., -1] = depth[start:stop]
            values = as_answers(field(points.reshape(-1, len(lattice.shape))), points[..., 0].size)
            samples[first:last, start:stop] = values.reshape(points.shape[:2])
        progress.report(last * len(depth), samples.size)
    return samples.reshape(lattice.shape)
