"""Errors at points left out of the fit, group by group, without refitting: by which smoothing is compared."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local.columns.column_fit_loops import ball_held_out
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.smoothing_selection import each_ball
from o3dleaf.fitting.rbf.smoothing import SplineModel


def held_out_errors(cover: Cover, data: ScatteredData, model: SplineModel) -> FloatArray:
    r"""Return :math:`f_j - F^{(-I)}(x_j)`, with the whole group I of point j left out of every ball's fit.

    Groups of one, where the data have none, give leave-one-out errors. On scattered scans, neighboring points share
    their errors, and only groups wider than that sharing (stretches of a leaf) distinguish smoothing from
    following it. NaN where no ball keeps enough points without the group.

    .. math:: e_I = (B_{II})^{-1} (B f)_I, \qquad B = Q_2 \bigl(Q_2^T (A + D)\, Q_2\bigr)^{-1} Q_2^T

    in each ball, blended with the partition of unity (Wahba 1990, chapter 4, for groups of one).

    Parameters
    ----------
    cover : Cover
    data : ScatteredData
        Its groups may have any numbers.
    model : SplineModel
        Of the fit.

    Returns
    -------
    (n,) ndarray, or (n, c) of c columns of values, by one factorization a ball
    """
    points, exponents = data.points, model.exponents
    values = data.weighted._replace(values=data.values.reshape(len(points), -1))
    groups = np.arange(len(points)) if data.groups is None else data.groups
    diagonals, power = model.smoothing.diagonals(cover.counts), model.kernel.power

    def errors_of(ball: int) -> FloatArray:
        errors: FloatArray = ball_held_out(ball, values, cover.balls, exponents, power, diagonals, groups)
        return errors

    with single_threaded_blas():
        errors = np.concatenate(each_ball(errors_of, np.arange(len(cover.radii))), axis=1)
    known = ~np.isnan(errors[0])
    rows, weight = cover.members[known], member_weights(cover, points)[known]
    total = np.bincount(rows, weight, len(points))
    blended = np.array([np.bincount(rows, weight * column[known], len(points)) for column in errors])
    means = np.where(total > 0, blended / np.where(total > 0, total, 1.0), np.nan)
    return means.T.reshape(data.values.shape)


def member_weights(cover: Cover, points: FloatArray) -> FloatArray:
    """Return the weights (total,) of the balls at the points that they are fitted to, which do not sum to 1."""
    balls = np.repeat(np.arange(len(cover.radii)), cover.counts)
    away = points[cover.members] - cover.centers[balls]
    return _wendland(np.linalg.norm(away, axis=1) / cover.radii[balls])


def _wendland(tau: FloatArray) -> FloatArray:
    """Return w(τ) of an array, as `weight_loops.wendland` does of a number."""
    rest = np.maximum(1.0 - tau, 0.0)
    return np.asarray(rest * rest * rest * rest * (4.0 * tau + 1.0))
