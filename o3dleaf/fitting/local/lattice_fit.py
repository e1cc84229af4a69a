r"""Splines of voxels: balls that sit alike on a lattice share their points, their matrix and its factor.

A rigid motion keeps distances, hence the matrix of :math:`φ`. A class of balls (see `VoxelCover`) is factored once,
and its balls are the columns of one right-hand side. Bare balls share what takes their values to a plane.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.core.resources.measured import Cost
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.core.resources.scratch import is_held, scratch_array
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.local.smoothing_selection import GCV_BALLS, each_ball
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.rbf.factor import LocalFactor
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, SplineModel
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import IntArray

STEEPEST = 0.9
"""Of the value in the middle of a bare ball, how much its plane may rise or fall to the ball's edge: all of it lies on
the side of the isovalue on which its voxels lie."""
COLUMNS = 256
"""Balls of a class that are solved for at once; fixed, so that the result does not depend on the threads."""
RELEASED = 64
"""Such batches, after which the pages of a mapped file are given back."""
COMPANY = 16
"""Balls that they are filled up to a multiple of: columns that BLAS takes by itself at the end come out otherwise."""


@dataclass(frozen=True, eq=False)
class VoxelValues:
    """The data of a lattice: read where they lie, as float64 less the isovalue, ball by ball.

    Attributes
    ----------
    data : ndarray
        Of any layout; a mapped file stays one.
    isovalue : float
    """

    data: npt.NDArray[Any]
    isovalue: float

    @classmethod
    def of_array(cls, data: npt.NDArray[Any], isovalue: float) -> "VoxelValues":
        """Return the values of an array, copied only where it runs backwards, or is a part of records."""
        lies = min(data.strides) > 0 and not any(stride % data.itemsize for stride in data.strides)
        return cls(data if lies else np.ascontiguousarray(data), isovalue)

    @cached_property
    def _stride(self) -> IntArray:
        """(d,) numbers from a voxel to the next along each axis."""
        return np.array(self.data.strides) // self.data.itemsize

    @cached_property
    def _flat(self) -> npt.NDArray[Any]:
        """All numbers from the first voxel to the last, as they lie in memory or in the file."""
        last = int((np.array(self.data.shape) - 1) @ self._stride)
        return np.lib.stride_tricks.as_strided(self.data, (last + 1,), (self.data.itemsize,), writeable=False)

    @property
    def slowest(self) -> int:
        """The axis along which voxels lie farthest apart."""
        return int(np.argmax(self._stride))

    def of(self, starts: IntArray, voxels: IntArray) -> FloatArray:
        """Return the (m, n) values of balls whose tiles start at (m, d), of `voxels` (n, d) counted from there."""
        places = (starts @ self._stride)[:, np.newaxis] + voxels @ self._stride
        values: FloatArray = self._flat[places].astype(np.float64)
        values -= self.isovalue
        return values


def require_room_for_voxels(voxels: int, cover: VoxelCover | None) -> None:
    """Raise `MemoryBudgetError` or `TimeBudgetError` if a volume takes too much to be fitted by the balls of a cover.

    Without a cover, all of it is fitted in full. Coefficients in a file (`scratch_array`) take no memory.
    """
    cost, what = measured.FITTED_VOXEL * voxels, f"fit: {voxels:,} voxels"
    if cover is not None:
        fitted = int(np.count_nonzero(~cover.bare) * np.prod(cover.tile))
        coefficients = int(_sizes(cover)[cover.classes].sum())
        on_disk = 0 if is_held(8 * coefficients) else 8 * coefficients
        cost = measured.FITTED_VOXEL * fitted + measured.LEFT_VOXEL * voxels + Cost(-on_disk)
        what = f"{what}, {fitted:,} near the surface"
    require_resources(cost, what, "crop the volume, or take every second voxel")


def _sizes(cover: VoxelCover) -> IntArray:
    """Return how many voxels the balls of each class are fitted to by a spline."""
    return np.array([0 if key[-1] else len(cover.voxels(number)) for number, key in enumerate(cover.keys)])


def fit_voxels(cover: VoxelCover, values: VoxelValues, model: SplineModel) -> LocalSplines:
    """Fit a spline to the voxels of every ball, each class of balls by one factorization; to bare ones a plane."""
    bare, sizes = cover.keys[:, -1] == 1, _sizes(cover)
    voxels = [cover.voxels(number) for number in range(len(cover.keys))]
    points = [cover.points(number, each) for number, each in enumerate(voxels)]
    # A bare ball has no site: the place of its class, which names it, is its middle.
    sites = [np.zeros((len(cover.shape), 1)) if empty else each for empty, each in zip(bare, points, strict=True)]
    offsets = np.concatenate([[0], np.cumsum(sizes[cover.classes])])
    begins = np.concatenate([[0], np.cumsum([each.size for each in sites])[:-1]])
    weights, tails = scratch_array((int(offsets[-1]),)), np.empty((len(cover.starts), len(model.exponents)))
    with single_threaded_blas():
        factors = _factors(cover, points, model)
        # As their voxels lie, so that a file larger than memory is gone through once.
        along = cover.starts[:, values.slowest]
        batches = sorted(_batches(cover.classes, along), key=lambda balls: along[balls[0]])

        def solve_batches(start: int, stop: int) -> None:
            for balls in batches[start:stop]:
                number, many = cover.classes[balls[0]], len(balls)
                # In whole groups of columns a product has the same bits for each, whatever its company.
                data = np.zeros((-(-many // COMPANY) * COMPANY, len(voxels[number])))
                data[:many] = values.of(cover.starts[balls], voxels[number])
                coefficients, coarse = factors[number].solve(data)
                tails[balls] = coarse[:many]
                weights[offsets[balls][:, np.newaxis] + np.arange(sizes[number])] = coefficients[:many]
            if start % RELEASED == 0:
                release_pages(values.data)
                release_pages(weights)

        run_blocks(solve_batches, len(batches), 1, reports=True)
    ranks = np.array([each.rank for each in factors])[cover.classes]
    dropped = np.zeros(len(cover.starts), dtype=np.int64)
    flat = np.concatenate([each.ravel() for each in sites])
    places = begins[cover.classes]
    return LocalSplines(
        model.kernel, model.smoothing, offsets, places, flat, weights, tails, model.exponents, ranks, dropped
    )


def _factors(cover: VoxelCover, points: list[FloatArray], model: SplineModel) -> "list[LocalFactor | BarePlane]":
    """Return what takes the values of the balls of each class to their coefficients."""
    factors: list[Any] = [None] * len(points)
    power, exponents = model.kernel.power, model.exponents
    of_class = cover.radii[np.unique(cover.classes, return_index=True)[1]]

    def factor(start: int, stop: int) -> None:
        for number in range(start, stop):
            if cover.keys[number, -1]:
                factors[number] = BarePlane.of(points[number], exponents)
                continue
            count = points[number].shape[1]
            diagonal = model.smoothing.diagonal(count) / of_class[number] ** power
            factors[number] = LocalFactor.of(points[number], exponents, power, np.full(count, diagonal))

    run_blocks(factor, len(points), 1)
    return factors


@dataclass(frozen=True, eq=False)
class BarePlane:
    """The plane of least squares through the values of a bare ball, not as steep as to leave their side of zero.

    Attributes
    ----------
    solution : (q, n) ndarray
        From values to coefficients of the tail, those of a degree above 1 being zero.
    rank : int
    """

    solution: FloatArray
    rank: int

    @classmethod
    def of(cls, points: FloatArray, exponents: IntArray) -> "BarePlane":
        """Return it for (d, n) points in unit coordinates."""
        low = exponents.sum(axis=1) <= 1
        matrix = np.prod(points.T[:, np.newaxis, :] ** exponents[low], axis=2)
        solution = np.zeros((len(exponents), points.shape[1]))
        solution[low] = np.linalg.pinv(matrix)
        return cls(solution, int(np.linalg.matrix_rank(matrix)))

    def solve(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return no λ, (m, 0), and the (m, q) tails of (m, n) values."""
        # Not by BLAS, whose bits depend on how many balls there are.
        tails: FloatArray = np.einsum("mn,qn->mq", values, self.solution)
        # The first monomial is 1.
        rise = np.linalg.norm(tails[:, 1:], axis=1)
        most = STEEPEST * np.abs(tails[:, 0])
        tails[:, 1:] *= np.where(rise > most, most / np.maximum(rise, np.finfo(np.float64).tiny), 1.0)[:, np.newaxis]
        return np.empty((len(values), 0)), tails


