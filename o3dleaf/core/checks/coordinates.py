"""Points, boxes and directions: rows of coordinates."""

from os import PathLike

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray, as_floats, require_finite
from o3dleaf.core.checks.scalars import LARGEST
from o3dleaf.core.errors import InputError

FAR_BOXES = 1e6
"""Sizes of a surface from which on a place is too far to tell the foot of it."""
STRAY = 100
"""One in so many of the points, at either end, may be stray where it is judged whether they lie on a line."""


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


def as_bounds(bounds: npt.ArrayLike, dim: int, name: str = "bounds") -> FloatArray:
    """Return `bounds` as a (2, dim) array, lower corner then upper corner, or raise `InputError`."""
    array = as_sites(bounds, name, dim=dim)
    if len(array) != 2 or np.any(array[1] < array[0]):
        raise InputError(f"{name}: are no two corners of a box; give the lower, then the upper one, shape (2, {dim})")
    return array


def as_rigid_motion(transform: npt.ArrayLike, dimension: int = 3) -> tuple[FloatArray, FloatArray]:
    """Return rotation (d, d) and displacement (d,) of a (d + 1, d + 1) matrix, or raise `InputError`."""
    matrix = as_points(transform, "transform", dim=dimension + 1)
    turn = matrix[:dimension, :dimension]
    size = f"({dimension + 1}, {dimension + 1})"
    if len(matrix) != dimension + 1 or np.abs(turn @ turn.T - np.eye(dimension)).max() > 1e-9:
        raise InputError(f"transform: is no rigid motion of shape {size}; give a rotation and a translation")
    return turn, matrix[:dimension, dimension]


def require_breadth(points: FloatArray, name: str) -> None:
    """Raise `InputError` if (n, 3) points are a line, and no surface.

    They are where they are no wider than one of n steps along them. Where they are as thick as wide, as a line with
    noise or a wire, they are up to nine: fewer than five points around a circle do not show it. The outermost
    hundredth at either end counts in no width: a single stray point may lie a million widths away.
    """
    offsets = points - (points.min(axis=0) / 2 + points.max(axis=0) / 2)
    scale = float(np.abs(offsets).max()) or 1.0
    offsets /= scale
    offsets -= offsets.mean(axis=0)
    axes = np.linalg.eigh(offsets.T @ offsets)[1]
    places, stray = offsets @ axes, -(-len(points) // STRAY)
    widths = np.ptp(places, axis=0)
    if _is_line(widths, len(points)) and _is_line(np.ptp(np.sort(places, axis=0)[stray:-stray], axis=0), len(points)):
        _, breadth, length = (scale * widths).tolist()
        raise InputError(
            f"{name}: its {len(points):,} points lie on one line, {breadth:.3g} wide and {length:.3g} long; "
            f"{surface_wanted(points)}"
        )


def _is_line(widths: FloatArray, count: int) -> bool:
    """Return whether so many points of a thickness, breadth and length (3,) are a line; those of one place are."""
    thickness, breadth, length = widths.tolist()
    steps = 9 if thickness > breadth / 2 else 1
    return bool(breadth * count <= steps * length)


def surface_wanted(points: FloatArray) -> str:
    """Return the cure for points (n, 3) that are no surface: to give those of one, or to give them more digits.

    Coordinates in single precision have 24 bits, so that far from the origin their steps may be as wide as the cloud.
    """
    single, extent = points.astype(np.float32), float(np.ptp(points, axis=0).max())
    steps = float(np.spacing(np.abs(single).max(axis=0)).max())
    if not np.array_equal(single, points) or not 0 < extent <= steps * np.sqrt(len(points)):
        return "give the points of a surface"
    return (
        f"they are in single precision, which has steps of {steps:.2g} so far from the origin: subtract one before the "
        "file is written, or write double precision"
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
