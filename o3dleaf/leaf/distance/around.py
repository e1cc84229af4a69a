"""Bounding balls of the leaf, which separate empty air from it without evaluating G."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.textured_blade import TexturedBlade

MAX_BALLS = 1 << 16
"""Balls, 24 bytes each in the tree and some 1 kB while it is grown; where they are too many they grow."""
SLACK = 1.1
"""By how much a ball is larger than about the corners of its piece: the blade bends between them, by less than 1 %."""
RUNS = (64, 8)
"""Points of a grid that are tested against the leaf together, at first and later."""


@dataclass(frozen=True, eq=False)
class BoundingBalls:
    """Balls of one size whose union contains the leaf.

    Attributes
    ----------
    tree : cKDTree
        Their centers.
    radius : float
    """

    tree: cKDTree
    radius: float

    @classmethod
    def of(cls, leaf: TexturedBlade) -> "BoundingBalls":
        """Cut the outline's box into pieces as long as the patch is high, and put balls about them."""
        first, last = leaf.blade.outline.bounds
        step = max(leaf.thickness, float(np.sqrt((last - first).prod() / MAX_BALLS)))
        counts = np.maximum(np.ceil((last - first) / step), 1).astype(np.int64)
        lines = [np.linspace(a, b, n + 1) for a, b, n in zip(first, last, counts, strict=True)]
        flat = np.stack(np.meshgrid(*lines, leaf.heights, indexing="ij"), axis=-1)
        ends = leaf.blade.lift(flat.reshape(-1, 3)).reshape(*(counts + 1), 2, 3)
        corners = np.stack([ends[:-1, :-1], ends[1:, :-1], ends[:-1, 1:], ends[1:, 1:]], axis=2).reshape(-1, 8, 3)
        centers = corners.mean(axis=1)
        radius = SLACK * float(np.linalg.norm(corners - centers[:, np.newaxis], axis=2).max())
        return cls(cKDTree(centers), radius)

    def rows(self, points: FloatArray) -> IntArray:
        """Return which of the points (n, 3), neighbors in a row, may lie in the leaf: all that do are among them."""
        rows = np.arange(len(points))
        for run in RUNS:
            starts = np.arange(0, len(rows), run)
            if not len(starts):
                break
            low, high = (merge.reduceat(points[rows], starts) for merge in (np.minimum, np.maximum))
            reach = self.radius + np.linalg.norm(high - low, axis=1) / 2
            near = self.tree.query((low + high) / 2, distance_upper_bound=reach.max())[0] <= reach
            rows = rows[np.repeat(near, np.diff(starts, append=len(rows)))]
        return rows
