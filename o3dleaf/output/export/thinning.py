"""Samples of a surface, closer together than the particles that are chosen among them."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import in_words, require_resources

AROUND = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def surface_samples(
    corners: FloatArray, areas: FloatArray, part: float, step: float, copies: int = 1
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return points, triangles and areas of samples: the middles of k² equal parts of each (3, 3) triangle.

    No part is longer than `part`; `step` is what a user would have to enlarge, `copies` is how often the caller will
    hold the samples.

    Raises
    ------
    InputError, MemoryBudgetError
        If there is no area, or there are too many parts.
    """
    if not areas.sum() > 0:
        raise InputError("mesh: has no area; there is nothing to cover")
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(np.ceil(longest / part), 1)
    with np.errstate(over="ignore"):
        total = float((parts**2).sum()) * copies
    what = f"spacing: {in_words(total)} samples"
    require_resources(measured.SAMPLE * total, what, "give a larger one", step=step)
    samples = []
    for k in np.unique(parts[areas > 0]):
        rows = np.flatnonzero((parts == k) & (areas > 0))
        weights = _middles(int(k))
        points = np.einsum("sc,tcd->tsd", weights, corners[rows]).reshape(-1, 3)
        samples.append((points, np.repeat(rows, len(weights)), np.repeat(areas[rows] / len(weights), len(weights))))
    together = [np.concatenate(each) for each in zip(*samples, strict=True)]
    return together[0], together[1], together[2]


def _middles(k: int) -> FloatArray:
    """Return the (k², 3) barycentric weights of the middles of a triangle's k² equal parts."""
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(k), np.arange(k), indexing="ij"))
    upright, turned = i + j < k, i + j < k - 1
    first = np.concatenate([i[upright] + 1 / 3, i[turned] + 2 / 3])
    second = np.concatenate([j[upright] + 1 / 3, j[turned] + 2 / 3])
    return np.stack([first / k, second / k, 1 - (first + second) / k], axis=1)


def sort_into_cubes(points: FloatArray, edge: float) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return how `particle_loops` wants samples: their order by cubes, and of sorted ones cubes, starts and neighbors.

    Returns
    -------
    by_cube : (n,) ndarray
    cube : (n,) ndarray
        Of each sorted sample.
    starts : (c,) ndarray
        The first sample of each cube.
    neighbors : (c, 27) ndarray
        The cubes around each, and itself; −1 where there is none.
    """
    place = np.floor((points - points.min(axis=0)) / edge).astype(np.int64) + 1
    counts = place.max(axis=0) + 2
    strides = np.array([counts[1] * counts[2], counts[2], 1])
    key = place @ strides
    by_cube = np.argsort(key, kind="stable")
    keys, starts, cube = np.unique(key[by_cube], return_index=True, return_inverse=True)
    wanted = keys[:, np.newaxis] + AROUND @ strides
    neighbors = np.searchsorted(keys, wanted)
    neighbors[keys[np.minimum(neighbors, len(keys) - 1)] != wanted] = -1
    return by_cube, cube, starts, neighbors
