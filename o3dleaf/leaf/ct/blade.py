"""The blade among what is solid in a volume: a sheet that columns of voxels cross from air to air."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import label

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray

MIN_COLUMNS = 100
"""Columns that a blade spans at least."""
MAX_TRIED = 8
"""Pieces that are looked at, the largest first: a support, or the wall of a tube, may be larger than the blade."""
OTHERS = (1, 2), (0, 2), (0, 1)
"""The axes beside each one."""


@dataclass(frozen=True, eq=False)
class SolidBlade:
    """The blade of a volume.

    Attributes
    ----------
    pieces : (nx, ny, nz) ndarray of int32
        Pieces of what is solid, from 1 on; 0 is air.
    number : int
        The piece that is the blade.
    axis : int
        The axis of the volume nearest to the direction in which the blade is thinnest.
    first, last : ndarrays of int
        Lowest and highest voxel of the blade by column along the axis; 0 and −1 where there is none.
    """

    pieces: npt.NDArray[np.int32]
    number: int
    axis: int
    first: npt.NDArray[np.intp]
    last: npt.NDArray[np.intp]

    @classmethod
    def of(cls, solid: BoolArray, spacing: FloatArray) -> "SolidBlade":
        """Return the largest piece of what is solid that is a blade.

        Raises
        ------
        ReconstructionError
            If there is none.
        """
        pieces, count = label(solid)
        sizes = piece_sizes(pieces, count)
        largest = 1 + np.argsort(-sizes[1:], kind="stable")[:MAX_TRIED]
        most = 0
        for number in largest[sizes[largest] >= MIN_COLUMNS]:
            axis = thin_axis(pieces == number, spacing)
            blade = cls(pieces, int(number), axis, *_ends(pieces == number, axis))
            crossed = int(np.count_nonzero(blade.crossed))
            if crossed >= MIN_COLUMNS:
                return blade
            most = max(most, crossed)
        if not len(largest):
            raise ReconstructionError("align: no blade was found in the volume at this threshold; lower the threshold")
        raise ReconstructionError(
            f"align: only {most} columns of voxels cross the blade from air to air; crop the volume less, lower the "
            "threshold or, where air is brighter than leaf, change the sign of the intensities"
        )

    @property
    def covered(self) -> BoolArray:
        """The columns that meet the blade."""
        return np.asarray(self.last >= self.first)

    @property
    def crossed(self) -> BoolArray:
        """The columns that cross it, from air to air."""
        return np.asarray(self.covered & (self.first > 0) & (self.last < self.pieces.shape[self.axis] - 1))


def piece_sizes(pieces: npt.NDArray[np.integer[Any]], count: int) -> npt.NDArray[np.int64]:
    """Return how many voxels each of `count` pieces has, and what is of none first.

    Plane by plane: NumPy counts in eight bytes a voxel.
    """
    sizes = np.zeros(count + 1, dtype=np.int64)
    for plane in pieces:
        sizes += np.bincount(plane.ravel(), minlength=count + 1)
    return sizes


def thin_axis(blade: BoolArray, spacing: FloatArray) -> int:
    """Return the axis of the lattice nearest to the direction in which the blade is thinnest."""
    count = np.count_nonzero(blade)
    places = [step * np.arange(size, dtype=np.float64) for step, size in zip(spacing, blade.shape, strict=True)]
    places = [each - blade.sum(axis=others) @ each / count for each, others in zip(places, OTHERS, strict=True)]
    moments = np.empty((3, 3))
    # Of sums over lines: the places of all its voxels are 24 times as much memory as the blade.
    for axis, left in enumerate(OTHERS):
        (a, b), plane = left, blade.sum(axis=axis)
        moments[a, b] = moments[b, a] = places[a] @ plane @ places[b]
        moments[a, a], moments[b, b] = plane.sum(axis=1) @ places[a] ** 2, plane.sum(axis=0) @ places[b] ** 2
    _, directions = np.linalg.eigh(moments)
    return int(np.argmax(abs(directions[:, 0])))


def _ends(blade: BoolArray, axis: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return the lowest and the highest voxel of the blade in each column; 0 and −1 where there is none."""
    columns = np.moveaxis(blade, axis, 2)
    met = columns.any(axis=2)
    last = columns.shape[2] - 1 - np.argmax(columns[:, :, ::-1], axis=2)
    return np.argmax(columns, axis=2), np.where(met, last, -1)
