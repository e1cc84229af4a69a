"""Sharp creases: balls whose points fall into smooth sheets get a spline for each, combined by minima and maxima."""

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.checks import FloatArray
from o3dleaf.parallel import Progress, finish, run_blocks, share_out, single_threaded_blas
from o3dleaf.pu import crease_loops
from o3dleaf.pu.choice import choose_amounts
from o3dleaf.pu.cover import Cover
from o3dleaf.pu.index import BallIndex
from o3dleaf.pu.local import LocalSplines, blend_balls
from o3dleaf.pu.loops import CreasedBalls
from o3dleaf.rbf.kernels import Polyharmonic
from o3dleaf.rbf.smoothing import Smoothing
from o3dleaf.rbf.tail import IntArray, tail_exponents

BoolArray = npt.NDArray[np.bool_]
Sheets = tuple[IntArray, BoolArray, FloatArray, FloatArray]
"""What `find_sheets` returns: sheet of each point, whether it lies on it, distances and normals by sheet."""

ANGLE = 30.0
"""Degrees by which normals turn across what "auto" calls a crease."""

NEIGHBOURS = 8
"""Neighbours that a calm point agrees with; as many join it to its sheet."""

BEYOND = 1.5
"""Radius, in that of a ball's farthest point, of what its sheets are looked for in: they come in from outside."""

LEAST_POINTS = 40
"""Points that a sheet is fitted to, from beyond the ball where it holds fewer."""

LEAST_SITES = 4
"""Constraints off the surface that a sheet needs: with fewer, its inside is not told from its outside."""

ROUNDS = 3
"""Times that normals are averaged over neighbours that agree: noise goes, creases stay."""

SHARES = (4, 1, 2, 8)
"""About how long neighbours, sheets, the judging of splits and the fit take."""

BLOCK = 1 << 12

AT_ONCE = 32
"""Balls whose sheets are found in one compiled call."""

LOST = 0.03
"""Share of a ball's points that may lie on none of its sheets, as noise makes them: else one sheet was not found."""


class Surface(NamedTuple):
    """What creases are found from.

    Attributes
    ----------
    rows : (m,) int64 ndarray
        Rows of the constraints that are measured points.
    normals : (m, 3) ndarray
        Outward unit normals there.
    angle : float
        Degrees.
    """

    rows: IntArray
    normals: FloatArray
    angle: float

    @property
    def half(self) -> float:
        """The cosine of half the angle."""
        return float(np.cos(np.radians(self.angle / 2)))


class Pieces(NamedTuple):
    """The sheets of balls, end to end.

    Attributes
    ----------
    cover : Cover
        A ball for each sheet, where that of the sheet is.
    first : (M + 1,) int64 ndarray
        Ball i has the sheets ``first[i]:first[i + 1]``.
    joins : (P,) int64 ndarray
        How a sheet is joined to those before it: −1, minimum (convex); 1, maximum (concave); 0, the first of a ball.
    """

    cover: Cover
    first: IntArray
    joins: IntArray


class Split(NamedTuple):
    """The sheets of one ball: the rows of the constraints of each, in order, and how each is joined to those before."""

    members: list[IntArray]
    joins: IntArray


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


class _Cloud(NamedTuple):
    """The measured points, their normals averaged over neighbours that agree, the neighbours, and who is calm."""

    rows: IntArray
    points: FloatArray
    normals: FloatArray
    near: IntArray
    calm: BoolArray
    half: float
    tree: cKDTree

    @classmethod
    def of(cls, surface: Surface, points: FloatArray, progress: Progress | None = None) -> "_Cloud":
        planting, finding, *averaging, calming = share_out(progress, 1, 2, *ROUNDS * [1], 1)
        x, normals = points[surface.rows], surface.normals
        tree = cKDTree(x)
        finish(planting)
        near = tree.query(x, k=min(NEIGHBOURS + 1, len(x)), workers=-1)[1][:, 1:]
        finish(finding)
        calm = np.empty(len(x), dtype=bool)
        for averaged in averaging:
            normals = crease_loops.average_alike(normals, near, surface.half)
            finish(averaged)
        run_blocks(lambda i, j: crease_loops.find_calm(i, j, normals, near, surface.half, calm), len(x), BLOCK, calming)
        return cls(surface.rows, x, normals, near, calm, surface.half, tree)


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
    cloud = _Cloud.of(surface, points, calming)
    pieces = _find_pieces(cover, cloud, _Belonging.of(surface.rows, owners, values), owners, finding)
    if pieces is not None:
        calm = np.zeros(len(points), dtype=bool)
        calm[surface.rows] = cloud.calm
        data = _Data(points, values, np.ones(len(points)) if trust is None else trust, owners, calm)
        pieces, smoothing = _keep_better(cover, data, pieces, kernel, degree, smoothing, progress=judging)
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


