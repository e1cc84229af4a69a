"""Any point cloud made ready for a surface: faulty points go, and every point has an outward normal."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray, as_floats
from o3dleaf.core.checks.attributes import as_viewpoint
from o3dleaf.core.checks.coordinates import as_points, require_breadth, require_size
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.checks.voxels import as_mask
from o3dleaf.core.cloud_arrays import CloudLike, raw_normals, raw_points
from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.branchings.branchings import Branchings
from o3dleaf.surface.cloud.branchings.find import find_branchings
from o3dleaf.surface.cloud.downsample import voxel_down_sample
from o3dleaf.surface.cloud.neighbors import IndexArray, fit_planes
from o3dleaf.surface.cloud.normals import plane_normals
from o3dleaf.surface.cloud.orientation.given_normals import check_normals, without_unfit
from o3dleaf.surface.cloud.orientation.orientation import Orientation, estimate_normals, orient_normals
from o3dleaf.surface.cloud.orientation.viewpoint import face_given, face_viewpoint
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud, Removed
from o3dleaf.surface.cloud.outliers import detect_outliers

UNUSABLE = 0.1
"""Share of given normals on the wrong side of a noisy cloud beyond which their directions are not used either."""
SHARES = (3, 5, 3, 1, 5, 4)
"""About how long the steps of preprocessing take: sorting, outliers, planes, branchings, sides, the order restored."""
MIN_POINTS = 10
"""Fewer points do not determine a quadratic, let alone a surface."""

Branch = Callable[[OrientedCloud], Branchings | None]
Detect = Callable[[OrientedCloud], npt.NDArray[np.bool_]]
Estimate = Callable[[OrientedCloud], npt.ArrayLike]
Orient = Callable[[OrientedCloud], Orientation]


@checked
def preprocess_point_cloud(
    cloud: CloudLike,
    *,
    normals: npt.ArrayLike | None = None,
    viewpoint: npt.ArrayLike | None = None,
    voxel_size: Positive | None = None,
    outliers: Detect | None = detect_outliers,
    branchings: Branch | None = find_branchings,
    estimate: Estimate | None = None,
    orient: Orient | None = orient_normals,
) -> OrientedCloud:
    """Return a cloud without non-finite points, duplicates and outliers, each with its outward normal.

    Where three sheets meet, no three normals agree: the points there are left out too, and the lines known.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        Points that are removed are counted.
    normals : (n, 3) array_like, optional
        Normals in place of those of the cloud. Given normals are kept as far as their neighbors agree
        with them: missing ones (zero or not finite) are found, single wrong ones are turned, and all of them where they
        point into a closed surface; where they contradict one another throughout, their sides are found anew. Where a
        tenth of them lie across the planes of a clean cloud, as one direction for all does, they are not used.
    viewpoint : (3,) or (n, 3) array_like, optional
        Where the cloud, or each point, was scanned from: all normals, given or estimated, are turned to it, and left
        so. Nothing is oriented by `orient` then.
    voxel_size : float, optional
        Edge of the voxels whose points are averaged, those on the two sides of a sheet apart; without it none are.
    outliers : callable, optional
        ``outliers(cloud) -> (n,) mask`` of points that belong to no surface; None keeps everything.
    branchings : callable, optional
        ``branchings(cloud) -> Branchings or None``, the lines along which sheets meet: points near them are left out,
        and a surface is cut there. None leaves sheets together.
    estimate : callable, optional
        ``estimate(cloud) -> (n, 3)`` unit normals of either sign, where the cloud has none; left out, `orient` finds
        both directions and sides.
    orient : callable, optional
        ``orient(cloud) -> Orientation``, of a cloud with the normals estimated, if any; None leaves normals as they
        were given or estimated.

    Raises
    ------
    InputError
        If too few points are left.
    OrientationError
        If the points do not determine which side is outside, of any part of the cloud.
    """
    points = _as_rows(raw_points(cloud), "cloud")
    normals = raw_normals(cloud) if normals is None else normals
    given = None if normals is None else _as_rows(normals, "normals")
    if given is not None and len(given) != len(points):
        raise InputError(f"normals: {len(given)} for {len(points)} points; give one per point")
    seen_from = None if viewpoint is None else as_viewpoint(viewpoint, len(points))
    if voxel_size is not None:
        require_positive(voxel_size, "voxel_size")
    sorting, finding, measuring, branching, siding, ending = progress.split(*SHARES)
    with sorting:
        usable = _Usable.of(points, _weights_of(cloud, len(points)))
    with finding:
        usable = usable.without(outliers, len(points))
    with measuring:
        _ = usable.cloud.spacing  # and with it the neighbors and planes that the sides are found by
    with branching:
        usable = usable.apart(branchings, None if given is None else given[usable.rows])
    with siding:
        known = None if given is None else given[usable.rows]
        known, notes = (known, ()) if known is None or orient is None else without_unfit(usable.cloud, known)
        if seen_from is None:
            orientation = _find_normals(usable.cloud, known, estimate, orient)
        else:
            orientation = _find_facing(usable.cloud, known, estimate, seen_from[usable.rows])
    with ending:
        oriented = usable.cloud.with_normals(orientation.normals, (*notes, *orientation.notes))
        if orientation.cut is not None:
            usable, oriented = usable.parted(orientation.cut), _cut_out(oriented, orientation.cut)
        if voxel_size is None:
            return _by_side(usable.restored(oriented))
        averaged = voxel_down_sample(oriented.take(np.argsort(usable.rows)), voxel_size)
        _require_enough(len(averaged), len(oriented))
        return averaged


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
    points = _as_rows(raw_points(cloud), "cloud")
    usable = _Usable.of(points, _weights_of(cloud, len(points))).without(outliers, len(points))
    return usable.restored(usable.cloud)


def usable_rows(cloud: CloudLike) -> IndexArray:
    """Return the rows (k,), rising, of the points that `remove_faults` leaves of a cloud."""
    points = _as_rows(raw_points(cloud), "cloud")
    usable = _Usable.of(points, _weights_of(cloud, len(points))).without(detect_outliers, len(points))
    return np.sort(usable.rows)


class _Usable(NamedTuple):
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
    def of(cls, points: FloatArray, weights: FloatArray) -> "_Usable":
        """Leave out what is not finite, and repeated."""
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        distinct = finite[_first_of_each(require_size(points[finite], "cloud"))]
        _require_enough(len(distinct), len(points))
        require_breadth(points[distinct], "cloud")
        tree = cKDTree(points[distinct])
        rows = distinct[tree.indices]
        removed = Removed(non_finite=len(points) - len(finite), repeated=len(finite) - len(distinct))
        return cls(OrientedCloud(points[rows], None, weights[rows], removed), rows, tree)

    def without(self, outliers: Detect | None, count: int) -> "_Usable":
        """Leave out what a step takes for outliers, of `count` points in all."""
        if outliers is None:
            return self
        stray = as_mask(outliers(self.cloud), (len(self.cloud),), "outliers")
        if not stray.any():
            return self
        _require_enough(int(np.sum(~stray)), count)
        removed = self.cloud.removed._replace(outliers=int(stray.sum()))
        return _Usable(replace(self.cloud.take(~stray), removed=removed), self.rows[~stray], None)

    def apart(self, branchings: Branch | None, normals: FloatArray | None) -> "_Usable":
        """Leave out what lies near the lines along which sheets meet, by a step that finds them."""
        known = self.cloud if normals is None else self.cloud.with_normals(np.nan_to_num(normals))
        met = None if branchings is None else branchings(known)
        if met is None:
            return self
        cut = met.nearness(self.cloud.points) < 1
        _require_enough(int(np.sum(~cut)), len(cut))
        kept, removed = self.cloud.take(~cut), self.cloud.removed._replace(cut=int(cut.sum()))
        notes = self.cloud.notes + met.tell(int(cut.sum()), self.cloud.points)
        kept = replace(kept, removed=removed, notes=notes, branchings=met)
        if len(kept.surfels.points) == len(kept):
            near = np.ascontiguousarray(kept.neighbors.row[:, : kept.surfels.scale.neighbors])
            planes = fit_planes(kept.points, met.part(kept.points, kept.tree, near))
            vars(kept)["surfels"] = replace(kept.surfels, planes=planes)
        return _Usable(kept, self.rows[~cut], None)

    def parted(self, cut: npt.NDArray[np.bool_]) -> "_Usable":
        """Leave out what is to be cut out, a mask (n,)."""
        return _Usable(self.cloud.take(~cut), self.rows[~cut], None)

    def restored(self, cloud: OrientedCloud) -> OrientedCloud:
        """Return a cloud of these points in their first order."""
        return cloud.reordered(np.argsort(self.rows), self.tree)


def _cut_out(cloud: OrientedCloud, cut: npt.NDArray[np.bool_]) -> OrientedCloud:
    """Return a cloud without the points of a mask (n,), which are counted."""
    return replace(cloud.take(~cut), removed=cloud.removed._replace(cut=cloud.removed.cut + int(cut.sum())))


def _by_side(cloud: OrientedCloud) -> OrientedCloud:
    """Return a cloud with what is known of it by its sides: its spacing and, where there is noise, its normals."""
    _ = cloud.spacing
    if not cloud.is_measurable or cloud.noise > cloud.spacing or cloud.is_clean:
        return cloud  # of more noise, sixteen points have no plane: normals will be averaged with the points
    normals = plane_normals(cloud.points, cloud.require_normals(), cloud.neighbors.row, cloud.noise)
    if normals is cloud.normals:
        return cloud
    turned = cloud.with_normals(normals)
    _ = turned.spacing
    return turned


def _as_rows(array: npt.ArrayLike, name: str) -> FloatArray:
    """Return an (n, 3) float64 array, of which values may be NaN."""
    rows = as_floats(array, name)
    as_points(np.zeros(rows.shape), name, dim=3)
    return rows


def _weights_of(cloud: CloudLike, count: int) -> FloatArray:
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


def _require_enough(count: int, whole: int) -> None:
    if not whole:
        raise InputError(f"cloud: is empty; a surface needs at least {MIN_POINTS} points")
    if count < MIN_POINTS:
        raise InputError(
            f"cloud: {count} of {whole} points are left after removing repeated, outlying and non-finite ones; "
            f"a surface needs at least {MIN_POINTS}; is it damaged?"
        )


def _find_normals(
    cloud: OrientedCloud, given: FloatArray | None, estimate: Estimate | None, orient: Orient | None
) -> Orientation:
    """Return outward normals: those given where they can be used, else those that the steps find."""
    if given is None:
        return _find_anew(cloud, estimate, orient)
    unit, notes, _ = check_normals(cloud, given, orient=orient is not None)
    turned = float(np.mean(np.einsum("ij,ij->i", np.nan_to_num(given), unit) < 0))
    noisy = len(cloud.surfels.points) < len(cloud)
    if orient is None or not noisy or not UNUSABLE < turned < 1 - UNUSABLE:
        return Orientation(unit, notes)
    unit, more, cut = _find_anew(cloud, estimate, orient)
    note = f"{turned:.0%} of the given normals are on the wrong side, because of noise: all were estimated anew"
    return Orientation(unit, (note, *more), cut)


def _find_facing(
    cloud: OrientedCloud, given: FloatArray | None, estimate: Estimate | None, viewpoint: FloatArray
) -> Orientation:
    """Return normals that face the viewpoints (n, 3), in the directions given or else estimated."""
    if given is not None:
        return face_given(cloud.points, check_normals(cloud, given, orient=False), viewpoint)
    found = _find_anew(cloud, estimate, None)
    return found._replace(normals=face_viewpoint(cloud.points, found.normals, viewpoint))


def _find_anew(cloud: OrientedCloud, estimate: Estimate | None, orient: Orient | None) -> Orientation:
    """Return the normals that two steps find of a cloud without any."""
    if orient is None and estimate is None:
        return Orientation(estimate_normals(cloud), ())
    if estimate is not None:
        cloud = cloud.with_normals(as_points(estimate(cloud), "normals", dim=3))
    return Orientation(cloud.require_normals(), ()) if orient is None else orient(cloud)
