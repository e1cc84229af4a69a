"""Sharp creases: balls whose points fall into smooth sheets get a spline for each, combined by minima and maxima."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Positive, SmoothingValue
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import as_number
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks, single_threaded_blas
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.blending import blend_balls
from o3dleaf.fitting.local.fitter import POINTS_PER_BALL, ScatteredData
from o3dleaf.fitting.local.smoothing_selection import choose_smoothing
from o3dleaf.fitting.local.splines import LocalSplines, Splines, fit_splines
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing, SplineModel
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents
from o3dleaf.surface.creases import crease_loops, sheets
from o3dleaf.surface.creases.composition_loops import ComposedBalls
from o3dleaf.surface.creases.crease_loops import GroupedValues, SheetBalls, SplineSystem
from o3dleaf.surface.creases.sheets import BoolArray, MeasuredPoints, PointGroups, SheetCover, SplitBalls, find_splits

ANGLE = 30.0
"""Degrees by which normals turn across what "auto" calls a crease."""

BATCH_SIZE = 4
"""Balls that are compared in one compiled call."""

SHARES = (4, 1, 2, 8)
"""About how long neighbors, sheets, the comparison of splits and the fit take."""


@checked
@dataclass(frozen=True)
class CreasedSplines:
    r"""Splines of values that keep sharp creases: one for each smooth sheet of a ball, combined by minima and maxima.

    .. math:: F_i = F_{i1}, \qquad F_i \leftarrow \min(F_i, F_{ij}) \text{ or } \max(F_i, F_{ij}), \quad j = 2, \ldots

    Larger inside: two sheets meet in a minimum where the solid is convex, in a maximum where it is concave.
    Derivatives are those of the sheet that is active. A ball is split where its sheets predict points that were left
    out better than one spline does; a surface without creases is fitted as if none were sought.

    For `PUInterpolant.fit`, with its `normals`, which creases are found from, and its `groups`, by which constraints
    off the surface go with the measured points that they were made from.

    Attributes
    ----------
    angle : "auto" or float
        Degrees by which normals turn, at least, across a crease; "auto" is 30.
    kernel, degree, smoothing, rho
        As in `PUInterpolant.fit`.
    points_per_ball : int or (least, most)

    References
    ----------
    Ohtake, Belyaev, Alexa, Turk and Seidel (2003), Multi-level partition of unity implicits: sharp features as
    Boolean combinations of local fits (Ricci 1973).
    """

    angle: Literal["auto"] | Positive = "auto"
    kernel: str | Polyharmonic = "cubic"
    degree: int | None = None
    smoothing: SmoothingValue | None = None
    rho: SmoothingValue | None = None
    points_per_ball: Count | tuple[Count, Count] = POINTS_PER_BALL

    def fit(self, cover: Cover, data: ScatteredData) -> "LocalSplines | LocalCreasedSplines":
        """Fit every ball of the cover, split into its sheets where cross-validation supports it."""
        dimension, normals = data.points.shape[1], data.normals
        if normals is None or dimension != 3:
            raise InputError("creases: are found from normals in three dimensions; give normals, or fit plain splines")
        model = Splines(self.kernel, self.degree, self.smoothing, self.rho).model(dimension)
        groups = np.arange(len(data.points)) if data.groups is None else data.groups
        data = replace(data, groups=groups)
        measured_rows = np.flatnonzero(groups == np.arange(len(groups)))
        looking, splitting, comparing, solving = progress.split(*SHARES)
        with looking:
            measured = MeasuredPoints.of(data.points[measured_rows], normals[measured_rows], self._degrees())
        with splitting:
            splits = find_splits(cover, measured, PointGroups.of(measured_rows, groups, data.values))
        sheet_cover = None
        if len(splits.balls):
            smooth = np.zeros(len(data.points), dtype=bool)
            smooth[measured_rows] = measured.smooth
            with comparing:
                sheet_cover, smoothing = _keep_better(cover, data, smooth, splits, model)
                model = replace(model, smoothing=smoothing)
        with solving:
            if sheet_cover is None:
                return fit_splines(cover, data, model)
            splines = fit_splines(sheet_cover.cover, data, model, _terms(sheet_cover, model))
            return LocalCreasedSplines(splines, sheet_cover.first, sheet_cover.composition)

    def _degrees(self) -> float:
        """Return the angle, or raise `InputError`."""
        angle = ANGLE if self.angle == "auto" else as_number(self.angle, "angle")
        if not 0 < angle < 180:
            raise InputError(f"angle: {angle:g} is no angle between 0 and 180 degrees; give for example 30")
        return angle


@dataclass(frozen=True, eq=False)
class LocalCreasedSplines:
    """One spline for each smooth sheet of a ball; see `CreasedSplines`.

    Attributes
    ----------
    splines : LocalSplines
        A spline for each sheet of each ball, end to end.
    first : (M + 1,) int64 ndarray
        Ball i has the sheets ``first[i]:first[i + 1]``.
    composition : (P,) int64 ndarray
        −1: minimum with the sheets before; 1: maximum; 0: the first of its ball.
    """

    splines: LocalSplines
    first: IntArray
    composition: IntArray = field(metadata={"stored": "joins"})

    def __repr__(self) -> str:
        return f"LocalCreasedSplines({len(self.composition):,} sheets in {len(self.first) - 1:,} balls)"

    def with_points(self, cover: Cover, data: ScatteredData, balls: IntArray) -> "LocalCreasedSplines":
        """Return the splines with some of their balls fitted again, to their points in a cover and without creases."""
        counts, ball_of = np.diff(self.first), np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))
        fresh = self.splines.fit_alike(cover.only(balls), data, self.first[balls])
        changed = np.full(len(counts), -1)
        changed[balls] = len(ball_of) + np.arange(len(balls))
        # Of the sheets of a ball that is fitted again the first stands for it.
        is_first = np.arange(len(ball_of)) == self.first[ball_of]
        kept = is_first | (changed[ball_of] < 0)
        rows = np.where(changed[ball_of] < 0, np.arange(len(ball_of)), changed[ball_of])[kept]
        first = np.concatenate([[0], np.cumsum(np.bincount(ball_of[kept], minlength=len(counts)))])
        return LocalCreasedSplines(self.splines.composed(fresh, rows), first, self.composition[kept])

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at (n, d) queries, outside the index's box too."""
        splines = self.splines.balls(level, dtype)
        size = splines.sites, splines.exponents, splines.widest
        return blend_balls(ComposedBalls(splines, self.first, self.composition, *size), index, queries, level)