def _find_pieces(
    cover: Cover, cloud: _Cloud, belonging: "_Belonging", owners: IntArray, progress: Progress | None
) -> Pieces | None:
    """Return the cover with each ball split that holds several sheets, or None if none does."""
    asked = _suspects(cover, cloud, owners)
    found: dict[int, Split] = {}

    def task(start: int, stop: int) -> None:
        helds, arounds = [], []
        for ball in asked[start:stop]:
            members = cover.members[cover.offsets[ball] : cover.offsets[ball + 1]]
            inside = np.unique(belonging.surface_of[owners[members]])
            helds.append(inside[inside >= 0])
            arounds.append(_around(helds[-1], cover.centres[ball], cover.radii[ball], cloud))
        first = np.concatenate([[0], np.cumsum([len(rows) for rows in arounds])])
        sheets = crease_loops.find_sheets_of(
            first, np.concatenate(arounds), cloud.points, cloud.normals, cloud.near, cloud.calm, cloud.half
        )
        for ball, held, rows, found_there in zip(asked[start:stop], helds, arounds, sheets, strict=True):
            split = _split(held, rows, found_there, cover.centres[ball], cloud, belonging)
            if split is not None:
                found[int(ball)] = split

    run_blocks(task, len(asked), AT_ONCE, progress)
    return _replace(cover, found) if found else None


def _suspects(cover: Cover, cloud: _Cloud, owners: IntArray) -> IntArray:
    """Return the balls that hold constraints of points which are not calm; not those that only borrow theirs."""
    rough = np.zeros(len(owners))
    rough[cloud.rows] = ~cloud.calm
    hold = cloud.tree.query_ball_point(cover.centres, cover.radii, workers=-1, return_length=True) > 0
    return np.flatnonzero(hold & (np.add.reduceat(rough[owners[cover.members]], cover.offsets[:-1]) > 0))


