"""The only input validation of the package: each check returns a clean array or raises `InputError`."""

import os
import stat
import warnings
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import shown
from o3dleaf.core.errors import DataWarning, InputError

FloatArray = npt.NDArray[np.float64]

LARGEST = 1e30
"""Size of a cloud's coordinates beyond which, and one over which, tenth powers of lengths leave float64."""


FARTHEST = 1e100
"""Size of coordinates beyond which, and one over which, squares of their distances leave float64."""
FAR_BOXES = 1e6
"""Sizes of a surface from which on a place is too far to tell the foot of it."""


def as_floats(array: npt.ArrayLike, name: str) -> FloatArray:
    """Return an array of real numbers as float64 in the layout that loops are compiled for; NaN may be among them."""
    try:
        given = np.asanyarray(array)
        what = _no_numbers(given)
        floats = given if what else np.require(given, np.float64, ["C", "A", "W", "E"])
    except (TypeError, ValueError, OverflowError) as cause:
        raise InputError(f"{name}: not an array of numbers ({cause}); give an array of real numbers") from cause
    if what:
        raise InputError(f"{name}: {what}")
    return floats


def as_array(array: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """Return an array of any type as it is; nothing is masked in it."""
    try:
        given = np.asanyarray(array)
    except ValueError as cause:
        raise InputError(f"{name}: is no array ({cause}); give rows of one length") from cause
    if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        raise InputError(f"{name}: {np.ma.count_masked(given)} are masked; give an array without them")
    return np.asarray(given)


def as_row(values: npt.ArrayLike, name: str, *, count: int | None = None) -> FloatArray:
    """Return `values` as a finite (n,) array, one number as n of them or, where n is not known, as one."""
    array = as_floats(values, name)
    if array.ndim == 0:
        array = np.full(count or 1, array)
    if array.ndim != 1 or len(array) != (len(array) if count is None else count):
        raise InputError(
            f"{name}: has shape {array.shape}; give a row of numbers, ({'n' if count is None else count},)"
        )
    return require_finite(array, name)


def as_lengths(values: npt.ArrayLike, name: str) -> FloatArray:
    """Return lengths of any shape, one as (1,), finite and at most `LARGEST`, or raise `InputError`."""
    lengths = require_finite(np.atleast_1d(as_floats(values, name)), name)
    if lengths.size and np.abs(lengths).max() > LARGEST:
        raise InputError(f"{name}: reach {np.abs(lengths).max():.3g}; give lengths of at most {LARGEST:.0e}")
    return lengths


def as_pairs(first: npt.ArrayLike, second: npt.ArrayLike, names: tuple[str, str]) -> tuple[FloatArray, FloatArray]:
    """Return two rows of lengths as (n,) each, one of either for all of the other, or raise `InputError`."""
    a, b = (as_lengths(values, name) for values, name in zip((first, second), names, strict=True))
    if a.ndim > 1 or b.ndim > 1 or (len(a) != len(b) and 1 not in {len(a), len(b)}):
        raise InputError(f"{names[0]}, {names[1]}: have shapes {a.shape} and {b.shape}; give rows of one length")
    both = np.broadcast_arrays(a, b)
    return both[0], both[1]


def as_points(points: npt.ArrayLike, name: str = "points", *, dim: int | None = None, least: int = 0) -> FloatArray:
    """Return `points` as a finite (n, d) float64 array in the one layout that loops are compiled for.

    A C-contiguous, writeable float64 array comes back as it is, anything else as a copy.

    Parameters
    ----------
    points : (n, d) array_like
        Coordinates, one point a row. A flat array of length d counts as one point where `dim` is d.
    name : str
        The argument's name, for the message.
    dim : int, optional
        The number of columns that the points must have.
    least : int
        The smallest number of points that will do.

    Raises
    ------
    InputError
        If the array has another shape, too few rows, or a value that is not finite.
    """
    array = as_floats(points, name)
    if array.ndim == 1 and dim is not None and array.shape == (dim,):
        array = array[np.newaxis]
    columns = array.shape[1] if array.ndim == 2 else 0
    if columns == 0 or columns != (dim or columns):
        wanted = f"(n, {dim})" if dim else "(n, d)"
        raise InputError(f"{name}: has shape {array.shape}; give one point per row, shape {wanted}")
    if len(array) < least:
        raise InputError(f"{name}: has {len(array)} points; at least {least} are needed")
    return require_finite(array, name)


def as_sites(
    points: npt.ArrayLike, name: str, *, dim: int | None = None, least: int = 0, largest: float = LARGEST
) -> FloatArray:
    """Return `points` as `as_points` does, if they are of a size to calculate with: data, not places to evaluate at."""
    return require_size(as_points(points, name, dim=dim, least=least), name, largest=largest)


def as_near(places: npt.ArrayLike, bounds: FloatArray, name: str = "points") -> FloatArray:
    """Return places to evaluate at as `as_points` does, if they are near a box (2, d), as `require_near` has it."""
    return require_near(as_points(places, name, dim=bounds.shape[1]), bounds, name)


def require_near(places: FloatArray, bounds: FloatArray, name: str) -> FloatArray:
    """Return places (n, d) if none is farther from a box than `FAR_BOXES` times its size, else raise `InputError`."""
    low, high = bounds
    reach = FAR_BOXES * float((high - low).max())
    far = np.any((places < low - reach) | (places > high + reach), axis=1)
    if far.any():
        raise InputError(f"{name}: {far.sum():,} lie {FAR_BOXES:.0e} times its size away from it; give places nearby")
    return places


def require_reach(local: FloatArray, name: str) -> FloatArray:
    """Return places (n, d), measured in radii of the data, if powers of their distances stay within float64."""
    farthest = float(np.abs(local).max(initial=0.0))
    if farthest > LARGEST:
        raise InputError(
            f"{name}: lie {farthest:.3g} times the size of the data away from it; give places within {LARGEST:.0e}"
        )
    return local


def box_of(points: FloatArray) -> FloatArray:
    """Return the lower and the upper corner (2, d) of points (n, d), by columns: many times as fast as by rows."""
    return np.array([[column.min() for column in points.T], [column.max() for column in points.T]])


def require_size(array: FloatArray, name: str, *, largest: float = LARGEST) -> FloatArray:
    """Return finite points (n, d) if no coordinate is above `largest`, and their box no smaller than one over it."""
    if len(array):
        low, high = box_of(array)
        farthest, side = float(max(-low.min(), high.max())), float((high / 2 - low / 2).max())
        if farthest > largest or 0 < side < 1 / largest:
            what = f"reach {farthest:.3g}" if farthest > largest else f"lie within {2 * side:.3g} of one another"
            limits = f"{1 / largest:.0e} to {largest:.0e}"
            raise InputError(f"{name}: {what}; give lengths in a unit in which they are {limits}")
    return array


def _no_numbers(array: npt.NDArray[Any]) -> str:
    """Return why an array has no real numbers, and what to do, or nothing."""
    if array.dtype.kind == "c":
        return "are complex; give real numbers, real and imaginary parts as two columns"
    if array.dtype.kind in "mMUS":
        what = "times" if array.dtype.kind in "mM" else "text"
        return f"not an array of numbers ({what}); give an array of real numbers"
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        return f"{np.ma.count_masked(array)} are masked; give an array without them"
    return ""


def as_values(values: npt.ArrayLike, count: int, name: str = "values", *, columns: bool = False) -> FloatArray:
    """Return `values` as a finite (count,) array, or (count, m) where there may be `columns`, or raise `InputError`."""
    array = as_floats(values, name)
    if array.shape != (count,) and not (columns and array.ndim == 2 and len(array) == count and array.shape[1]):
        wanted = f"({count},) or ({count}, m)" if columns else f"({count},)"
        raise InputError(f"{name}: has shape {array.shape}; give one value per point, shape {wanted}")
    return require_moderate(array, name)


def require_moderate(values: npt.NDArray[Any], name: str) -> npt.NDArray[Any]:
    """Return values of any shape if all are finite and none is beyond `FARTHEST`, else raise `InputError`."""
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    if not (np.isfinite(low) and np.isfinite(high)):
        require_finite(values, name)
    if max(-low, high) > FARTHEST:
        raise InputError(
            f"{name}: reach {max(-low, high):.3g}; give them in a unit in which they stay below {FARTHEST:.0e}"
        )
    return values


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


def as_labels(labels: npt.ArrayLike, count: int, kinds: int, name: str = "labels") -> npt.NDArray[np.uint8]:
    """Return `labels` as (count,) whole numbers from 0 to `kinds` - 1, or raise `InputError`."""
    array = as_array(labels, name)
    if array.shape != (count,) or array.dtype.kind not in "bui":
        raise InputError(
            f"{name}: is {array.dtype} of shape {array.shape}; give one whole number per triangle, ({count},)"
        )
    if count and (array.min() < 0 or array.max() >= kinds):
        raise InputError(f"{name}: range from {array.min()} to {array.max()}; give 0 to {kinds - 1}")
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


def as_place(values: npt.ArrayLike, name: str) -> FloatArray:
    """Return one point or vector (3,), or raise `InputError`."""
    rows = as_points(values, name, dim=3)
    if len(rows) != 1:
        raise InputError(f"{name}: has {len(rows)} rows; give three numbers")
    return np.asarray(rows[0])


def as_direction(values: npt.ArrayLike, name: str) -> FloatArray:
    """Return a direction as a (3,) unit vector, or raise `InputError` if it has no length."""
    row = as_place(values, name)
    largest = np.abs(row).max()
    if not largest > 0:
        raise InputError(f"{name}: has no length; give a direction, such as 0 0 1")
    return np.asarray(row / largest / np.linalg.norm(row / largest))


def as_viewpoint(viewpoint: npt.ArrayLike, count: int) -> FloatArray:
    """Return the place that each of `count` points was seen from (count, 3), given one or one each."""
    array = as_floats(viewpoint, "viewpoint")
    if array.shape not in {(3,), (count, 3)}:
        raise InputError(f"viewpoint: has shape {array.shape}; give one place (3,), or one for each point ({count}, 3)")
    return np.broadcast_to(require_finite(array, "viewpoint"), (count, 3))


def require_breadth(points: FloatArray, name: str) -> None:
    """Raise `InputError` if (n, 3) points are a line, and no surface.

    They are where they are no wider than one of n steps along them. Where they are as thick as wide, as a line with
    noise or a wire, they are up to nine: fewer than five points around a circle do not show it.
    """
    offsets = points - (points.min(axis=0) / 2 + points.max(axis=0) / 2)
    scale = float(np.abs(offsets).max()) or 1.0
    offsets /= scale
    offsets -= offsets.mean(axis=0)
    axes = np.linalg.eigh(offsets.T @ offsets)[1]
    thickness, breadth, length = (scale * np.ptp(offsets @ axes, axis=0)).tolist()
    steps = 9 if thickness > breadth / 2 else 1
    if breadth * len(points) < steps * length:
        raise InputError(
            f"{name}: its {len(points):,} points lie on one line, {breadth:.3g} wide and {length:.3g} long; "
            "give the points of a surface"
        )


def require_cloud(thing: object, name: str) -> None:
    """Raise `InputError` if a path, a mesh or nothing stands where a point cloud should."""
    if thing is None:
        raise InputError(f"{name}: is None; give a point cloud")
    if isinstance(thing, str | PathLike):
        raise InputError(f"{name}: is a path; read it first, by read_point_cloud({str(thing)!r})")
    of_mesh = any(hasattr(thing, part) for part in ("vertices", "vertex", "mesh"))
    if of_mesh or (isinstance(thing, tuple) and len(thing) == 2 and np.ndim(thing[1]) == 2):
        raise InputError(
            f"{name}: is a mesh; give a point cloud: its vertices, or mesh.sample_points_uniformly(100_000) of Open3D"
        )


def warn_of_contradictions(points: FloatArray, values: FloatArray, *, stacklevel: int = 3) -> None:
    """Warn of places where several of the (n, d) points have different values, (n,) or (n, m): fits average them."""
    order = np.lexsort(points.T)
    same = np.all(points[order[1:]] == points[order[:-1]], axis=1)
    rows = values.reshape(len(values), -1)
    group = np.concatenate([[0], np.cumsum(~same)])
    first = order[np.searchsorted(group, group)]
    differs = np.any(rows[order] != rows[first], axis=1)
    places = np.unique(group[differs])
    if len(places):
        where = ", ".join(f"{x:.6g}" for x in points[order[np.searchsorted(group, places[0])]])
        warnings.warn(
            f"values: points coincide and have different values at {len(places):,} place{'s' * (len(places) > 1)}, the "
            f"first at ({where}); the fit goes through their means; give smoothing, or leave one point at each place",
            DataWarning,
            stacklevel=stacklevel + 2,  # of this function, and of `checked`
        )


def as_bounds(bounds: npt.ArrayLike, dim: int, name: str = "bounds") -> FloatArray:
    """Return `bounds` as a (2, dim) array, lower corner then upper corner, or raise `InputError`."""
    array = as_sites(bounds, name, dim=dim)
    if len(array) != 2 or np.any(array[1] < array[0]):
        raise InputError(f"{name}: are no two corners of a box; give the lower, then the upper one, shape (2, {dim})")
    return array


def as_step(spacing: float | npt.ArrayLike, dimension: int = 3) -> FloatArray:
    """Return the (d,) steps of a spacing given as one number or one an axis, or raise `InputError`."""
    step = as_floats(spacing, "spacing")
    if step.shape not in {(), (dimension,)}:
        raise InputError(f"spacing: has shape {step.shape}; give one number, or one per axis")
    for each in step.ravel():
        require_positive(float(each), "spacing")
    return np.broadcast_to(step, dimension).copy()


def as_voxels(data: npt.ArrayLike, name: str = "values") -> npt.NDArray[Any]:
    """Return an array of finite real numbers in this machine's byte order, copied only if it must be.

    Raises
    ------
    InputError
        If it holds anything else, or has no voxel.
    """
    voxels = as_array(data, name)
    if voxels.dtype.kind not in "buif":
        raise InputError(f"{name}: has {voxels.dtype} values; give real numbers")
    if voxels.ndim == 0 or voxels.size == 0:
        raise InputError(f"{name}: has shape {voxels.shape}; give an array of voxels")
    if voxels.dtype.kind == "b":
        return voxels.astype(np.uint8)
    if not voxels.dtype.isnative:
        # Compiled loops know this machine's byte order only; ImageJ writes the other one.
        voxels = voxels.astype(voxels.dtype.newbyteorder("="))
    if voxels.dtype.kind == "f":
        # Slab by slab in the file's own order, so that a mapped file is read once and never held whole.
        axis = int(np.argmax(voxels.strides))
        for i in range(voxels.shape[axis]):
            require_moderate(np.moveaxis(voxels, axis, 0)[i], f"{name}, slab {i} along axis {axis}")
    return voxels


def as_mask(mask: npt.ArrayLike, shape: tuple[int, ...], name: str = "mask") -> npt.NDArray[np.bool_]:
    """Return `mask` as an array of bool of the given shape, or raise `InputError`."""
    array = as_array(mask, name)
    if array.shape != shape or array.dtype != np.bool_:
        raise InputError(f"{name}: is {array.dtype} of shape {array.shape}; give one bool per voxel, shape {shape}")
    return array


def as_rigid_motion(transform: npt.ArrayLike, dimension: int = 3) -> tuple[FloatArray, FloatArray]:
    """Return rotation (d, d) and displacement (d,) of a (d + 1, d + 1) matrix, or raise `InputError`."""
    matrix = as_points(transform, "transform", dim=dimension + 1)
    turn = matrix[:dimension, :dimension]
    size = f"({dimension + 1}, {dimension + 1})"
    if len(matrix) != dimension + 1 or np.abs(turn @ turn.T - np.eye(dimension)).max() > 1e-9:
        raise InputError(f"transform: is no rigid motion of shape {size}; give a rotation and a translation")
    return turn, matrix[:dimension, dimension]


def require_finite(array: FloatArray, name: str) -> FloatArray:
    """Return `array` if all of it is finite, else raise `InputError` with the count and the first place."""
    finite = np.isfinite(array)
    if not finite.all():
        bad = np.argwhere(~finite)
        raise InputError(
            f"{name}: {len(bad)} values are NaN or infinite, the first at index {tuple(bad[0].tolist())}; remove them"
        )
    return array


def as_number(value: float, name: str) -> float:
    """Return `value` as a finite float, or raise `InputError`."""
    number = _as_float(value)
    if not np.isfinite(number):
        raise InputError(f"{name}: is {value}; give a finite number")
    return number


def require_positive(value: float, name: str, *, largest: float = LARGEST) -> float:
    """Return `value` as a float if it is above zero and of a size to calculate with, else raise `InputError`."""
    number = _as_float(value)
    if not 1 / largest <= number <= largest:
        raise InputError(f"{name}: is {value}; give a number above zero, {1 / largest:.0e} to {largest:.0e}")
    return number


def _as_float(value: object) -> float:
    """Return `value` as a float, NaN where it is no number at all."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return np.nan


def require_choice(value: str, choices: Iterable[str], name: str) -> str:
    """Return `value` if it is one of `choices`, else raise `InputError` that lists them."""
    known = list(choices)
    if value not in known:
        raise InputError(f"{name}: unknown {value!r}; choose one of {', '.join(known)}")
    return value


def is_folder(path: str | PathLike[str]) -> bool:
    """Return whether a path is a folder; a name that none can have is not, where `Path.is_dir` raises."""
    return os.path.isdir(path)  # noqa: PTH112


def is_file(path: str | PathLike[str]) -> bool:
    """Return whether a path is a regular file; a name that none can have is not, where `Path.is_file` raises."""
    return os.path.isfile(path)  # noqa: PTH113


def require_file(path: str | PathLike[str]) -> Path:
    """Return `path` as a `Path` if it is a file that holds something, else raise `InputError`."""
    file = Path(path)
    try:
        state = file.stat()
    except (OSError, ValueError) as cause:
        raise InputError(
            f"{shown(file)}: no such file ({getattr(cause, 'strerror', cause)}); check the path"
        ) from cause
    if not stat.S_ISREG(state.st_mode):
        raise InputError(f"{shown(file)}: is a folder, a pipe or a device, no such file as can be read; check the path")
    if state.st_size == 0:
        raise InputError(f"{shown(file)}: the file is empty; export it again")
    if not os.access(file, os.R_OK):
        raise InputError(f"{shown(file)}: may not be read by you; ask its owner, or copy it")
    return file
