"""An adaptive cover: balls around the cells of a box that is halved until each contains few enough points."""

from dataclasses import dataclass, field
from operator import index
from typing import cast

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import blocks
from o3dleaf.core.resources.scratch import ROWS, GrowingArray, made_by_rows
from o3dleaf.core.trees import query, threads_for
from o3dleaf.fitting.cover import ball_loops
from o3dleaf.fitting.cover.ball_loops import Balls
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.rbf.tail import IntArray

MIN_CELL = 1e-14
"""Share of the largest coordinate that a cell may shrink to: a hundred roundings. What lies in it then coincides."""

SHARES = (1, 3, 4, 2)
"""About how long the tree of the points, the halving, the points of the balls and those that they borrow take."""

BATCH_SIZE = 1 << 14
"""Balls whose nearest points are searched at once."""

LEAF_POINTS = 32
"""Points of a leaf of the tree that counts the points of balls, hundreds at a time."""


@dataclass(frozen=True, eq=False)
class Cover:
    """Balls Ω_i whose union contains a box, and the points that each of them is fitted to.

    Attributes
    ----------
    centers : (M, d) ndarray
    radii : (M,) ndarray
    bounds : (2, d) ndarray
        The box that is covered.
    offsets, members : (M + 1,), (total,) int64 ndarrays
        Ball i is fitted to the points ``members[offsets[i]:offsets[i + 1]]``, in rising order: all
        the points in it, or its nearest ones where it contains too few.
    """

    centers: FloatArray = field(metadata={"stored": "centres"})
    radii: FloatArray
    bounds: FloatArray
    offsets: IntArray
    members: IntArray

    def __repr__(self) -> str:
        return f"Cover({len(self.radii):,} balls in {self.bounds.shape[1]}-D)"

    @classmethod
    def fit(cls, points: FloatArray, bounds: FloatArray, points_per_ball: tuple[int, int], overlap: float) -> "Cover":
        """Return what `indexed` does without the index."""
        return cls.indexed(points, bounds, points_per_ball, overlap)[0]

    @classmethod
    def indexed(
        cls, points: FloatArray, bounds: FloatArray, points_per_ball: tuple[int, int], overlap: float
    ) -> tuple["Cover", BallIndex]:
        """Cover `bounds` by balls that contain at most ``points_per_ball[1]`` of the points; return also their index.

        The box is halved across its longest side until the ball around each cell, `overlap` times
        the cell's half diagonal, contains few enough points; cells tile the box, so no query is ever
        uncovered. A ball that contains fewer than ``points_per_ball[0]`` points is fitted to that many
        nearest ones, all of its own among them.

        Raises
        ------
        InputError
            If too many points coincide.
        """
        least, most = points_per_ball
        planting, halving, sorting, borrowing = progress.split(*SHARES)
        with planting:
            # Halves by place, not by number: made in a third of the time, and a ball meets fewer leaves.
            tree = cKDTree(points, leafsize=LEAF_POINTS, balanced_tree=False, compact_nodes=False)
        with halving:
            low, high = _halve_until_small(tree, points, bounds, most, overlap)
        centers, radii = _circumscribe(low, high, overlap)
        index = BallIndex.build(centers, radii, bounds)
        with sorting:
            offsets, members = index.members(points)
        least = min(least, len(points))
        few = np.flatnonzero(np.diff(offsets) < least)
        with borrowing:
            offsets, members = _replace_rows(offsets, members, few, _nearest(tree, centers[few], least))
        return cls(centers, radii, bounds, offsets, members), index

    @property
    def balls(self) -> Balls:
        """The balls, as the compiled loops take them."""
        dimension = self.bounds.shape[1]
        return Balls(self.centers, self.radii, self.offsets, self.members, np.empty((0, dimension, dimension)))

    @property
    def counts(self) -> IntArray:
        """(M,) number of points that each ball is fitted to, the paper's N_i."""
        offsets = self.offsets
        return made_by_rows((len(offsets) - 1,), lambda start, stop: np.diff(offsets[start : stop + 1]), offsets.dtype)

    @property
    def typical(self) -> tuple[float, float]:
        """Median radius and median number of points of the balls; bare ones of `VoxelCover` have none."""
        counts, found = self.counts, (GrowingArray(np.float64), GrowingArray(np.int64))
        least = min(1, int(counts.max(initial=0)))
        for start, stop in blocks(len(counts), ROWS):
            filled = counts[start:stop] >= least
            for whole, part in zip(found, (self.radii[start:stop], counts[start:stop]), strict=True):
                whole.append(part[filled])
        radius, count = (float(np.median(each.whole(), overwrite_input=True)) for each in found)
        return radius, count

    def only(self, balls: IntArray) -> "Cover":
        """Return some of the balls, by their numbers."""
        counts = self.counts[balls]
        members = self.members[ragged_rows(self.offsets[balls], counts)]
        offsets = np.concatenate([[0], np.cumsum(counts)])
        return Cover(self.centers[balls], self.radii[balls], self.bounds, offsets, members)

    def with_members(self, balls: IntArray, points: IntArray) -> "Cover":
        """Return the cover with point ``points[k]``, a row after all that there are, in ball ``balls[k]`` as well."""
        order = np.lexsort((points, balls))
        members = np.insert(self.members, self.offsets[balls[order] + 1], points[order])
        counts = self.counts + np.bincount(balls, minlength=len(self.radii))
        return Cover(self.centers, self.radii, self.bounds, np.concatenate([[0], np.cumsum(counts)]), members)


