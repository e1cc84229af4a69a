"""Draw the worst places of a reconstruction: sections through mesh, truth and points where they are farthest apart.

    python scripts/draw_worst.py TRUTH.ply [--points 10000] [--noise 0.005] [--mesh MADE.ply] [-o worst.png]

The truth is a closed mesh; points are drawn on it by area, with noise in shares of its diagonal (noisy points get
normals estimated, facing as the truth does), and reconstructed by `create_from_point_cloud_rbfpu`, unless a mesh of
another hand, made of the same points, is given. Both directions count: what the mesh invents, and what it lacks. Places
are five spacings apart at least; each is printed with its distance in spacings, and drawn in the plane of the error and
of the direction in which the truth's normals turn most around it.
"""

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
import open3d as o3d
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.spatial import KDTree
from surface_errors import sample_triangles

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import mesh_arrays, triangle_areas
from o3dleaf.surface.mesh.deviation import nearest_on_mesh

SAMPLES = 300_000
APART = 5.0
HALF = 5.0
"""Half the width of a picture, in spacings."""
NEAR_PLANE = 0.7
"""Spacings within which points are drawn."""


def cloud_on(vertices, triangles, count, noise, seed=0):
    """Return points on a mesh with normals, and their spacing."""
    rng = np.random.default_rng([count, seed])
    points, normals = sample_triangles(vertices, triangles, count, rng)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    if noise:
        sigma = noise * np.linalg.norm(np.ptp(vertices, axis=0))
        cloud.points = o3d.utility.Vector3dVector(points + sigma * rng.normal(size=points.shape))
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
        found = np.array(cloud.normals)
        normals = np.where((found * normals).sum(axis=1)[:, np.newaxis] < 0, -found, found)
    cloud.normals = o3d.utility.Vector3dVector(normals)
    return cloud, np.sqrt(triangle_areas(vertices, triangles).sum() / count)


def worst(made, truth, spacing, count):
    """Return the worst places: (distance, from, to, what)."""
    rng, found = np.random.default_rng(1), []
    for one, other, what in ((made, truth, "invented"), (truth, made, "lacking")):
        places = np.concatenate([sample_triangles(*one, SAMPLES, rng)[0], one[0][np.unique(one[1])]])
        feet = nearest_on_mesh(*other, places)
        distance = np.linalg.norm(places - feet, axis=1)
        rows = np.argsort(-distance)[: len(distance) // 50]
        found += [(distance[row], places[row], feet[row], what) for row in rows]
    found.sort(key=lambda each: -each[0])
    chosen = []
    for each in found:
        if all(np.linalg.norm(each[1] - other[1]) > APART * spacing for other in chosen):
            chosen.append(each)
        if len(chosen) == count:
            break
    return chosen


def section(mesh, origin, frame, reach):
    """Return the (n, 2, 2) lines in which a plane, the first two rows of a frame, cuts a mesh near a place."""
    vertices, triangles = mesh
    local = (vertices - origin) @ frame.T
    near = triangles[(np.abs(local[triangles]).min(axis=1) < reach).all(axis=1)]
    corners = local[near]
    above = corners[:, :, 2] > 0
    corners, above = (part[(above.sum(axis=1) % 3) > 0] for part in (corners, above))
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    a, b, c = (corners[np.arange(len(corners)), (lone + k) % 3] for k in range(3))
    ends = [a + (a[:, 2] / (a[:, 2] - other[:, 2]))[:, np.newaxis] * (other - a) for other in (b, c)]
    return np.stack(ends, axis=1)[:, :, :2]


def frame_of(place, foot, truth):
    """Return axes: the error's, that in which normals turn most around it, and the section's normal."""
    towards = (place - foot) / np.linalg.norm(place - foot)
    points, normals = truth
    turning = normals[KDTree(points).query(foot, 60)[1]]
    turning -= np.outer(turning @ towards, towards)
    across = np.linalg.svd(turning)[2][0]
    return np.stack([across, towards, np.cross(across, towards)])


def draw(places, made, truth, points, spacing, path):
    """Draw a picture of each place into one file."""
    sampled = sample_triangles(*truth, SAMPLES, np.random.default_rng(2))
    figure = Figure(figsize=(15, 6.6), layout="constrained")
    for k, (distance, place, foot, what) in enumerate(places):
        frame, axes = frame_of(place, foot, sampled), figure.add_subplot(2, 5, k + 1)
        for mesh, color, width in ((truth, "black", 1.6), (made, "tab:red", 1.0)):
            lines = section(mesh, place, frame, HALF * spacing) / spacing
            axes.add_collection(LineCollection(lines, colors=color, linewidths=width))
        local = (points - place) @ frame.T / spacing
        local = local[np.abs(local[:, 2]) < NEAR_PLANE]
        axes.plot(local[:, 0], local[:, 1], ".", color="tab:blue", markersize=3)
        axes.plot([0, 0], [0, -distance / spacing], color="tab:green", linewidth=2)
        axes.set(xlim=(-HALF, HALF), ylim=(-HALF, HALF), aspect="equal", xticks=[], yticks=[])
        axes.set_title(f"{k + 1}: {what}, {distance / spacing:.2f} spacings", fontsize=9)
        position = " ".join(f"{x:.4g}" for x in place)
        print(f"{k + 1:3d}  {what:9s} {distance / spacing:6.2f} spacings at {position}")
    figure.suptitle("black: truth, red: mesh, blue: points near the plane, green: error", fontsize=9)
    figure.savefig(path, dpi=110)


def main():
    """Run as a program."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("truth", type=Path)
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--noise", type=float, default=0.0, help="share of the diagonal")
    parser.add_argument("--mesh", type=Path, help="a mesh made of the same points")
    parser.add_argument("--count", type=int, default=10, choices=range(1, 11))
    parser.add_argument("-o", "--output", type=Path, default=Path("worst.png"))
    options = parser.parse_args()
    mpl.use("Agg")
    solid = o3d.io.read_triangle_mesh(str(options.truth))
    solid.remove_duplicated_vertices()
    solid.remove_degenerate_triangles()
    vertices, triangles = mesh_arrays(solid)
    turned = (
        np.einsum("ij,ij->", vertices[triangles[:, 0]], np.cross(*vertices[triangles[:, 1:]].transpose(1, 0, 2))) < 0
    )
    truth = vertices, triangles[:, ::-1] if turned else triangles
    cloud, spacing = cloud_on(*truth, options.points, options.noise)
    made = o3d.io.read_triangle_mesh(str(options.mesh)) if options.mesh else None
    made = mesh_arrays(made or o3l.create_from_point_cloud_rbfpu(cloud, measure=None)[0])
    draw(worst(made, truth, spacing, options.count), made, truth, np.asarray(cloud.points), spacing, options.output)


if __name__ == "__main__":
    main()
