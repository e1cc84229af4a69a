"""Scan lines that lie much farther apart than the points along them, thinned until they are a sample of a surface."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.average import thin

NEIGHBORS = 12
"""Points around one: of an even sample they lie on a disc, of lines that are far denser along than across on a line."""
LINEAR = 0.05
"""Difference of the second and third variance of such neighbors, of the first, up to which they lie on a line: of an
even sample it is 0.15 and more, noise of a spacing included, but for one point in thirty."""
MIN_SHARE_ON_LINES = 0.1
"""Share of points on lines from which on a scan is one of lines. Of random points on a leaf three wide and more it is a
fiftieth, of the real leaves that were tried a ninetieth, of lines four times denser along than across a seventh."""
BESIDE = 0.25
"""Share of the neighbors of a point that lie on a line, from which on it does: noise makes balls of some."""
COARSER = 1.5
"""Distance of points after a round of thinning along a line, in their spacing before."""
ROUNDS = 12


def without_scan_lines(points: FloatArray) -> IntArray:
    """Return the rows (k,) of points (n, 3), all but those too close to others along the scan lines that they are on.

    Planes through the nearest points of such a line turn about it. Lines are thinned, round after round, until
    neighbors lie on a surface; a scan that is not of lines stays whole. So does one whose noise hides them: twice the
    distance of points along them and more.
    """
    rows = np.arange(len(points))
    for _ in range(ROUNDS):
        linear, spacing = _along_lines(points[rows])
        if linear.mean() < MIN_SHARE_ON_LINES:
            break
        rows = rows[thin(points[rows], np.where(linear, COARSER * spacing, 0.0))]
    return rows


def _along_lines(points: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Return which points (n,) have neighbors along a line, and the mean distance there from one to the next."""
    distance, near = query(cKDTree(points), points, k=min(NEIGHBORS + 1, len(points)))
    around = points[near]
    centered = around - around.mean(axis=1, keepdims=True)
    least, middle, most = np.linalg.eigvalsh(np.einsum("nki,nkj->nij", centered, centered)).T
    linear = middle - least <= LINEAR * most
    return linear[near].mean(axis=1) >= BESIDE, 2 * distance[:, -1] / NEIGHBORS
