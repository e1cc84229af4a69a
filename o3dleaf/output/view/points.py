"""Point clouds as things to draw: a small sphere at each point, lit and shadowed as a mesh is."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy.spatial import cKDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray

FINENESS = ((100, 3), (1_000, 2), (20_000, 1), (200_000, 0))
"""Up to so many points a sphere is an icosahedron, split so often: on a page of 1,600 pixels that spheres fill, edges
are within a pixel of the circle. Of more points each one is an octahedron."""

NEIGHBORS = 12
"""Points by which the plane of the cloud about each one is estimated."""


@checked
@dataclass(frozen=True, repr=False)
class Points:
    """A point cloud to draw: a scan, control points, a curve that is sampled closely.

    Attributes
    ----------
    points : (n, 3) array_like or Open3D point cloud
    radius : float, optional
        Of the sphere at each point, in the points' unit; left out, half their median distance to the nearest other.
    color : str, optional
        A color of Matplotlib for all of them; left out, the cloud's own colors, or a light brown.
    """

    points: CloudLike
    radius: Positive | None = None
    color: str | None = None

    def __repr__(self) -> str:
        options = [f"{name}={value!r}" for name, value in (("radius", self.radius), ("color", self.color)) if value]
        return f"Points({', '.join([type(self.points).__name__, *options])})"

    def positions(self) -> FloatArray:
        """Return the (n, 3) points, at least one."""
        return points_of(self.points, "points", least=1)

    def size(self, points: FloatArray) -> float:
        """Return the radius of the spheres, in the points' unit."""
        if self.radius is not None:
            return require_positive(self.radius, "radius")
        apart = cKDTree(points).query(points, k=2)[0][:, 1] if len(points) > 1 else np.zeros(1)
        apart = apart[np.isfinite(apart) & (apart > 0)]
        if not len(apart):
            raise InputError("points: are all in one place, so their size cannot be chosen; give a radius")
        return float(np.median(apart)) / 2


def make_spheres(points: FloatArray, radius: float) -> tuple[FloatArray, IntArray, IntArray]:
    """Return vertices (n · v, 3), triangles (n · t, 3) and the point of each triangle, of spheres at (n, 3) points."""
    splits = next((splits for most, splits in FINENESS if len(points) <= most), None)
    make = o3d.geometry.TriangleMesh
    ball = make.create_octahedron() if splits is None else make.create_icosahedron().subdivide_midpoint(splits)
    corners, faces = np.asarray(ball.vertices), np.asarray(ball.triangles, dtype=np.int64)
    corners = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    vertices = (points[:, np.newaxis] + radius * corners).reshape(-1, 3)
    first = len(corners) * np.arange(len(points), dtype=np.int64)
    triangles = (first[:, np.newaxis, np.newaxis] + faces).reshape(-1, 3)
    return vertices, triangles, np.repeat(np.arange(len(points)), len(faces))


def make_facets(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return small triangles in the plane of the cloud about each point, facing both sides: they show what it faces."""
    if len(points) <= 3:
        vertices, triangles, _ = make_spheres(points, 1.0)
        return vertices, triangles
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(min(NEIGHBORS, len(points))))
    normal = np.asarray(cloud.normals)
    helper = np.eye(3)[np.abs(normal).argmin(axis=1)]
    one = np.cross(normal, helper)
    other = np.cross(normal, one)
    side = 1e-3 * float(np.ptp(points, axis=0).max() or 1.0)
    vertices = np.stack([points, points + side * one, points + side * other], axis=1).reshape(-1, 3)
    front: npt.NDArray[np.int64] = np.arange(3 * len(points)).reshape(-1, 3)
    return vertices, np.concatenate([front, front[:, ::-1]])
