"""Clouds without normals, of thin parts under noise: at which scale they are a surface, and how many sides are right.

python scripts/measure_sides.py [--points N] [--noise SHARE ...] [--seeds N] [--first SEED] [--wires] [--meshes]
                                  [--rounded]

Flatness is that of neighborhoods of sixteen points, and of twelve over it; balls and boxes that points fill are there
to compare with. Noise is in shares of the diagonal; a side is right where a normal faces as the solid's does at the
nearest place. With --wires, instead: three wires in a row, and one among six, by their radius, gaps and noise in
spacings; right is the mean of all seeds, and the least. With --meshes, too, how many of their surfaces are not of as
many pieces without handles as there are wires, and how many of these without a word. With --rounded, instead: solids
whose coordinates along one axis, or a turned one, are rounded to steps, in spacings; right is the share of the normals,
the error is the mean of the mesh's vertices in spacings of the cloud, beside its components, genus and rim edges, and
how many lines say that coordinates are rounded.
"""

import argparse
import warnings

import numpy as np
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import FEW, flatness_of

SOLIDS = ("fold", "fins", "gap", "bumps")
FILLED = ("ball", "box")
WIRES = [(1.5, 1.0), (1.5, 2.0), (1.5, 3.0), (2.0, 1.0), (2.0, 2.0), (3.0, 1.0)]
"""Radius and gap."""
WIRE_NOISE, WIRE_LENGTH = (0.0, 0.2, 0.4), 40.0
ROUNDED, STEPS = ("Sphere", "Torus", "bumps", "Block", "Figure", "gap"), (0.0, 1.0, 1.5, 2.0, 2.5, 4.0)
DIRECTIONS = {"z": np.array([0.0, 0.0, 1.0]), "turned": np.array([2.0, 3.0, 6.0]) / 7}
TURN = np.arange(6) * np.pi / 3
PLACES = {
    "row of three": np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]),
    "one among six": np.vstack([[[0.0, 0.0]], np.column_stack([np.cos(TURN), np.sin(TURN)])]),
}
"""Of wires, in distances between their axes."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.002, 0.005], help="of the box's diagonal")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--wires", action="store_true", help="wires side by side instead")
    parser.add_argument("--first", type=int, default=0, help="seed of the wires' first cloud")
    parser.add_argument("--meshes", action="store_true", help="reconstruct the wires, too")
    parser.add_argument("--rounded", action="store_true", help="coordinates rounded to steps instead")
    args = parser.parse_args()
    if args.rounded:
        measure_rounded(args.points, range(args.first, args.first + args.seeds))
        return
    if args.wires:
        measure_wires(range(args.first, args.first + args.seeds), meshes=args.meshes)
        return
    table = Table(title="Sides of clouds without normals")
    for name in ("cloud", "noise", "seed", "flatness", "of twelve", "thinned", "planes of", "right"):
        table.add_column(name)
    for kind in FILLED:
        for seed in range(args.seeds):
            table.add_row(kind, "-", str(seed), *scale_of(filled(kind, args.points, seed)), "-")
    for kind in SOLIDS:
        solid = getattr(o3l.samples, kind)()
        exact, _ = solid.sample(args.points)
        for noise in args.noise:
            sigma = noise * np.linalg.norm(np.ptp(exact, axis=0))
            for seed in range(args.seeds):
                points = exact + sigma * np.random.default_rng(seed).normal(size=exact.shape)
                table.add_row(kind, f"{noise:.1%}", str(seed), *scale_of(points), share_right(solid, points))
    Console(width=100).print(table)


def measure_wires(seeds, *, meshes):
    """Print which share of the normals of wires side by side is right, and how many surfaces join or tear wires."""
    table = Table(title="Wires side by side, a point per unit area")
    for name in ("wires", "radius", "gap", "noise", "right", "least", *(("wrong", "untold") if meshes else ())):
        table.add_column(name)
    total = np.zeros(2, dtype=int)
    for kind, places in PLACES.items():
        for radius, gap in WIRES:
            solid = o3l.samples.Wires(tuple(map(tuple, places * (2 * radius + gap))), radius, WIRE_LENGTH)
            for noise in WIRE_NOISE:
                clouds = [noisy_wires(solid, noise, seed) for seed in seeds]
                shares = [right_of_wires(*cloud) for cloud in clouds]
                row = [kind, radius, gap, noise, f"{np.mean(shares):.1%}", f"{np.min(shares):.1%}"]
                if meshes:
                    found = np.sum([faults_of_wires(points, len(places)) for points, _ in clouds], axis=0)
                    total += found
                    row += list(found)
                table.add_row(*map(str, row))
    Console(width=100).print(table)
    if meshes:
        bundles = len(PLACES) * len(WIRES) * len(WIRE_NOISE) * len(seeds)
        print(f"Of {bundles} surfaces {total[0]} are wrong, {total[1]} without a word")


def noisy_wires(solid, noise, seed):
    """Return a point per unit area of wires, with noise, and the normals where they came from."""
    points, normals = solid.sample(round(solid.area), seed)
    return points + noise * np.random.default_rng(seed).normal(size=points.shape), normals


def right_of_wires(points, facing):
    """Return the share of right normals of wires, 0 where they are refused."""
    try:
        normals = o3l.orient_normals(points).normals
    except O3DLeafError:
        return 0.0
    return np.mean(np.einsum("ij,ij->i", normals, facing) > 0)


def faults_of_wires(points, count):
    """Return whether the surface is not of so many pieces without handles, and whether it is so without a word."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            report = o3l.mesh_report(o3l.create_from_point_cloud_rbfpu(points)[0])
        except O3DLeafError:
            return 1, 0
    wrong = (report.components, report.genus, report.boundary_edges) != (count, 0, 0)
    return int(wrong), int(wrong and not told)


