"""The noise of a scan about its local planes, and its density: what smoothings are told from."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query

NEIGHBORS = 12
MIN_NOISE = 0.01
"""Noise in spacings that is taken for granted. A scan that is flat for the most part and without noise has none about
its planes, and where it bends every point would be an outlier."""
MAD = 1.4826
"""Median absolute deviation to standard deviation, for normal errors."""


def plane_noise(points: FloatArray) -> float:
    """Return a robust standard deviation of (n, 3) points about the plane through each one and its 12 neighbors."""
    _, rows = query(cKDTree(points), points, k=min(NEIGHBORS + 1, len(points)))
    local = points[rows]
    mean = local.mean(axis=1)
    centered = local - mean[:, None]
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", centered, centered))[1][:, :, 0]
    return MAD * float(np.median(np.abs(np.einsum("ni,ni->n", points - mean, normals))))


def height_noise(points: FloatArray) -> float:
    """Return a robust standard deviation of heights, the last of (n, 3), about planes fitted to 13 points each.

    They are the nearest seen from above, and planes are least squares of heights alone, so that the two sides of a leaf
    thicker than its points are apart, which lie closer to their own neighbors, are noise of one surface between them.
    """
    places = np.ascontiguousarray(points[:, :2])
    _, rows = query(cKDTree(places), places, k=min(NEIGHBORS + 1, len(points)))
    local = points[rows]
    mean = local.mean(axis=1)
    centered = local - mean[:, None]
    products = np.einsum("nki,nkj->nij", centered, centered)
    slope = np.einsum("nij,nj->ni", np.linalg.pinv(products[:, :2, :2], hermitian=True), products[:, :2, 2])
    off = points - mean
    return MAD * float(np.median(np.abs(off[:, 2] - np.einsum("ni,ni->n", slope, off[:, :2]))))


def density_of(plane: FloatArray) -> float:
    """Return points per area, of the median point: its neighbors over the disc that contains them; ∞ of one place."""
    distance, _ = query(cKDTree(plane), plane, k=[min(4 * NEIGHBORS, len(plane))])
    reach = float(np.median(distance))
    return 4 * NEIGHBORS / (np.pi * reach**2) if reach > 0 else np.inf
