r"""Splines of points and normals on a surface: F = 0 and ∇F = −n there, and values alone where no normal is known.

.. math:: F(x) = \sum_j λ_j φ(x - x_j) - \sum_j c_j \cdot \nabla φ(x - x_j) + p(x)

`Hermite` fits both in a ball at once, `CurlFree` the gradients first and the values then. Each blends
like splines of values do; see `PUInterpolant.fit_oriented`.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Positive, SmoothingValue
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import as_number, require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.fitting.cover.cover import Cover, ragged_rows
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local import oriented_loops
from o3dleaf.fitting.local.blend_loops import PotentialBalls
from o3dleaf.fitting.local.blending import blend_balls
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.oriented_loops import (
    CORRECTED,
    CURL_FREE,
    HERMITE,
    OrientedPoints,
    PotentialArrays,
    PotentialKind,
)
from o3dleaf.fitting.local.smoothing_selection import GCV_BALLS, each_ball
from o3dleaf.fitting.rbf.kernels import Polyharmonic, as_degree, as_kernel
from o3dleaf.fitting.rbf.smoothing import Spectrum, choose_by_gcv
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

FIT_BLOCK = 16


@checked
@dataclass(frozen=True)
class Hermite:
    r"""Splines of values and gradients at once, Hermite interpolation in the sense of Duchon's energy E.

    .. math:: \sum_j \left(F(x_j)^2 + h^2\,|\nabla F(x_j) + n_j|^2\right) + s\,E(F) \to \min

    With s = 0 both are exact to rounding, also for the blend (Wendland 2005, chapter 16). On a torus the mean error
    falls like spacing⁴ with r⁵, to a hundredth of what values at points beside the surface give. Normals are taken as
    they are: where they are off by an angle ε, as those of planes through neighbors are by about the spacing over the
    radius of curvature, the surface is off by up to ε spacings, more than such values give. The slopes of a fit of
    values, −∇F at the points, are better ones; `fit_surface` takes them where they are.

    Attributes
    ----------
    kernel : str or Polyharmonic
        An odd power, 3 or more; "quintic" by default. Hessians are continuous from r⁵ on.
    degree : int, optional
        Of the tail; by default the kernel's own.
    smoothing : float or "gcv"
        s, in unit^k for rᵏ. "gcv" takes what a fixed sample of balls agrees on, as for values.
    step : float
        h, in spacings of the ball's points on their sheet: the weight of gradients against values.
    points_per_ball : int
    """

    kernel: str | Polyharmonic = "quintic"
    degree: int | None = None
    smoothing: SmoothingValue = 0.0
    step: Positive = 1.0
    points_per_ball: Count = 50

    def fit(self, cover: Cover, data: ScatteredData) -> "LocalPotentials":
        """Fit every ball of the cover."""
        return _fit_potentials(self, cover, data, HERMITE, require_positive(self.step, "step"))


@checked
@dataclass(frozen=True)
class CurlFree:
    r"""A curl-free field that fits the normals, and its potential put onto zero at the points.

    The field Σ −∇∇ᵀφ(x − x_j) c_j + ∇p meets −n_j (or smooths it); its potential, whose heights at the points should
    be one constant, loses that and, where `exact`, a spline of values through the rest (Drake, Fuselier and Wright
    2022, "Implicit surface reconstruction with a curl-free radial basis function partition of unity method"). Values
    at the points are then zero to rounding, gradients −n but for what the spline adds; `Hermite` needs no such step.
    Normals that are off put the surface off as there.

    Attributes
    ----------
    kernel, degree
        As of `Hermite`.
    smoothing : float or "gcv"
        On the diagonal of the normals' system, in unit^(k−2).
    exact : bool
        Whether to go through the points. Not where they are noisy: a spline through points off the surface finds
        their distances to it, which is the potential itself, and takes them off.
    points_per_ball : int
    """

    kernel: str | Polyharmonic = "quintic"
    degree: int | None = None
    smoothing: SmoothingValue = 0.0
    exact: bool = True
    points_per_ball: Count = 50

    def fit(self, cover: Cover, data: ScatteredData) -> "LocalPotentials":
        """Fit every ball of the cover."""
        return _fit_potentials(self, cover, data, CORRECTED if self.exact else CURL_FREE, 1.0)


def _fit_potentials(
    fitter: Hermite | CurlFree, cover: Cover, data: ScatteredData, method: int, step: float
) -> "LocalPotentials":
    """Fit every ball of the cover by one of the two methods."""
    points, dimension = data.oriented, data.points.shape[1]
    kernel = as_kernel(fitter.kernel, dimension)
    if kernel.logarithmic or kernel.power < 3:
        raise InputError(f"kernel: {kernel} is not smooth enough for gradients at its data; use 'cubic' or 'quintic'")
    kind = PotentialKind(tail_exponents(dimension, as_degree(fitter.degree, kernel)), kernel.power, method, step)
    return _fit_alike(kernel, kind, _chosen(fitter.smoothing, cover, points, kind), cover, points)


def _fit_alike(
    kernel: Polyharmonic, kind: PotentialKind, smoothing: float, cover: Cover, points: OrientedPoints
) -> "LocalPotentials":
    """Fit every ball of the cover with a smoothing that is known."""
    dimension, count, total = kernel.dimension, len(cover.radii), int(cover.offsets[-1])
    fitted = PotentialArrays(
        np.empty(dimension * total),
        np.empty(total),
        np.empty(dimension * total),
        np.empty((count, len(kind.exponents))),
        np.empty(count, dtype=np.int64),
    )

    def task(start: int, stop: int) -> None:
        oriented_loops.fit_potentials(start, stop, points, cover.balls, kind, smoothing, fitted)

    with single_threaded_blas():
        run_blocks(task, count, FIT_BLOCK, reports=True)
    sites, weights, moments, tails, dropped = fitted
    fit = sites, weights, moments, tails, kind.exponents, dropped
    return LocalPotentials(kernel, smoothing, cover.offsets, *fit, kind.method, kind.step)


def _chosen(smoothing: SmoothingValue, cover: Cover, points: OrientedPoints, kind: PotentialKind) -> float:
    """Return the value of the smoothing, or what a sample of balls agrees on."""
    if not isinstance(smoothing, str):
        if smoothing < 0:
            raise InputError(f"smoothing: is {smoothing}; give a number >= 0 or 'gcv'")
        return as_number(smoothing, "smoothing")
    require_choice(smoothing, ("gcv",), "smoothing")

    def spectrum(ball: int) -> Spectrum:
        eigenvalues, coefficients = oriented_loops.ball_spectrum(ball, points, cover.balls, kind)
        return Spectrum(eigenvalues, coefficients, int(cover.counts[ball]))

    filled = balls_with_points(cover, points.points)
    sample = filled[even_rows(len(filled), GCV_BALLS)]
    with single_threaded_blas():
        return choose_by_gcv(Spectrum.pooled(each_ball(spectrum, sample)))


def balls_with_points(cover: Cover, points: FloatArray) -> IntArray:
    """Return the balls that contain all their points, or all balls where each is far from them and borrows them."""
    ball_of = np.repeat(np.arange(len(cover.radii)), cover.counts)
    distances = np.linalg.norm(points[cover.members] - cover.centers[ball_of], axis=1)
    filled = np.maximum.reduceat(distances, cover.offsets[:-1]) <= cover.radii
    return np.flatnonzero(filled) if filled.any() else np.arange(len(cover.radii))


@dataclass(frozen=True, eq=False)
class LocalPotentials:
    """One spline of values and gradients a ball, in unit coordinates, stored end to end for the compiled blend.

    Attributes
    ----------
    kernel : Polyharmonic
    smoothing : float
        Its value, chosen where it was "gcv".
    offsets : (M + 1,) int64 ndarray
        Ball i has the weights ``offsets[i]:offsets[i + 1]``.
    sites, weights, moments : (d total,), (total,), (d total,) ndarrays
        Points and c as (d, N_i) blocks, and λ.
    tails : (M, q) ndarray
    exponents : (q, d) int64 ndarray
    dropped : (M,) int64 ndarray
        Directions of each ball's system that coinciding points left out.
    method, step : int, float
        How they were fitted, and h, as in `PotentialKind`: balls that get more points are fitted so again.
    """

    kernel: Polyharmonic
    smoothing: float
    offsets: IntArray
    sites: FloatArray
    weights: FloatArray
    moments: FloatArray
    tails: FloatArray
    exponents: IntArray
    dropped: IntArray
    method: int = HERMITE
    step: float = 1.0

    def __repr__(self) -> str:
        return f"LocalPotentials({self.kernel}, {len(self.tails):,} balls)"

    def with_points(self, cover: Cover, data: ScatteredData, balls: IntArray) -> "LocalPotentials":
        """Return the splines with some of their balls fitted again, to their points in a cover."""
        kind = PotentialKind(self.exponents, self.kernel.power, self.method, self.step)
        fresh = _fit_alike(self.kernel, kind, self.smoothing, cover.only(balls), data.oriented)
        rows, dimension = np.arange(len(self.tails)), self.kernel.dimension
        rows[balls] = len(rows) + np.arange(len(balls))
        counts = np.concatenate([np.diff(self.offsets), np.diff(fresh.offsets)])
        first = (np.cumsum(counts) - counts)[rows]
        counts = counts[rows]
        taken, blocks = ragged_rows(first, counts), ragged_rows(dimension * first, dimension * counts)
        chosen = {"weights": taken, "sites": blocks, "moments": blocks, "tails": rows, "dropped": rows}
        parts = {name: np.concatenate([getattr(self, name), getattr(fresh, name)])[k] for name, k in chosen.items()}
        return replace(self, offsets=np.concatenate([[0], np.cumsum(counts)]), **parts)

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at (n, d) queries, outside the index's box too.

        Raises
        ------
        InputError
            If second derivatives are requested of a kernel below r⁵.
        """
        if level == 2 and self.kernel.power < 5:
            raise InputError(f"hessian: gradients of {self.kernel} have kinks at the data; use 'quintic'")
        sites, weights, moments = (self.sites, self.weights, self.moments) if dtype == np.float64 else self._single
        widest, places = int(np.diff(self.offsets).max()), queries.shape[1] * self.offsets[:-1]
        tail = (self.tails, self.exponents, self.kernel.power, widest)
        balls = PotentialBalls(self.offsets, places, sites, weights, *tail, moments)
        return blend_balls(balls, index, queries, level)

    @cached_property
    def _single(self) -> tuple[npt.NDArray[np.float32], ...]:
        return self.sites.astype(np.float32), self.weights.astype(np.float32), self.moments.astype(np.float32)
