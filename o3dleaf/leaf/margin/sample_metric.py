"""The metric of a sample as a whole: scan lines that lie far apart are an even sample of a stretched plane."""

import numpy as np
from scipy.spatial import Delaunay, QhullError

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.sample_region import cover_sample
from o3dleaf.leaf.margin.sample_spacing import local_shape

MIN_RATIO = 1.25
"""Ratio of a sample's spacings, as its Delaunay edges have it, from which on it has a metric of its own: of independent
points on a strip ten spacings wide it is 1.12, of scan lines twice as far apart as the points along them 1.8."""
STEPS, CONVERGED = 8, 1.05
"""Steps from the plane to a metric, and the change of its ratio up to which it is found: triangles in the plane are too
flat to tell all of it."""
MAX_POINTS = 4000
"""Points that tell a metric: its direction to a degree."""
MORE_EVEN = 0.75
"""Randomness in a metric over that in the plane, at most, where the metric is the sample's own: of 300 independent
points chance changes it by a tenth, of lines four times as far apart as their points half of it goes."""


def sample_metric(points: FloatArray) -> FloatArray:
    """Return the symmetric matrix A (2, 2) of determinant 1 such that q = p A is an even sample; I of one that is even.

    The metric M = A² is the mean of that at each point (`local_shape`). Delaunay triangles of the plane join points of
    one line where lines lie six times as far apart as their points, and so they are triangulated again by M, which is
    M A⁻¹ … A⁻¹ in those coordinates, until it stays. Independent points are as independent in any metric, and of them
    none is found: it would be that of their chance.

    Parameters
    ----------
    points : (n, 2) ndarray
        Distinct; those on one line have none.
    """
    stretch, before = np.eye(2), 1.0
    for _ in range(STEPS):
        stretched = points @ stretch
        try:
            triangles = Delaunay(stretched).simplices.astype(np.int64)
        except QhullError:
            return np.eye(2)
        xx, xy, yy = local_shape(stretched, triangles).mean(axis=0)
        squares, axes = np.linalg.eigh(stretch @ np.array([[xx, xy], [xy, yy]]) @ stretch)
        ratio = float(np.sqrt(squares[1] / squares[0]))
        if ratio < MIN_RATIO:
            return np.eye(2)
        stretch = (axes * np.sqrt(squares / np.sqrt(squares.prod()))) @ axes.T
        if ratio < CONVERGED * before:
            break
        before = ratio
    return np.asarray(stretch)


def own_metric(points: FloatArray) -> FloatArray:
    """Return the matrix of `sample_metric` (2, 2) if (n, 2) distinct points are more even by it, and else I.

    Independent points on a narrow leaf have a metric by chance, and are as random by it as in the plane. Of many points
    those in the middle are asked.
    """
    if len(points) > MAX_POINTS:
        points = points[np.argpartition(np.hypot(*(points - np.median(points, axis=0)).T), MAX_POINTS)[:MAX_POINTS]]
    stretch = sample_metric(points)
    if np.array_equal(stretch, np.eye(2)):
        return stretch
    own, plane = (cover_sample(places).randomness for places in (points @ stretch, points))
    return stretch if own <= MORE_EVEN * plane else np.eye(2)
