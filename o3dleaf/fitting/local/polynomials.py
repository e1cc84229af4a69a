"""Moving least squares: one polynomial a ball, fitted to points and normals of a surface."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local import oriented_loops
from o3dleaf.fitting.local.blend_loops import SplineBalls
from o3dleaf.fitting.local.blending import blend_balls
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

FIT_BLOCK = 16


@checked
@dataclass(frozen=True)
class MovingLeastSquares:
    r"""One polynomial p a ball, fitted to the oriented points by least squares with Wendland's weight w of the ball.

    .. math:: \sum_j w(|x_j - c|/r)\left(p(x_j)^2 + h^2\,|\nabla p(x_j) + n_j|^2\right) \to \min

    Levin's moving least squares (1998) solves such a system anew at every query x, with weights about x. This one
    solves it at the balls' centers and blends the polynomials by Shepard's sum, as Ohtake's multi-level partition of
    unity (MPU, 2003) does; MPU has no gradients in its sum but auxiliary points that check the sign, halves a cell
    until p fits, and knows edges, where here the cover alone says how large a ball is. Of noise, the size of the
    balls takes away what smoothing does elsewhere, at little cost: time grows with the points, not with their cube.

    Attributes
    ----------
    degree : int
        Total degree, 1, 2 or 3: planes, quadrics or cubics.
    step : float
        h, in spacings of the ball's points on their sheet; 3 suits normals from about 30 neighbors.
    points_per_ball : int
    """

    degree: int = 3
    step: Positive = 1.0
    points_per_ball: Count = 50

    def fit(self, cover: Cover, data: ScatteredData) -> "LocalPolynomials":
        """Fit every ball of the cover. Where points do not determine a term, as on a plane, it is left out."""
        if self.degree not in {1, 2, 3}:
            raise InputError(f"degree: is {self.degree}; give 1, 2 or 3")
        step = require_positive(self.step, "step")
        return _fit_polynomials(cover, data, tail_exponents(data.points.shape[1], self.degree), step)


def _fit_polynomials(cover: Cover, data: ScatteredData, exponents: IntArray, step: float) -> "LocalPolynomials":
    """Fit every ball of the cover."""
    points, balls, count = data.oriented, cover.balls, len(cover.radii)
    tails, ranks = np.empty((count, len(exponents))), np.empty(count, dtype=np.int64)

    def task(start: int, stop: int) -> None:
        oriented_loops.fit_polynomials(start, stop, points, balls, exponents, step, tails, ranks)

    with single_threaded_blas():
        run_blocks(task, count, FIT_BLOCK, reports=True)
    return LocalPolynomials(tails, exponents, ranks, step)


@dataclass(frozen=True, eq=False)
class LocalPolynomials:
    """One polynomial a ball, in unit coordinates.

    Attributes
    ----------
    tails : (M, q) ndarray
    exponents : (q, d) int64 ndarray
    ranks : (M,) int64 ndarray
        How many terms each ball's points determine.
    step : float
        h of their fit, in spacings: balls that get more points are fitted with it again.
    """

    tails: FloatArray
    exponents: IntArray
    ranks: IntArray
    step: float = 1.0

    def __repr__(self) -> str:
        return f"LocalPolynomials({len(self.tails):,} balls)"

    def with_points(self, cover: Cover, data: ScatteredData, balls: IntArray) -> "LocalPolynomials":
        """Return the polynomials with some of their balls fitted again, to their points in a cover."""
        fresh, tails, ranks = (
            _fit_polynomials(cover.only(balls), data, self.exponents, self.step),
            self.tails.copy(),
            self.ranks.copy(),
        )
        tails[balls], ranks[balls] = fresh.tails, fresh.ranks
        return replace(self, tails=tails, ranks=ranks)

    def blend(
        self,
        index: BallIndex,
        queries: FloatArray,
        *,
        level: int,
        dtype: np.dtype[Any],  # noqa: ARG002 - polynomials are too few terms for single precision to pay
    ) -> FloatArray:
        """Return the jets, a column each, of the blend at (n, d) queries, outside the index's box too."""
        nowhere, nothing = np.zeros(len(self.tails) + 1, dtype=np.int64), np.empty(0)
        balls = SplineBalls(nowhere, nowhere, nothing, nothing, self.tails, self.exponents, 3, 0)
        return blend_balls(balls, index, queries, level)
