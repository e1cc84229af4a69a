"""The lattice of an array's voxels in space, and the box that they fill."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds, as_points, as_rigid_motion
from o3dleaf.core.checks.voxels import as_step
from o3dleaf.core.errors import InputError

FACE = 1e-6
"""Share of a voxel that a box may reach beyond the lattice: the rounding of a box computed from it."""


@dataclass(frozen=True, eq=False)
class VoxelLattice:
    """Positions of an array's voxels: voxel (i, j, k) at turn · (spacing (i, j, k) + start) + shift.

    Attributes
    ----------
    shape : tuple of int
    spacing, start : (d,) ndarrays
    turn : (d, d) ndarray
        Identity where there is no rigid motion.
    origin : (d,) ndarray
        Position of the first voxel, motion included.
    moved : bool
        Whether there is a motion.
    """

    shape: tuple[int, ...]
    spacing: FloatArray
    start: FloatArray
    turn: FloatArray
    origin: FloatArray
    moved: bool

    @classmethod
    def of(
        cls,
        shape: tuple[int, ...],
        spacing: float | npt.ArrayLike,
        origin: npt.ArrayLike | None,
        transform: npt.ArrayLike | None,
    ) -> "VoxelLattice":
        """Return the lattice of an array, or raise `InputError`."""
        dimension = len(shape)
        step = as_step(spacing, dimension)
        start = np.zeros(dimension) if origin is None else as_points(origin, "origin", dim=dimension)[0]
        if transform is None:
            return cls(shape, step, start, np.eye(dimension), start, False)
        turn, shift = as_rigid_motion(transform, dimension)
        return cls(shape, step, start, turn, turn @ start + shift, True)

    @property
    def steps(self) -> FloatArray:
        """(d, d) displacement from a voxel to the next along each axis, one a row."""
        return self.spacing[:, np.newaxis] * self.turn.T

    def box(self, bounds: npt.ArrayLike | None) -> FloatArray:
        """Return the box to cover, or raise `InputError` where it reaches beyond the voxels' faces."""
        sides = np.array(self.shape)
        if bounds is None:
            if self.moved:
                raise InputError(
                    "bounds: are needed with a transform; give a box inside the rotated volume (inscribed_box)"
                )
            return np.array([self.origin, self.origin + np.diag(self.steps) * (sides - 1)])
        box = as_bounds(bounds, len(sides))
        corners = np.array(list(product(*box.T)))
        voxels = (corners - self.origin) @ np.linalg.inv(self.steps)
        if np.any(voxels < -0.5 - FACE) or np.any(voxels > sides - 0.5 + FACE):
            raise InputError("bounds: reach beyond the voxels; give a smaller box (inscribed_box finds the largest)")
        return box
