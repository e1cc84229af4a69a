"""An interpolant that is asked in single precision: half the time, where what that rounds cannot be seen."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.pu.interpolant import PUInterpolant


@dataclass(frozen=True, eq=False)
class SingleBlend:
    """The field of an interpolant of one column of values, its sums over the points of a ball in single precision.

    Attributes
    ----------
    exact : PUInterpolant
    near : float
        Values no larger than that are asked again, in double precision: the sides of its surface are those of the
        interpolant, and what is small is not rounding.
    """

    exact: PUInterpolant
    near: float

    def __repr__(self) -> str:
        return f"SingleBlend({self.exact!r})"

    @property
    def bounds(self) -> FloatArray:
        """(2, d) lower, then upper corner of the covered box."""
        return self.exact.bounds

    @property
    def unit(self) -> str | None:
        """Unit of length of the points, or None."""
        return self.exact.unit

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) values at (n, d) points."""
        values = self.exact(points, dtype=np.float32).astype(np.float64)
        rows = np.flatnonzero(np.abs(values) <= self.near)
        if len(rows):
            values[rows] = self.exact(np.asarray(points)[rows])
        return values

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, d) gradients at (n, d) points."""
        return self.exact.gradient(points, dtype=np.float32).astype(np.float64)

    def jets(self, points: npt.ArrayLike, level: int) -> tuple[FloatArray, ...]:
        """Return values, gradients, ... at (n, d) points, derivatives up to order `level`."""
        parts = self.exact.jets(points, level, dtype=np.float32)
        return tuple(part.astype(np.float64) for part in parts)