def chosen_smoothing(cover: VoxelCover, values: VoxelValues, model: SplineModel) -> SplineModel:
    """Return the model with its smoothing chosen, if it is yet to be."""
    if not isinstance(model.smoothing.value, str):
        return model
    with single_threaded_blas():
        return replace(model, smoothing=_choose_smoothing(cover, values, model))


def averaged_voxels(cover: VoxelCover, model: SplineModel) -> float:
    """Return how many voxels the fit in the middle of a ball averages over, 1 for an interpolant.

    By so much it lowers the variance of white noise: 1 / |h|², where the fit at a voxel is h · f. The class of the most
    balls stands for all.
    """
    number = int(np.bincount(cover.classes).argmax())
    voxels = cover.voxels(number)
    points, radius = cover.points(number, voxels), cover.radii[cover.classes == number][0]
    diagonal = model.smoothing.diagonal(len(voxels)) / radius**model.kernel.power
    with single_threaded_blas():
        factor = LocalFactor.of(points, model.exponents, model.kernel.power, np.full(len(voxels), diagonal))
        row = np.zeros((1, len(voxels)))
        row[0, np.argmin((points**2).sum(axis=0))] = 1.0
        # The fit at the voxels is f − D λ, and λ of f is a symmetric matrix.
        row -= diagonal * factor.solve(row)[0]
    return float(1 / (row**2).sum())


def _batches(classes: IntArray, along: IntArray) -> Iterator[IntArray]:
    """Yield the balls of each class in the order of `along`, `COLUMNS` at a time."""
    order = np.lexsort((along, classes))
    groups = np.split(order, np.flatnonzero(np.diff(classes[order])) + 1)
    for balls in groups:
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
    batches = list(_batches(cover.classes[sample], sample))

    def of_class(batch: int) -> Spectrum:
        balls = sample[batches[batch]]
        number = int(cover.classes[balls[0]])
        voxels = cover.voxels(number)
        points, data = cover.points(number, voxels), values.of(cover.starts[balls], voxels)
        eigenvalues, coefficients = spectra(points, data, np.ones(len(voxels)), exponents, power)
        eigenvalues /= smoothing.scale(len(voxels)) / cover.radii[balls[0]] ** power
        return Spectrum.pooled(Spectrum(eigenvalues, each, len(voxels)) for each in coefficients)

    return smoothing.chosen(Spectrum.pooled(each_ball(of_class, np.arange(len(batches)))))