class _Belonging(NamedTuple):
    """Which constraints belong to which measured point: `rows[first[p]:first[p + 1]]` to point p."""

    surface_of: IntArray
    first: IntArray
    rows: IntArray
    off: BoolArray

    @classmethod
    def of(cls, surface: IntArray, owners: IntArray, values: FloatArray) -> "_Belonging":
        surface_of = np.full(len(owners), -1, dtype=np.int64)
        surface_of[surface] = np.arange(len(surface))
        number = surface_of[owners]
        rows = np.argsort(number, kind="stable")
        first = np.searchsorted(number[rows], np.arange(len(surface) + 1))
        return cls(surface_of, first, rows, values != 0)

    def constraints(self, chosen: IntArray, trusted: BoolArray) -> IntArray:
        """Return the rising rows of all constraints of measured points, those off the surface of trusted ones alone."""
        counts = self.first[chosen + 1] - self.first[chosen]
        at = np.repeat(self.first[chosen] - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
        rows = self.rows[at]
        return np.sort(rows[~self.off[rows] | np.repeat(trusted, counts)])


def _around(held: IntArray, centre: FloatArray, radius: float, cloud: _Cloud) -> IntArray:
    """Return the rising rows of the measured points in a ball, a little larger than what holds the points `held`."""
    if not len(held):
        return held
    reach = BEYOND * max(radius, np.linalg.norm(cloud.points[held] - centre, axis=1).max())
    return np.sort(np.array(cloud.tree.query_ball_point(centre, reach), dtype=np.int64))


def _split(
    held: IntArray, rows: IntArray, found: Sheets, centre: FloatArray, cloud: _Cloud, belonging: _Belonging
) -> Split | None:
    """Return the sheets of a ball that holds constraints of the measured points `held`; None for one sheet.

    `found` is what `find_sheets` says of the points `rows` around it.
    """
    if not len(held):
        return None
    labels, lying, away, outward = found
    inside = np.isin(rows, held)
    sheets = np.unique(labels[inside])
    if len(sheets) < 2 or sheets[0] < 0 or np.count_nonzero(inside & ~lying) > LOST * np.count_nonzero(inside):
        return None
    agreeing = np.einsum("ia,ia->i", outward[labels, np.arange(len(rows))], cloud.normals[rows])
    joins = np.empty(len(sheets), dtype=np.int64)
    if crease_loops.order_sheets(labels, away, sheets, joins) > crease_loops.MIXED:
        return None
    far = np.linalg.norm(cloud.points[rows] - centre, axis=1)
    parts = []
    for sheet in sheets:
        own = np.flatnonzero(labels == sheet)
        order = own[np.lexsort((far[own], ~inside[own]))]
        chosen = order[: max(LEAST_POINTS, np.count_nonzero(inside[own]))]
        part = belonging.constraints(rows[chosen], agreeing[chosen] >= cloud.half)
        if np.count_nonzero(belonging.off[part]) < LEAST_SITES:
            return None
        parts.append(part)
    return Split(parts, joins)


def _replace(cover: Cover, found: dict[int, Split]) -> Pieces:
    """Return the cover with some of its balls replaced by their sheets."""
    counts = np.ones(len(cover.radii), dtype=np.int64)
    for ball, (parts, _) in found.items():
        counts[ball] = len(parts)
    first = np.concatenate([[0], np.cumsum(counts)])
    ball_of = np.repeat(np.arange(len(counts)), counts)
    members, joins = [], np.zeros(first[-1], dtype=np.int64)
    for ball in range(len(counts)):
        if ball in found:
            members += found[ball][0]
            joins[first[ball] : first[ball + 1]] = found[ball][1]
        else:
            members.append(cover.members[cover.offsets[ball] : cover.offsets[ball + 1]])
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in members])])
    over = Cover(cover.centres[ball_of], cover.radii[ball_of], cover.bounds, offsets, np.concatenate(members))
    return Pieces(over, first, joins)


def _keep_better(
    cover: Cover,
    data: _Data,
    pieces: Pieces,
    kernel: Polyharmonic,
    degree: int,
    rule: Smoothing,
    *,
    progress: Progress | None,
) -> tuple[Pieces | None, Smoothing]:
    """Return the pieces of those balls alone that are better split, and the smoothing chosen for them."""
    points, values, trust, owners, _ = data
    exponents, terms = tail_exponents(3, degree), _terms(pieces, kernel, degree)
    tail = (exponents, int(terms.min()))
    balls = np.flatnonzero(np.diff(pieces.first) > 1)
    better = np.zeros(len(balls), dtype=bool)
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
        whole, split = (_arrays(over) for over in (cover, pieces.cover))

        def task(start: int, stop: int) -> None:
            for at in range(start, stop):
                ball = balls[at]
                parts = ((pieces.first[ball], pieces.first[ball + 1]), split, pieces.joins)
                better[at] = crease_loops.judge(ball, data, whole, parts, tail, kernel.power, diagonals)

        run_blocks(task, len(balls), 1, progress)
    if not better.any():
        return None, rule
    kept = {}
    for ball in balls[better]:
        first, last = pieces.first[ball], pieces.first[ball + 1]
        kept[int(ball)] = Split(
            [pieces.cover.members[slice(*pieces.cover.offsets[p : p + 2])] for p in range(first, last)],
            pieces.joins[first:last],
        )
    return _replace(cover, kept), chosen if better.all() else rule


def _arrays(cover: Cover) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    return cover.centres, cover.radii, cover.offsets, cover.members
