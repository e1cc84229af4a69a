"""Oriented clouds to reconstruct: samples of solids with known truth, clean and noisy, and real scans."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import open3d as o3d
from leaf_errors import spacing_of
from peers import cloud_of
from scipy.spatial import KDTree
from surface_errors import errors_to_scan, errors_to_truth, shape_of

import o3dleaf as o3l

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
SOLIDS = {
    "sphere": o3l.samples.Sphere,
    "torus": o3l.samples.Torus,
    "sheet": o3l.samples.WavySheet,
    "block": o3l.samples.Block,
    "figure": o3l.samples.Figure,
    "fins": o3l.samples.fins,
    "gap": o3l.samples.gap,
    "fold": o3l.samples.fold,
    "bumps": o3l.samples.bumps,
}
MESHES = {"horse": "solids/horse.ply", "lucy": "solids/lucy.ply"}
SCANS = {
    # File, and whether the surface has a border.
    "homer": ("oriented/homer.ply", False),
    "tori": ("oriented/interlocked_tori.ply", False),
    "soybean": ("leaves/soybean_with_normals.ply", True),
    "sugarbeet": ("leaves/sugarbeet.ply", True),
    "wheat": ("wheat/wheat_leaf.ply", True),
}
NEIGHBOURS = 30
"""Points that a normal is estimated from."""
AT_ODDS = 0.05
"""Part of neighbours beyond which the normals of a scan are not used: homer has 0.9 %, soybean 13 %."""
HELD_OUT = 0.1
FINEST = 10
"""On clean clouds the F-score counts what is within the spacing over this."""


@dataclass
class Case:
    """A cloud, and how a mesh of it is judged: `errors(vertices, triangles)` returns the figures.

    Without normals, `normals` are for the peers: Open3D's, made consistent by its minimum spanning tree. `euler` is
    V − E + F of the truth, None where that is not known.
    """

    shape: str
    noise: float
    points: np.ndarray
    normals: np.ndarray
    spacing: float
    is_open: bool
    errors: Callable
    euler: int | None = None
    oriented: bool = True


def synthetic(shape, count, noise, normals="auto", samples=None):
    """Return a case of a solid, or of a file of a closed mesh; noise is in parts of the diagonal of the clean box."""
    solid = solid_of(shape)
    points, facing = solid.sample(count)
    amount = noise * np.linalg.norm(np.ptp(points, axis=0))
    points = points + amount * np.random.default_rng([count, 17]).normal(size=points.shape)
    if normals == "none":
        facing = made_consistent(points)
    elif normals == "estimated" or (normals == "auto" and noise):
        facing = estimated(points, solid.closest(points).normals)
    spacing = float(np.sqrt(solid.area / count))
    more = {"samples": samples} if samples else {}
    errors = partial(errors_to_truth, solid=solid, threshold=max(spacing / FINEST, amount), **more)
    name, oriented = Path(shape).stem, normals != "none"
    return Case(name, noise, points, facing, spacing, False, errors, euler_of(shape), oriented)


@cache
def solid_of(shape):
    """Return a solid, made once: its mesh and its trees are kept."""
    if shape in SOLIDS:
        return SOLIDS[shape]()
    return o3l.samples.MeshSolid.of(o3d.io.read_triangle_mesh(str(SHARED / MESHES.get(shape, shape))))


def euler_of(shape):
    """Return V − E + F of a solid's surface: 2 of those made here, but the torus."""
    if shape in SOLIDS:
        return 0 if shape == "torus" else 2
    return shape_of(solid_of(shape).vertices, solid_of(shape).triangles)["euler"]


def made_consistent(points):
    """Return the normals that a user of Open3D's gets for a cloud without any."""
    cloud = cloud_of(points, np.zeros_like(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    cloud.orient_normals_consistent_tangent_plane(NEIGHBOURS)
    return np.array(cloud.normals)


def estimated(points, sides):
    """Return PCA normals of a cloud, on the side that `sides` point to: what a known viewpoint tells a user."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    normals = np.array(cloud.normals)
    return np.where((normals * sides).sum(axis=1)[:, np.newaxis] < 0, -normals, normals)


def scanned(shape, samples=None):
    """Return a case of a real scan: nine tenths of its points to reconstruct from, the others to judge by."""
    file, is_open = SCANS[shape]
    cloud = o3l.read_point_cloud(SHARED / file)
    points = np.unique(np.column_stack([np.asarray(cloud.points), facing_of(cloud)]), axis=0)
    order = np.random.default_rng(0).permutation(len(points))
    held_out, kept = np.split(order, [round(HELD_OUT * len(points))])
    used = np.ascontiguousarray(points[np.sort(kept)])
    spacing = spacing_of(used[:, :3])
    more = {"samples": samples} if samples else {}
    scan = np.ascontiguousarray(points[:, :3]), points[:, 3:]
    errors = partial(errors_to_scan, scan=scan, held_out=points[held_out, :3], threshold=spacing, **more)
    return Case(shape, 0.0, used[:, :3].copy(), used[:, 3:].copy(), spacing, is_open, errors)


def facing_of(cloud):
    """Return a scan's own normals; if they are not there or at odds, PCA normals made consistent by Open3D."""
    if not cloud.has_normals() or at_odds(np.asarray(cloud.points), np.asarray(cloud.normals)) > AT_ODDS:
        return made_consistent(np.asarray(cloud.points))
    normals = np.asarray(cloud.normals)
    return normals / np.linalg.norm(normals, axis=1)[:, np.newaxis]


def at_odds(points, normals, neighbours=6):
    """Return the part of pairs of neighbours whose normals point to opposite sides."""
    rows = KDTree(points).query(points, neighbours + 1)[1][:, 1:]
    return float(np.mean((normals[:, np.newaxis] * normals[rows]).sum(axis=2) < 0))