def ragged_rows(first: IntArray, counts: IntArray) -> IntArray:
    """Return first[0], first[0] + 1, ... counts[0] of them, then as many of the next, and so on."""
    begin = np.cumsum(counts) - counts
    return np.asarray(np.repeat(first - begin, counts) + np.arange(int(counts.sum())))


def as_ball_size(points_per_ball: int | tuple[int, int], overlap: float) -> tuple[int, int]:
    """Return (least, most) points of a ball, an int n standing for (n/2, n), or raise `InputError`."""
    try:
        if np.ndim(points_per_ball) == 0:
            most = index(cast("int", points_per_ball))
            least = max(most // 2, 1)
        else:
            least, most = (index(number) for number in cast("tuple[int, int]", points_per_ball))
    except (TypeError, ValueError) as cause:
        raise InputError(f"points_per_ball: is {points_per_ball!r}; give a whole number or (least, most)") from cause
    if not 1 <= least <= most:
        raise InputError(f"points_per_ball: is {points_per_ball}; give (least, most) with 1 <= least <= most")
    if not 1 < overlap < 10:
        raise InputError(f"overlap: is {overlap}; give a factor above 1 and below 10, such as 1.1")
    return least, most


def _circumscribe(low: FloatArray, high: FloatArray, overlap: float) -> tuple[FloatArray, FloatArray]:
    radii = overlap * np.linalg.norm(high - low, axis=1) / 2
    return (low + high) / 2, np.where(radii > 0, radii, 1.0)


def _tree_order(places: FloatArray) -> IntArray:
    """Return the order of a tree: places near one another in a query find their answers near in memory."""
    return np.asarray(cKDTree(places).indices, dtype=np.int64)


def _nearest(tree: cKDTree, places: FloatArray, count: int) -> IntArray:
    """Return the rising rows (n, count) of the points that are nearest to each of the (n, d) places."""
    rows, order = np.empty((len(places), count), dtype=np.int64), _tree_order(places)
    for i, j in blocks(len(places), BATCH_SIZE):
        asked = order[i:j]
        rows[asked] = np.sort(query(tree, places[asked], k=np.arange(1, count + 1))[1], axis=1)
        progress.report(j, len(places))
    return rows


def _halve_until_small(
    tree: cKDTree, points: FloatArray, bounds: FloatArray, most: int, overlap: float
) -> tuple[FloatArray, FloatArray]:
    """Return the (M, d) lower and upper corners of the final cells, in a fixed order."""
    low, high = bounds[:1].copy(), bounds[1:].copy()
    cells = np.zeros(len(points), dtype=np.int64)
    done: list[tuple[FloatArray, FloatArray]] = []
    while True:
        centers, radii = _circumscribe(low, high, overlap)
        # A ball contains its cell, so that only balls of cells with few points need to be counted.
        large = ball_loops.count_cells(cells, len(low)) > most
        asked = np.flatnonzero(~large)
        asked = asked[_tree_order(centers[asked])]
        large[asked] = (
            tree.query_ball_point(centers[asked], radii[asked], workers=threads_for(len(asked)), return_length=True)
            > most
        )
        done.append((low[~large], high[~large]))
        if not large.any():
            return np.concatenate([cell[0] for cell in done]), np.concatenate([cell[1] for cell in done])
        rows, low, high = np.where(large, np.cumsum(large) - 1, -1), low[large], high[large]
        if np.any(np.max(high - low, axis=1) <= MIN_CELL * np.abs(bounds).max()):
            raise InputError(f"points: more than {most} coincide near {low[0]}; remove duplicated points")
        axis = np.argmax(high - low, axis=1)
        low, high, middle = _halve(low, high, axis)
        ball_loops.move_to_halves(cells, points, rows, axis, middle)
        progress.report(int(np.count_nonzero(cells < 0)), len(cells))


def _halve(low: FloatArray, high: FloatArray, axis: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the corners of all lower halves, then of all upper ones, and where they meet."""
    row = np.arange(len(low))
    middle = (low[row, axis] + high[row, axis]) / 2
    lower_high, upper_low = high.copy(), low.copy()
    lower_high[row, axis] = middle
    upper_low[row, axis] = middle
    return np.concatenate([low, upper_low]), np.concatenate([lower_high, high]), middle


def _replace_rows(offsets: IntArray, members: IntArray, rows: IntArray, new: IntArray) -> tuple[IntArray, IntArray]:
    """Return the ragged rows (offsets, members) with `rows` replaced by the rows of `new`."""
    counts = np.diff(offsets)
    counts[rows] = new.shape[1]
    replaced = np.zeros(len(counts), dtype=bool)
    replaced[rows] = True
    fresh = np.concatenate([[0], np.cumsum(counts)])
    result = np.empty(fresh[-1], dtype=np.int64)
    changed = np.repeat(replaced, counts)
    result[~changed] = members[~np.repeat(replaced, np.diff(offsets))]
    result[changed] = new.ravel()
    return fresh, result
