"""The noise of a scan about a blade, from what neighbors differ by, and what of their residuals they share."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query

NEIGHBORS = 6
"""Points whose residuals a point's is compared with: near ones, over which the blade's own errors hardly change."""
MAX_POINTS = 20_000
"""Points at which the noise is measured, which gives it to a hundredth."""
SMALLEST_SHARE = 0.25
"""Share of the differences that is looked at, the smallest: of two passes that disagree half are of one pass."""
QN = 2.2191
"""That quantile of differences of normal errors to their standard deviation (Rousseeuw and Croux 1993)."""


def local_noise(feet: FloatArray, distance: FloatArray) -> float:
    """Return a robust standard deviation of points about a blade, less what whole neighborhoods are off it.

    Passes of a scan that disagree, and places that the blade does not follow, make it no larger than twice what it is
    without them, as long as half of each point's neighbors err as it does.

    Parameters
    ----------
    feet : (n, 3) ndarray
        Of the points on the blade, in the world.
    distance : (n,) ndarray
        Signed, of the points from the blade.
    """
    own, others = _beside(feet, distance, NEIGHBORS)
    return QN * float(np.quantile(np.abs(others - own), SMALLEST_SHARE))


def shared_residual(feet: FloatArray, distance: FloatArray) -> float:
    """Return the root mean square of what points and their nearest neighbors are off a blade alike.

    Errors of single points are independent, and their products cancel; waves that are shorter than what the blade
    follows lift neighbors together, as noise does that several points have in common.

    Parameters
    ----------
    feet, distance
        As in `local_noise`.
    """
    own, others = _beside(feet, distance, 1)
    return float(np.sqrt(max(float(np.mean(own * others)), 0.0)))


def _beside(feet: FloatArray, distance: FloatArray, neighbors: int) -> tuple[FloatArray, FloatArray]:
    """Return the distances (m, 1) of at most `MAX_POINTS` of the points, and (m, k) of the nearest other ones."""
    rows = np.arange(0, len(feet), -(-len(feet) // MAX_POINTS))
    _, near = query(cKDTree(feet), feet[rows], k=range(2, min(neighbors + 1, len(feet)) + 1))
    return distance[rows, np.newaxis], distance[near]
