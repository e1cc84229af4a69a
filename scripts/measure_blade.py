"""Measure the paper's blade of the real wheat leaf: the figures of the docs, for the midrib picked and the one found.

    python scripts/measure_blade.py [SCAN MIDRIB] [--spacing 0.2]

Precision is the share of the surface within two median point spacings of a scan point, recall the
share of scan points that near the surface, F their harmonic mean. What is fitted is measured on the
points that it was fitted to; `tests/leaf/macro/test_height.py` measures against a known truth.
"""

import argparse
from pathlib import Path

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

import o3dleaf as o3l

WHEAT = Path(__file__).resolve().parents[2] / "shared" / "data" / "wheat"


REACH = 4.0
"""Half the length, in mm, over which the scan's extent across is taken for the local width."""


def farthest(scan, midrib, other):
    """Largest distance from one midrib to points of the other, in local half widths of the scan about the first."""
    frame, axis = (o3l.LeafFrame.fit(scan, control, unit="mm") for control in (midrib, other))
    leaf = frame.to_leaf(np.asarray(scan.points))
    along = frame.to_leaf(axis.stations(np.linspace(0, axis.length, 200))[0])
    away = np.linalg.norm(along[:, 1:], axis=1)
    near = [leaf[np.abs(leaf[:, 0] - t) <= REACH, 1] for t in along[:, 0]]
    return max(gap / (np.ptp(np.quantile(across, (0.02, 0.98))) / 2) for gap, across in zip(away, near, strict=True))


def measure(scan, midrib, spacing):
    points = np.asarray(scan.points)
    blade = o3l.create_blade(scan, midrib, unit="mm", options=o3l.BladeOptions(frame="paper"))
    mesh = blade.extract_mesh(spacing)
    near = 2 * float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))
    o3d.utility.random.seed(0)
    precision = np.mean(cKDTree(points).query(np.asarray(mesh.sample_points_uniformly(200_000).points))[0] <= near)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    recall = np.mean(scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy() <= near)
    plane = blade.flatten(np.asarray(mesh.vertices))[:, :2]
    slope = np.linalg.norm(blade.height_map.gradient(plane), axis=1)
    report = o3l.mesh_report(mesh, unit="mm")
    return {
        "area mm²": report.area,
        "F": 2 * precision * recall / (precision + recall),
        "precision": precision,
        "recall": recall,
        "99 % slope": np.percentile(slope, 99),
        "bandwidth mm": blade.height_map.choice.bandwidth,
        "scan noise mm": blade.height_map.choice.noise,
        "alpha mm": blade.outline.alpha,
        "least thickness": blade.distortion().thickness.min(),
        "least Jacobian": blade.frame_quality(scan).least_jacobian,
        "components": report.components,
        "holes": report.holes,
        "manifold": report.manifold,
        "self-intersections": report.self_intersections,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", default=[WHEAT / "wheat_leaf.ply", WHEAT / "wheat_leaf_midrib.ply"])
    parser.add_argument("--spacing", type=float, default=0.2, help="mesh step in mm")
    options = parser.parse_args()
    scan, midrib = (o3l.read_point_cloud(file, least=2) for file in options.files)
    picked, found = (measure(scan, control, options.spacing) for control in (midrib, None))
    print(f"{'':>20}{'picked midrib':>16}{'found midrib':>16}")
    for name, value in picked.items():
        print(f"{name:>20}{value:>16.4g}{found[name]:>16.4g}")
    control = o3l.find_midrib(scan)
    there, back = farthest(scan, midrib, control), farthest(scan, control, midrib)
    print(
        f"the found midrib is within {there:.2f} local half widths of the picked one, and that within {back:.2f} of it"
    )


if __name__ == "__main__":
    main()
