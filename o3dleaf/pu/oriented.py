"""Local fits to oriented points, on the surface alone: potentials of curl-free fields, and moving least squares."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray, require_choice
from o3dleaf.parallel import Progress, run_blocks, single_threaded_blas
from o3dleaf.pu import loops
from o3dleaf.pu.cover import Cover
from o3dleaf.pu.index import BallIndex
from o3dleaf.pu.local import LocalFits, blend_balls
from o3dleaf.rbf.kernels import Polyharmonic, as_degree, as_kernel
from o3dleaf.rbf.tail import IntArray, tail_exponents


class OrientedFitter(Protocol):
    """A way to fit the balls of a cover to points on a surface and the outward normals there."""

    @property
    def points_per_ball(self) -> int:
        """The most points of a ball that suit it."""
        ...

    def fit(
        self, cover: Cover, points: FloatArray, normals: FloatArray, *, progress: Progress | None = None
    ) -> LocalFits:
        """Fit every ball of the cover to its (n, d) points and (n, d) outward unit normals."""
        ...


@dataclass(frozen=True)
class CurlFree:
    """doc later."""

    kernel: str | Polyharmonic = "cubic"
    degree: int | None = None
    smoothing: tuple[float, float] = (0.0, 0.0)
    joint: bool = False
    points_per_ball: int = 50

    def fit(
        self, cover: Cover, points: FloatArray, normals: FloatArray, *, progress: Progress | None = None
    ) -> "LocalPotentials":
        """Fit every ball of the cover."""
        phi = as_kernel(self.kernel, points.shape[1])
        exponents = tail_exponents(points.shape[1], as_degree(self.degree, phi))
        balls = (cover.centres, cover.radii, cover.offsets, cover.members)
        count, total, dimension = len(cover.radii), int(cover.offsets[-1]), points.shape[1]
        model = (
            np.empty(dimension * total),
            np.empty(total),
            np.empty(dimension * total),
            np.empty((count, len(exponents))),
        )
        dropped = np.empty(count, dtype=np.int64)
        ridges = np.array(self.smoothing, dtype=float)

        def task(start: int, stop: int) -> None:
            loops.fit_potentials(
                start, stop, points, normals, balls, exponents, phi.power, self.joint, ridges, model, dropped
            )

        with single_threaded_blas():
            run_blocks(task, count, 16, progress)
        return LocalPotentials(phi, ridges, cover.offsets, *model, exponents, dropped)


@dataclass(frozen=True)
class MovingLeastSquares:
    """doc later."""

    degree: int = 2
    step: float = 1.0
    points_per_ball: int = 24

    def fit(
        self, cover: Cover, points: FloatArray, normals: FloatArray, *, progress: Progress | None = None
    ) -> "LocalPolynomials":
        """Fit every ball of the cover."""
        exponents = tail_exponents(points.shape[1], self.degree)
        balls = (cover.centres, cover.radii, cover.offsets, cover.members)
        count = len(cover.radii)
        tails, ranks = np.empty((count, len(exponents))), np.empty(count, dtype=np.int64)

        def task(start: int, stop: int) -> None:
            loops.fit_polynomials(start, stop, points, normals, balls, exponents, self.step, tails, ranks)

        with single_threaded_blas():
            run_blocks(task, count, 16, progress)
        return LocalPolynomials(tails, exponents, ranks)


@dataclass(frozen=True, eq=False)
class LocalPotentials:
    """doc later."""

    kernel: Polyharmonic
    ridges: FloatArray
    offsets: IntArray
    sites: FloatArray
    weights: FloatArray
    moments: FloatArray
    tails: FloatArray
    exponents: IntArray
    dropped: IntArray

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box."""
        sites, weights, moments = (self.sites, self.weights, self.moments) if dtype == np.float64 else self._single
        widest = int(np.diff(self.offsets).max())
        places = queries.shape[1] * self.offsets[:-1]
        power, exponents = self.kernel.power, self.exponents
        balls = loops.PotentialBalls(
            self.offsets, places, sites, weights, self.tails, exponents, power, widest, moments
        )
        return blend_balls(balls, index, queries, level)

    @cached_property
    def _single(self) -> tuple[npt.NDArray[np.float32], ...]:
        return self.sites.astype(np.float32), self.weights.astype(np.float32), self.moments.astype(np.float32)


@dataclass(frozen=True, eq=False)
class LocalPolynomials:
    """doc later."""

    tails: FloatArray
    exponents: IntArray
    ranks: IntArray

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:  # noqa: ARG002
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box."""
        nowhere = np.zeros(len(self.tails) + 1, dtype=np.int64)
        nothing = np.empty(0)
        balls = loops.SplineBalls(nowhere, nowhere, nothing, nothing, self.tails, self.exponents, 3, 0)
        return blend_balls(balls, index, queries, level)


LOCAL_FITTERS = {"curl-free": CurlFree, "mls": MovingLeastSquares}


def as_fitter(local: str | OrientedFitter) -> OrientedFitter:
    """Return the fitter of a name, "curl-free" or "mls", or of itself."""
    if isinstance(local, str):
        return LOCAL_FITTERS[require_choice(local, LOCAL_FITTERS, "local")]()
    return local
