"""Errors at points left out of the fit, group by group, without refitting: what smoothing is judged by."""

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.fitting.pu import ball_loops
from o3dleaf.fitting.pu.cover import Cover
from o3dleaf.fitting.pu.weight_loops import wendland
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents


def held_out_errors(
    cover: Cover,
    points: FloatArray,
    values: FloatArray,
    groups: IntArray,
    *,
    kernel: Polyharmonic,
    degree: int,
    smoothing: Smoothing,
    trust: FloatArray | None = None,
) -> FloatArray:
    r"""Return :math:`f_j - F^{(-I)}(x_j)`, with the whole group I of point j left out of every ball's fit.

    Groups of one give leave-one-out errors. On scattered scans, neighbouring points share their
    errors, and only groups wider than that sharing (stretches of a leaf) tell smoothing from
    following it. NaN where no ball keeps enough points without the group.

    .. math:: e_I = (B_{II})^{-1} (B f)_I, \qquad B = Q_2 \bigl(Q_2^T (A + D)\, Q_2\bigr)^{-1} Q_2^T

    in each ball, blended with the partition of unity (Wahba 1990, chapter 4, for groups of one).

    Parameters
    ----------
    cover : Cover
    points, values : (n, d), (n,) ndarrays
    groups : (n,) int64 ndarray
        Number of the group of each point.
    kernel, degree, smoothing, trust
        As the fit that is judged.
    """
    exponents = tail_exponents(points.shape[1], degree)
    balls = (cover.centres, cover.radii, cover.offsets, cover.members)
    diagonal = smoothing.diagonals(cover.counts)
    weights = np.ones(len(points)) if trust is None else trust
    found: list[FloatArray] = [np.empty(0)] * len(cover.radii)

    def task(start: int, stop: int) -> None:
        for ball in range(start, stop):
            found[ball] = ball_loops.ball_held_out(
                ball, points, values, weights, balls, exponents, kernel.power, diagonal, groups
            )

    with single_threaded_blas():
        run_blocks(task, len(found), 1)
    total, blended = np.zeros(len(points)), np.zeros(len(points))
    for ball, errors in enumerate(found):
        known = ~np.isnan(errors)
        rows = cover.members[cover.offsets[ball] : cover.offsets[ball + 1]][known]
        tau = np.linalg.norm(points[rows] - cover.centres[ball], axis=1) / cover.radii[ball]
        weight = np.array([wendland(t) for t in tau])
        total[rows] += weight
        blended[rows] += weight * errors[known]
    return np.where(total > 0, blended / np.where(total > 0, total, 1.0), np.nan)
