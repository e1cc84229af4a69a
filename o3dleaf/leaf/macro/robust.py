"""A smooth height through a scan whose passes disagree: Huber's loss, smoothing judged on held-out stretches.

A scanner's passes over one leaf can lie more than a millimeter apart. Least squares then runs between
them, or swings from one to the other; a robust fit follows the majority. And as neighboring points of a
pass err together, smoothing that is judged on single points follows their errors; whole stretches of
the leaf must be left out to see them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.trees import query
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local.cross_validation import held_out_errors, member_weights
from o3dleaf.fitting.local.fit_loops import ball_residuals
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.smoothing_selection import each_ball
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing, SplineModel
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.macro.noise import MIN_NOISE, density_of, height_noise, plane_noise

HUBER = 1.345
"""Huber's constant: 95 % of the efficiency of least squares where the errors are normal (Huber 1964)."""
GRID_RATIO = np.sqrt(10)
"""From one trial smoothing to the next: a factor 1.33 to 1.26 in bandwidth for kernels of 2m = 4 to 5."""
MAX_STRETCH = 1 / 40
"""Longest stretch left out, of the leaf's length: more of them judge better than wider ones."""

MAX_BANDWIDTH = 0.25
"""Largest bandwidth of the smoothing, of a ball's radius: beyond it the balls would shape the surface, so they grow."""

TOLERANCE = 0.02
MAX_ITERATIONS = 30


@dataclass(frozen=True)
class RobustChoice:
    """Smoothing and weights chosen by the robust fit.

    Attributes
    ----------
    smoothing : float
        The number on the diagonal.
    bandwidth : float
        Its low-pass bandwidth, in the points' unit.
    noise : float
        Standard deviation of the scan about its local planes, or `MIN_NOISE`.
    weights : (n,) ndarray
        Huber's, of each point: 1 within 1.345 noise of the surface, less beyond.
    """

    smoothing: float
    bandwidth: float
    noise: float
    weights: FloatArray = field(metadata={"stored": "trust"})


def huber_loss(errors: FloatArray, corner: float) -> FloatArray:
    """Return e²/2 up to the corner δ and δ(|e| − δ/2) beyond."""
    size = np.abs(errors)
    return np.where(size <= corner, size**2 / 2, corner * (size - corner / 2))


@dataclass(frozen=True, eq=False)
class RobustHeight:
    r"""The problem :math:`\min_H \sum_k \mathrm{huber}_δ(z_k - H(x_k)) + s\,θ J(H)` over one cover of balls.

    Attributes
    ----------
    cover : Cover
    plane, heights : (n, 2), (n,) ndarrays
    kernel : Polyharmonic
    corner : float
        Huber's δ.
    space, normals : (n, 3) ndarrays, optional
        Where heights are those over another surface, the points in space and that surface's unit normals: what is held
        out are the points, whose errors along the normals count, so that a smoothing is judged by the shape as well.
    """

    cover: Cover
    plane: FloatArray
    heights: FloatArray
    kernel: Polyharmonic
    corner: float
    space: FloatArray | None = None
    normals: FloatArray | None = None

    @cached_property
    def shares(self) -> FloatArray:
        """(total,) the shares that the balls have in the blend at each of their points."""
        weights, members = member_weights(self.cover, self.plane), self.cover.members
        return np.asarray(weights / np.bincount(members, weights)[members])

    def reweight(self, smoothing: float, weights: FloatArray) -> FloatArray:
        """Return the weights min(1, δ/|residual|) that reproduce themselves, by repeated fits from given ones.

        The residual is that of the blended fit, so that overlapping balls agree on the pass they follow. At a ball's
        own points it is known from its solution. A ball is fitted again where a weight has moved since it was.
        """
        cover, members = self.cover, self.cover.members
        model = SplineModel(self.kernel, 1, Smoothing(smoothing))
        exponents, power, diagonals = model.exponents, self.kernel.power, model.smoothing.diagonals(cover.counts)
        left, used, stale = np.empty(len(members)), np.empty(len(members)), np.arange(len(cover.radii))

        def fit(ball: int) -> None:
            own = slice(cover.offsets[ball], cover.offsets[ball + 1])
            left[own] = ball_residuals(ball, data, cover.balls, exponents, power, diagonals)
            used[own] = data.weights[members[own]]

        for _ in range(MAX_ITERATIONS):
            data = ScatteredData(self.plane, self.heights, weights).weighted
            each_ball(fit, stale)
            residual = np.abs(np.bincount(members, self.shares * left))
            weights = np.minimum(1.0, self.corner / np.maximum(residual, self.corner / 1e6))
            moved = np.maximum.reduceat(np.abs(weights[members] - used), cover.offsets[:-1])
            stale = np.flatnonzero(moved >= TOLERANCE)
            if not len(stale):
                break
        return weights

    def held_out_losses(self, smoothing: float, weights: FloatArray, stretches: IntArray) -> FloatArray:
        """Return the Huber losses (n,) of heights, or points, predicted without their stretch; NaN where none was."""
        values = self.heights if self.space is None else self.space
        data = ScatteredData(self.plane, values, weights, stretches)
        errors = held_out_errors(self.cover, data, SplineModel(self.kernel, 1, Smoothing(smoothing)))
        return huber_loss(errors if self.normals is None else np.sum(errors * self.normals, axis=1), self.corner)


