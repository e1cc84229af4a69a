"""The smooth sheets that the measured points of balls fall into, and the cover with a ball for each of them."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import Progress, blocks, finish, run_blocks, share_out
from o3dleaf.fitting.creases import sheet_loops, split_loops
from o3dleaf.fitting.pu.cover import Cover
from o3dleaf.fitting.pu.index import BallIndex
from o3dleaf.fitting.rbf.tail import IntArray

BoolArray = npt.NDArray[np.bool_]
BallArrays = tuple[FloatArray, FloatArray, IntArray, IntArray]
"""Centres, radii, offsets and members of a cover, as the compiled loops take them."""

ANGLE = 30.0
"""Degrees by which normals turn across what "auto" calls a crease."""

NEIGHBOURS = 8
"""Neighbours that a calm point agrees with; as many join it to its sheet."""

BEYOND = 1.5
"""Radius, in that of a ball's farthest point, of what its sheets are looked for in: they come in from outside."""

ROUNDS = 3
"""Times that normals are averaged over neighbours that agree: noise goes, creases stay."""

BLOCK = 1 << 12

AT_ONCE = 16
"""Balls that are split in one compiled call."""

MOST = 1 << 16
"""Balls whose surroundings are kept at once."""


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


class Cloud(NamedTuple):
    """The measured points, their normals averaged over neighbours that agree, the neighbours, and who is calm."""

    points: FloatArray
    normals: FloatArray
    near: IntArray
    calm: BoolArray
    half: float

    @classmethod
    def of(cls, surface: Surface, points: FloatArray, progress: Progress | None = None) -> "Cloud":
        """Return the cloud of the measured ones of all points."""
        planting, finding, *averaging, calming = share_out(progress, 1, 2, *ROUNDS * [1], 1)
        x, normals, half = points[surface.rows], surface.normals, surface.half
        tree = cKDTree(x)
        finish(planting)
        near = np.empty((len(x), min(NEIGHBOURS, len(x) - 1)), dtype=np.int64)
        # Asked in the tree's own order, neighbours in the question are neighbours in memory.
        near[tree.indices] = tree.query(x[tree.indices], k=near.shape[1] + 1, workers=-1)[1][:, 1:]
        finish(finding)
        for averaged in averaging:
            before, normals = normals, np.empty_like(normals)
            _over(len(x), averaged, sheet_loops.average_alike, before, near, half, normals)
        calm = np.empty(len(x), dtype=bool)
        _over(len(x), calming, sheet_loops.find_calm, normals, near, half, calm)
        return cls(x, normals, near, calm, half)


def _over(count: int, progress: Progress | None, loop: Callable[..., None], *arrays: object) -> None:
    """Run a compiled loop over blocks of so many points."""
    run_blocks(lambda start, stop: loop(start, stop, *arrays), count, BLOCK, progress)


class Belonging(NamedTuple):
    """Which constraints belong to which measured point: `rows[first[p]:first[p + 1]]` to point p = `point_of[row]`."""

    point_of: IntArray
    first: IntArray
    rows: IntArray
    off: BoolArray

    @classmethod
    def of(cls, surface: IntArray, owners: IntArray, values: FloatArray) -> "Belonging":
        """Return what belongs to the measured points, which are the rows `surface`; −1 where there is none."""
        number = np.full(len(owners), -1, dtype=np.int64)
        number[surface] = np.arange(len(surface))
        point_of = number[owners]
        rows = np.argsort(point_of, kind="stable")
        first = np.searchsorted(point_of[rows], np.arange(len(surface) + 1))
        return cls(point_of, first, rows, values != 0)


