"""The smooth sheets that the measured points of balls fall into, and the cover with a ball for each of them."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.trees import query
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.surface.creases import sheet_loops, split_loops

BoolArray = npt.NDArray[np.bool_]

NEIGHBORS = 8
"""Neighbors that a smooth point agrees with; as many join it to its sheet."""

BEYOND = 1.5
"""Radius, in that of a ball's farthest point, of what its sheets are looked for in: they come in from outside."""

ROUNDS = 3
"""Times that normals are averaged over neighbors that agree: noise goes, creases stay."""

BLOCK = 1 << 12

BATCH_SIZE = 16
"""Balls that are split in one compiled call."""

MAX_BALLS = 1 << 16
"""Balls whose surroundings are kept at once."""


class MeasuredPoints(NamedTuple):
    """The measured points of a surface, and which of them lie away from any crease.

    Attributes
    ----------
    points, normals : (n, 3) ndarrays
        Outward unit normals, averaged over neighbors that agree.
    joined : (n, k) int64 ndarray
        The neighbors that agree with a smooth point and are smooth; −1 in place of others.
    smooth : (n,) ndarray of bool
        Whether all neighbors agree with the normal of a point, those on the other side of a thin sheet aside.
    cosine : float
        Of half the angle by which normals turn across a crease; normals agree whose product is no less.
    """

    points: FloatArray
    normals: FloatArray
    joined: IntArray
    smooth: BoolArray
    cosine: float

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray, angle: float) -> "MeasuredPoints":
        """Return measured points with their normals, and what makes a crease, in degrees."""
        planting, finding, *averaging, smoothing = progress.split(1, 2, *ROUNDS * [1], 1)
        cosine = float(np.cos(np.radians(angle / 2)))
        with planting:
            tree = cKDTree(points)
        neighbors = np.empty((len(points), min(NEIGHBORS, len(points) - 1)), dtype=np.int64)
        with finding:
            # In the tree's own order, neighbors in the query are neighbors in memory.
            rows = query(tree, points[tree.indices], k=neighbors.shape[1] + 1)[1]
            neighbors[tree.indices] = rows[:, 1:]
        for part in averaging:
            before, normals = normals, np.empty_like(normals)
            with part:
                _over(len(points), sheet_loops.average_alike, before, neighbors, cosine, normals)
        smooth = np.empty(len(points), dtype=bool)
        with smoothing:
            _over(len(points), sheet_loops.find_smooth, normals, neighbors, cosine, smooth)
            _over(len(points), sheet_loops.join_alike, normals, smooth, cosine, neighbors)
        return cls(points, normals, neighbors, smooth, cosine)


def _over(count: int, loop: Callable[..., None], *arrays: object) -> None:
    """Run a compiled loop over blocks of so many points."""
    run_blocks(lambda start, stop: loop(start, stop, *arrays), count, BLOCK, reports=True)


class PointGroups(NamedTuple):
    """The constraints that are made from each measured point.

    Attributes
    ----------
    point_of : (n,) int64 ndarray
        The measured point of each constraint; −1 where there is none.
    first, rows : (m + 1,), (n,) int64 ndarrays
        Point p has the constraints ``rows[first[p]:first[p + 1]]``.
    off : (n,) ndarray of bool
        Whether a constraint lies off the surface.
    """

    point_of: IntArray
    first: IntArray
    rows: IntArray
    off: BoolArray

    @classmethod
    def of(cls, measured: IntArray, groups: IntArray, values: FloatArray) -> "PointGroups":
        """Return the constraints of the measured points, which are the rows `measured`."""
        number = np.full(len(groups), -1, dtype=np.int64)
        number[measured] = np.arange(len(measured))
        point_of = number[groups]
        rows = np.argsort(point_of, kind="stable")
        first = np.searchsorted(point_of[rows], np.arange(len(measured) + 1))
        return cls(point_of, first, rows, values != 0)