class Trials(NamedTuple):
    """Smoothings that were tried, from smooth to rough.

    Attributes
    ----------
    noise : float
        Standard deviation of the points about their local planes, or `MIN_NOISE`.
    stretches : (n,) ndarray of int64
        The stretch of the leaf that each point was held out with.
    bandwidths, smoothings : (t,) ndarrays
    losses, weights : (t, n) ndarrays
        Huber's, of each point held out (NaN where it could not be), and of each point in the fit.
    """

    noise: float
    stretches: IntArray
    bandwidths: FloatArray
    smoothings: FloatArray
    losses: FloatArray
    weights: FloatArray

    @property
    def best(self) -> int:
        """The trial of least mean loss."""
        known = [losses[~np.isnan(losses)] for losses in self.losses]
        if not all(map(len, known)):
            raise InputError("leaf_points: are too few to judge a smoothing; give smoothing, or more points")
        return int(np.argmin([losses.mean() for losses in known]))

    def choice(self, trial: int) -> RobustChoice:
        """Return one of the trials."""
        return RobustChoice(
            float(self.smoothings[trial]), float(self.bandwidths[trial]), self.noise, self.weights[trial]
        )


def try_smoothings(
    cover: Cover,
    leaf_points: FloatArray,
    kernel: Polyharmonic,
    *,
    half_width: float | None = None,
    widest: float = np.inf,
    space: FloatArray | None = None,
    normals: FloatArray | None = None,
) -> Trials:
    """Fit heights robustly with every trial smoothing, and predict each stretch of the leaf from the others.

    Parameters
    ----------
    cover : Cover
        Of the (along, across) plane.
    leaf_points : (n, 3) ndarray
        (along, across, up).
    kernel : Polyharmonic
        In two dimensions.
    half_width : float, optional
        Of the leaf; by default what most points lie within of across = 0, or nearly.
    widest : float
        Bandwidth beyond which none is tried, if it is less than a quarter of the width.
    space, normals : (n, 3) ndarrays, optional
        As in `RobustHeight`.
    """
    plane, heights = np.ascontiguousarray(leaf_points[:, :2]), np.ascontiguousarray(leaf_points[:, 2])
    measured = plane_noise(leaf_points) if space is None else height_noise(leaf_points)
    noise = max(measured, MIN_NOISE / np.sqrt(density_of(plane)))
    problem = RobustHeight(cover, plane, heights, kernel, HUBER * noise, space, normals)
    if half_width is None:
        half_width = float(np.quantile(np.abs(plane[:, 1] - np.median(plane[:, 1])), 0.95))
    stretch = min(half_width, float(np.ptp(plane[:, 0])) * MAX_STRETCH)
    if not stretch > 0:
        raise InputError("leaf_points: lie on one line, seen from above; give the points of a leaf")
    stretches = np.floor((plane[:, 0] - plane[:, 0].min()) / stretch).astype(np.int64)
    weights, rows = np.ones(len(plane)), []
    trials = list(_trial_smoothings(leaf_points, kernel, min(half_width / 2, widest)))
    # From smooth to rough: each weighting starts from its smoother neighbor's, which knows the majority.
    for done, (_, smoothing) in enumerate(trials, start=1):
        with progress.silent():
            weights = problem.reweight(smoothing, weights)
            rows.append((problem.held_out_losses(smoothing, weights, stretches), weights))
        progress.report(done, len(trials))
    bandwidths, smoothings = np.array(trials).T
    losses, weighted = (np.array(column) for column in zip(*rows, strict=True))
    return Trials(noise, stretches, bandwidths, smoothings, losses, weighted)