def measure_rounded(count, seeds):
    """Print what comes of solids whose coordinates along a direction are rounded to steps."""
    table = Table(title="Coordinates rounded to steps, in spacings")
    for name in ("solid", "along", "step", "seed", "right", "parts, genus, rim", "error", "told"):
        table.add_column(name)
    for kind in ROUNDED:
        solid = getattr(o3l.samples, kind)()
        spacing = np.sqrt(solid.area / count)
        for along, direction in DIRECTIONS.items():
            for step in STEPS:
                for seed in seeds:
                    points, _ = solid.sample(count, seed)
                    heights = points @ direction
                    if step:
                        rounded = np.round(heights / (step * spacing)) * step * spacing
                        points = points + np.outer(rounded - heights, direction)
                    table.add_row(kind, along, str(step), str(seed), *row_of_rounded(solid, points, spacing))
    Console(width=100).print(table)


def row_of_rounded(solid, points, spacing):
    """Return in words the right sides, the mesh's shape and error, and whether steps were told."""
    right = share_right(solid, points)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            mesh, _ = o3l.create_from_point_cloud_rbfpu(points, measure=None)
        except O3DLeafError:
            return right, "refused", "-", "-"
    report, error = o3l.mesh_report(mesh), np.abs(solid.closest(np.asarray(mesh.vertices)).distance).mean()
    shape = f"{report.components}, {report.genus}, {report.boundary_edges}"
    return right, shape, f"{error / spacing:.3f}", str(sum("rounded" in str(each.message) for each in told))


def filled(kind, count, seed):
    """Return points (count, 3) that fill a ball or a box."""
    random = np.random.default_rng(seed)
    if kind == "box":
        return random.uniform(size=(count, 3)) * [3, 2, 1]
    direction = random.normal(size=(count, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True) * np.cbrt(random.uniform(size=(count, 1)))


def scale_of(points):
    """Return the flatness of a cloud, that of fewer neighbors over it, its thinning and the neighbors of its planes."""
    cloud = OrientedCloud.of(points)
    rows = cloud.neighbors.row
    flat, few = flatness_of(points, rows), flatness_of(points, np.ascontiguousarray(rows[:, :FEW]))
    scale = cloud.surfels.scale
    return f"{flat:.3f}", f"{few / flat:.3f}", str(scale.thinning), "none" if scale.full else str(scale.neighbors)


def share_right(solid, points):
    """Return in words the share of normals on the right side, or that the cloud was refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            cloud = o3l.preprocess_point_cloud(points)
        except O3DLeafError:
            return "refused"
    normals = solid.closest(cloud.points).normals
    return f"{np.mean(np.einsum('ij,ij->i', cloud.normals, normals) > 0):.2%}"


if __name__ == "__main__":
    main()
