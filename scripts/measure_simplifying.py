"""Measure triangles that cross others after simplifying open meshes with long rims, and thin closed ones.

    python scripts/measure_simplifying.py [--shares 1 1.2 1.5 3] [--real CLOUD ...]

A round sheet rolled up in two turns, one of a wavy rim in four, sheets with 12 and 40 holes, lenses 1 and 3 steps
thick, which bend, and the surfaces of real clouds, 12 balls of a fortieth of their size taken out of each. Each comes
down to so many triangles for an edge of its rim (closed ones: to a hundredth and a tenth). Printed are the triangles
asked for; those made by MeshLab's collapses alone, those that cross others, and the seconds of the processor; and the
same with `simplify_mesh`, whether its rim is that of the mesh bit for bit, and the distance to it in its mean edges.
"""

import argparse
import time
import warnings
from pathlib import Path

import numpy as np
import open3d as o3d

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import drop_unused_vertices, mesh_arrays, triangle_areas
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.repair.meshlab import collapse_edges

MOST, HOLES, RADIUS, QUALITY = 20_000, 12, 1 / 40, 0.3


def grid(count):
    """Return u and v of a square of so many vertices a side, from -1 to 1, and its triangles."""
    ticks = np.linspace(-1, 1, count)
    u, v = (each.ravel() for each in np.meshgrid(ticks, ticks, indexing="ij"))
    rows = np.arange(count * count).reshape(count, count)
    a, b, c, d = (each.ravel() for each in (rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]))
    return u, v, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def scroll(count, turns, gap, wave):
    """Return a round sheet, rolled up, with 17 waves of its rim."""
    u, v, triangles = grid(count)
    angle, radius = np.pi * turns * u, 1 + gap * u
    x, y = u[triangles].mean(axis=1), v[triangles].mean(axis=1)
    kept = np.hypot(x, y) < 0.95 * (1 - wave + wave * np.cos(17 * np.arctan2(y, x)))
    return drop_unused_vertices(
        np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 3 * v]), triangles[kept]
    )


def sieve(count, holes, seed):
    """Return an undulating sheet with round holes in random places."""
    u, v, triangles = grid(count)
    rng = np.random.default_rng(seed)
    centers, radii = rng.uniform(-0.9, 0.9, (holes, 2)), rng.uniform(0.04, 0.15, holes)
    middles = np.column_stack([u, v])[triangles].mean(axis=1)
    kept = (np.linalg.norm(middles[:, np.newaxis] - centers, axis=2) > radii).all(axis=1)
    return drop_unused_vertices(np.column_stack([u, v, 0.3 * np.sin(3 * u) * np.cos(4 * v)]), triangles[kept])


def lens(steps, step=0.03):
    """Return a closed bent lens, so many steps thick."""

    class Lens:
        """Its field."""

        unit, bounds = None, np.array([[-1.2, -1.2, -0.6], [1.2, 1.2, 0.6]])

        def __call__(self, p):
            """Return 1 - x² - y² less the square of the height over the half thickness."""
            height = (p[:, 2] - 0.3 * np.sin(4 * p[:, 0])) / (steps * step / 2)
            return 1 - p[:, 0] ** 2 - p[:, 1] ** 2 - height**2

        def gradient(self, p):
            """Return the gradient."""
            half = steps * step / 2
            height = (p[:, 2] - 0.3 * np.sin(4 * p[:, 0])) / half
            slope = 2 * height / half
            return np.column_stack([-2 * p[:, 0] + slope * 1.2 * np.cos(4 * p[:, 0]), -2 * p[:, 1], -slope])

    return mesh_arrays(o3l.extract_isosurface(Lens(), step))


def real(path):
    """Return the surface of a cloud with holes."""
    points, rng = np.asarray(o3d.io.read_point_cloud(str(path)).points), np.random.default_rng(0)
    points = points[rng.permutation(len(points))[:MOST]]
    centers = points[rng.choice(len(points), HOLES, replace=False)]
    apart = np.linalg.norm(points[:, np.newaxis] - centers, axis=2).min(axis=1)
    points = points[apart > RADIUS * np.linalg.norm(np.ptp(points, axis=0))]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mesh_arrays(o3l.create_from_point_cloud_rbfpu(points, closed=False, measure=None)[0])


def rim(vertices, triangles):
    """Return the places of the vertices on the border."""
    edges = EdgeTable.of(triangles)
    return {tuple(each) for each in vertices[np.unique(edges.ends[edges.count == 1])]}


def show(name, mesh, shares):
    """Print the figures of one mesh."""
    vertices, triangles = mesh
    report = o3l.mesh_report(mesh)
    edges, count = report.boundary_edges, len(triangles)
    print(f"{name}: {count:,} triangles, {edges:,} edges of the rim, {report.self_intersections} cross")
    length = float(np.sqrt(triangle_areas(vertices, triangles).mean() * 4 / 3**0.5))
    for asked in [int(share * edges) for share in shares] if edges else [count // 100, count // 30, count // 10]:
        start = time.process_time()
        plain = collapse_edges((vertices, triangles, np.zeros(count, dtype=np.int64)), asked, QUALITY)[:2]
        between = time.process_time()
        ours = mesh_arrays(o3l.simplify_mesh(mesh, target_triangles=asked))
        seconds = between - start, time.process_time() - between
        crossing = [o3l.mesh_report(each).self_intersections for each in (plain, ours)]
        print(
            f"    {asked:7,} asked: {len(plain[1]):7,}, {crossing[0]:4} cross, {seconds[0]:5.2f} s; "
            f"{len(ours[1]):7,} ({len(ours[1]) / asked:.2f}), {crossing[1]} cross, {seconds[1]:5.2f} s, "
            f"rim {'kept' if rim(*ours) == rim(*mesh) else 'CHANGED'}, "
            f"off by {o3l.surface_distance(mesh, ours) / length:.2f}",
            flush=True,
        )


def main():
    """Measure all meshes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shares", type=float, nargs="+", default=[1, 1.2, 1.5, 3], help="triangles for a rim's edge")
    parser.add_argument("--real", type=Path, nargs="*", default=[], help="clouds")
    arguments = parser.parse_args()
    show("scroll", scroll(81, 2, 0.3, 0.0), arguments.shares)
    show("wavy scroll", scroll(121, 4, 0.15, 0.1), arguments.shares)
    show("12 holes", sieve(161, 12, 0), arguments.shares)
    show("40 holes", sieve(241, 40, 1), arguments.shares)
    for steps in (1, 3):
        show(f"lens of {steps} steps", lens(steps), arguments.shares)
    for path in arguments.real:
        show(path.stem, real(path), arguments.shares)


if __name__ == "__main__":
    main()
