"""The values of a lattice's voxels, read ball by ball from where they lie."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray


@dataclass(frozen=True, eq=False)
class VoxelValues:
    """The data of a lattice: read where they lie, as float64 less the isovalue, ball by ball.

    Attributes
    ----------
    data : ndarray
        Of any layout; a mapped file stays one.
    isovalue : float
    """

    data: npt.NDArray[Any]
    isovalue: float

    @classmethod
    def of_array(cls, data: npt.NDArray[Any], isovalue: float) -> "VoxelValues":
        """Return the values of an array, copied only where it runs backwards, or is a part of records."""
        lies = min(data.strides) > 0 and not any(stride % data.itemsize for stride in data.strides)
        return cls(data if lies else np.ascontiguousarray(data), isovalue)

    @cached_property
    def _stride(self) -> IntArray:
        """(d,) numbers from a voxel to the next along each axis."""
        return np.array(self.data.strides) // self.data.itemsize

    @cached_property
    def _flat(self) -> npt.NDArray[Any]:
        """All numbers from the first voxel to the last, as they lie in memory or in the file."""
        last = int((np.array(self.data.shape) - 1) @ self._stride)
        return np.lib.stride_tricks.as_strided(self.data, (last + 1,), (self.data.itemsize,), writeable=False)

    @property
    def slowest(self) -> int:
        """The axis along which voxels lie farthest apart."""
        return int(np.argmax(self._stride))

    def of(self, starts: IntArray, voxels: IntArray) -> FloatArray:
        """Return the (m, n) values of balls whose tiles start at (m, d), of `voxels` (n, d) counted from there."""
        places = (starts @ self._stride)[:, np.newaxis] + voxels @ self._stride
        values: FloatArray = self._flat[places].astype(np.float64)
        values -= self.isovalue
        return values
