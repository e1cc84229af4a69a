"""Points with an intensity each, the form of the paper's data: a PLY with a property f, made a lattice of voxels."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.files import is_file
from o3dleaf.core.errors import InputError
from o3dleaf.io.ply_reader import PlyHeader, read_ply_points
from o3dleaf.leaf.ct.formats.stated import Stated

SUFFIXES = (".ply",)
OF_VOXELS = ("f", "scalar_f")
"""Names by which points are known to be voxels: laser scans have intensities, too."""
NAMES = ("f", "scalar_f", "intensity", "scalar_intensity", "value", "scalar")
"""Names that a property of intensities has: the paper's, and what CloudCompare makes of it."""
MISSED = 0.01
"""Distance of a point from its place in the lattice, in steps, that rounding in single precision explains."""


def read(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (x, y, z) voxels of a file of points on a lattice, and the lattice; a PLY states no unit.

    Raises
    ------
    InputError
        If the points have no intensity, do not lie on a lattice along the axes, or leave places of it empty.
    """
    numbers = read_ply_points(path)
    name = next((name for name in NAMES if name in numbers), None)
    if name is None or any(axis not in numbers for axis in "xyz"):
        raise InputError(f"{path}: its points have no intensity; give points with a property f")
    points = np.stack([numbers[axis].astype(np.float64) for axis in "xyz"], axis=1)
    values = numbers[name]
    axes = [_lattice_of(points[:, axis], path) for axis in range(3)]
    shape = tuple(len(places) for places, _ in axes)
    voxels = np.zeros(shape, dtype=values.dtype)
    if len(points) != voxels.size:
        raise InputError(
            f"{path}: {len(points):,} points for a lattice of {shape} places; give the whole box, each voxel once"
        )
    filled = np.zeros(shape, dtype=bool)
    rows = tuple(row for _, row in axes)
    voxels[rows], filled[rows] = values, True
    if not filled.all():
        raise InputError(f"{path}: {np.sum(~filled):,} places of its lattice are empty; give each voxel once")
    spacing = np.array([np.diff(places).mean() if len(places) > 1 else 1.0 for places, _ in axes])
    return voxels, Stated(spacing, np.array([places[0] for places, _ in axes]), None, "xyz")


def holds_voxels(path: Path) -> bool:
    """Return whether a file is a PLY of points with the paper's intensity f, by its header; False where it has none."""
    if not is_file(path):  # a pipe would be waited for
        return False
    try:
        elements = {each.name: each for each in PlyHeader.of(path).elements(path)}
    except (InputError, OSError):
        return False
    names = {each.name for each in elements["vertex"].properties} if "vertex" in elements else set()
    return "face" not in elements and not names.isdisjoint(OF_VOXELS)


def _lattice_of(coordinates: FloatArray, path: Path) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return the (m,) even places of coordinates along an axis, and which of them each has."""
    if not len(coordinates) or not np.isfinite(coordinates).all():
        raise InputError(f"{path}: has no points, or some that are not finite; export it again")
    low, high = float(coordinates.min()), float(coordinates.max())
    gaps = np.diff(np.unique(coordinates))
    wide = gaps[gaps > MISSED * gaps.max(initial=0.0)]  # narrower ones are rounding
    steps = round((high - low) / float(np.median(wide))) if wide.size else 0
    places = np.linspace(low, high, steps + 1)
    rows = (
        np.rint((coordinates - low) / (high - low) * steps).astype(np.int64)
        if steps
        else np.zeros(len(coordinates), int)
    )
    if steps and np.abs(coordinates - places[rows]).max() > MISSED * (high - low) / steps:
        raise InputError(f"{path}: its points are on no lattice along the axes; turn it back, or export the voxels")
    return places, rows
