"""Normals of the blade along its midrib, by principal component analysis with a consistent sign."""

import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query

MIN_NEIGHBORS = 12
"""With fewer points in the radius the nearest ones are taken: noise turns the plane of fewer."""

WIDTH_QUANTILE = 0.95
"""Share of the scan within the half width: nearly all of the blade's points, but no stray ones."""

POLYLINE_SAMPLES = 4096
"""Samples of the midrib's polyline at equal steps, which find the nearest of its segments."""


def half_width(scan: FloatArray, control: FloatArray) -> float:
    """Return about half the width of the blade: a high quantile of the distance from the scan to the midrib's polyline.

    Parameters
    ----------
    scan, control : (n, 3), (k, 3) ndarrays
        Points of the blade and control points of its midrib, in one unit.
    """
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(control, axis=0), axis=1))])
    steps = np.linspace(0, reached[-1], POLYLINE_SAMPLES)
    polyline = np.stack([np.interp(steps, reached, column) for column in control.T], axis=1)
    _, nearest = query(cKDTree(polyline), scan)
    last = len(polyline) - 1
    before, after = (_to_segments(scan, polyline, np.clip(nearest + step, 0, last - 1)) for step in (-1, 0))
    return float(np.quantile(np.minimum(before, after), WIDTH_QUANTILE))


def _to_segments(points: FloatArray, polyline: FloatArray, first: npt.NDArray[np.int64]) -> FloatArray:
    """Return the distances of points (n, 3) from one segment each, that from vertex `first` (n,) on."""
    start, along = polyline[first], polyline[first + 1] - polyline[first]
    square = np.sum(along**2, axis=1)
    share = np.sum((points - start) * along, axis=1) / np.where(square > 0, square, 1.0)
    distance: FloatArray = np.linalg.norm(points - start - np.clip(share, 0, 1)[:, np.newaxis] * along, axis=1)
    return distance


def consistent_normals(scan: FloatArray, control: FloatArray, radius: float, facing: FloatArray) -> FloatArray:
    """Return unit normals (k, 3) of the scan at the control points, v_j · v_{j−1} > 0 (paper, appendix A).

    Each is the direction of least variance of the scan within `radius`, by Open3D's neighbor
    search and covariance; their common sign is the one that faces `facing` on the whole.
    """
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(scan))
    tree = o3d.geometry.KDTreeFlann(cloud)
    normals = np.empty_like(control)
    for j, point in enumerate(control):
        count, rows, _ = tree.search_radius_vector_3d(point, radius)
        if count < MIN_NEIGHBORS:
            _, rows, _ = tree.search_knn_vector_3d(point, min(MIN_NEIGHBORS, len(scan)))
        _, covariance = cloud.select_by_index(list(rows)).compute_mean_and_covariance()
        normals[j] = np.linalg.eigh(covariance)[1][:, 0]
        if j and normals[j] @ normals[j - 1] < 0:
            normals[j] *= -1
    return normals if normals.sum(axis=0) @ facing >= 0 else -normals
