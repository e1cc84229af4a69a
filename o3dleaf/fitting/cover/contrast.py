"""Balls beside a cluster of points: they get points from all around, not those of the cluster alone.

A ball whose points lie nearly all in a cluster many times as dense as what is around has a spline whose tail follows
the cluster's noise: a slope known from a tenth of the ball, and a bend from its square, go on over all of it.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import box_of
from o3dleaf.core.parallel import blocks
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.rbf.tail import IntArray

CONTRAST = 4.0
"""Spacing around over that in a cluster from which it is one: 64 times the density in space, 16 times on a surface.
Beside clusters up to 300 times as dense errors are no larger than without them, as they are."""

CELL = 1 / 4
"""Side, in radii, of the cells by which it is counted how much of a ball has points."""

TIMES = 6
"""Times the terms of a quadratic that many of a ball's cells have points, or these may be in one place: 60 of some 270
in space. With 30, balls beside clusters of 10³ and 10⁴ times the density were passed over. Only of these it is asked
whether what is around is sparser."""

FEWEST = 2
"""The same for balls of so few points that they cannot be told to be in one place."""

MAX_SHARE = 2 / 3
"""Share of the least number of a ball's points above which no more cells are asked for: points share some at random."""

SIDES = (1 / 2, 1.0, 2.0, 4.0)
"""Sides, in radii, of the cells of which one point each stands for what is around a ball, near and far."""

SHARE = 1 / 8
"""Of the least number of a ball's points, that many are added from the cells of each side."""

BATCH_SIZE = 4096
"""Balls whose cells are marked at once."""

PROBES = 16
"""Points of a ball that tell how far they are from one another."""


def widen_clusters(cover: Cover, points: FloatArray, least: int) -> Cover:
    """Return a cover in which balls that were fitted to hardly more than a cluster are to points around it as well.

    Where the points of all balls are about as dense, which is seen at once, nothing changes.

    Parameters
    ----------
    cover : Cover
    points : (n, d) ndarray
    least : int
        Points that are asked of a ball: one with more contains them all.
    """
    dimension = points.shape[1]
    terms = (dimension + 1) * (dimension + 2) // 2
    full = cover.counts > least
    spacing = cover.radii[full] / cover.counts[full] ** (1 / dimension)
    if MAX_SHARE * least < FEWEST * terms or not len(spacing) or spacing.max() < CONTRAST * spacing.min():
        return cover
    few = np.flatnonzero(_occupied(points, cover) < min(TIMES * terms, MAX_SHARE * least))
    tree, wider = cKDTree(points), dict[int, IntArray]()
    octaves = np.floor(np.log2(cover.radii[few]))

    @cache  # an octave has cells of the sides that its neighbors have
    def thinned(side: float) -> tuple[IntArray, cKDTree]:
        one = _one_of_each_cell(points, side)
        return one, cKDTree(points[one])

    for octave in np.unique(octaves):
        some = few[octaves == octave]
        thin = [thinned(side * 2.0**octave) for side in SIDES]
        levels = [level[_nearest(among, cover.centers[some], int(SHARE * least))] for level, among in thin]
        probes = cover.offsets[some, np.newaxis] + cover.counts[some, np.newaxis] * np.arange(PROBES) // PROBES
        inner = np.median(_gaps(tree, points[cover.members[probes]]), axis=1)
        outer = np.max([np.median(_gaps(tree, points[near]), axis=1) for near in levels], axis=0)
        around = np.hstack(levels)
        for k in np.flatnonzero(outer > CONTRAST * inner):
            own = cover.members[cover.offsets[some[k]] : cover.offsets[some[k] + 1]]
            wider[int(some[k])] = np.union1d(own, around[k])
    if not wider:
        return cover
    rows = [wider.get(k, own) for k, own in enumerate(np.split(cover.members, cover.offsets[1:-1]))]
    offsets = np.concatenate([[0], np.cumsum([len(each) for each in rows])])
    return replace(cover, offsets=offsets, members=np.concatenate(rows))


def _occupied(points: FloatArray, cover: Cover) -> IntArray:
    """Return how many of the cells of each ball, (M,), have a point that it is fitted to."""
    found, side = np.empty(len(cover.radii), dtype=np.int64), 2 * round(1 / CELL) + 2
    for start, stop in blocks(len(found), BATCH_SIZE):
        first, last = cover.offsets[start], cover.offsets[stop]
        key = np.repeat(np.arange(stop - start), cover.counts[start:stop])
        ball, rows = start + key, cover.members[first:last]
        for axis in range(points.shape[1]):
            away = (points[rows, axis] - cover.centers[ball, axis]) / (CELL * cover.radii[ball])
            # What is borrowed lies beyond the ball: it counts by where it is seen.
            key = key * side + np.clip(np.floor(away), -1 / CELL - 1, 1 / CELL).astype(np.int64) + round(1 / CELL) + 1
        # A mark a cell: to sort the keys, or to hash them, takes several times as long.
        marks = np.zeros((stop - start, side ** points.shape[1]), dtype=bool)
        marks.ravel()[key] = True
        found[start:stop] = np.count_nonzero(marks, axis=1)
    return found


def _one_of_each_cell(points: FloatArray, side: float) -> IntArray:
    """Return the first point of each cell, (k,)."""
    low, high = box_of(points)
    cells, width = np.floor((points - low) / side), np.floor((high - low) / side) + 1
    if not np.prod(width) < 2.0**62:
        return np.asarray(np.sort(np.unique(cells, axis=0, return_index=True)[1]), dtype=np.int64)
    key = np.zeros(len(points), dtype=np.int64)  # one number a cell: found in a tenth of the time
    for axis in range(points.shape[1]):
        key = key * np.int64(width[axis]) + cells[:, axis].astype(np.int64)
    return np.asarray(np.sort(np.unique(key, return_index=True)[1]), dtype=np.int64)


def _nearest(tree: cKDTree, places: FloatArray, count: int) -> IntArray:
    """Return the numbers (n, count) of the points of a tree, if there are so many, nearest to each place."""
    found = tree.query(places, k=np.arange(1, min(max(count, 1), tree.n) + 1))[1]
    return np.asarray(found, dtype=np.int64)


def _gaps(tree: cKDTree, places: FloatArray) -> FloatArray:
    """Return the distances (n, m) of points (n, m, d) of a tree to the next one."""
    return np.asarray(tree.query(places, k=[2])[0][..., 0])
