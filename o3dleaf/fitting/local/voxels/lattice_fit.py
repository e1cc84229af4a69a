"""The fit of all balls of a lattice, class by class, here or on the workers of a cluster; and what it takes."""

from collections.abc import Callable
from uuid import uuid4

import numpy as np

from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.core.processes.spread import current_spread
from o3dleaf.core.progress import report
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.core.resources.measured import Cost
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.core.resources.scratch import is_held, made_by_rows, offsets_of, result_array, scratch_array
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.cover.voxel_values import VoxelValues
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.local.voxels.class_solver import ClassSolver, Solved, WorkerSolver, batches_of
from o3dleaf.fitting.rbf.smoothing import SplineModel
from o3dleaf.fitting.rbf.tail import IntArray

RELEASED = 64
"""Such batches, after which the pages of a mapped file are given back."""


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
    batches = sorted(batches_of(cover.classes, along), key=lambda balls: along[balls[0]])

    def place(number: int, solved: Solved) -> None:
        balls = batches[number]
        coefficients, tails[balls] = solved
        weights[offsets[balls][:, np.newaxis] + np.arange(coefficients.shape[1])] = coefficients
        if number % RELEASED == 0:
            release_pages(values.data)
            release_pages(weights)

    with single_threaded_blas():
        run_blocks(lambda start, stop: [solver.factor(number) for number in range(start, stop)], len(sizes), 1)
        _solvebatches_of(cover, values, solver, batches, place)
    of_classes = np.array([solver.factor(number).rank for number in range(len(sizes))])
    flat = np.concatenate([each.ravel() for each in sites])
    places, ranks, dropped = (
        made_by_rows((count,), lambda *part, each=each: each[cover.classes[slice(*part)]], np.int64)
        for each in (begins, of_classes, np.zeros_like(of_classes))
    )
    return LocalSplines(
        model.kernel, model.smoothing, offsets, places, flat, weights, tails, model.exponents, ranks, dropped
    )


def _solvebatches_of(
    cover: VoxelCover,
    values: VoxelValues,
    solver: ClassSolver,
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
    there = WorkerSolver(solver.cover, solver.model, read, values.isovalue, uuid4().hex)
    for done, (number, solved) in enumerate(spread.each(there, map(asked, range(len(batches)))), start=1):
        place(number, solved)
        report(done, len(batches))
