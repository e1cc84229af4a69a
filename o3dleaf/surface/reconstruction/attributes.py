"""What the points of a cloud carry, brought to the vertices of a mesh: colors and scalars, as values of a spline."""

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray, as_floats
from o3dleaf.core.checks.coordinates import as_points, require_cloud
from o3dleaf.core.cloud_arrays import CloudLike, point_attributes, raw_points
from o3dleaf.core.errors import InputError
from o3dleaf.core.trees import query
from o3dleaf.fitting.pu.interpolant import PUInterpolant

POINTS_PER_BALL = (100, 200)
"""Half of what suits values in space: colors vary along a surface, of which such a ball holds ten points across."""

STRAY = 8.0
"""Points so many times farther from the vertices than half of them are belong to no surface of the mesh."""

FEWEST = 12
"""Points with a value, below which that of the nearest one is taken: a tail has four terms."""


def interpolate_attributes(cloud: CloudLike, places: npt.ArrayLike) -> dict[str, npt.NDArray[Any]]:
    r"""Return what the points of a cloud carry, beside their normals, at other places, such as a mesh's vertices.

    Colors and other real numbers are those of splines φ = −r with a linear tail blended of balls, as of
    `PUInterpolant.fit`, all columns of an attribute by one factorization, smoothed as much as cross-validation says:
    colors without noise come back as they are, and those that are linear in space in either case. Colors have edges,
    at which r³ would overshoot, and off the surface r³ grows faster than r. Whole numbers, such as labels, are those of
    the nearest point.

    Parameters
    ----------
    cloud : Open3D point cloud, legacy or tensor, or (n, 3) array_like
        With colors, and of a tensor cloud any other attributes (n,) or (n, c); an array carries nothing. Points
        that are not finite, have no finite value, or lie far from all places do not count.
    places : (m, 3) array_like

    Returns
    -------
    dict of str to (m,) or (m, c) ndarray
        By Open3D's names: "colors" (m, 3) as float32 from 0 to 1, also where the cloud has bytes, clipped; other
        numbers in the cloud's type, within the range of the points' own.

    Raises
    ------
    InputError
        If an attribute does not have one row for each point.
    """
    require_cloud(cloud, "cloud")
    points = as_floats(raw_points(cloud), "cloud")
    as_points(np.zeros(points.shape), "cloud", dim=3)
    attributes, targets = point_attributes(cloud), as_points(places, "places", dim=3)
    if not attributes or not len(targets):
        return {}
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    distance = query(cKDTree(targets), points[finite])[0]
    near = finite[distance <= STRAY * np.median(distance)] if len(finite) else finite
    carried = {}
    for part, (name, values) in zip(progress.split(*[1] * len(attributes)), attributes.items(), strict=True):
        if len(values) != len(points):
            raise InputError(f"cloud: has {len(values)} {name} for {len(points)} points; give one row for each")
        with part:
            carried[name] = _carry(name, points[near], values[near], targets) if len(near) else None
    return {name: values for name, values in carried.items() if values is not None}


def _carry(name: str, points: FloatArray, values: npt.NDArray[Any], targets: FloatArray) -> npt.NDArray[Any] | None:
    """Return one attribute at the targets, None where no point has a value."""
    if name == "colors":
        return np.clip(_interpolate(points, as_unit_colors(values), targets), 0, 1).astype(np.float32)
    if values.dtype.kind != "f":
        return np.asarray(values[query(cKDTree(points), targets)[1]])
    known = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if not known.any():
        return None
    points, values = points[known], values[known]
    found = _interpolate(points, values.reshape(len(values), -1).astype(np.float64), targets)
    found = np.clip(found.reshape(-1, *values.shape[1:]), values.min(axis=0), values.max(axis=0))
    return found.astype(values.dtype)


def _interpolate(points: FloatArray, values: FloatArray, targets: FloatArray) -> FloatArray:
    """Return the (m, c) values at the targets of (n, c) values at the points."""
    if len(points) < FEWEST:
        return np.asarray(values[query(cKDTree(points), targets)[1]])
    box = np.array([np.minimum(points.min(axis=0), targets.min(axis=0)), np.maximum(points.max(0), targets.max(0))])
    field = PUInterpolant.fit(
        points, values, kernel="linear", degree=1, smoothing="gcv", points_per_ball=POINTS_PER_BALL, bounds=box
    )
    return np.asarray(field(targets))


def as_unit_colors(colors: npt.NDArray[Any]) -> FloatArray:
    """Return (n, 3) colors from 0 to 1 of such, or of whole numbers up to the largest of their type."""
    whole = colors.dtype.kind in "ui"
    scaled = colors.astype(np.float64) / (np.iinfo(colors.dtype).max if whole else 1.0)
    return np.nan_to_num(scaled.reshape(len(colors), -1)[:, :3], nan=0.5)
