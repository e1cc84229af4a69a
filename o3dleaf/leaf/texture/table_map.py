"""Smooth maps over the plane from tables that the user gives: of thickness, of how many hairs there are."""

import csv
from dataclasses import dataclass
from functools import cached_property
from os import PathLike

import numpy as np
import numpy.typing as npt
from scipy.interpolate import NdBSpline

from o3dleaf.core.checks.arrays import FloatArray, as_floats
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.checks.files import require_file
from o3dleaf.core.errors import InputError

DEGREE = 3


@dataclass(frozen=True, eq=False)
class TableMap:
    r"""A smooth function over the plane, from a table of numbers.

    .. math:: τ(u, v) = \sum_{ij} f_{ij}\, B(u - u_i)\, B(v - v_j)

    with B the cubic B-spline of the table's lattice, which is laid over `bounds` corner to corner: C², between the
    least and the largest number around, and beyond the bounds as at their nearest point.

    Attributes
    ----------
    table : (n, m) ndarray
        Along, from the base to the tip, and across.
    bounds : (2, 2) ndarray
        Lower, then upper (u, v) of the area that the table is laid over.
    """

    table: FloatArray
    bounds: FloatArray

    def values(self, uv: npt.ArrayLike) -> FloatArray:
        """Return τ (n,) at (n, 2) points of the plane."""
        return np.asarray(self._spline(self._places(uv)[0]))

    def jet(self, uv: npt.ArrayLike) -> FloatArray:
        """Return τ, ∂τ/∂u and ∂τ/∂v (n, 3) at (n, 2) points of the plane."""
        places, density = self._places(uv)
        slopes = [self._spline(places, nu=nu) * density[:, axis] for axis, nu in enumerate(((1, 0), (0, 1)))]
        return np.stack([self._spline(places), *slopes], axis=1)

    @cached_property
    def _spline(self) -> NdBSpline:
        # A row of nodes beyond each edge, as high as the edge: level there.
        table = np.pad(self.table, 2, mode="edge")
        knots = tuple(np.arange(count + DEGREE + 1) - 4.0 for count in table.shape)
        return NdBSpline(knots, table, DEGREE)

    def _places(self, uv: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return points of the plane in steps of the table, and steps over lengths: 0 where they lie beyond it."""
        (low, high), plane = self.bounds, as_points(uv, "uv", dim=2)
        steps = (np.array(self.table.shape) - 1) / (high - low)
        within = (plane >= low) & (plane <= high)
        return (np.clip(plane, low, high) - low) * steps, np.where(within, steps, 0.0)


def as_table(
    table: npt.ArrayLike | str | PathLike[str], name: str, limits: tuple[float, float], meaning: str
) -> FloatArray:
    """Return a table of numbers (n, m) within limits, given or read from a CSV file, or raise `InputError`."""
    numbers = as_floats(read_table(table, name) if isinstance(table, str | PathLike) else table, name)
    if numbers.ndim != 2 or numbers.size == 0:
        raise InputError(f"{name}: has shape {numbers.shape}; give a table, its rows along the leaf")
    if not (numbers.min() >= limits[0] and numbers.max() <= limits[1]):
        raise InputError(
            f"{name}: has numbers from {numbers.min():g} to {numbers.max():g}; give {limits[0]:g} to {limits[1]:g}, "
            f"{meaning}"
        )
    return numbers


def read_table(path: str | PathLike[str], name: str) -> list[list[float]]:
    """Return the rows of numbers of a CSV file, or raise `InputError`."""
    file = require_file(path)
    try:
        with file.open(newline="") as stream:
            rows = [[float(word) for word in row] for row in csv.reader(stream) if row]
    except (ValueError, csv.Error) as cause:
        raise InputError(
            f"{name}: {file.name} is no table of numbers ({cause}); give rows of numbers, by commas"
        ) from cause
    if len({len(row) for row in rows}) != 1:
        raise InputError(f"{name}: {file.name} has rows of different lengths, or none; give a table")
    return rows
