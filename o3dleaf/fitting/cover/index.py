"""Index of the balls that contain a point: a tree of boxes, each with the list of the balls that reach into it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.resources.scratch import ROWS, GrowingArray, made_by_rows
from o3dleaf.fitting.cover import ball_loops
from o3dleaf.fitting.cover.ball_loops import BoxTree, Images
from o3dleaf.fitting.cover.tree import build_tree
from o3dleaf.fitting.rbf.tail import IntArray

FOLD_BLOCK = 1 << 15
MEMBER_BLOCKS = 16
"""Blocks that points are sorted into balls in; each keeps a number for each ball."""


@dataclass(frozen=True, eq=False)
class BallIndex:
    """Images of balls over a box, found by the points that they contain.

    An image is a ball and a displacement s: a plain cover has one image a ball with s = 0, a tiled
    one has several, so that tiling copies neither points nor coefficients (paper, section 2.6).
    Points anywhere are first folded into the box: by whole periods where an axis repeats, else to
    the nearest point of the box.

    Attributes
    ----------
    bounds : (2, d) ndarray
        The box whose points can be looked up.
    period : (d,) ndarray
        Period of each axis, 0 where it does not repeat.
    balls : (K,) int64 ndarray
        The ball of each image.
    shifts : (K, d) ndarray
        The displacement of each image.
    centers, radii : (K, d), (K,) ndarrays
        Where the images lie.
    """

    bounds: FloatArray
    period: FloatArray
    balls: IntArray
    shifts: FloatArray
    centers: FloatArray
    radii: FloatArray

    def __repr__(self) -> str:
        return f"BallIndex({len(self.balls):,} images of balls in {self.bounds.shape[1]}-D)"

    def state(self) -> dict[str, Any]:
        """Return what the index is made of, for `o3dleaf.io.models.model_file`: the tree follows from it."""
        return {
            "bounds": self.bounds,
            "period": self.period,
            "balls": self.balls,
            "shifts": self.shifts,
            "centres": self.centers,
            "radii": self.radii,
        }

    @classmethod
    def build(cls, centers: FloatArray, radii: FloatArray, bounds: FloatArray) -> "BallIndex":
        """Index the balls (M, d), (M,) over `bounds`, one image each."""
        period = np.zeros(centers.shape[1])
        shifts = made_by_rows(centers.shape, lambda start, stop: np.zeros((stop - start, len(period))))
        return cls(bounds, period, made_by_rows(radii.shape, np.arange, np.int64), shifts, centers, radii)

    @classmethod
    def periodic(cls, centers: FloatArray, radii: FloatArray, bounds: FloatArray, period: FloatArray) -> "BallIndex":
        """Index all images, under shifts by whole `period` (d,), that reach into the cell `bounds`; 0: not periodic."""
        repeats = np.zeros(len(period), dtype=np.int64)
        moving = period > 0
        lowest, highest = np.full(len(period), np.inf), np.full(len(period), -np.inf)
        for start, stop in blocks(len(centers), ROWS):
            places, sizes = centers[start:stop], radii[start:stop, np.newaxis]
            lowest = np.minimum(lowest, (places - sizes).min(axis=0))
            highest = np.maximum(highest, (places + sizes).max(axis=0))
        reach = np.maximum(bounds[1] - lowest, highest - bounds[0])
        repeats[moving] = np.ceil(reach[moving] / period[moving]).astype(np.int64)
        steps = np.stack(np.meshgrid(*[np.arange(-n, n + 1) for n in repeats], indexing="ij"), axis=-1)
        found = [GrowingArray(np.int64), *(GrowingArray(np.float64, row) for row in ((), period.shape, period.shape))]
        for shift in steps.reshape(-1, len(period)) * period:
            # Some at a time: nine displaced copies of a large cover are more than all else.
            for start, stop in blocks(len(centers), ROWS):
                moved = centers[start:stop] + shift
                gap = np.maximum(np.maximum(bounds[0] - moved, moved - bounds[1]), 0)
                kept = np.flatnonzero(np.linalg.norm(gap, axis=1) < radii[start:stop])
                by = np.tile(shift, (len(kept), 1))
                for whole, part in zip(found, (start + kept, radii[start + kept], by, moved[kept]), strict=True):
                    whole.append(part)
        balls, sizes, shifts, places = (each.whole() for each in found)
        return cls(bounds, period, balls, shifts, places, sizes)

    @cached_property
    def tree(self) -> BoxTree:
        """Boxes, each leaf with the list of the images that reach into it; made when it is first asked for.

        The index of a patch that is tiled is never asked.
        """
        return build_tree(self.centers, self.radii, self.bounds)

    def only(self, images: npt.NDArray[Any]) -> "BallIndex":
        """Return the index of some of the images, by their numbers or a mask, in the order that they have."""
        places = self.centers[images], self.radii[images]
        return BallIndex(self.bounds, self.period, self.balls[images], self.shifts[images], *places)

    @property
    def images(self) -> Images:
        """The images, as the compiled loops take them."""
        return Images(self.balls, self.centers, self.radii)

    @property
    def domain(self) -> FloatArray:
        """(2, d) the box, without end along the axes that repeat."""
        box = self.bounds.copy()
        box[0, self.period > 0], box[1, self.period > 0] = -np.inf, np.inf
        return box

    def fold(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return the (n, d) points folded into the box, and the (n,) tree leaf of each."""
        folded, leaves = np.empty_like(points), np.empty(len(points), dtype=np.int64)

        def task(start: int, stop: int) -> None:
            ball_loops.fold(start, stop, points, self.bounds, self.period, self.tree, folded, leaves)

        run_blocks(task, len(points), FOLD_BLOCK)
        return folded, leaves

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the (n, d) points, those outside `domain` moved to its nearest point."""
        return np.asarray(np.clip(points, *self.domain))

    def is_left(self, points: FloatArray, folded: FloatArray) -> bool:
        """Return whether some of the (n, d) points lie outside `domain`, from what `fold` made of them."""
        fixed = np.flatnonzero(self.period == 0)
        return any(bool((points[:, axis] != folded[:, axis]).any()) for axis in fixed)

    def share_ball(self, some: FloatArray, points: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which of the (n, d) points lie in an image that contains one of `some` (m, d).

        Of points outside the domain their nearest place in it counts: a blend has the weights that they have there.
        """
        chosen, shared = np.diff(self.members(some)[0]) > 0, np.empty(len(points), dtype=bool)
        folded, leaves = self.fold(points)

        def mark(start: int, stop: int) -> None:
            ball_loops.mark_members(start, stop, folded, leaves, self.tree, self.images, chosen, shared)

        run_blocks(mark, len(points), FOLD_BLOCK)
        return shared

    def members(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Return (offsets (K + 1,), rows (total,)): the points in each image, in rising order."""
        counting, filling = progress.split(1, 1)
        _, leaves = self.fold(points)
        block = max(1, -(-len(points) // MEMBER_BLOCKS))
        heads = np.zeros((MEMBER_BLOCKS, len(self.radii)), dtype=np.int64)

        def count(start: int, stop: int) -> None:
            ball_loops.count_members(start, stop, points, leaves, self.tree, self.images, heads[start // block])

        with counting:
            run_blocks(count, len(points), block, reports=True)
        offsets = np.concatenate([[0], np.cumsum(heads.sum(axis=0))])
        # The points of an earlier block come first.
        heads[:] = offsets[:-1] + np.cumsum(heads, axis=0) - heads
        rows = np.empty(offsets[-1], dtype=np.int64)

        def fill(start: int, stop: int) -> None:
            ball_loops.fill_members(start, stop, points, leaves, self.tree, self.images, heads[start // block], rows)

        with filling:
            run_blocks(fill, len(points), block, reports=True)
        return offsets, rows
