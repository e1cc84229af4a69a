"""Samples that were thinned to a least distance: no two points are nearer, and along an edge there are more of them.

CloudCompare's space and MeshLab's Poisson disk take points in random order, each unless one that was taken is nearer
than d (random sequential adsorption). A point at the edge of a leaf has neighbors on one side only that may shut it
out, so that more are taken there than the density inside tells.
"""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query

FEW, SOME = 0.01, 0.05
"""Shares of the points whose nearest neighbors are compared."""
SHARP = 1.03
"""Ratio of those two distances, at most. Of a sample thinned to half its spacing it is 1.02, of the densest 1.003; of
independent points √5, of a scan 1.3."""
MIN_POINTS = 100
"""Of fewer the two may be the same point's, or as near by chance."""
MIN_RANDOM = 0.04
"""How random a thinned sample is at least (`randomness`): half of the densest; one of a lattice is 0.01 and less."""
MAX_SHARE = 0.8345
"""The least distance over the spacing that a thinned sample has at most (Feder 1980: discs cover 0.547)."""


def least_distance(points: FloatArray) -> float:
    """Return the distance of neighbors below which points (n, d) have been left out; 0 if there is none."""
    if len(points) < MIN_POINTS:
        return 0.0
    nearest = query(cKDTree(points), points, k=[2])[0][:, 0]
    few, some = np.quantile(nearest, [FEW, SOME])
    return float(few) if some <= SHARP * few else 0.0


def excess_beside(share: FloatArray | float) -> FloatArray:
    r"""Return how many points more there are for each spacing of an edge, of a sample thinned to c (n,) spacings.

    .. math:: ε = c^3/3 + c^5/5

    The first term is what the discs of pairs of points lack beyond the edge; the second, of three points and more, is
    as simulated, to 0.02 up to the densest sample (`tests/leaf/margin/test_least_distance.py`).

    References
    ----------
    Feder, J. (1980): Random sequential adsorption. J. Theor. Biol. 87, 237-254.
    """
    c = np.minimum(share, MAX_SHARE)
    return np.asarray(c**3 / 3 + c**5 / 5)
