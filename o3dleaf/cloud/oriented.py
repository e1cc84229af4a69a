"""Any point cloud, made ready for a surface: what is wrong with it goes, and every point has an outward normal."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray, as_points
from o3dleaf.cloud.neighbours import fit_planes, nearest_neighbours
from o3dleaf.cloud.normals import repair_normals
from o3dleaf.cloud.spacing import cloud_spacing
from o3dleaf.cloud.stray import find_stray_points
from o3dleaf.errors import InputError
from o3dleaf.geometry import CloudLike, held_normals, held_points

LEAST_POINTS = 10
"""Fewer points do not determine a quadratic, let alone a surface."""

FindStray = Callable[[FloatArray], npt.NDArray[np.bool_]]


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
    """

    points: FloatArray
    normals: FloatArray
    spacing: float
    non_finite: int
    repeated: int
    stray: int
    merged: int
    notes: tuple[str, ...]


def prepare_cloud(
    cloud: CloudLike,
    *,
    normals: npt.ArrayLike | None = None,
    find_stray: FindStray | None = find_stray_points,
) -> OrientedCloud:
    """Return the points of any cloud without those that do no good, each with its outward normal.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        Points that are not finite are removed and counted, as are repeated ones.
    normals : (n, 3) array_like, optional
        Normals to use in place of those that the cloud holds. They are made of unit length; a normal that is
        missing (zero or not finite) is found anew, and one that nearly all its neighbours contradict is turned.
    find_stray : callable, optional
        ``find_stray(points) -> (n,) mask`` of what is no surface; None keeps everything.

    Raises
    ------
    InputError
        If too few points are left.
    """
    held = _held_array(held_points(cloud), "cloud")
    given = held_normals(cloud) if normals is None else normals
    if given is None:
        raise InputError("cloud: has no normals; estimate and orient them first")
    direction = _held_array(given, "normals")
    if len(direction) != len(held):
        raise InputError(f"normals: {len(direction)} for {len(held)} points; give one a point")
    finite = np.flatnonzero(np.isfinite(held).all(axis=1))
    distinct = finite[_first_of_each(held[finite])]
    _require_enough(len(distinct), len(held))
    kept = distinct[~find_stray(held[distinct])] if find_stray else distinct
    _require_enough(len(kept), len(held))
    points = np.ascontiguousarray(held[kept])
    unit, notes = _checked(points, direction[kept])
    return OrientedCloud(
        points,
        unit,
        cloud_spacing(points).median,
        non_finite=len(held) - len(finite),
        repeated=len(finite) - len(distinct),
        stray=len(distinct) - len(kept),
        merged=0,
        notes=notes,
    )


def _held_array(array: npt.ArrayLike, name: str) -> FloatArray:
    """Return an (n, 3) float64 array, of which values may be NaN."""
    held = np.asarray(array)
    as_points(np.zeros(held.shape), name, dim=3)
    return np.asarray(held, dtype=np.float64)


def _first_of_each(points: FloatArray) -> npt.NDArray[np.int64]:
    """Return the rows, in order, at which each distinct point of `points` (n, 3) stands first."""
    order = np.lexsort(points.T)
    same = np.zeros(len(points), dtype=bool)
    same[1:] = (points[order[1:]] == points[order[:-1]]).all(axis=1)
    return np.sort(order[~same])  # lexsort is stable: of equal points the first comes first


def _require_enough(count: int, whole: int) -> None:
    if count < LEAST_POINTS:
        raise InputError(
            f"cloud: {count} of {whole} points are left without repeated, stray and non-finite ones; "
            f"a surface needs {LEAST_POINTS}"
        )


def _checked(points: FloatArray, given: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return unit normals with the missing and the clearly wrong ones mended, and what was done."""
    notes = []
    rows = nearest_neighbours(points).row
    length = np.linalg.norm(np.where(np.isfinite(given), given, 0.0), axis=1)
    missing = ~(np.isfinite(given).all(axis=1) & (length > 0))
    unit = np.where(missing[:, np.newaxis], 0.0, given) / np.where(missing, 1.0, length)[:, np.newaxis]
    if missing.any():
        unit[missing] = fit_planes(points, rows[missing]).normal
        around = unit[rows[missing]] * ~missing[rows[missing]][:, :, np.newaxis]
        unit[missing] *= np.where(np.einsum("ia,ija->i", unit[missing], around) < 0, -1.0, 1.0)[:, np.newaxis]
        notes.append(f"{missing.sum()} normals were missing and are those of the planes through their neighbours")
    unit, turned, _ = repair_normals(points, unit, rows)
    if turned:
        notes.append(f"{turned} normals were turned round, contradicted by their neighbours")
    return unit, tuple(notes)
