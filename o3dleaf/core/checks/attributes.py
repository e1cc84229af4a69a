"""What belongs to points and triangles, one each: values, weights, labels, normals."""

from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core import journal
from o3dleaf.core.checks.arrays import FloatArray, as_array, as_floats, require_finite, require_moderate
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.errors import DataWarning, InputError
from o3dleaf.core.places import tell_place
from o3dleaf.core.units import tell_count


def as_values(values: npt.ArrayLike, count: int, name: str = "values", *, columns: bool = False) -> FloatArray:
    """Return `values` as a finite (count,) array, or (count, m) where there may be `columns`, or raise `InputError`."""
    array = as_floats(values, name)
    if array.shape != (count,) and not (columns and array.ndim == 2 and len(array) == count and array.shape[1]):
        wanted = f"({count},) or ({count}, m)" if columns else f"({count},)"
        raise InputError(f"{name}: has shape {array.shape}; give one value per point, shape {wanted}")
    return require_moderate(array, name)


def as_answers(answers: Any, count: int) -> npt.NDArray[Any]:
    """Return what a field answered at `count` points, finite (count,), or raise `InputError`."""
    values = as_array(answers, "field values")
    if values.dtype.kind not in "buif" or values.shape != (count,):
        raise InputError(f"field values: are {values.dtype} of shape {values.shape}; let it return one number a point")
    return require_finite(values, "field values")


def require_one_column(field: object, caller: str) -> None:
    """Raise `InputError` if a field has several values at a point, where the caller needs one."""
    columns = getattr(field, "columns", None)
    if columns is not None:
        raise InputError(f"{caller}: the field has {columns} columns of values; fit one of them, values (n,), for this")


def as_labels(labels: npt.ArrayLike, count: int, kinds: int) -> npt.NDArray[np.uint8]:
    """Return `labels` as (count,) whole numbers from 0 to `kinds` - 1, or raise `InputError`."""
    array = as_array(labels, "labels")
    if array.shape != (count,) or array.dtype.kind not in "bui":
        raise InputError(
            f"labels: is {array.dtype} of shape {array.shape}; give one whole number per triangle, ({count},)"
        )
    if count and (array.min() < 0 or array.max() >= kinds):
        raise InputError(f"labels: range from {array.min()} to {array.max()}; give 0 to {kinds - 1}")
    return array.astype(np.uint8)


def as_weights(weights: npt.ArrayLike, count: int, name: str = "weights") -> FloatArray:
    """Return `weights` as a (count,) array of finite numbers above zero, or raise `InputError`."""
    array = as_values(weights, count, name)
    if np.any(array <= 0):
        raise InputError(f"{name}: {np.sum(array <= 0)} are not above zero; leave such points out")
    return array


def as_rows(rows: npt.ArrayLike, count: int, name: str = "groups") -> npt.NDArray[np.int64]:
    """Return `rows` as (count,) whole numbers from 0 to `count` - 1, or raise `InputError`."""
    array = as_array(rows, name)
    if array.shape != (count,) or array.dtype.kind not in "ui" or np.any((array < 0) | (array >= count)):
        raise InputError(
            f"{name}: is {array.dtype} of shape {array.shape}; give one row number from 0 to {count - 1} each"
        )
    return array.astype(np.int64)


def as_normals(normals: npt.ArrayLike, points: FloatArray) -> FloatArray:
    """Return one finite (n, d) vector for each of the points, divided by its length, or raise `InputError`."""
    array = as_points(normals, "normals", dim=points.shape[1])
    if len(array) != len(points):
        raise InputError(f"normals: {len(array)} for {len(points)} points; give one for each point")
    lengths: FloatArray = np.linalg.norm(array, axis=1, keepdims=True)
    if not np.all(lengths > 0):
        raise InputError(
            f"normals: {np.sum(lengths == 0)} have length zero; remove these points, or use estimate_normals"
        )
    return np.divide(array, lengths)


def as_viewpoint(viewpoint: npt.ArrayLike, count: int) -> FloatArray:
    """Return the place that each of `count` points was seen from (count, 3), given one or one each."""
    array = as_floats(viewpoint, "viewpoint")
    if array.shape not in {(3,), (count, 3)}:
        raise InputError(f"viewpoint: has shape {array.shape}; give one place (3,), or one for each point ({count}, 3)")
    return np.broadcast_to(require_finite(array, "viewpoint"), (count, 3))


def warn_of_contradictions(points: FloatArray, values: FloatArray) -> None:
    """Warn of places where several of the (n, d) points have different values, (n,) or (n, m): fits average them."""
    order = np.lexsort(points.T)
    same = np.all(points[order[1:]] == points[order[:-1]], axis=1)
    rows = values.reshape(len(values), -1)
    group = np.concatenate([[0], np.cumsum(~same)])
    first = order[np.searchsorted(group, group)]
    differs = np.any(rows[order] != rows[first], axis=1)
    places = np.unique(group[differs])
    if len(places):
        where = tell_place(points[order[np.searchsorted(group, places[0])]], points)
        journal.warn(
            f"values: points coincide and have different values at {tell_count(len(places), 'place')}, the "
            f"first at {where}; the fit goes through their means; give smoothing, or leave one point at each place",
            DataWarning,
        )
