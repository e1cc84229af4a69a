"""Where a field is asked: a regular lattice over a box, sampled block by block in bounded memory."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray, as_bounds, require_finite, require_positive
from o3dleaf.errors import InputError, MemoryBudgetError
from o3dleaf.field import Field
from o3dleaf.mesh.arrays import BoolArray
from o3dleaf.parallel import Progress, blocks

BLOCK = 1 << 18
"""Points asked for at once: 6 MiB of coordinates, and enough of them to keep a field's threads busy."""

LARGEST = 1 << 29
"""Samples that a lattice may hold (4 GiB): beyond it, a spacing is more likely mistyped than meant."""

OUTSIDE = -1e30
"""Value of a lattice point that is not asked for: outside for any level, and finite in float32 too."""


@dataclass(frozen=True)
class Lattice:
    """A regular lattice of points: point (i, j, k) lies at origin + spacing * (i, j, k).

    Attributes
    ----------
    origin : (3,) tuple of float
        Position of point (0, 0, 0).
    spacing : (3,) tuple of float
        Step along each axis, in the unit of `origin`.
    shape : (3,) tuple of int
        Number of points along each axis.
    """

    origin: tuple[float, float, float]
    spacing: tuple[float, float, float]
    shape: tuple[int, int, int]

    def __post_init__(self) -> None:
        """Refuse steps that are not positive and lattices without a cell or beyond all memory."""
        for step in self.spacing:
            require_positive(step, "spacing")
        if min(self.shape) < 2:
            raise InputError(f"lattice: has shape {self.shape}; two points an axis make a cell, refine the spacing")
        if self.size > LARGEST:
            raise MemoryBudgetError(f"lattice: {self.size:.2g} points are too many; coarsen the spacing or cut the box")

    @classmethod
    def covering(cls, bounds: npt.ArrayLike, spacing: float | npt.ArrayLike) -> "Lattice":
        r"""Return the lattice of whole multiples of `spacing` that covers a box.

        The points lie at spacing * k for integers floor(lower / spacing) <= k <= ceil(upper / spacing),
        so that two boxes share the points, and hence the surface, of their common part.

        Parameters
        ----------
        bounds : (2, 3) array_like
            Lower, then upper corner.
        spacing : float or (3,) array_like
            Step, in the unit of `bounds`; one number for all axes or one each.

        Raises
        ------
        InputError, MemoryBudgetError
            If a step is not positive, or there would be too many points.
        """
        lower, upper = as_bounds(bounds, 3)
        step = as_step(spacing)
        # A corner that is a multiple but for rounding must not cost a layer more.
        first, last = np.floor(lower / step + 1e-9), np.ceil(upper / step - 1e-9)
        count = np.maximum(last - first, 1.0) + 1.0
        if np.prod(count) > LARGEST:
            raise MemoryBudgetError(
                f"spacing: {np.prod(count):.2g} lattice points are too many; coarsen the spacing or cut the box"
            )
        a, b, c = (first * step).tolist()
        u, v, w = step.tolist()
        i, j, k = (int(n) for n in count)
        return cls((a, b, c), (u, v, w), (i, j, k))

    @property
    def size(self) -> int:
        """Number of lattice points."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) first and last point of the lattice."""
        return self.positions(np.array([(0, 0, 0), self.shape], dtype=np.float64) - [[0] * 3, [1] * 3])

    def positions(self, indices: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) positions of (n, 3) lattice coordinates, whole or fractional."""
        return np.asarray(np.asarray(self.origin) + np.asarray(indices) * np.asarray(self.spacing), dtype=np.float64)

    def columns(self) -> FloatArray:
        """Return the (nx * ny, 2) positions (x, y) of the lattice's columns, y running fastest.

        What an outline says of them, reshaped to (nx, ny), is the `keep` of `sample_lattice`.
        """
        grid = np.stack(np.meshgrid(*(np.arange(n) for n in self.shape[:2]), indexing="ij"), axis=-1).reshape(-1, 2)
        return np.asarray(np.asarray(self.origin[:2]) + grid * np.asarray(self.spacing[:2]), dtype=np.float64)


def as_step(spacing: float | npt.ArrayLike) -> FloatArray:
    """Return the (3,) steps of a spacing given as one number or three, or raise `InputError`."""
    step = np.asarray(spacing, dtype=np.float64)
    if step.shape not in {(), (3,)}:
        raise InputError(f"spacing: has shape {step.shape}; give one number, or one an axis")
    for each in step.ravel():
        require_positive(float(each), "spacing")
    return np.broadcast_to(step, 3)


def sample_lattice(
    field: Field,
    lattice: Lattice,
    *,
    keep: npt.ArrayLike | None = None,
    block: int = BLOCK,
    progress: Progress | None = None,
) -> FloatArray:
    """Return the values of a field at the points of a lattice.

    Parameters
    ----------
    field : Field
        Called with `block` points at a time from this thread; it spreads them over threads itself.
    lattice : Lattice
        The points, in the unit of the field.
    keep : (nx, ny) array_like of bool, optional
        The columns to ask; the points of all others get the value `OUTSIDE`. Hand the same mask to
        `polygonise`, which leaves out the walls that the jump would make.
    block : int
        Points asked for at once; the result does not depend on it.
    progress : callable, optional
        ``progress(done, total)`` in lattice points that are asked for.

    Returns
    -------
    (nx, ny, nz) ndarray
        F at point (i, j, k).

    Raises
    ------
    InputError
        If `keep` has another shape than the lattice's columns, or the field returns NaN.
    """
    depth = lattice.shape[2]
    columns = np.flatnonzero(check_keep(keep, lattice.shape[:2]))
    samples = np.full(lattice.size, OUTSIDE)
    total = len(columns) * depth
    for start, stop in blocks(total, block):
        number = np.arange(start, stop)
        flat = columns[number // depth] * depth + number % depth
        points = lattice.positions(np.stack(np.unravel_index(flat, lattice.shape), axis=1))
        samples[flat] = require_finite(np.asarray(field(points), dtype=np.float64), "field values")
        if progress:
            progress(stop, total)
    return samples.reshape(lattice.shape)


def check_keep(keep: npt.ArrayLike | None, shape: tuple[int, ...]) -> BoolArray:
    """Return the mask of columns as an array of `shape` (all of them where it is None), or raise `InputError`."""
    if keep is None:
        return np.ones(shape, dtype=bool)
    mask = np.asarray(keep)
    if mask.shape != shape or mask.dtype != np.bool_:
        raise InputError(f"keep: is {mask.dtype} of shape {mask.shape}; give one bool a column, shape {shape}")
    return mask
