"""Nearest neighbors of all points of a cloud, the planes through them, and the spacing by their distances."""

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud import cloud_loops, parity_loops

IndexArray = npt.NDArray[np.int64]
NEIGHBORS = 16
"""Of a sampled surface they lie within 2.3 spacings: fewer make normals noisy, more reach across a thin sheet."""
SPACED = 12
"""Neighbor by whose distance the spacing is measured; off by 1/(2 √12), 14 %, at one random point, before averaging."""
LINKED = 8
"""Nearest points that one is linked to in a group."""
BLOCK = 4096
BATCH_SIZE = 1 << 18
"""Points whose neighbors are searched at once."""
STEP = 2.0
"""Spacing of those that count a point among their neighbors over that of its own neighbors above which density steps
there, by 4: of even random points, noisy or not, it reaches 1.8."""
FEWEST = 2
"""Points that count another among their neighbors, for these to be no strays: of two strays each counts the other."""
CLASSES = 4
"""Classes of spacing to an octave: within one spacings differ by a fifth at most."""


class Neighborhoods(NamedTuple):
    """The k nearest points of each point, itself first: distance (n, k) and row (n, k)."""

    distance: FloatArray
    row: IndexArray


class SpacingClass(NamedTuple):
    """Points of about one spacing: their rows, rising, their tree, and the least and the greatest of their spacings."""

    rows: IndexArray
    tree: cKDTree
    least: float
    greatest: float


class Planes(NamedTuple):
    """Principal axes of neighborhoods: unit normal (n, 3), and variances (n, 3) along the axes, least first."""

    normal: FloatArray
    variance: FloatArray


def nearest_neighbors(tree: cKDTree, *, batch: int = BATCH_SIZE) -> Neighborhoods:
    """Return the 16 nearest points (fewer if there are fewer) of each point of a tree, itself among them."""
    points, count = tree.data, min(NEIGHBORS, tree.n)
    # In the tree's own order, successive queries are neighbors in memory: three times faster.
    order = (
        tree.indices.copy()
    )  # since SciPy 1.18 what a tree holds is read-only, and compiled code takes such for others
    distance, row = np.empty((len(points), count)), np.empty((len(points), count), dtype=np.int64)
    for first, last in blocks(len(order), batch):
        queried = order[first:last]
        far, near = query(tree, points[queried], k=np.arange(1, count + 1))
        run_blocks(partial(cloud_loops.put_rows, queried, far, near, distance, row), len(queried), BLOCK)
        progress.report(last, len(order))
    return Neighborhoods(distance, row)


def reordered(near: Neighborhoods, order: IndexArray) -> Neighborhoods:
    """Return the neighborhoods of the same points in another order."""
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    distance, row = np.empty_like(near.distance), np.empty_like(near.row)
    task = partial(cloud_loops.take_rows, order, rank, near.distance, near.row, distance, row)
    run_blocks(task, len(order), BLOCK, reports=True)
    return Neighborhoods(distance, row)


def fit_planes(points: FloatArray, rows: IndexArray) -> Planes:
    """Return the principal axes of the neighborhoods `rows` (m, k) among `points` (n, 3)."""
    normal, variance = np.empty((len(rows), 3)), np.empty((len(rows), 3))

    def task(start: int, stop: int) -> None:
        cloud_loops.principal_axes(points, rows, start, stop, normal, variance)

    run_blocks(task, len(rows), BLOCK, reports=True)
    return Planes(normal, variance)


def linked(distance: FloatArray, row: IndexArray, reach: FloatArray | float) -> IndexArray:
    """Return the group (n,) of each point, by one of its rows, of links to its neighbors (n, k) within a reach."""
    parent, sign = np.arange(len(row)), np.ones(len(row), np.int8)
    parity_loops.join_near(row, np.where(distance <= reach, 0.0, np.inf), 1.0, parent, sign)
    parity_loops.flatten(parent, sign)
    return parent


def largest_group(points: FloatArray, reach: float) -> FloatArray:
    """Return those of some points (n, 3) that are most, linked to those of their eight nearest within a reach."""
    near = np.arange(1, min(LINKED + 1, len(points)) + 1)
    distance, row = query(cKDTree(points), points, k=near)
    group = linked(distance, row, reach)
    return np.asarray(points[group == np.bincount(group).argmax()])


def smooth_spacings(near: Neighborhoods) -> FloatArray:
    """Return the (n,) spacings by the twelfth neighbors' distances: the median, then the mean, over 13 points."""
    if near.row.shape[1] <= SPACED:
        raise InputError(f"cloud: has {len(near.row)} points; at least {SPACED + 1} are needed for its spacing")
    first, middle = near.distance[:, SPACED] * np.sqrt(np.pi / SPACED), np.empty(len(near.row))
    spacing = np.empty(len(near.row))

    def median(start: int, stop: int) -> None:
        middle[start:stop] = np.median(first[near.row[start:stop, : SPACED + 1]], axis=1)

    def mean(start: int, stop: int) -> None:
        spacing[start:stop] = middle[near.row[start:stop, : SPACED + 1]].mean(axis=1)

    run_blocks(median, len(first), BLOCK)
    run_blocks(mean, len(first), BLOCK)
    if not spacing.min() > 0:
        raise InputError(f"cloud: {SPACED + 1} points lie in one place; remove duplicates")
    _raise_beside_dense_data(spacing, first, near.row[:, : SPACED + 1])
    return spacing


def _raise_beside_dense_data(spacing: FloatArray, first: FloatArray, row: IndexArray) -> None:
    """Give points of a sparse region beside a dense one the spacing of those that count them as neighbors, in place.

    Most of their own neighbors are dense, and so the medians over `row` (n, 13) are. But dense points have nearer
    neighbors than them, so that those which count one of them, itself among them, are of its own region.
    """
    asked = np.zeros(len(first), dtype=bool)

    def ask(start: int, stop: int) -> None:
        near = row[start:stop]
        asked[near[first[start:stop, np.newaxis] > STEP * spacing[near]]] = True

    run_blocks(ask, len(first), BLOCK)
    if not asked.any():
        return
    by, column = np.nonzero(asked[row])
    of = row[by, column]
    order = np.lexsort((first[by], of))
    by, of = by[order], of[order]
    point, start, count = np.unique(of, return_index=True, return_counts=True)
    middle = first[by[start + count // 2]]
    sparse = (middle > STEP * spacing[point]) & (count > FEWEST)
    spacing[point[sparse]] = middle[sparse]


def spacing_classes(points: FloatArray, spacing: FloatArray) -> tuple[SpacingClass, ...]:
    """Return points (n, 3) by classes of their spacings (n,), the sparsest first."""
    number = np.floor(CLASSES * np.log2(spacing / spacing.min())).astype(np.int64)
    found = []
    for each in np.unique(number)[::-1]:
        rows = np.flatnonzero(number == each)
        found.append(SpacingClass(rows, cKDTree(points[rows]), spacing[rows].min(), spacing[rows].max()))
    return tuple(found)
