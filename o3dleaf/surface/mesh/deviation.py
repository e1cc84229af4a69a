"""Distances between a mesh and what it shows: to the surface of a field, and to and from the points of a scan."""

import inspect
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d
from scipy.spatial import KDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import as_answers, require_one_column
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import IntArray, ray_scene
from o3dleaf.core.parallel import blocks, get_num_threads
from o3dleaf.core.units import check_unit, unit_scale
from o3dleaf.surface.mesh.measurements import MeshMeasurements

SUPPORT = 3.0
"""A vertex is supported if a point of the scan is within this many median spacings of the scan."""

ON_BOUNDS = 1e-6
"""Share of a mesh's size within which a vertex is on a face of a field's bounds: that of single precision in files."""

BATCH_SIZE = 2**20
"""Vertices whose distances are found together."""


@dataclass(frozen=True, eq=False, repr=False)
class Deviation:
    """Distances between a mesh and what it shows, in the mesh's unit; None where there is nothing to compare with.

    Attributes
    ----------
    to_field : (n,) ndarray or None
        Of each vertex to the field's surface. Of a closed mesh, where the field knows its
        ``signed_distance``, |signed_distance|: the rim of a leaf is no level set. Otherwise
        |F − isovalue| / |∇F|, the first step of Newton's method, at most the diagonal of the field's
        bounds; 0 on a face of the bounds where F is above the isovalue: a solid ends there. Vertices that no triangle
        uses have NaN, here and in `to_scan`.
    to_scan : (n,) ndarray or None
        Of each vertex to the nearest point of the scan.
    from_scan : (k,) ndarray or None
        Of each point of the scan to the mesh.
    spacing : float or None
        Median distance of the scan's points to their nearest neighbor.
    unsupported : float or None
        Part of the area (a third of each triangle to each corner) farther than `SUPPORT` spacings from the scan.
    unit : str or None
        The mesh's unit; that of the field if none is given.
    """

    to_field: FloatArray | None
    to_scan: FloatArray | None
    from_scan: FloatArray | None
    spacing: float | None
    unsupported: float | None
    unit: str | None

    def __repr__(self) -> str:
        means = {"field": _figure(self.to_field, "mean"), "scan": _figure(self.from_scan, "mean")}
        known = [f"mean distance to {name} {mean:.3g}" for name, mean in means.items() if mean is not None]
        return f"Deviation({', '.join([*known, f'unit {self.unit}'])})"

    @classmethod
    def of(
        cls,
        measured: MeshMeasurements,
        field: Field | None = None,
        cloud: CloudLike | None = None,
        unit: str | None = None,
        *,
        isovalue: float = 0.0,
    ) -> "Deviation":
        """Measure a mesh against a field and a scan; the arguments are those of `mesh_report`."""
        unit = check_unit(unit) or (None if field is None else check_unit(field.unit))
        to_field = None if field is None else distance_to_field(measured, field, unit, isovalue)
        if cloud is None:
            return cls(to_field, None, None, None, None, unit)
        points = points_of(cloud, "cloud", least=2)
        tree = KDTree(points)
        spacing = float(np.median(tree.query(points, 2, workers=get_num_threads())[0][:, 1]))
        to_scan = _at_used(measured, lambda some: tree.query(some, workers=get_num_threads())[0])
        weight = measured.vertex_area()
        far = float(weight[np.nan_to_num(to_scan) > SUPPORT * spacing].sum() / max(weight.sum(), np.finfo(float).tiny))
        from_scan = distance_to_mesh(measured.vertices, measured.triangles, points)
        return cls(to_field, to_scan, from_scan, spacing, far, unit)

    def figures(self) -> dict[str, Any]:
        """Return what a report says of it, by the names there."""
        parts = {
            "field_distance": (self.to_field, ("mean", "95pc", "99pc", "max")),
            "scan_distance": (self.from_scan, ("mean", "95pc", "max")),
            "support": (self.to_scan, ("median", "95pc", "max")),
        }
        figures = {f"{name}_{what}": _figure(d, what) for name, (d, whats) in parts.items() for what in whats}
        return figures | {"scan_spacing": self.spacing, "unsupported_share": self.unsupported}


