"""The Field protocol: the interface between fitting a function and meshing it."""

from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import require_one_column
from o3dleaf.core.lattice import Lattice


@runtime_checkable
class Field(Protocol):
    r"""A real function of d-dimensional points with a known domain; **larger inside**, F > isovalue is solid.

    Anything with these four members can be meshed, tiled or blended: a fitted interpolant, a
    synthetic truth, a function of your own.

    Attributes
    ----------
    bounds : (2, d) ndarray
        Lower, then upper corner of the domain, in `unit`. Outside, a field is finite: an interpolant goes on, a solid
        of known shape falls with the distance. A surface is closed where they cut it, whatever the field is there.
    unit : str or None
        Unit of length of the points.
    """

    @property
    def bounds(self) -> FloatArray:
        """(2, d) lower, then upper corner of the domain."""
        ...

    @property
    def unit(self) -> str | None:
        """Unit of length of the points, or None."""
        ...

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) values at (n, d) points; NaN never comes back, a NaN query is an error."""
        ...

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, d) gradients at (n, d) points, in value per `unit`."""
        ...


@runtime_checkable
class HasJets(Protocol):
    """A field that finds values and derivatives in one pass."""

    def jets(self, points: npt.ArrayLike, level: int) -> tuple[FloatArray, ...]:
        """Return values (n,), gradients (n, d), ... at (n, d) points, derivatives up to order `level`."""
        ...


@runtime_checkable
class HasRough(Protocol):
    """A field with values that cost less, and a bound of how far off they are inside its bounds."""

    @property
    def rough_error(self) -> float:
        """The most that a rough value is off; infinite where that is not known."""
        ...

    def rough(self, points: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Return the (n,) rough values at (n, d) points."""
        ...

    def rough_on(self, lattice: Lattice) -> npt.NDArray[np.float32] | None:
        """Return the rough values at a lattice's points within the bounds, if there is a faster way; else None."""
        ...


def values_and_gradients(field: Field, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the values (n,) and gradients (n, d) of a field at (n, d) points, in one pass where it can."""
    require_one_column(field, "values_and_gradients")
    if isinstance(field, HasJets):
        value, slope = field.jets(points, 1)
        return value, slope
    return np.asarray(field(points)), np.asarray(field.gradient(points))
