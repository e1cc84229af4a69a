"""Lines through which the planes of neighborhoods pass: of a crease, of a branching, and of nothing else."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import box_of
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.surface.cloud.branchings import axis_loops
from o3dleaf.surface.cloud.neighbors import IndexArray

AROUND = 5.0
"""Spacings around a place within which planes are looked at: some eighty neighborhoods of a sheet, half of them away
from where it meets others."""
BLOCK = 64
"""Places that one thread looks around at a time."""


class Axes(NamedTuple):
    """Lines near places, each with the plane across it.

    Attributes
    ----------
    point : (m, 3) ndarray
        The point of the line in the plane across it.
    direction : (m, 3) ndarray
        Unit vectors along the lines.
    across : (m, 3, 2) ndarray
        Two unit vectors of the plane across, in columns.
    spacing : (m,) ndarray
        Of the cloud around.
    """

    point: FloatArray
    direction: FloatArray
    across: FloatArray
    spacing: FloatArray

    def __len__(self) -> int:
        return len(self.point)

    def take(self, rows: IndexArray) -> "Axes":
        """Return some of the lines."""
        return Axes(self.point[rows], self.direction[rows], self.across[rows], self.spacing[rows])


def find_axes(places: FloatArray, spacing: FloatArray, points: FloatArray, normals: FloatArray) -> Axes:
    """Return the lines near some of the places (m, 3) that the planes at points (n, 3) around them pass through.

    The line's direction t is the one that the normals n (n, 3) are all upright to, the least eigenvector of Σ n nᵀ;
    where it passes, least squares over the planes' distances say, those that pass by counting less and less.
    """
    offsets, rows = BallIndex.build(places, AROUND * spacing, box_of(points)).members(points)
    count = len(places)
    found, middles, frames = np.empty(count, dtype=bool), np.empty((count, 3)), np.empty((count, 3, 3))

    def task(start: int, stop: int) -> None:
        planes = offsets, rows, places, spacing, points, normals
        axis_loops.find_lines(start, stop, *planes, found, middles, frames)

    run_blocks(task, count, BLOCK)
    frame = frames[found]
    across = np.ascontiguousarray(frame[:, 1:].transpose(0, 2, 1))
    return Axes(middles[found], np.ascontiguousarray(frame[:, 0]), across, spacing[found])
