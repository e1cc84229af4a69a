r"""The solver of each class of a lattice's balls: one factorization, and a right-hand side for each ball.

A rigid motion keeps distances, hence the matrix of :math:`φ`. A class of balls (see `VoxelCover`) is factored once,
and its balls are the columns of one right-hand side. Bare balls share what takes their values to a plane.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import blocks, single_threaded_blas
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.core.resources.scratch import made_by_rows, order_of
from o3dleaf.fitting.cover.bare_plane import BarePlane
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.cover.voxel_values import VoxelValues
from o3dleaf.fitting.rbf.factor import LocalFactor
from o3dleaf.fitting.rbf.smoothing import SplineModel
from o3dleaf.fitting.rbf.tail import IntArray

Solved = tuple[FloatArray, FloatArray]
"""The coefficients λ and the tails of some balls."""

COLUMNS = 256
"""Balls of a class that are solved for at once; fixed, so that the result does not depend on the threads."""
COMPANY = 16
"""Balls that they are filled up to a multiple of: columns that BLAS takes by itself at the end come out otherwise."""


def batches_of(classes: IntArray, along: IntArray) -> Iterator[IntArray]:
    """Yield the balls of each class in the order of `along`, `COLUMNS` at a time."""
    every = made_by_rows(classes.shape, np.arange, np.int64)
    order = order_of(classes, order_of(along, every))
    ends = np.cumsum(np.bincount(classes))
    for begin, end in pairwise([0, *ends.tolist()]):
        for start, stop in blocks(end - begin, COLUMNS):
            yield order[begin + start : begin + stop]


class ClassSolver:
    """What takes the values of the balls of each class of a cover to their coefficients, factored when first asked for.

    Attributes
    ----------
    cover : VoxelCover
        The classes alone, without balls.
    model : SplineModel
    """

    def __init__(self, cover: VoxelCover, model: SplineModel) -> None:
        none = np.empty(0, dtype=np.int64)
        self.cover = replace(cover, starts=none.reshape(0, len(cover.shape)), levels=none, classes=none)
        self.model = model
        self._voxels: dict[int, IntArray] = {}
        self._factors: dict[int, LocalFactor | BarePlane] = {}

    def __repr__(self) -> str:
        return f"ClassSolver({len(self.cover.keys)} classes)"

    def voxels(self, number: int) -> IntArray:
        """Return the (n, d) voxels of a class, counted from the first of a ball's tile."""
        if number not in self._voxels:
            self._voxels[number] = self.cover.voxels(number)
        return self._voxels[number]

    def points(self, number: int) -> FloatArray:
        """Return the (d, n) unit coordinates of a class's voxels."""
        return self.cover.points(number, self.voxels(number))

    def diagonal(self, number: int) -> float:
        """Return the smoothing on the diagonal of a class's system, in unit coordinates."""
        model = self.model
        return model.smoothing.diagonal(len(self.voxels(number))) / self.cover.radius_of(number) ** model.kernel.power

    def factor(self, number: int) -> LocalFactor | BarePlane:
        """Return what takes the values of a ball of a class to its coefficients."""
        if number not in self._factors:
            self._factors[number] = self._made(number)
        return self._factors[number]

    def _made(self, number: int) -> LocalFactor | BarePlane:
        points, exponents, power = self.points(number), self.model.exponents, self.model.kernel.power
        if self.cover.keys[number, -1]:
            return BarePlane.of(points, exponents)
        return LocalFactor.of(points, exponents, power, np.full(points.shape[1], self.diagonal(number)))

    def solve(self, values: VoxelValues, number: int, starts: IntArray) -> Solved:
        """Return λ (m, n) and tails (m, q) of the balls of a class whose tiles start at (m, d)."""
        many, voxels = len(starts), self.voxels(number)
        # In whole groups of columns a product has the same bits for each, whatever its company.
        data = np.zeros((-(-many // COMPANY) * COMPANY, len(voxels)))
        data[:many] = values.of(starts, voxels)
        coefficients, coarse = self.factor(number).solve(data)
        return coefficients[:many], coarse[:many]


@dataclass(frozen=True)
class WorkerSolver:
    """A `ClassSolver` on a worker, which reads the voxels that it needs.

    Attributes
    ----------
    cover, model
        As of `ClassSolver`.
    read : callable
        ``read(slices)`` returns a part of the lattice.
    isovalue : float
    name : str
        Of the fit: its factors are kept for its next batch.
    """

    cover: VoxelCover
    model: SplineModel
    read: Callable[[tuple[slice, ...]], npt.NDArray[Any]]
    isovalue: float
    name: str

    def __call__(self, batch: tuple[int, IntArray]) -> Solved:
        """Return λ (m, n) and tails (m, q) of a batch: the number of its class, and where its tiles start."""
        number, starts = batch
        with single_threaded_blas():
            solver = _latest.setdefault(self.name, ClassSolver(self.cover, self.model))
            for other in _latest.keys() - {self.name}:
                _latest.pop(other, None)
            voxels = solver.voxels(number)
            low, high = starts.min(axis=0) + voxels.min(axis=0), starts.max(axis=0) + voxels.max(axis=0) + 1
            part = self.read(tuple(slice(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True)))
            values = VoxelValues.of_array(part, self.isovalue)
            coefficients, tails = solver.solve(values, number, starts - low)
        # Dask ends a worker that holds too much, and counts the pages of files.
        release_pages(part)
        return np.ascontiguousarray(coefficients), np.ascontiguousarray(tails)


_latest: dict[str, ClassSolver] = {}
"""The solver of the fit that this worker is at."""
