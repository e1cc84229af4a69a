"""The balls of a volume that are fitted, and how much they are smoothed where that is to be chosen."""

from dataclasses import replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.cover.lattice_sample import sample_balls
from o3dleaf.fitting.cover.voxel_lattice import VoxelLattice
from o3dleaf.fitting.cover.voxel_noise import VoxelNoise
from o3dleaf.fitting.cover.voxel_values import VoxelValues
from o3dleaf.fitting.local.smoothing_selection import GCV_BALLS, each_ball
from o3dleaf.fitting.local.voxels.class_solver import ClassSolver, batches_of
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, SplineModel
from o3dleaf.fitting.rbf.spectrum_loops import spectra


def cover_in_full(
    values: VoxelValues,
    lattice: VoxelLattice,
    most: int,
    overlap: float,
    box: FloatArray,
    model: SplineModel,
    *,
    mask: npt.NDArray[np.bool_] | None = None,
) -> tuple[VoxelCover, SplineModel]:
    """Return the balls that reach into a box (2, d), and the model, its smoothing chosen.

    Balls contain `most` voxels at most, but larger ones where they contain none that a mask marks.
    """
    cover = VoxelCover.fit(values.data.shape, lattice.steps, most, overlap, mask)
    cover = cover.reaching(box[0], box[1], lattice.origin)
    return cover, _with_smoothing(cover, values, model)


def cover_near_surface(
    values: VoxelValues,
    lattice: VoxelLattice,
    most: int,
    overlap: float,
    box: FloatArray,
    model: SplineModel,
) -> tuple[VoxelCover, SplineModel]:
    """Return the balls near the isovalue that reach into a box (2, d), bare ones elsewhere, and the model."""
    sizes = values.data.shape, lattice.steps, most, overlap
    sample, usual = sample_balls(*sizes, box, lattice.origin, GCV_BALLS)
    model = _with_smoothing(sample, values, model, two_sides=True)
    cover = sample.banded(values.data, values.isovalue, averaged_voxels(usual, model))
    return cover.reaching(box[0], box[1], lattice.origin), model


def averaged_voxels(cover: VoxelCover, model: SplineModel) -> float:
    """Return how many voxels the fit in the middle of a ball averages over, 1 for an interpolant.

    By so much it lowers the variance of white noise: 1 / |h|², where the fit at a voxel is h · f. The class of the most
    balls stands for all.
    """
    number, solver = int(np.bincount(cover.classes).argmax()), ClassSolver(cover, model)
    points = solver.points(number)
    row = np.zeros((1, points.shape[1]))
    row[0, np.argmin((points**2).sum(axis=0))] = 1.0
    with single_threaded_blas():
        # The fit at the voxels is f − D λ, and λ of f is a symmetric matrix.
        row -= solver.diagonal(number) * solver.factor(number).solve(row)[0]
    return float(1 / (row**2).sum())


def _with_smoothing(
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


def _choose_smoothing(
    cover: VoxelCover, values: VoxelValues, model: SplineModel, noise: VoxelNoise | None
) -> Smoothing:
    """Return the smoothing that a fixed sample of balls agrees on, by one eigen-decomposition a class."""
    smoothing, power, exponents = model.smoothing, model.kernel.power, model.exponents
    if smoothing.value == "gcv-per-ball":
        raise InputError(
            "smoothing: balls on a lattice share one factorization and its smoothing; give 'gcv' or a number"
        )
    sample = even_rows(len(cover.starts), GCV_BALLS)
    batches = list(batches_of(cover.classes[sample], np.arange(len(sample))))

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
