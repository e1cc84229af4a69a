r"""Local fits to oriented points on a surface, with no others beside it: F = 0 and ∇F = −n there.

.. math:: F(x) = \sum_j λ_j φ(x - x_j) - \sum_j c_j \cdot \nabla φ(x - x_j) + p(x)

`Hermite` asks a ball's points for both at once, `CurlFree` for the slopes first and the values then, and
`MovingLeastSquares` has the polynomial alone. Each blends like splines of values do; see `PUInterpolant.fit_oriented`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray, as_number, require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import Progress, run_blocks, single_threaded_blas
from o3dleaf.fitting.pu import ball_loops, oriented_loops
from o3dleaf.fitting.pu.cover import Cover
from o3dleaf.fitting.pu.index import BallIndex
from o3dleaf.fitting.pu.local import LocalFits, blend_balls
from o3dleaf.fitting.pu.smoothing_selection import GCV_BALLS, each_ball
from o3dleaf.fitting.rbf.kernels import Polyharmonic, as_degree, as_kernel
from o3dleaf.fitting.rbf.smoothing import Amount, Spectrum, choose_by_gcv
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

FIT_BLOCK = 16


class OrientedFitter(Protocol):
    """A way to fit the balls of a cover to points on a surface and the outward normals there."""

    @property
    def points_per_ball(self) -> int:
        """The most points of a ball, where the caller does not say."""
        ...

    def fit(
        self, cover: Cover, points: FloatArray, normals: FloatArray, *, progress: Progress | None = None
    ) -> LocalFits:
        """Fit every ball of the cover to its points (n, d) and outward unit normals (n, d)."""
        ...


@dataclass(frozen=True)
class Hermite:
    r"""Splines of values and gradients at once, Hermite interpolation in the sense of Duchon's energy E.

    .. math:: \sum_j \left(F(x_j)^2 + h^2\,|\nabla F(x_j) + n_j|^2\right) + s\,E(F) \to \min

    With s = 0 both hold to rounding, also for the blend (Wendland 2005, chapter 16). On a torus the mean error falls
    like spacing⁴ with r⁵, to a hundredth of what values at points beside the surface give.

    Attributes
    ----------
    kernel : str or Polyharmonic
        An odd power, 3 or more; "quintic" by default. Hessians are continuous from r⁵ on.
    degree : int, optional
        Of the tail; by default the kernel's own.
    smoothing : float or "gcv"
        s, in unit^k for rᵏ. "gcv" takes what a fixed sample of balls agrees on, as for values.
    step : float
        h, in spacings of the ball's points on their sheet: the weight of slopes against values.
    points_per_ball : int
    """

    kernel: str | Polyharmonic = "quintic"
    degree: int | None = None
    smoothing: Amount = 0.0
    step: float = 1.0
    points_per_ball: int = 50

    def fit(
        self, cover: Cover, points: FloatArray, normals: FloatArray, *, progress: Progress | None = None
    ) -> "LocalPotentials":
        """Fit every ball of the cover."""
        step = require_positive(self.step, "step")
        return _Balls.of(self, cover, points, normals, oriented_loops.HERMITE, step).fit(self.smoothing, progress)


@dataclass(frozen=True)
class CurlFree:
    r"""A curl-free field that fits the normals, and its potential put onto zero at the points.

    The field Σ −∇∇ᵀφ(x − x_j) c_j + ∇p meets −n_j (or smooths it); its potential, whose heights at the points should
    be one constant, loses that and, where `exact`, a spline of values through the rest (Drake, Fuselier and Wright
    2022, "Implicit surface reconstruction with a curl-free radial basis function partition of unity method"). Values
    at the points are then zero to rounding, slopes −n but for what the spline adds; `Hermite` needs no such step.

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
    smoothing: Amount = 0.0
    exact: bool = True
    points_per_ball: int = 50

    def fit(
        self, cover: Cover, points: FloatArray, normals: FloatArray, *, progress: Progress | None = None
    ) -> "LocalPotentials":
        """Fit every ball of the cover."""
        method = oriented_loops.CORRECTED if self.exact else oriented_loops.CURL_FREE
        return _Balls.of(self, cover, points, normals, method, 1.0).fit(self.smoothing, progress)


