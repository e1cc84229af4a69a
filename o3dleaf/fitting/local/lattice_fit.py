r"""Splines of voxels: balls that sit alike on a lattice share their points, their matrix and its factor.

A rigid motion keeps distances, hence the matrix of :math:`φ`. A class of balls (see `VoxelCover`) is factored once,
and its balls are the columns of one right-hand side.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.local.smoothing_selection import GCV_BALLS, each_ball
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.rbf.factor import LocalFactor
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, SplineModel
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import IntArray

COLUMNS = 256
"""Balls of a class that are solved for at once; fixed, so that the result does not depend on the threads."""


@dataclass(frozen=True, eq=False)
class VoxelValues:
    """The data of a lattice: read where they lie, as float64 less the isovalue, ball by ball."""

    data: npt.NDArray[Any]
    isovalue: float

    def of(self, starts: IntArray, voxels: IntArray) -> FloatArray:
        """Return the (m, n) values of balls whose tiles start at (m, d), of `voxels` (n, d) counted from there."""
        stride = np.array([int(np.prod(self.data.shape[axis + 1 :])) for axis in range(self.data.ndim)])
        places = (starts @ stride)[:, np.newaxis] + voxels @ stride
        values: FloatArray = self.data.reshape(-1)[places].astype(np.float64)
        values -= self.isovalue
        return values


def fit_voxels(cover: VoxelCover, values: VoxelValues, model: SplineModel) -> LocalSplines:
    """Fit a spline to the voxels of every ball, each class of balls by one factorization."""
    kernel, smoothing, exponents = model.kernel, model.smoothing, model.exponents
    voxels = [cover.voxels(number) for number in range(len(cover.keys))]
    points = [cover.points(number, each) for number, each in enumerate(voxels)]
    sizes = np.array([each.shape[1] for each in points])
    offsets = np.concatenate([[0], np.cumsum(sizes[cover.classes])])
    begins = np.concatenate([[0], np.cumsum(len(cover.shape) * sizes)[:-1]])
    weights, tails = np.empty(offsets[-1]), np.empty((len(cover.starts), len(exponents)))
    factors: list[Any] = [None] * len(points)
    radii = cover.radii
    of_class = radii[np.unique(cover.classes, return_index=True)[1]]
    with single_threaded_blas():
        if isinstance(smoothing.value, str):
            smoothing = _choose_smoothing(cover, values, model)

        def factor(start: int, stop: int) -> None:
            for number in range(start, stop):
                diagonal = smoothing.diagonal(int(sizes[number])) / of_class[number] ** kernel.power
                factors[number] = LocalFactor.of(
                    points[number], exponents, kernel.power, np.full(sizes[number], diagonal)
                )

        run_blocks(factor, len(points), 1)
        batches = list(_batches(cover.classes))

        def solve_batches(start: int, stop: int) -> None:
            for balls in batches[start:stop]:
                number = cover.classes[balls[0]]
                data = values.of(cover.starts[balls], voxels[number])
                coefficients, tails[balls] = factors[number].solve(data)
                weights[offsets[balls][:, np.newaxis] + np.arange(sizes[number])] = coefficients

        run_blocks(solve_batches, len(batches), 1, reports=True)
    ranks = np.array([len(each.right) for each in factors])[cover.classes]
    sites = np.concatenate([each.ravel() for each in points])
    places, dropped = begins[cover.classes], np.zeros(len(radii), dtype=np.int64)
    return LocalSplines(kernel, smoothing, offsets, places, sites, weights, tails, exponents, ranks, dropped)


def _batches(classes: IntArray) -> Iterator[IntArray]:
    """Yield the balls of each class, `COLUMNS` at a time, those of the largest classes first."""
    order = np.argsort(classes, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(classes[order])) + 1)
    for balls in sorted(groups, key=len, reverse=True):
        for start in range(0, len(balls), COLUMNS):
            yield balls[start : start + COLUMNS]


def _choose_smoothing(cover: VoxelCover, values: VoxelValues, model: SplineModel) -> Smoothing:
    """Return the smoothing that a fixed sample of balls agrees on, by one eigen-decomposition a class."""
    smoothing, power, exponents = model.smoothing, model.kernel.power, model.exponents
    if smoothing.value == "gcv-per-ball":
        raise InputError(
            "smoothing: balls on a lattice share one factorization and its smoothing; give 'gcv' or a number"
        )
    sample = np.unique(np.linspace(0, len(cover.starts) - 1, GCV_BALLS).round().astype(np.int64))
    batches = list(_batches(cover.classes[sample]))

    def of_class(batch: int) -> Spectrum:
        balls = sample[batches[batch]]
        number = int(cover.classes[balls[0]])
        voxels = cover.voxels(number)
        points, data = cover.points(number, voxels), values.of(cover.starts[balls], voxels)
        eigenvalues, coefficients = spectra(points, data, np.ones(len(voxels)), exponents, power)
        eigenvalues /= smoothing.scale(len(voxels)) / cover.radii[balls[0]] ** power
        return Spectrum.pooled(Spectrum(eigenvalues, each, len(voxels)) for each in coefficients)

    return smoothing.chosen(Spectrum.pooled(each_ball(of_class, np.arange(len(batches)))))
