"""Sharp creases: balls whose points fall into smooth sheets get a spline for each, combined by minima and maxima."""

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import Progress, run_blocks, share_out, single_threaded_blas
from o3dleaf.fitting.creases import crease_loops
from o3dleaf.fitting.creases.sheets import (
    Belonging,
    BoolArray,
    Cloud,
    Pieces,
    Splits,
    Surface,
    ball_arrays,
    find_splits,
    replace,
)
from o3dleaf.fitting.pu.ball_loops import CreasedBalls
from o3dleaf.fitting.pu.cover import Cover
from o3dleaf.fitting.pu.index import BallIndex
from o3dleaf.fitting.pu.local import LocalSplines, blend_balls
from o3dleaf.fitting.pu.smoothing_selection import choose_amounts
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

AT_ONCE = 4
"""Balls that are judged in one compiled call."""

SHARES = (4, 1, 2, 8)
"""About how long neighbours, sheets, the judging of splits and the fit take."""


@dataclass(frozen=True, eq=False)
class CreasedSplines:
    r"""One spline for each smooth sheet of a ball, whose function is their minimum or maximum, sheet by sheet.

    .. math:: F_i = F_{i1}, \qquad F_i \leftarrow \min(F_i, F_{ij}) \text{ or } \max(F_i, F_{ij}), \quad j = 2, \ldots

    Larger inside: two sheets meet in a minimum where the solid is convex, in a maximum where it is concave.
    Derivatives are those of the sheet that is active.

    Attributes
    ----------
    splines : LocalSplines
        A spline for each sheet of each ball, end to end.
    first : (M + 1,) int64 ndarray
        Ball i has the sheets ``first[i]:first[i + 1]``.
    joins : (P,) int64 ndarray
        −1: minimum with the sheets before; 1: maximum; 0: the first of its ball.

    References
    ----------
    Ohtake, Belyaev, Alexa, Turk and Seidel (2003), Multi-level partition of unity implicits: sharp features as
    Boolean combinations of local fits (Ricci 1973).
    """

    splines: LocalSplines
    first: IntArray
    joins: IntArray

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box."""
        return blend_balls(
            CreasedBalls(self.splines.balls(level, dtype), self.first, self.joins), index, queries, level
        )


class _Data(NamedTuple):
    """The constraints of a fit: where, what, how far trusted, made from which, and which are calm measured points."""

    points: FloatArray
    values: FloatArray
    trust: FloatArray
    owners: IntArray
    calm: BoolArray


def fit_creased(
    cover: Cover,
    points: FloatArray,
    values: FloatArray,
    surface: Surface,
    *,
    kernel: Polyharmonic,
    degree: int,
    smoothing: Smoothing,
    trust: FloatArray | None,
    owners: IntArray,
    progress: Progress | None = None,
) -> LocalSplines | CreasedSplines:
    """Fit every ball of the cover, split into its sheets where leaving out points speaks for it."""
    calming, finding, judging, solving = share_out(progress, *SHARES)
    cloud = Cloud.of(surface, points, calming)
    splits = find_splits(cover, cloud, Belonging.of(surface.rows, owners, values), finding)
    pieces = None
    if len(splits.balls):
        calm = np.zeros(len(points), dtype=bool)
        calm[surface.rows] = cloud.calm
        data = _Data(points, values, np.ones(len(points)) if trust is None else trust, owners, calm)
        pieces, smoothing = _keep_better(cover, data, splits, kernel, degree, smoothing, judging)
    fit = partial(LocalSplines.fit, points=points, values=values, kernel=kernel, degree=degree, smoothing=smoothing)
    if pieces is None:
        return fit(cover, trust=trust, owners=owners, progress=solving)
    terms = _terms(pieces, kernel, degree)
    splines = fit(pieces.cover, trust=trust, owners=owners, terms=terms, progress=solving)
    return CreasedSplines(splines, pieces.first, pieces.joins)


def _terms(pieces: Pieces, kernel: Polyharmonic, degree: int) -> IntArray:
    """Return how many monomials the tail of each sheet has: of split balls the fewest, which extend most tamely."""
    least, most = (len(tail_exponents(3, each)) for each in (kernel.least_degree, degree))
    counts = np.diff(pieces.first)
    return np.repeat(np.where(counts > 1, least, most), counts)


def _keep_better(  # noqa: PLR0917 - a fit, what it is judged by, and its bar
    cover: Cover,
    data: _Data,
    splits: Splits,
    kernel: Polyharmonic,
    degree: int,
    rule: Smoothing,
    progress: Progress | None,
) -> tuple[Pieces | None, Smoothing]:
    """Return the pieces of those balls alone that are better split, and the smoothing chosen for them."""
    points, values, trust, owners, _ = data
    pieces, exponents = replace(cover, splits), tail_exponents(3, degree)
    terms = _terms(pieces, kernel, degree)
    tail = (exponents, int(terms.min()))
    better = np.zeros(len(splits.balls), dtype=bool)
    with single_threaded_blas():
        chosen, amounts = choose_amounts(
            pieces.cover,
            points,
            values,
            trust,
            kernel=kernel,
            exponents=exponents,
            terms=terms,
            rule=rule,
            owners=owners,
        )
        own = None if amounts is None else amounts[pieces.first[:-1]]
        diagonals = (chosen.diagonals(cover.counts, own), chosen.diagonals(pieces.cover.counts, amounts))
        whole, split = ball_arrays(cover), (ball_arrays(pieces.cover), pieces.joins)
        judged = data, whole, split, tail, kernel.power, diagonals

        def task(start: int, stop: int) -> None:
            crease_loops.judge_balls(start, stop, splits.balls, pieces.first, *judged, better)

        run_blocks(task, len(better), AT_ONCE, progress)
    if not better.any():
        return None, rule
    return replace(cover, splits.only(better)), chosen if better.all() else rule