@dataclass(frozen=True)
class MovingLeastSquares:
    r"""One polynomial p a ball, fitted to the oriented points by least squares with Wendland's weight w of the ball.

    .. math:: \sum_j w(|x_j - c|/r)\left(p(x_j)^2 + h^2\,|\nabla p(x_j) + n_j|^2\right) \to \min

    Levin's moving least squares (1998) solves such a system anew at every query x, with weights about x. This one
    solves it at the balls' centres and blends the polynomials by Shepard's sum, as Ohtake's multi-level partition of
    unity (MPU, 2003) does; MPU has no slopes in its sum but auxiliary points that check the sign, halves a cell until
    p fits, and knows edges, where here the cover alone says how large a ball is. Of noise, the size of the balls
    takes away what smoothing does elsewhere, at little cost: time grows with the points, not with their cube.

    Attributes
    ----------
    degree : int
        Total degree, 1, 2 or 3: planes, quadrics or cubics.
    step : float
        h, in spacings of the ball's points on their sheet; 3 suits normals from about 30 neighbours.
    points_per_ball : int
    """

    degree: int = 3
    step: float = 1.0
    points_per_ball: int = 50

    def fit(
        self, cover: Cover, points: FloatArray, normals: FloatArray, *, progress: Progress | None = None
    ) -> "LocalPolynomials":
        """Fit every ball of the cover. Where points do not tell a term, as on a plane, it is left out."""
        if self.degree not in {1, 2, 3}:
            raise InputError(f"degree: is {self.degree}; give 1, 2 or 3")
        step = require_positive(self.step, "step")
        exponents = tail_exponents(points.shape[1], self.degree)
        count = len(cover.radii)
        balls = (cover.centres, cover.radii, cover.offsets, cover.members)
        tails, ranks = np.empty((count, len(exponents))), np.empty(count, dtype=np.int64)

        def task(start: int, stop: int) -> None:
            oriented_loops.fit_polynomials(start, stop, points, normals, balls, exponents, step, tails, ranks)

        with single_threaded_blas():
            run_blocks(task, count, FIT_BLOCK, progress)
        return LocalPolynomials(tails, exponents, ranks)


@dataclass(frozen=True, eq=False)
class _Balls:
    """What the two fits of potentials share: the data of a cover's balls and the kernel."""

    cover: Cover
    points: FloatArray
    normals: FloatArray
    kernel: Polyharmonic
    exponents: IntArray
    method: int
    step: float

    @classmethod
    def of(
        cls, fitter: Hermite | CurlFree, cover: Cover, points: FloatArray, normals: FloatArray, method: int, step: float
    ) -> "_Balls":
        dimension = points.shape[1]
        phi = as_kernel(fitter.kernel, dimension)
        if phi.logarithmic or phi.power < 3:
            raise InputError(f"kernel: {phi} has no slopes to interpolate here; use 'cubic' or 'quintic'")
        exponents = tail_exponents(dimension, as_degree(fitter.degree, phi))
        return cls(cover, points, normals, phi, exponents, method, step)

    def chosen(self, smoothing: Amount) -> float:
        """Return the amount of smoothing, or what a sample of balls agrees on."""
        if not isinstance(smoothing, str):
            if smoothing < 0:
                raise InputError(f"smoothing: is {smoothing}; give a number >= 0 or 'gcv'")
            return as_number(smoothing, "smoothing")
        require_choice(smoothing, ("gcv",), "smoothing")
        cover, kind = self.cover, (self.exponents, self.kernel.power, self.method, self.step)

        def spectrum(ball: int) -> Spectrum:
            rows = cover.members[cover.offsets[ball] : cover.offsets[ball + 1]]
            place = (self.points, self.normals, rows, cover.centres[ball], cover.radii[ball])
            eigenvalues, coefficients = oriented_loops.ball_spectrum(*place, *kind)
            return Spectrum(eigenvalues, coefficients, len(rows))

        own = balls_with_points(cover, self.points)
        sample = own[np.unique(np.linspace(0, len(own) - 1, GCV_BALLS).round().astype(np.int64))]
        with single_threaded_blas():
            return choose_by_gcv(Spectrum.pooled(each_ball(spectrum, sample)))

    def fit(self, smoothing: Amount, progress: Progress | None) -> "LocalPotentials":
        """Fit all balls."""
        cover, dimension, amount = self.cover, self.points.shape[1], self.chosen(smoothing)
        count, total = len(cover.radii), int(cover.offsets[-1])
        sites, moments, weights = np.empty(dimension * total), np.empty(dimension * total), np.empty(total)
        tails, dropped = np.empty((count, len(self.exponents))), np.empty(count, dtype=np.int64)
        balls = (cover.centres, cover.radii, cover.offsets, cover.members)
        kind = (self.exponents, self.kernel.power, self.method, amount, self.step)
        model = (sites, weights, moments, tails)

        def task(start: int, stop: int) -> None:
            oriented_loops.fit_potentials(start, stop, self.points, self.normals, balls, *kind, model, dropped)

        with single_threaded_blas():
            run_blocks(task, count, FIT_BLOCK, progress)
        kept = (cover.offsets, sites, weights, moments, tails, self.exponents, dropped)
        return LocalPotentials(self.kernel, amount, *kept)


