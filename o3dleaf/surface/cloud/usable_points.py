"""The points of a cloud that can be used: finite, distinct and no outliers, in an order that keeps neighbors close."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray, as_floats
from o3dleaf.core.checks.coordinates import as_points, require_breadth, require_size
from o3dleaf.core.checks.voxels import as_mask
from o3dleaf.core.cloud_arrays import CloudLike, raw_points
from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.branchings.branchings import Branchings
from o3dleaf.surface.cloud.neighbors import IndexArray, Neighborhoods, fit_planes
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud, Removed
from o3dleaf.surface.cloud.outliers import detect_outliers, tell_outliers
from o3dleaf.surface.cloud.rounding import average_levels

MIN_POINTS = 10
"""Fewer points do not determine a quadratic, let alone a surface."""
REPEATED = 1e-3
"""Spacings within which a point repeats another, as what was rounded to single precision does: of independent points
three in a million lie so near to one."""

Branch = Callable[[OrientedCloud], Branchings | None]
Detect = Callable[[OrientedCloud], npt.NDArray[np.bool_]]


def remove_faults(cloud: CloudLike, outliers: Detect | None = detect_outliers) -> OrientedCloud:
    """Return the points of a cloud, in order, without non-finite ones, duplicates and outliers, which are counted.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
    outliers : callable, optional
        ``outliers(cloud) -> (n,) mask`` of points that belong to no surface; None keeps everything.

    Raises
    ------
    InputError
        If too few points are left.
    """
    usable = _without_faults(cloud, outliers)
    return usable.restored(usable.cloud)


def usable_rows(cloud: CloudLike, outliers: Detect | None = detect_outliers) -> IndexArray:
    """Return the rows (k,), rising, of the points that `remove_faults` leaves of a cloud."""
    return np.sort(_without_faults(cloud, outliers).rows)


def _without_faults(cloud: CloudLike, outliers: Detect | None) -> "UsablePoints":
    points = as_raw_rows(raw_points(cloud), "cloud")
    sorting, finding = progress.split(4, 1)
    with sorting:
        usable = UsablePoints.of(points, weights_of(cloud, len(points)))
    with finding:
        return usable.without(outliers, len(points))


class UsablePoints(NamedTuple):
    """The usable points of a cloud in the order of a tree: neighbors are close in memory, and loops twice as fast.

    Attributes
    ----------
    cloud : OrientedCloud
        Without normals.
    rows : (n,) ndarray
        Of the points in the cloud that they come from.
    tree : scipy.spatial.cKDTree or None
        Of the points in their first order, where it is known.
    """

    cloud: OrientedCloud
    rows: IndexArray
    tree: cKDTree | None

    @classmethod
    def of(cls, points: FloatArray, weights: FloatArray) -> "UsablePoints":
        """Leave out what is not finite, and repeated."""
        sorting, comparing = progress.split(3, 4)
        with sorting:
            finite = np.flatnonzero(np.isfinite(points).all(axis=1))
            distinct = finite[_first_of_each(require_size(points[finite], "cloud"))]
            require_enough(len(distinct), len(points))
            require_breadth(points[distinct], "cloud")
            tree = cKDTree(points[distinct])
        rows = distinct[tree.indices]
        removed = Removed(non_finite=len(points) - len(finite), repeated=len(finite) - len(distinct))
        usable = cls(OrientedCloud(points[rows], None, weights[rows], removed), rows, tree)
        with comparing:
            return usable._distinct(len(points))

    def _distinct(self, count: int) -> "UsablePoints":
        """Leave out what nearly repeats other points, of `count` points in all."""
        usable = self
        while len(again := _repeated_nearly(usable.cloud.neighbors, usable.rows)):
            kept = np.ones(len(usable.rows), dtype=bool)
            kept[again] = False
            removed = usable.cloud.removed._replace(repeated=usable.cloud.removed.repeated + len(again))
            usable = UsablePoints(replace(usable.cloud.take(kept), removed=removed), usable.rows[kept], None)
            require_enough(len(usable.rows), count)
        return usable

    def without(self, outliers: Detect | None, count: int) -> "UsablePoints":
        """Leave out what a step takes for outliers, of `count` points in all."""
        if outliers is None:
            return self
        stray = as_mask(outliers(self.cloud), (len(self.cloud),), "outliers")
        if not stray.any():
            return self
        require_enough(int(np.sum(~stray)), count)
        removed = self.cloud.removed._replace(outliers=int(stray.sum()))
        notes = (*self.cloud.notes, tell_outliers(self.cloud, stray))
        return UsablePoints(replace(self.cloud.take(~stray), removed=removed, notes=notes), self.rows[~stray], None)

    def averaged(self, normals: FloatArray | None) -> "UsablePoints":
        """Average what lies on levels wider apart than the points are; each mean stands in its first point's row."""
        cloud, first = average_levels(self.cloud, normals)
        if cloud is self.cloud:
            return self
        require_enough(len(first), len(self.rows))
        averaged = UsablePoints(cloud, self.rows[first], self.tree if len(first) == len(self.rows) else None)
        return averaged._distinct(len(self.rows))  # means of both sides of what is thinner than a step may coincide

    def apart(self, branchings: Branch | None, normals: FloatArray | None) -> "UsablePoints":
        """Leave out what lies near the lines along which sheets meet, by a step that finds them."""
        known = self.cloud if normals is None else self.cloud.with_normals(normals)
        met = None if branchings is None else branchings(known)
        if met is None:
            return self
        cut = met.nearness(self.cloud.points) < 1
        require_enough(int(np.sum(~cut)), len(cut))
        kept, removed = self.cloud.take(~cut), self.cloud.removed._replace(cut=int(cut.sum()))
        notes = self.cloud.notes + met.tell(int(cut.sum()), self.cloud.points)
        kept = replace(kept, removed=removed, notes=notes, branchings=met)
        if len(kept.surfels.points) == len(kept):
            near = np.ascontiguousarray(kept.neighbors.row[:, : kept.surfels.scale.neighbors])
            planes = fit_planes(kept.points, met.part(kept.points, kept.tree, near))
            vars(kept)["surfels"] = replace(kept.surfels, planes=planes)
        return UsablePoints(kept, self.rows[~cut], None)

    def parted(self, cut: npt.NDArray[np.bool_]) -> "UsablePoints":
        """Leave out what is to be cut out, a mask (n,)."""
        return UsablePoints(self.cloud.take(~cut), self.rows[~cut], None)

    def restored(self, cloud: OrientedCloud) -> OrientedCloud:
        """Return a cloud of these points in their first order."""
        return cloud.reordered(np.argsort(self.rows), self.tree)