class Splits(NamedTuple):
    """Balls that are split, and the sheets of each, end to end.

    Attributes
    ----------
    balls, counts : (B,) int64 ndarrays
        Rising numbers of the balls, and how many sheets each has.
    members, sizes : (total,), (P,) int64 ndarrays
        The rows of the constraints of each sheet, rising, and how many they are.
    joins : (P,) int64 ndarray
        As of `Pieces`.
    """

    balls: IntArray
    counts: IntArray
    members: IntArray
    sizes: IntArray
    joins: IntArray

    def only(self, kept: BoolArray) -> "Splits":
        """Return some (B,) of the balls."""
        sheets = np.repeat(kept, self.counts)
        members = self.members[np.repeat(sheets, self.sizes)]
        return Splits(self.balls[kept], self.counts[kept], members, self.sizes[sheets], self.joins[sheets])


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


def ball_arrays(cover: Cover) -> BallArrays:
    """Return what the compiled loops take of a cover."""
    return cover.centres, cover.radii, cover.offsets, cover.members


def find_splits(cover: Cover, cloud: Cloud, belonging: Belonging, progress: Progress | None = None) -> Splits:
    """Return the balls that hold several sheets."""
    balls = _suspects(cover, cloud, belonging)
    parts = list(blocks(len(balls), MOST))
    bars = share_out(progress, *(j - i for i, j in parts))
    found = [_split(balls[i:j], cover, cloud, belonging, bar) for (i, j), bar in zip(parts, bars, strict=True)]
    if not found:
        return Splits(*np.empty((5, 0), dtype=np.int64))
    return Splits(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _split(balls: IntArray, cover: Cover, cloud: Cloud, belonging: Belonging, progress: Progress | None) -> Splits:
    """Return those of the balls that hold several sheets."""
    arrays, reach = ball_arrays(cover), np.empty(len(balls))

    def measure(start: int, stop: int) -> None:
        split_loops.reach(start, stop, balls, arrays, belonging, cloud.points, reach)

    run_blocks(measure, len(balls), BLOCK)
    index = BallIndex.build(cover.centres[balls], BEYOND * reach, cover.bounds)
    around = index.members(cloud.points)
    found = [(np.empty(0, dtype=np.int64),) * 4] * -(-len(balls) // AT_ONCE)

    def task(start: int, stop: int) -> None:
        found[start // AT_ONCE] = split_loops.split_balls(start, stop, balls, *around, arrays, cloud, belonging)

    run_blocks(task, len(balls), AT_ONCE, progress)
    counts, members, sizes, joins = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Splits(balls[counts > 0], counts[counts > 0], members, sizes, joins)


def _suspects(cover: Cover, cloud: Cloud, belonging: Belonging) -> IntArray:
    """Return the balls that hold constraints of points which are not calm; not those that only borrow theirs."""
    rough = np.append(~cloud.calm, False)[belonging.point_of]
    found = np.flatnonzero(np.logical_or.reduceat(rough[cover.members], cover.offsets[:-1]))
    if not len(found):
        return found
    index = BallIndex.build(cover.centres[found], cover.radii[found], cover.bounds)
    return np.asarray(found[np.diff(index.members(cloud.points)[0]) > 0])


def replace(cover: Cover, splits: Splits) -> Pieces:
    """Return the cover with some of its balls replaced by their sheets."""
    counts = np.ones(len(cover.radii), dtype=np.int64)
    counts[splits.balls] = splits.counts
    first, ball_of = np.concatenate([[0], np.cumsum(counts)]), np.repeat(np.arange(len(counts)), counts)
    split = np.zeros(len(counts), dtype=bool)
    split[splits.balls] = True
    sizes, joins = cover.counts[ball_of], np.zeros(len(ball_of), dtype=np.int64)
    sizes[split[ball_of]], joins[split[ball_of]] = splits.sizes, splits.joins
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    members, new = np.empty(offsets[-1], dtype=np.int64), np.repeat(split[ball_of], sizes)
    members[new], members[~new] = splits.members, cover.members[~np.repeat(split, cover.counts)]
    over = Cover(cover.centres[ball_of], cover.radii[ball_of], cover.bounds, offsets, members)
    return Pieces(over, first, joins)
