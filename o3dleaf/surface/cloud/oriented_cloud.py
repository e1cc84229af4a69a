"""Any point cloud, made ready for a surface: what is wrong with it goes, and every point has an outward normal."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray, as_points, require_positive
from o3dleaf.core.cloud_arrays import CloudLike, held_normals, held_points
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import Progress, finish, share_out
from o3dleaf.surface.cloud.downsample import merge_points
from o3dleaf.surface.cloud.given import check_normals
from o3dleaf.surface.cloud.neighbors import Neighbourhoods, nearest_neighbours, rearranged
from o3dleaf.surface.cloud.orientation import (
    Orientation,
    estimate_normals,
    orient_normals,
    orient_surfels,
    turn_outward,
)
from o3dleaf.surface.cloud.point_spacing import median_spacing
from o3dleaf.surface.cloud.stray import find_stray_points, stray_among
from o3dleaf.surface.cloud.surfels import Surfels

UNUSABLE = 0.1
"""Share of given normals on the wrong side of a noisy cloud beyond which their directions are not believed either."""
SHARES = (3, 6, 3, 5, 3)
"""About how long the steps of preparing a cloud take: sorting, neighbours, planes, sides, and the order restored."""
LEAST_POINTS = 10
"""Fewer points do not determine a quadratic, let alone a surface."""

FindStray = Callable[[FloatArray], npt.NDArray[np.bool_]]
Estimate = Callable[[FloatArray], FloatArray]
Orient = Callable[[FloatArray, FloatArray], Orientation]


@dataclass(frozen=True, eq=False)
class OrientedCloud:
    """A cloud that a surface can be fitted to.

    Attributes
    ----------
    points, normals : (n, 3) ndarray
        In the order of the cloud they come from; normals are of unit length and point outward.
    spacing : float
        Median of s = 1/sqrt(points per unit area).
    non_finite, repeated, stray, merged : int
        Points removed for being NaN or infinite, for being there twice, for lying far from all others, and for
        being averaged with others of their voxel.
    notes : tuple of str
        What was decided on the way, one sentence each.
    near : Neighbourhoods, optional
        Of the points, for whoever needs them next.
    """

    points: FloatArray
    normals: FloatArray
    spacing: float
    non_finite: int = 0
    repeated: int = 0
    stray: int = 0
    merged: int = 0
    notes: tuple[str, ...] = ()
    near: Neighbourhoods | None = field(default=None, repr=False)


def prepare_cloud(
    cloud: CloudLike,
    *,
    normals: npt.ArrayLike | None = None,
    voxel_size: float | None = None,
    find_stray: FindStray | None = find_stray_points,
    estimate: Estimate = estimate_normals,
    orient: Orient | None = orient_normals,
    progress: Progress | None = None,
) -> OrientedCloud:
    """Return the points of any cloud without those that do no good, each with its outward normal.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        Points that are not finite are removed and counted, as are repeated ones.
    normals : (n, 3) array_like, optional
        Normals to use in place of those that the cloud holds. Given normals are kept as far as their neighbours bear
        them out: missing ones (zero or not finite) are found, single wrong ones are turned, and all of them where they
        point inward; where they contradict one another throughout, their sides are found anew.
    voxel_size : float, optional
        Edge of the voxels whose points are averaged, those on the two sides of a sheet apart; without it none are.
    find_stray : callable, optional
        ``find_stray(points) -> (n,) mask`` of what is no surface; None keeps everything.
    estimate : callable
        ``estimate(points) -> (n, 3)`` unit normals of either sign, where the cloud has none.
    orient : callable, optional
        ``orient(points, normals) -> Orientation``; None leaves normals as they were given or estimated.
    progress : callable, optional
        ``progress(done, total)``, in shares of the work.

    Raises
    ------
    InputError
        If too few points are left.
    OrientationError
        If the points do not say which side is outside.
    """
    held = _held_array(held_points(cloud), "cloud")
    given = held_normals(cloud) if normals is None else normals
    directions = None if given is None else _held_array(given, "normals")
    if directions is not None and len(directions) != len(held):
        raise InputError(f"normals: {len(directions)} for {len(held)} points; give one a point")
    sorting, finding, measuring, siding, ending = share_out(progress, *SHARES)
    finite = np.flatnonzero(np.isfinite(held).all(axis=1))
    distinct = finite[_first_of_each(held[finite])]
    _require_enough(len(distinct), len(held))
    # In the order of a tree, neighbours are close in memory, and each of the loops below runs up to twice as fast.
    tree = cKDTree(held[distinct])
    finish(sorting)
    kept, near = _without_stray(held, distinct[tree.indices], find_stray, finding)
    points = np.ascontiguousarray(held[kept])
    surfels = Surfels.of(points, near.row, progress=measuring)
    spacing = median_spacing(surfels.spacing).median
    if directions is not None:
        unit, notes = check_normals(points, directions[kept], surfels, near.row, orient=orient is not None)
        turned = float(np.mean(np.einsum("ij,ij->i", np.nan_to_num(directions[kept]), unit) < 0))
        if orient is not None and len(surfels.points) < len(points) and UNUSABLE < turned < 1 - UNUSABLE:
            unit, more = _found(points, surfels, estimate, orient, siding)
            notes = (
                f"{turned:.0%} of the given normals are on the wrong side, under noise: all were found anew",
                *more,
            )
    else:
        unit, notes = _found(points, surfels, estimate, orient, siding)
    finish(siding)
    order, count = np.argsort(kept), len(points)
    points, unit = points[order], unit[order]
    if voxel_size is not None:
        points, unit, _ = merge_points(points, unit, require_positive(voxel_size, "voxel_size"))
        _require_enough(len(points), count)
        near = nearest_neighbours(points, progress=ending)
        spacing = median_spacing(Surfels.of(points, near.row).spacing).median
    else:
        near = rearranged(near, order, tree if count == len(distinct) else cKDTree(points), ending)
    removed = len(held) - len(finite), len(finite) - len(distinct), len(distinct) - len(kept), count - len(points)
    return OrientedCloud(points, unit, spacing, *removed, notes, near)


def _held_array(array: npt.ArrayLike, name: str) -> FloatArray:
    """Return an (n, 3) float64 array, of which values may be NaN."""
    held = np.asarray(array)
    as_points(np.zeros(held.shape), name, dim=3)
    return np.asarray(held, dtype=np.float64)


def _first_of_each(points: FloatArray) -> npt.NDArray[np.int64]:
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


def _without_stray(
    held: FloatArray, rows: npt.NDArray[np.int64], find_stray: FindStray | None, progress: Progress | None
) -> tuple[npt.NDArray[np.int64], Neighbourhoods]:
    """Return those of `rows` that are no stray points, and their neighbourhoods."""
    points = held[rows]
    whole, linking, rest = share_out(progress, 4, 1, 4)
    near = nearest_neighbours(points, progress=whole)
    if find_stray is None:
        return rows, near
    # Our own step shares its neighbourhoods with the next ones.
    stray = stray_among(near) if find_stray is find_stray_points else find_stray(points)
    finish(linking)
    if not stray.any():
        return rows, near
    kept = rows[~stray]
    _require_enough(len(kept), len(held))
    return kept, nearest_neighbours(held[kept], progress=rest)


def _require_enough(count: int, whole: int) -> None:
    if count < LEAST_POINTS:
        raise InputError(
            f"cloud: {count} of {whole} points are left without repeated, stray and non-finite ones; "
            f"a surface needs {LEAST_POINTS}"
        )


def _found(
    points: FloatArray, surfels: Surfels, estimate: Estimate, orient: Orient | None, progress: Progress | None
) -> Orientation:
    """Return normals of a cloud that has none; our own steps share the surfels."""
    ours = estimate is estimate_normals
    if ours and orient is orient_normals:
        return orient_surfels(points, surfels, progress)
    normals = surfels.blend(points, surfels.planes.normal)[0] if ours else as_points(estimate(points), "normals", dim=3)
    if orient is None:
        return Orientation(normals, ())
    return turn_outward(points, normals, surfels) if orient is orient_normals else orient(points, normals)