def balls_with_points(cover: Cover, points: FloatArray) -> IntArray:
    """Return the balls that hold all their points, or all balls where each is far from them and borrows them."""
    owner = np.repeat(np.arange(len(cover.radii)), cover.counts)
    distances = np.linalg.norm(points[cover.members] - cover.centres[owner], axis=1)
    own = np.maximum.reduceat(distances, cover.offsets[:-1]) <= cover.radii
    return np.flatnonzero(own) if own.any() else np.arange(len(cover.radii))


@dataclass(frozen=True, eq=False)
class LocalPotentials:
    """One spline of values and gradients a ball, in unit coordinates, stored end to end for the compiled blend.

    Attributes
    ----------
    kernel : Polyharmonic
    smoothing : float
        The amount, chosen where it was "gcv".
    offsets : (M + 1,) int64 ndarray
        Ball i has the weights ``offsets[i]:offsets[i + 1]``.
    sites, weights, moments : (d total,), (total,), (d total,) ndarrays
        Points and c as (d, N_i) blocks, and λ.
    tails : (M, q) ndarray
    exponents : (q, d) int64 ndarray
    dropped : (M,) int64 ndarray
        Directions of each ball's system that coinciding points left out.
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

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box.

        Raises
        ------
        InputError
            If second derivatives are asked for of a kernel below r⁵.
        """
        if level == 2 and self.kernel.power < 5:
            raise InputError(f"hessian: gradients of {self.kernel} have kinks at the data; use 'quintic'")
        sites, weights, moments = (self.sites, self.weights, self.moments) if dtype == np.float64 else self._single
        widest, places = int(np.diff(self.offsets).max()), queries.shape[1] * self.offsets[:-1]
        tail = (self.tails, self.exponents, self.kernel.power, widest)
        balls = ball_loops.PotentialBalls(self.offsets, places, sites, weights, *tail, moments)
        return blend_balls(balls, index, queries, level)

    @cached_property
    def _single(self) -> tuple[npt.NDArray[np.float32], ...]:
        return self.sites.astype(np.float32), self.weights.astype(np.float32), self.moments.astype(np.float32)


@dataclass(frozen=True, eq=False)
class LocalPolynomials:
    """One polynomial a ball, in unit coordinates.

    Attributes
    ----------
    tails : (M, q) ndarray
    exponents : (q, d) int64 ndarray
    ranks : (M,) int64 ndarray
        How many terms each ball's points tell.
    """

    tails: FloatArray
    exponents: IntArray
    ranks: IntArray

    def blend(
        self,
        index: BallIndex,
        queries: FloatArray,
        *,
        level: int,
        dtype: np.dtype[Any],  # noqa: ARG002 - polynomials are too few terms for single precision to pay
    ) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box."""
        nowhere, nothing = np.zeros(len(self.tails) + 1, dtype=np.int64), np.empty(0)
        return blend_balls(
            ball_loops.SplineBalls(nowhere, nowhere, nothing, nothing, self.tails, self.exponents, 3, 0),
            index,
            queries,
            level,
        )


LOCAL_FITTERS: dict[str, type[Hermite | CurlFree | MovingLeastSquares]] = {
    "hermite": Hermite,
    "curl-free": CurlFree,
    "mls": MovingLeastSquares,
}
