"""The factor of a blade's thickness, from a map that the user gives: thin at the tip, thick along the midrib."""

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.leaf.texture.table_map import TableMap, as_table

LIMITS = (0.01, 100.0)
"""Factors between which a map is one of thickness."""


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
        return self._map.values(uv)

    def jet(self, uv: npt.ArrayLike) -> FloatArray:
        """Return τ, ∂τ/∂u and ∂τ/∂v (n, 3) at (n, 2) points of the plane."""
        return self._map.jet(uv)

    @cached_property
    def _map(self) -> TableMap:
        return TableMap(np.asarray(self.factors), np.asarray(self.bounds))


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
    return as_table(table, name, LIMITS, "1 for the thickness of the patch")