class SplitBalls(NamedTuple):
    """Balls that are split, and the sheets of each, end to end.

    Attributes
    ----------
    balls, counts : (B,) int64 ndarrays
        Rising numbers of the balls, and how many sheets each has.
    members, sizes : (total,), (P,) int64 ndarrays
        The rows of the constraints of each sheet, rising, and how many they are.
    composition : (P,) int64 ndarray
        As of `SheetCover`.
    """

    balls: IntArray
    counts: IntArray
    members: IntArray
    sizes: IntArray
    composition: IntArray

    def only(self, kept: BoolArray) -> "SplitBalls":
        """Return some (B,) of the balls."""
        sheets = np.repeat(kept, self.counts)
        members = self.members[np.repeat(sheets, self.sizes)]
        return SplitBalls(self.balls[kept], self.counts[kept], members, self.sizes[sheets], self.composition[sheets])


class SheetCover(NamedTuple):
    """The sheets of balls, end to end.

    Attributes
    ----------
    cover : Cover
        A ball for each sheet, where that of the sheet is.
    first : (M + 1,) int64 ndarray
        Ball i has the sheets ``first[i]:first[i + 1]``.
    composition : (P,) int64 ndarray
        How a sheet is composed with those before it: −1, minimum (convex); 1, maximum (concave); 0, the first of a
        ball.
    """

    cover: Cover
    first: IntArray
    composition: IntArray


def find_splits(cover: Cover, measured: MeasuredPoints, groups: PointGroups) -> SplitBalls:
    """Return the balls that contain several sheets."""
    with progress.silent():
        balls = _suspects(cover, measured, groups)
    batches = list(blocks(len(balls), MAX_BALLS))
    parts = []
    for (i, j), part in zip(batches, progress.split(*(j - i for i, j in batches)), strict=True):
        with part:
            parts.append(_split(balls[i:j], cover, measured, groups))
    if not parts:
        return SplitBalls(*np.empty((5, 0), dtype=np.int64))
    return SplitBalls(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _split(balls: IntArray, cover: Cover, measured: MeasuredPoints, groups: PointGroups) -> SplitBalls:
    """Return those of the balls that contain several sheets."""
    reach = np.empty(len(balls))

    def measure(start: int, stop: int) -> None:
        split_loops.reach(start, stop, balls, cover.balls, groups, measured.points, reach)

    run_blocks(measure, len(balls), BLOCK)
    index = BallIndex.build(cover.centers[balls], BEYOND * reach, cover.bounds)
    with progress.silent():
        around = index.members(measured.points)
    parts = [(np.empty(0, dtype=np.int64),) * 4] * -(-len(balls) // BATCH_SIZE)

    def task(start: int, stop: int) -> None:
        parts[start // BATCH_SIZE] = split_loops.split_balls(start, stop, balls, *around, cover.balls, measured, groups)

    run_blocks(task, len(balls), BATCH_SIZE, reports=True)
    counts, members, sizes, composition = (np.concatenate(each) for each in zip(*parts, strict=True))
    return SplitBalls(balls[counts > 0], counts[counts > 0], members, sizes, composition)


def _suspects(cover: Cover, measured: MeasuredPoints, groups: PointGroups) -> IntArray:
    """Return the balls that contain constraints of points near creases; not those that only borrow theirs."""
    rough = np.append(~measured.smooth, False)[groups.point_of]
    balls = np.flatnonzero(np.logical_or.reduceat(rough[cover.members], cover.offsets[:-1]))
    if not len(balls):
        return balls
    index = BallIndex.build(cover.centers[balls], cover.radii[balls], cover.bounds)
    return np.asarray(balls[np.diff(index.members(measured.points)[0]) > 0])


def replace(cover: Cover, splits: SplitBalls) -> SheetCover:
    """Return the cover with some of its balls replaced by their sheets."""
    counts = np.ones(len(cover.radii), dtype=np.int64)
    counts[splits.balls] = splits.counts
    first, ball_of = np.concatenate([[0], np.cumsum(counts)]), np.repeat(np.arange(len(counts)), counts)
    split = np.zeros(len(counts), dtype=bool)
    split[splits.balls] = True
    sizes, composition = cover.counts[ball_of], np.zeros(len(ball_of), dtype=np.int64)
    sizes[split[ball_of]], composition[split[ball_of]] = splits.sizes, splits.composition
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    members, new = np.empty(offsets[-1], dtype=np.int64), np.repeat(split[ball_of], sizes)
    members[new], members[~new] = splits.members, cover.members[~np.repeat(split, cover.counts)]
    over = Cover(cover.centers[ball_of], cover.radii[ball_of], cover.bounds, offsets, members)
    return SheetCover(over, first, composition)
