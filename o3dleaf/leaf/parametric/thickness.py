"""The factor of a blade's thickness, from a map that the user gives: thin at the tip, thick along the midrib."""

import csv
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import NdBSpline

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks import FloatArray, as_bounds, as_floats, as_points, require_file
from o3dleaf.core.errors import InputError

LIMITS = (0.01, 100.0)
"""Factors between which a map is one of thickness."""
DEGREE = 3


class Thickness(Protocol):
    """A factor of heights over the plane."""

    def values(self, uv: npt.ArrayLike) -> FloatArray:
        """Return the factors (n,) at (n, 2) points of the plane."""

    def jet(self, uv: npt.ArrayLike) -> FloatArray:
        """Return the factors and their two slopes (n, 3) at (n, 2) points of the plane."""


@checked
@dataclass(frozen=True, eq=False)
class ThicknessMap:
    r"""A smooth factor of thickness over the plane, from a table of factors.

    .. math:: τ(u, v) = \sum_{ij} f_{ij}\, B(u - u_i)\, B(v - v_j)

    with B the cubic B-spline of the table's lattice, which is laid over `bounds` corner to corner: C², between the
    least and the largest factor around, and beyond the bounds as at their nearest point.

    Attributes
    ----------
    factors : (n, m) array_like
        Along, from the base to the tip, and across; 0.01 to 100.
    bounds : (2, 2) array_like
        Lower, then upper (u, v) of the area that the table is laid over.
    """

    factors: npt.ArrayLike
    bounds: npt.ArrayLike

    def __post_init__(self) -> None:
        """Refuse what is no table of factors."""
        object.__setattr__(self, "factors", as_factors(self.factors, "factors"))
        object.__setattr__(self, "bounds", as_bounds(self.bounds, 2, "bounds"))

    @property
    def most(self) -> float:
        """The largest factor."""
        return float(np.max(np.asarray(self.factors)))

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
        factors = np.pad(np.asarray(self.factors, dtype=np.float64), 2, mode="edge")
        knots = tuple(np.arange(count + DEGREE + 1) - 4.0 for count in factors.shape)
        return NdBSpline(knots, factors, DEGREE)

    def _places(self, uv: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return points of the plane in steps of the table, and steps over lengths: 0 where they lie beyond it."""
        (low, high), plane = np.asarray(self.bounds), as_points(uv, "uv", dim=2)
        steps = (np.array(np.shape(self.factors)) - 1) / (high - low)
        within = (plane >= low) & (plane <= high)
        return (np.clip(plane, low, high) - low) * steps, np.where(within, steps, 0.0)


@dataclass(frozen=True, eq=False)
class ThicknessProduct:
    """The product of two factors of thickness.

    Attributes
    ----------
    one, other : Thickness
    """

    one: Thickness
    other: Thickness

    def values(self, uv: npt.ArrayLike) -> FloatArray:
        """Return the factors (n,) at (n, 2) points of the plane."""
        return np.asarray(self.one.values(uv) * self.other.values(uv))

    def jet(self, uv: npt.ArrayLike) -> FloatArray:
        """Return the factors and their two slopes (n, 3) at (n, 2) points of the plane."""
        a, b = self.one.jet(uv), self.other.jet(uv)
        return np.concatenate([a[:, :1] * b[:, :1], a[:, 1:] * b[:, :1] + a[:, :1] * b[:, 1:]], axis=1)


def as_factors(table: npt.ArrayLike | str | PathLike[str], name: str) -> FloatArray:
    """Return a table of factors (n, m), given or read from a CSV file, or raise `InputError`."""
    factors = as_floats(read_table(table, name) if isinstance(table, str | PathLike) else table, name)
    if factors.ndim != 2 or factors.size == 0:
        raise InputError(f"{name}: has shape {factors.shape}; give a table, its rows along the leaf")
    if not (factors.min() >= LIMITS[0] and factors.max() <= LIMITS[1]):
        raise InputError(
            f"{name}: has factors from {factors.min():g} to {factors.max():g}; give numbers from {LIMITS[0]} to "
            f"{LIMITS[1]:g}, 1 for the thickness of the patch"
        )
    return factors


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
