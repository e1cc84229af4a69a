"""Smoothing chosen place by place: a tight fold at the tip wants less of it than a stretch whose passes disagree.

One smoothing s for all of a leaf is a compromise. As s stands on a point's diagonal divided by the point's weight,
weights c = s/s' give the points of one place the smoothing s' of their own.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.trees import query
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.leaf.macro.robust import RobustChoice, Trials, try_smoothings, widest_bandwidth

WINDOW = 600
"""Points around a ball by which its smoothing is judged: of a narrow leaf five stretches or more, of a broad one a
tenth of it."""
PRIOR = 200
"""Points' worth of the whole leaf's mean losses that are added to a window's: a few points decide nothing."""
BLENDED = 3
"""Balls whose smoothing a point's is the mean of, in the logarithm, each by its nearness."""


@dataclass(frozen=True)
class LocalChoice(RobustChoice):
    """A robust choice whose smoothing holds where `factors` are 1.

    Attributes
    ----------
    factors : (n,) ndarray
        Of each point: the smoothing over that of its place, by which its weight is multiplied.
    """

    factors: FloatArray


def choose_by_place(
    cover: Cover,
    leaf_points: FloatArray,
    kernel: Polyharmonic,
    half_width: float,
    space: FloatArray,
    normals: FloatArray,
) -> LocalChoice:
    """Return the smoothing of least Huber loss on held-out stretches, for the leaf and for each place.

    Parameters
    ----------
    cover, leaf_points, kernel, half_width, space, normals
        As in `try_smoothings`.
    """
    trials = try_smoothings(
        cover,
        leaf_points,
        kernel,
        half_width=half_width,
        widest=widest_bandwidth(cover),
        space=space,
        normals=normals,
    )
    best = trials.best
    plane = leaf_points[:, :2]
    size = min(WINDOW, len(plane))
    _, windows = query(cKDTree(plane), cover.centers, k=[*range(1, size + 1)])
    prior = np.nanmean(trials.losses, axis=1)
    local = np.array([_best_of(trials, rows, prior) for rows in windows])
    ratio = np.log(trials.smoothings[best] / trials.smoothings[local])
    count = min(BLENDED, len(cover.centers))
    distance, balls = query(cKDTree(cover.centers), plane, k=[*range(1, count + 1)])
    nearness = 1 / np.maximum(distance, 1e-12 * cover.radii.max())
    factors = np.exp((nearness * ratio[balls]).sum(axis=1) / nearness.sum(axis=1))
    nearest = local[balls[:, 0]]
    weights = trials.weights[nearest, np.arange(len(plane))]
    widest = float(trials.bandwidths[local].max())
    return LocalChoice(float(trials.smoothings[best]), widest, trials.noise, weights, factors)


def _best_of(trials: Trials, rows: IntArray, prior: FloatArray) -> int:
    """Return the trial that predicts the points `rows` best, among those no smoother than the best for all."""
    sums = np.nansum(trials.losses[:, rows], axis=1) + PRIOR * prior
    return trials.best + int(np.argmin(sums[trials.best :]))
