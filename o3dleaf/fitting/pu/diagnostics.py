"""Diagnostics of the balls of a fit: degrees of freedom, score, condition, leave-one-out error."""

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray, as_array
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local.smoothing_selection import each_ball
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.rbf.spectrum_loops import diagnose
from o3dleaf.fitting.rbf.tail import IntArray


@dataclass(frozen=True, eq=False)
class BallDiagnostics:
    r"""Diagnostics of the fit of each ball: (M,) arrays, a row for each ball that was requested.

    Attributes
    ----------
    balls : int64
        Numbers of the balls in their cover.
    points : int64
        N, the number of points.
    smoothing : float
        s on the diagonal, in the data's unit.
    rho : float
        ρ = s θ/N in the data's unit; NaN where the kernel has no θ.
    score : float
        V, the GCV score of s, in the values' unit squared: about the mean square error at a point left out.
    degrees_of_freedom : float
        tr A, the effective degrees of freedom, the rank of the tail included: N of an interpolant.
    condition : float
        (e_max + s)/(e_min + s) of the system on the null space of the tail's transpose.
    rank : int64
        Rank of the tail on the ball's points.
    dropped : int64
        Directions that the solution left out because points coincide where nothing is smoothed. Score
        and leave-one-out error of such a ball are NaN.
    leave_one_out : float
        Root mean square, weighted like the fit, of the errors at points each left out of the ball in
        turn, s being kept, in the values' unit. NaN where the tail needs every point.
    """

    balls: IntArray
    points: IntArray
    smoothing: FloatArray
    rho: FloatArray
    score: FloatArray
    degrees_of_freedom: FloatArray
    condition: FloatArray
    rank: IntArray
    dropped: IntArray
    leave_one_out: FloatArray

    def __repr__(self) -> str:
        return f"BallDiagnostics({len(self.balls):,} balls)"

    def summary(self) -> dict[str, tuple[float, float, float]]:
        """Return (least, median, greatest) of each number over the balls that have it."""
        summary = {}
        for name in (field.name for field in fields(self) if field.name != "balls"):
            known = getattr(self, name)[~np.isnan(getattr(self, name))]
            if len(known):
                summary[name] = (float(known.min()), float(np.median(known)), float(known.max()))
        return summary


def diagnose_balls(cover: Cover, local: LocalSplines, balls: npt.ArrayLike | None = None) -> BallDiagnostics:
    """Return the diagnostics of some balls, each from one eigen-decomposition and the fit's own weights λ.

    Parameters
    ----------
    cover : Cover
    local : LocalSplines
        The fit over the balls of the cover.
    balls : (M,) array_like of int, optional
        Numbers of the balls; by default all that have points.

    Raises
    ------
    InputError
        If there is no ball of such a number, or it has no points.
    """
    rows = _numbers_of(cover, balls)
    diagonals, counts, theta = local.diagonals, cover.counts[rows], local.kernel.theta

    def numbers_of(ball: int) -> tuple[float, float, float, float]:
        points, coefficients, weights = local.ball(ball)
        smoothing = diagonals[ball] / cover.radii[ball] ** local.kernel.power
        system = np.sqrt(weights), local.exponents, local.kernel.power, smoothing, local.noise(ball)
        score, degrees, condition, errors = diagnose(points, coefficients, *system)
        known = ~np.isnan(errors)
        if not known.any():
            return score, degrees, condition, np.nan
        return score, degrees, condition, float(np.sqrt(np.average(errors[known] ** 2, weights=weights[known])))

    with single_threaded_blas():
        numbers = np.array(each_ball(numbers_of, rows, reports=True)).reshape(-1, 4)
    return BallDiagnostics(
        balls=rows,
        points=counts,
        smoothing=diagonals[rows],
        rho=np.full(len(rows), np.nan) if theta is None else diagonals[rows] * theta / counts,
        score=numbers[:, 0],
        degrees_of_freedom=numbers[:, 1],
        condition=numbers[:, 2],
        rank=local.ranks[rows],
        dropped=local.dropped[rows],
        leave_one_out=numbers[:, 3],
    )


def _numbers_of(cover: Cover, balls: npt.ArrayLike | None) -> IntArray:
    """Return the numbers of balls that a fit of their own was asked of, or raise `InputError` where one has none."""
    filled = cover.counts > 0
    asked = np.flatnonzero(filled) if balls is None else np.atleast_1d(as_array(balls, "balls"))
    if asked.dtype.kind not in "iu" or asked.ndim != 1 or np.any((asked < 0) | (asked >= len(filled))):
        raise InputError(f"balls: are {asked.tolist()}; give whole numbers from 0 to {len(filled) - 1}")
    if not filled[asked].all():
        bare = asked[~filled[asked]].tolist()
        raise InputError(f"balls: {bare} are bare, away from the surface, with no fit of their own; leave them out")
    return asked.astype(np.int64)