def as_raw_rows(array: npt.ArrayLike, name: str) -> FloatArray:
    """Return an (n, 3) float64 array, of which values may be NaN."""
    rows = as_floats(array, name)
    as_points(np.zeros(rows.shape), name, dim=3)
    return rows


def weights_of(cloud: CloudLike, count: int) -> FloatArray:
    """Return the weights (count,) of the points of a cloud, 1 where it has none."""
    return cloud.weights if isinstance(cloud, OrientedCloud) else np.broadcast_to(1.0, count)


def _first_of_each(points: FloatArray) -> IndexArray:
    """Return the rows, in order, at which each distinct point of `points` (n, 3) stands first."""
    order = np.argsort(points[:, 0], kind="stable")
    equal = points[order[1:], 0] == points[order[:-1], 0]
    shared = np.zeros(len(order), dtype=bool)
    shared[:-1] |= equal
    shared[1:] |= equal
    doubtful = np.sort(order[shared])  # most clouds have few points that share an x
    order = doubtful[np.lexsort(points[doubtful].T)]
    repeated = order[1:][(points[order[1:]] == points[order[:-1]]).all(axis=1)]  # stable: the first one comes first
    kept = np.ones(len(points), dtype=bool)
    kept[repeated] = False
    return np.flatnonzero(kept)


def _repeated_nearly(near: Neighborhoods, rows: IndexArray) -> IndexArray:
    """Return which points nearly repeat one that stands before them, by `rows` (n,).

    The spacing is that around each, r √(π/k) by its k-th neighbor at r, so that dense places keep their points; copies
    make it too small, and where some are left out others may be found.
    """
    count = near.row.shape[1] - 1
    if count < 2:
        return np.empty(0, np.int64)
    limit = REPEATED * np.sqrt(np.pi / count) * near.distance[:, -1:]
    repeats = (near.distance <= limit) & (rows[near.row] < rows[:, np.newaxis])
    return np.flatnonzero(repeats.any(axis=1))


def require_enough(count: int, whole: int) -> None:
    """Raise `InputError` if too few points are left of the whole number."""
    if not whole:
        raise InputError(f"cloud: is empty; a surface needs at least {MIN_POINTS} points")
    if whole < MIN_POINTS:
        raise InputError(f"cloud: has {whole} points, too few to show a surface; give at least {MIN_POINTS}")
    if count < MIN_POINTS:
        raise InputError(
            f"cloud: {count} of {whole} points are left after removing repeated, outlying and non-finite ones; "
            f"a surface needs at least {MIN_POINTS}; is it damaged?"
        )
