"""Downsampling that keeps the two sides of a thin sheet apart."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks import FloatArray, as_points, require_positive
from o3dleaf.surface.cloud.cells import Cells
from o3dleaf.surface.cloud.neighbors import nearest_neighbours

TAIL = 0.1
"""Share of its neighbours' weight up to which a mean is one of a tail: of a normal distribution, beyond 2.1 σ."""


class Merged(NamedTuple):
    """Means of a cloud's points: points (m, 3), unit mean normals (m, 3), weights (m,): how many each stands for."""

    points: FloatArray
    normals: FloatArray
    weights: FloatArray


def merge_points(points: FloatArray, normals: FloatArray, size: float) -> Merged:
    """Return the means of the points (n, 3) in each voxel whose normals face one way, and how many each stands for.

    As Open3D's `voxel_down_sample`, except that points whose normals face away from those of the first point in their
    voxel have a mean of their own, and that a fit may trust the mean of ten points as much as ten points. The means
    stand in the order of their first points.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
    size : float
        Edge of a voxel; the voxels begin at the cloud's lower corner.

    Raises
    ------
    InputError
        If the size is not above zero.
    """
    points, normals = as_points(points, "points", dim=3), as_points(normals, "normals", dim=3)
    require_positive(size, "size")
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
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return Merged(mean, unit, count.astype(np.float64))


def leave_out_tails(merged: Merged) -> Merged:
    """Return the means without those that stand for a tenth of the points that their neighbours stand for, or fewer.

    What the neighbours stand for is the mean over their points, Σw²/Σw, which those in the middle decide. Such
    voxels hold the tails of the noise: the normal of a single point three deviations off says nothing, and a hundred
    others hold the surface.
    """
    around = nearest_neighbours(merged.points).row
    near = merged.weights[around]
    kept = merged.weights > TAIL * (near * near).sum(axis=1) / near.sum(axis=1)
    return Merged(*(part[kept] for part in merged))