def distance_to_field(measured: MeshMeasurements, field: Field, unit: str | None, isovalue: float = 0.0) -> FloatArray:
    """Return the (n,) distances of a mesh's vertices to a field's surface, in the mesh's `unit`; see `Deviation`."""
    require_one_column(field, "deviation")
    scale = unit_scale(unit, field.unit)
    exact = getattr(field, "signed_distance", None)
    if exact is not None and measured.is_closed:
        closed = {"closed": True} if "closed" in inspect.signature(exact).parameters else {}
        return _at_used(measured, lambda some: np.abs(exact(some * scale, **closed)) / scale)
    bounds = as_bounds(field.bounds, 3, "field bounds")
    farthest = float(np.linalg.norm(bounds[1] - bounds[0]))
    size = float(np.linalg.norm(measured.bounds[1] - measured.bounds[0])) * scale

    def newton(some: FloatArray) -> FloatArray:
        above = as_answers(field(some * scale), len(some)) - isovalue
        excess = np.abs(above)
        slope = np.linalg.norm(field.gradient(some * scale), axis=1)
        # Where the field is flat, the first step of Newton's method leads nowhere near.
        far = excess >= slope * farthest
        distance = np.where(far & (excess > 0), farthest, excess / np.where(slope > 0, slope, 1.0))
        on_bounds = np.abs(some[:, np.newaxis] * scale - bounds).min(axis=(1, 2)) <= ON_BOUNDS * size
        return np.where((above > 0) & on_bounds, 0.0, distance) / scale

    return _at_used(measured, newton)


def distance_to_mesh(vertices: FloatArray, triangles: IntArray, points: FloatArray) -> FloatArray:
    """Return the (k,) distances of (k, 3) points to the nearest triangle, in single precision about their middle."""
    if not len(triangles):
        return np.full(len(points), np.inf)
    scene, middle = _scene(vertices, triangles, points)
    query = o3d.core.Tensor.from_numpy((points - middle).astype(np.float32))
    return np.asarray(scene.compute_distance(query, _ray_threads()).numpy(), dtype=np.float64)


def nearest_on_mesh(vertices: FloatArray, triangles: IntArray, points: FloatArray) -> FloatArray:
    """Return the (k, 3) points on a mesh nearest to (k, 3) points, in single precision about their middle."""
    scene, middle = _scene(vertices, triangles, points)
    query = o3d.core.Tensor.from_numpy((points - middle).astype(np.float32))
    return np.asarray(scene.compute_closest_points(query, _ray_threads())["points"].numpy() + middle)


def nearest_triangles(vertices: FloatArray, triangles: IntArray, points: FloatArray) -> IntArray:
    """Return the (k,) triangles of a mesh nearest to (k, 3) points, in single precision about their middle."""
    scene, middle = _scene(vertices, triangles, points)
    query = o3d.core.Tensor.from_numpy((points - middle).astype(np.float32))
    return np.asarray(scene.compute_closest_points(query, _ray_threads())["primitive_ids"].numpy(), dtype=np.int64)


def _ray_threads() -> int:
    """Return the threads that Open3D's ray casting is given: it has no more than cores, and warns if asked for more."""
    return min(get_num_threads(), os.cpu_count() or 1)


def _scene(
    vertices: FloatArray, triangles: IntArray, points: FloatArray
) -> tuple[o3d.t.geometry.RaycastingScene, FloatArray]:
    """Return a mesh in Open3D's scene, about the middle of some points, and that middle."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return ray_scene(vertices - middle, triangles, _ray_threads()), middle


def _at_used(measured: MeshMeasurements, measure: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return `measure` at the vertices that triangles use, batch by batch, and NaN at the others."""
    rows, distance = np.flatnonzero(measured.is_used), np.full(len(measured.vertices), np.nan)
    for start, stop in blocks(len(rows), BATCH_SIZE):
        distance[rows[start:stop]] = measure(measured.vertices[rows[start:stop]])
        progress.report(stop, len(rows))
    return distance


def _figure(distance: FloatArray | None, what: str) -> float | None:
    """Return one figure of some distances, NaN left out; None where there are none."""
    known = np.empty(0) if distance is None else distance[~np.isnan(distance)]
    if not len(known):
        return None
    if what == "mean":
        return float(known.mean())
    return float(np.quantile(known, {"median": 0.5, "95pc": 0.95, "99pc": 0.99, "max": 1.0}[what]))
