"""Columns of a file of points, as arrays, on the way to Open3D's point cloud."""

from dataclasses import dataclass

import numpy as np
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray

GROUPS = {"points": ("x", "y", "z"), "normals": ("nx", "ny", "nz"), "colors": ("r", "g", "b")}
"""Columns that belong together."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Coordinates, normals and colors of points, in float64.

    Attributes
    ----------
    points : (n, 3) ndarray
        As they stand in the file, in its unit.
    normals : (n, 3) ndarray or None
    colors : (n, 3) ndarray or None
        As they stand in the file: shares of 1, or of 255 or 65,535 where one is above 1 or 255.
    """

    points: FloatArray
    normals: FloatArray | None = None
    colors: FloatArray | None = None

    def to_open3d(self) -> o3d.geometry.PointCloud:
        """Return them as a legacy point cloud, which keeps float64; colors become shares of 1."""
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(self.points)))
        if self.normals is not None:
            cloud.normals = o3d.utility.Vector3dVector(np.ascontiguousarray(self.normals))
        if self.colors is not None and len(self.colors):
            largest = float(self.colors.max())
            full = 1.0 if largest <= 1 else 255.0 if largest <= 255 else 65535.0
            cloud.colors = o3d.utility.Vector3dVector(np.clip(self.colors / full, 0.0, 1.0))
        return cloud