def _terms(sheet_cover: SheetCover, model: SplineModel) -> IntArray:
    """Return how many monomials the tail of each sheet has: of split balls the fewest, which extend most tamely."""
    fewest, all_terms = (len(tail_exponents(3, degree)) for degree in (model.kernel.least_degree, model.degree))
    counts = np.diff(sheet_cover.first)
    return np.repeat(np.where(counts > 1, fewest, all_terms), counts)


def _keep_better(
    cover: Cover, data: ScatteredData, smooth: BoolArray, splits: SplitBalls, model: SplineModel
) -> tuple[SheetCover | None, Smoothing]:
    """Return the sheets of those balls alone that are better split, and the smoothing chosen for them."""
    sheet_cover = sheets.replace(cover, splits)
    terms = _terms(sheet_cover, model)
    better = np.zeros(len(splits.balls), dtype=bool)
    with single_threaded_blas():
        with progress.silent():
            chosen, per_sheet = choose_smoothing(sheet_cover.cover, data, model, terms)
        per_ball = None if per_sheet is None else per_sheet[sheet_cover.first[:-1]]
        of_sheets = chosen.diagonals(sheet_cover.cover.counts, per_sheet)
        system = SplineSystem(
            model.exponents, int(terms.min()), model.kernel.power, chosen.diagonals(cover.counts, per_ball), of_sheets
        )
        values = GroupedValues(data.weighted, data.groups, smooth)
        parts = SheetBalls(sheet_cover.cover.balls, sheet_cover.first, sheet_cover.composition)

        def task(start: int, stop: int) -> None:
            crease_loops.compare_balls(start, stop, splits.balls, values, cover.balls, parts, system, better)

        run_blocks(task, len(better), BATCH_SIZE, reports=True)
    if not better.any():
        return None, model.smoothing
    return sheets.replace(cover, splits.only(better)), chosen
