"""Nearest neighbours of all points of a cloud, and the plane through each point's neighbourhood."""

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import Progress, blocks, run_blocks
from o3dleaf.surface.cloud import cloud_loops

IndexArray = npt.NDArray[np.int64]
NEIGHBOURS = 16
"""Of a sampled surface they lie within 2.3 spacings: fewer make normals noisy, more reach across a thin sheet."""
BLOCK = 4096
BATCH = 1 << 18
"""Points whose neighbours are asked for at once."""


class Neighbourhoods(NamedTuple):
    """The k nearest points of each point, itself first: distance (n, k), row (n, k), and the tree that found them."""

    distance: FloatArray
    row: IndexArray
    tree: cKDTree


class Planes(NamedTuple):
    """Principal axes of neighbourhoods: unit normal (n, 3), and variances (n, 3) along the axes, least first."""

    normal: FloatArray
    variance: FloatArray


def nearest_neighbours(points: FloatArray, k: int = NEIGHBOURS, progress: Progress | None = None) -> Neighbourhoods:
    """Return the k nearest points (fewer if there are fewer) of each of `points` (n, 3), itself among them."""
    tree, count = cKDTree(points), min(k, len(points))
    # Asked in the tree's own order, neighbours in the question are neighbours in memory: three times faster.
    order = tree.indices
    distance, row = np.empty((len(points), count)), np.empty((len(points), count), dtype=np.int64)
    for first, last in blocks(len(order), BATCH):
        asked = order[first:last]
        far, near = tree.query(points[asked], k=np.arange(1, count + 1), workers=-1)
        run_blocks(partial(cloud_loops.put_rows, asked, far, near, distance, row), len(asked), BLOCK)
        if progress:
            progress(last, len(order))
    return Neighbourhoods(distance, row, tree)


def rearranged(
    near: Neighbourhoods, order: IndexArray, tree: cKDTree, progress: Progress | None = None
) -> Neighbourhoods:
    """Return the neighbourhoods of the same points in another order, of which `tree` is one."""
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    distance, row = np.empty_like(near.distance), np.empty_like(near.row)
    task = partial(cloud_loops.take_rows, order, rank, near.distance, near.row, distance, row)
    run_blocks(task, len(order), BLOCK, progress)
    return Neighbourhoods(distance, row, tree)


def fit_planes(points: FloatArray, rows: IndexArray, progress: Progress | None = None) -> Planes:
    """Return the principal axes of the neighbourhoods `rows` (m, k) among `points` (n, 3)."""
    normal, variance = np.empty((len(rows), 3)), np.empty((len(rows), 3))

    def task(start: int, stop: int) -> None:
        cloud_loops.principal_axes(points, rows, start, stop, normal, variance)

    run_blocks(task, len(rows), BLOCK, progress)
    return Planes(normal, variance)
