"""Nearest neighbours of all points of a cloud, and the plane through each point's neighbourhood."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.checks import FloatArray
from o3dleaf.cloud import loops
from o3dleaf.parallel import run_blocks

IndexArray = npt.NDArray[np.int64]
NEIGHBOURS = 16
"""Of a sampled surface they lie within 2.3 spacings: fewer make normals noisy, more reach across a thin sheet."""
BLOCK = 4096


class Neighbourhoods(NamedTuple):
    """The k nearest points of each point, itself first: distance (n, k), row (n, k), and the tree that found them."""

    distance: FloatArray
    row: IndexArray
    tree: cKDTree


class Planes(NamedTuple):
    """Principal axes of neighbourhoods: unit normal (n, 3), and variances (n, 3) along the axes, least first."""

    normal: FloatArray
    variance: FloatArray


def nearest_neighbours(points: FloatArray, k: int = NEIGHBOURS) -> Neighbourhoods:
    """Return the k nearest points (fewer if there are fewer) of each of `points` (n, 3), itself among them."""
    tree = cKDTree(points)
    # Asked in the tree's own order, neighbours in the question are neighbours in memory: three times faster.
    order = tree.indices
    found, near = tree.query(points[order], k=np.arange(1, min(k, len(points)) + 1), workers=-1)
    distance, row = np.empty_like(found), np.empty_like(near)
    run_blocks(lambda i, j: loops.put_rows(i, j, order, found, near, distance, row), len(order), BLOCK)
    return Neighbourhoods(distance, row, tree)


def fit_planes(points: FloatArray, rows: IndexArray) -> Planes:
    """Return the principal axes of the neighbourhoods `rows` (m, k) among `points` (n, 3)."""
    normal, variance = np.empty((len(rows), 3)), np.empty((len(rows), 3))
    run_blocks(lambda start, stop: loops.principal_axes(points, rows, start, stop, normal, variance), len(rows), BLOCK)
    return Planes(normal, variance)
