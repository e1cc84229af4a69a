r"""Splines of voxels: balls that sit alike on a lattice share their points, their matrix and its factor.

A rigid motion keeps distances, hence the matrix of :math:`φ`. A class of balls (see `VoxelCover`) is factored once,
and its balls are the columns of one right-hand side. Bare balls share what takes their values to a plane.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from typing import Any
from uuid import uuid4

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import blocks, run_blocks, single_threaded_blas
from o3dleaf.core.processes.spread import current_spread
from o3dleaf.core.progress import report
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.core.resources.measured import Cost
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.core.resources.scratch import is_held, made_by_rows, offsets_of, order_of, result_array, scratch_array
from o3dleaf.fitting.cover.bare_plane import BarePlane
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.cover.voxel_noise import VoxelNoise
from o3dleaf.fitting.cover.voxel_values import VoxelValues
from o3dleaf.fitting.local.smoothing_selection import GCV_BALLS, each_ball
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.rbf.factor import LocalFactor
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, SplineModel
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import IntArray

Solved = tuple[FloatArray, FloatArray]
"""The coefficients λ and the tails of some balls."""

COLUMNS = 256
"""Balls of a class that are solved for at once; fixed, so that the result does not depend on the threads."""
RELEASED = 64
"""Such batches, after which the pages of a mapped file are given back."""
COMPANY = 16
"""Balls that they are filled up to a multiple of: columns that BLAS takes by itself at the end come out otherwise."""


def require_room_for_voxels(voxels: int, cover: VoxelCover | None) -> None:
    """Raise `MemoryBudgetError` or `TimeBudgetError` if a volume takes too much to be fitted by the balls of a cover.

    Without a cover, all of it is fitted in full.
    """
    cost, what = measured.VOLUME + measured.FITTED_VOXEL * voxels, f"fit: {voxels:,} voxels"
    if cover is not None:
        balls = np.bincount(cover.classes, minlength=len(cover.keys))
        fitted = int(balls[cover.keys[:, -1] == 0].sum() * np.prod(cover.tile))
        cost = cost_of_fit(voxels, fitted, int(_sizes(cover) @ balls))
        what = f"{what}, {fitted:,} near the surface"
    require_resources(cost, what, "crop the volume, or take every second voxel")


def cost_of_fit(voxels: float, fitted: float, coefficients: float) -> Cost:
    """Return what a volume takes of which a narrow band is fitted; what lies in files (`scratch_array`) no memory."""
    parts = 8 * coefficients, measured.FITTED_VOXEL.bytes * fitted - 8 * coefficients
    on_disk = sum(size for size in parts if not is_held(size))
    whole = measured.VOLUME + measured.FITTED_VOXEL * fitted + measured.LEFT_VOXEL * voxels
    return whole + Cost(-on_disk)


def _sizes(cover: VoxelCover) -> IntArray:
    """Return how many voxels the balls of each class are fitted to by a spline."""
    return np.array([0 if key[-1] else len(cover.voxels(number)) for number, key in enumerate(cover.keys)])


def fit_voxels(cover: VoxelCover, values: VoxelValues, model: SplineModel) -> LocalSplines:
    """Fit a spline to the voxels of every ball, each class of balls by one factorization; to bare ones a plane."""
    bare, sizes, solver = cover.keys[:, -1] == 1, _sizes(cover), ClassSolver(cover, model)
    count = len(cover.starts)
    # A bare ball has no site: the place of its class, which names it, is its middle.
    sites = [np.zeros((len(cover.shape), 1)) if empty else solver.points(n) for n, empty in enumerate(bare)]
    offsets = offsets_of(made_by_rows((count,), lambda *part: sizes[cover.classes[slice(*part)]], np.int64))
    begins = np.concatenate([[0], np.cumsum([each.size for each in sites])[:-1]])
    weights, tails = result_array((int(offsets[-1]),)), scratch_array((count, len(model.exponents)))
    # As their voxels lie, so that a file larger than memory is gone through once.
    along = cover.starts[:, values.slowest]
    batches = sorted(_batches(cover.classes, along), key=lambda balls: along[balls[0]])

    def place(number: int, solved: Solved) -> None:
        balls = batches[number]
        coefficients, tails[balls] = solved
        weights[offsets[balls][:, np.newaxis] + np.arange(coefficients.shape[1])] = coefficients
        if number % RELEASED == 0:
            release_pages(values.data)
            release_pages(weights)

    with single_threaded_blas():
        run_blocks(lambda start, stop: [solver.factor(number) for number in range(start, stop)], len(sizes), 1)
        _solve_batches(cover, values, solver, batches, place)
    of_classes = np.array([solver.factor(number).rank for number in range(len(sizes))])
    flat = np.concatenate([each.ravel() for each in sites])
    places, ranks, dropped = (
        made_by_rows((count,), lambda *part, each=each: each[cover.classes[slice(*part)]], np.int64)
        for each in (begins, of_classes, np.zeros_like(of_classes))
    )
    return LocalSplines(
        model.kernel, model.smoothing, offsets, places, flat, weights, tails, model.exponents, ranks, dropped
    )


def _solve_batches(
    cover: VoxelCover,
    values: VoxelValues,
    solver: "ClassSolver",
    batches: list[IntArray],
    place: Callable[[int, Solved], None],
) -> None:
    """Solve for the balls of each batch, here or on the workers of a cluster, and place what comes of them."""
    spread = current_spread()
    read = None if spread is None else spread.stand_in(values.data)

    def asked(number: int) -> tuple[int, IntArray]:
        """Return the class of a batch, and where its tiles start."""
        balls = batches[number]
        return int(cover.classes[balls[0]]), cover.starts[balls]

    if spread is None or read is None:

        def solve(start: int, stop: int) -> None:
            for number in range(start, stop):
                place(number, solver.solve(values, *asked(number)))

        run_blocks(solve, len(batches), 1, reports=True)
        return
    there = SolverThere(solver.cover, solver.model, read, values.isovalue, uuid4().hex)
    for done, (number, solved) in enumerate(spread.each(there, map(asked, range(len(batches)))), start=1):
        place(number, solved)
        report(done, len(batches))


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

    def factor(self, number: int) -> LocalFactor | BarePlane:
        """Return what takes the values of a ball of a class to its coefficients."""
        if number not in self._factors:
            self._factors[number] = self._made(number)
        return self._factors[number]

    def _made(self, number: int) -> LocalFactor | BarePlane:
        points, exponents, power = self.points(number), self.model.exponents, self.model.kernel.power
        if self.cover.keys[number, -1]:
            return BarePlane.of(points, exponents)
        count = points.shape[1]
        diagonal = self.model.smoothing.diagonal(count) / self.cover.radius_of(number) ** power
        return LocalFactor.of(points, exponents, power, np.full(count, diagonal))

    def solve(self, values: VoxelValues, number: int, starts: IntArray) -> Solved:
        """Return λ (m, n) and tails (m, q) of the balls of a class whose tiles start at (m, d)."""
        many, voxels = len(starts), self.voxels(number)
        # In whole groups of columns a product has the same bits for each, whatever its company.
        data = np.zeros((-(-many // COMPANY) * COMPANY, len(voxels)))
        data[:many] = values.of(starts, voxels)
        coefficients, coarse = self.factor(number).solve(data)
        return coefficients[:many], coarse[:many]


@dataclass(frozen=True)
class SolverThere:
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


def chosen_smoothing(
    cover: VoxelCover, values: VoxelValues, model: SplineModel, *, two_sides: bool = False
) -> SplineModel:
    """Return the model with its smoothing chosen, if it is yet to be.

    Of values with `two_sides`, the isovalue between them, the noise is known where it is correlated.
    """
    if not isinstance(model.smoothing.value, str):
        return model
    noise = VoxelNoise.of(values) if two_sides else None
    with single_threaded_blas():
        return replace(model, smoothing=_choose_smoothing(cover, values, model, noise))


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
    every = made_by_rows(classes.shape, np.arange, np.int64)
    order = order_of(classes, order_of(along, every))
    ends = np.cumsum(np.bincount(classes))
    for begin, end in pairwise([0, *ends.tolist()]):
        for start, stop in blocks(end - begin, COLUMNS):
            yield order[begin + start : begin + stop]


def _choose_smoothing(
    cover: VoxelCover, values: VoxelValues, model: SplineModel, noise: VoxelNoise | None
) -> Smoothing:
    """Return the smoothing that a fixed sample of balls agrees on, by one eigen-decomposition a class."""
    smoothing, power, exponents = model.smoothing, model.kernel.power, model.exponents
    if smoothing.value == "gcv-per-ball":
        raise InputError(
            "smoothing: balls on a lattice share one factorization and its smoothing; give 'gcv' or a number"
        )
    sample = np.unique(np.linspace(0, len(cover.starts) - 1, GCV_BALLS).round().astype(np.int64))
    batches = list(_batches(cover.classes[sample], np.arange(len(sample))))

    def of_class(batch: int) -> list[tuple[Spectrum, bool]]:
        balls = sample[batches[batch]]
        number = int(cover.classes[balls[0]])
        voxels = cover.voxels(number)
        points, data = cover.points(number, voxels), values.of(cover.starts[balls], voxels)
        system = np.ones(len(voxels)), exponents, power
        eigenvalues, coefficients = spectra(points, data, *system)
        variances = None
        if noise is not None:
            # Of the covariances' columns, then of the rows of what comes of them.
            _, columns = spectra(points, noise.between(voxels), *system)
            _, both = spectra(points, np.ascontiguousarray(columns.T), *system)
            variances = np.maximum(np.diag(both), 0.0)
        eigenvalues /= smoothing.scale(len(voxels)) / cover.radii[balls[0]] ** power
        crossed = (data.min(axis=1) < 0) & (data.max(axis=1) > 0)
        return [
            (Spectrum(eigenvalues, each, len(voxels), variances), bool(on))
            for each, on in zip(coefficients, crossed, strict=True)
        ]

    found = list(chain.from_iterable(each_ball(of_class, np.arange(len(batches)))))
    # Where the noise is known, what is away from the level has nothing more to say.
    near = [spectrum for spectrum, crossed in found if crossed and noise is not None]
    return smoothing.chosen(Spectrum.pooled(near or [spectrum for spectrum, _ in found]))
