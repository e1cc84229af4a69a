"""The frame of an impact: x along the leaf, y across, z its normal, the origin at the mean height of the surface."""

from dataclasses import dataclass, replace

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.blade.blade import Blade


@dataclass(frozen=True, eq=False)
class ImpactFrame:
    """A right-handed orthonormal frame at a place of the blade.

    Attributes
    ----------
    origin : (3,) ndarray
        In the world, in its unit.
    axes : (3, 3) ndarray
        Rows are x, y and z in the world.
    """

    origin: FloatArray
    axes: FloatArray

    @classmethod
    def at(cls, blade: Blade, place: tuple[float, float]) -> "ImpactFrame":
        """Return the frame on the blade, at (along, across): z its unit normal, on the side of growing heights."""
        lifted = blade.lift_with_jacobian(np.array([[*place, 0.0]]))
        along, across, up = lifted.columns[0]
        normal = np.cross(along, across)
        normal *= np.sign(normal @ up) / np.linalg.norm(normal)
        first = along - (along @ normal) * normal
        first /= np.linalg.norm(first)
        return cls(lifted.world[0], np.array([first, np.cross(normal, first), normal]))

    def raised(self, height: float) -> "ImpactFrame":
        """Return the frame moved along its z."""
        return replace(self, origin=self.origin + height * self.axes[2])

    def to_local(self, points: FloatArray) -> FloatArray:
        """Return (n, 3) points of the world in the frame."""
        return np.asarray((points - self.origin) @ self.axes.T)

    def turn(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return the components of a vector of the world in the frame."""
        x, y, z = (self.axes @ np.asarray(vector, dtype=np.float64)).tolist()
        return x, y, z


def mean_height(vertices: FloatArray, triangles: IntArray) -> float:
    """Return the mean z of an open surface over the plane, ∫ z dA_z / ∫ dA_z, what overhangs counted with its sign."""
    corners = vertices[triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return float(area @ corners[:, :, 2].mean(axis=1) / area.sum())
