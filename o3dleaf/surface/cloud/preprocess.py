"""Any point cloud made ready for a surface: faulty points go, and every point has an outward normal."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import as_viewpoint
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.cloud_arrays import CloudLike, raw_normals, raw_points
from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.branchings.find import find_branchings
from o3dleaf.surface.cloud.downsample import voxel_down_sample
from o3dleaf.surface.cloud.normals import plane_normals
from o3dleaf.surface.cloud.orientation.given_normals import check_normals, without_infinite, without_unfit
from o3dleaf.surface.cloud.orientation.orientation import Orientation, estimate_normals, orient_normals
from o3dleaf.surface.cloud.orientation.viewpoint import face_given, face_viewpoint
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.outliers import detect_outliers
from o3dleaf.surface.cloud.usable_points import Branch, Detect, UsablePoints, as_raw_rows, require_enough, weights_of

UNUSABLE = 0.1
"""Share of given normals on the wrong side of a noisy cloud beyond which their directions are not used either."""
SHARES = (7, 1, 3, 1, 5, 4)
"""About how long the steps of preprocessing take: sorting, outliers, planes, branchings, sides, the order restored."""

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

    Where three sheets meet, no three normals agree: the points there are left out too, and the lines known. Where
    coordinates are rounded to steps wider than points are apart, these are averaged in voxels of one step.

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
        so; of points that were seen at less than 45° those of neighbors seen from the same place count too. Nothing is
        oriented by `orient` then.
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
    points = as_raw_rows(raw_points(cloud), "cloud")
    normals = raw_normals(cloud) if normals is None else normals
    given = None if normals is None else without_infinite(as_raw_rows(normals, "normals"))
    if given is not None and len(given) != len(points):
        raise InputError(f"normals: {len(given)} for {len(points)} points; give one per point")
    if given is not None and not given.any():
        given = None  # a property that was never filled
    seen_from = None if viewpoint is None else as_viewpoint(viewpoint, len(points))
    if voxel_size is not None:
        require_positive(voxel_size, "voxel_size")
    sorting, finding, measuring, branching, siding, ending = progress.split(*SHARES)
    with sorting:
        usable = UsablePoints.of(points, weights_of(cloud, len(points)))
        usable = usable.averaged(None if given is None else given[usable.rows])
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
        require_enough(len(averaged), len(oriented))
        return averaged


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


def _find_normals(
    cloud: OrientedCloud, given: FloatArray | None, estimate: Estimate | None, orient: Orient | None
) -> Orientation:
    """Return outward normals: those given where they can be used, else those that the steps find."""
    if given is None:
        return _find_anew(cloud, estimate, orient)
    repaired = check_normals(cloud, given, orient=orient is not None)
    turned = float(np.mean(np.einsum("ij,ij->i", given, repaired.normals) < 0))
    noisy = len(cloud.surfels.points) < len(cloud)
    if orient is None or not noisy or not UNUSABLE < turned < 1 - UNUSABLE:
        return repaired
    found = _find_anew(cloud, estimate, orient)
    note = f"{turned:.0%} of the given normals are on the wrong side, because of noise: all were estimated anew"
    return found._replace(notes=(note, *found.notes))


def _find_facing(
    cloud: OrientedCloud, given: FloatArray | None, estimate: Estimate | None, viewpoint: FloatArray
) -> Orientation:
    """Return normals that face the viewpoints (n, 3), in the directions given or else estimated."""
    if given is not None:
        return face_given(cloud.points, check_normals(cloud, given, orient=False), viewpoint, cloud.neighbors.row)
    found = _find_anew(cloud, estimate, None)
    return found._replace(normals=face_viewpoint(cloud.points, found.normals, viewpoint, cloud.neighbors.row))


def _find_anew(cloud: OrientedCloud, estimate: Estimate | None, orient: Orient | None) -> Orientation:
    """Return the normals that two steps find of a cloud without any."""
    if orient is None and estimate is None:
        return Orientation(estimate_normals(cloud), ())
    if estimate is not None:
        cloud = cloud.with_normals(as_points(estimate(cloud), "normals", dim=3))
    return Orientation(cloud.require_normals(), ()) if orient is None else orient(cloud)
