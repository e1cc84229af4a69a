"""A lattice of whole multiples of a step whose outermost points lie on the faces of a box, where they are to."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import require_resources

SHARE = 0.25
"""A point nearer to a face than this share of a step goes onto it; else it gets one more beside it. So the cells at a
face are a quarter of a step thick at least, without slivers, and five quarters at most."""


@dataclass(frozen=True, eq=False)
class BoxedLattice:
    """A lattice that ends on the faces of a box that it is `cut` at, and covers the others as `Lattice.covering` does.

    Attributes
    ----------
    lattice : Lattice
        Before its outermost points were moved.
    box : (2, 3) ndarray
    cut : (2, 3) ndarray of bool
        The faces that it ends on: lower, then upper ones.
    """

    lattice: Lattice
    box: FloatArray
    cut: BoolArray

    @classmethod
    def covering(cls, box: FloatArray, step: FloatArray, cut: BoolArray) -> "BoxedLattice":
        """Return the lattice over a box.

        Raises
        ------
        MemoryBudgetError
            If there would be too many points.
        """
        # A corner that is a multiple but for rounding must not cost a layer more.
        share = np.where(cut, SHARE, 1e-9)
        first, last = np.floor(box[0] / step + share[0]), np.ceil(box[1] / step - share[1])
        last = np.maximum(last, first + 1.0)
        count = last - first + 1.0
        lattice = Lattice(tuple((first * step).tolist()), tuple(step.tolist()), tuple(int(n) for n in count))
        what, cure = f"spacing: {lattice.size:,} lattice points", "crop the box or coarsen it"
        require_resources(measured.LATTICE_POINT * lattice.size, what, cure, step=float(step.max()), power=3)
        return cls(lattice, box, cut)

    def sample(self, field: Callable[[FloatArray], npt.NDArray[Any]]) -> FloatArray:
        """Return the (nx, ny, nz) values of a field at the points."""
        return sample_lattice(lambda points: field(self._moved(points)), self.lattice)

    @property
    def moved(self) -> BoolArray:
        """(nx, ny, nz) which points were moved onto a face."""
        which = np.zeros(self.lattice.shape, dtype=bool)
        for side, axis in zip(*np.nonzero(self.cut & (self.box != self.lattice.bounds)), strict=True):
            np.moveaxis(which, axis, 0)[-side] = True
        return which

    def points(self, indices: npt.NDArray[np.int64]) -> FloatArray:
        """Return the (n, 3) positions of (n, 3) points, to the last bit those that `sample` asks for."""
        return self._moved(self.lattice.positions(indices))

    def is_within(self, bounds: FloatArray) -> bool:
        """Return whether all points lie in a box."""
        low, high = self.points(np.array([np.zeros(3), np.array(self.lattice.shape) - 1.0], dtype=np.int64))
        return bool(np.all((low >= bounds[0]) & (high <= bounds[1])))

    def _moved(self, points: FloatArray) -> FloatArray:
        """Return points of the lattice with the outermost ones on their faces."""
        low, high = self.lattice.bounds
        half = np.asarray(self.lattice.spacing) / 2
        for axis in range(3):
            x = points[:, axis]
            if self.cut[0, axis]:
                x[x < low[axis] + half[axis]] = self.box[0, axis]
            if self.cut[1, axis]:
                x[x > high[axis] - half[axis]] = self.box[1, axis]
        return points

    def positions(self, coordinates: FloatArray) -> FloatArray:
        """Return the (n, 3) positions of (n, 3) lattice coordinates; those of a face lie on it to the last bit."""
        points, ticks = self.lattice.positions(coordinates), self.lattice.positions
        for axis in range(3):
            c, last = coordinates[:, axis], self.lattice.shape[axis] - 1
            low, beside = self.box[0, axis], float(ticks([1.0] * 3)[axis])
            high, before = self.box[1, axis], float(ticks([last - 1.0] * 3)[axis])
            lower, upper = self.cut[:, axis]
            if last == 1:
                beside, before = (high if upper else beside), (low if lower else before)
            if upper:
                rows = c > last - 1
                share = c[rows] - (last - 1)
                points[rows, axis] = np.where(share == 1.0, high, before + share * (high - before))
            if lower:
                rows = c < 1
                points[rows, axis] = low + c[rows] * (beside - low)
        return points