def choose_robustly(cover: Cover, leaf_points: FloatArray, kernel: Polyharmonic) -> RobustChoice:
    """Return the smoothing of least Huber loss on held-out stretches, and each point's weight under it.

    Parameters
    ----------
    cover, leaf_points, kernel
        As in `try_smoothings`.
    """
    trials = try_smoothings(cover, leaf_points, kernel)
    return trials.choice(trials.best)


Choice = TypeVar("Choice", bound=RobustChoice)


def widest_bandwidth(cover: Cover) -> float:
    """Return the widest bandwidth of a smoothing that does not let balls shape the surface.

    Of half a wave across a ball of radius r a bandwidth b leaves :math:`1/(1 + (π b / 2 r)^5)` by r³ in the plane: 99 %
    at a quarter of r, 77 % at half of it. Beyond that fits are their polynomial tails, and the surface is a patchwork
    of planes.
    """
    return MAX_BANDWIDTH * float(np.median(cover.radii))


def choose_with_balls(
    leaf_points: FloatArray,
    kernel: Polyharmonic,
    size: tuple[int, int],
    overlap: float,
    choose: Callable[[Cover, FloatArray, Polyharmonic], Choice],
) -> tuple[tuple[int, int], Choice]:
    """Return a robust choice, and the size of balls that are wide enough for its bandwidth."""
    plane = np.ascontiguousarray(leaf_points[:, :2])
    bounds = np.array([plane.min(axis=0), plane.max(axis=0)])
    while True:
        cover = Cover.fit(plane, bounds, size, overlap)
        choice = choose(cover, leaf_points, kernel)
        if choice.bandwidth <= widest_bandwidth(cover) or size[1] >= len(leaf_points):
            return size, choice
        size = (2 * size[0], 2 * size[1])


def _trial_smoothings(leaf_points: FloatArray, kernel: Polyharmonic, widest: float) -> Iterator[tuple[float, float]]:
    """Yield (bandwidth, smoothing) from the widest down to the scan's median spacing."""
    distance, _ = query(cKDTree(leaf_points), leaf_points, k=2)
    spacing = float(np.median(distance[:, 1]))
    if not spacing > 0:  # most of them stand there twice
        distinct = np.unique(leaf_points, axis=0)
        spacing = float(np.median(query(cKDTree(distinct), distinct, k=2)[0][:, 1]))
    density = density_of(leaf_points[:, :2])
    order = kernel.power + kernel.dimension
    steps = max(int(np.ceil(order * np.log(widest / spacing) / np.log(GRID_RATIO))), 1)
    for bandwidth in np.geomspace(widest, spacing, steps + 1):
        yield float(bandwidth), kernel.smoothing_for(float(bandwidth), density)
