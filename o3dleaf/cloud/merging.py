"""Downsampling that keeps the two sides of a thin sheet apart."""

import numpy as np

from o3dleaf.checks import FloatArray
from o3dleaf.cloud.cells import Cells


def merge_points(points: FloatArray, normals: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """Return the means of the points (n, 3) in each voxel whose normals face one way, with unit mean normals.

    As Open3D's `voxel_down_sample`, except that points whose normals face away from those of the first point in their
    voxel have a mean of their own. The means stand in the order of their first points.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
    size : float
        Edge of a voxel.

    Returns
    -------
    points, normals : (m, 3) ndarray
    """
    cells = Cells.sort(points, size)
    length = cells.last - cells.first
    first = np.repeat(cells.order[cells.first], length)
    away = np.einsum("ij,ij->i", normals[cells.order], normals[first]) < 0
    group = np.empty(len(points), np.int64)
    group[cells.order] = 2 * np.repeat(np.arange(len(length)), length) + away
    _, start, group, count = np.unique(group, return_index=True, return_inverse=True, return_counts=True)
    rank = np.empty(len(start), np.int64)
    rank[np.argsort(start)] = np.arange(len(start))
    group, count = rank[group], count[np.argsort(start)]
    mean, direction = (
        np.column_stack([np.bincount(group, part[:, a], len(count)) for a in range(3)]) / count[:, np.newaxis]
        for part in (points, normals)
    )
    return mean, direction / np.linalg.norm(direction, axis=1, keepdims=True)
