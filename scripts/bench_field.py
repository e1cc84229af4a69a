"""The field itself: rates of its parts, and its signed distance beside Open3D's RaycastingScene.

python scripts/bench_field.py [--leaf MODEL | --frame paper] [--mesh FILE | --spacing S] [--json FILE] [--quick]

Points are spread over the neighbourhood of a synthetic wheat leaf (or of the MODEL that `leaf.save` wrote), half a
patch's height above and below it; "far" ones over a box three times the leaf's; "both" are half of each. The scene is
built on FILE, a closed mesh of the whole leaf, or on the leaf's own at S mm, coarser if that does not fit into memory.
Its time and memory are those of its build and its queries, without the mesh; ours those of the index and the queries.
Memory of ours is the most that NumPy held at once, in a run of its own, that of the scene what the process grew by.
How far the two distances are apart is measured beside the closed mesh and, for the surface of G itself, on a window
that is meshed in the world at half the CT's step with the walls of its pockets. Compilation and reading are not
counted.
"""

import argparse
import tracemalloc
from pathlib import Path

import numpy as np
import open3d as o3d
from measuring import Row, measure, resident, show, write_json
from whole_leaf import QUICK_CT

import o3dleaf as o3l
from o3dleaf.leaf.distance.distance import SurfaceIndex

BYTES = 300
"""Memory a triangle of the closed mesh: its arrays, Open3D's copy, and the scene, with room to spare."""
QUICK_SPACING = 0.2
WINDOW = 1.0
"""Side of the window, in millimetres."""


def make_leaf(quick, frame="surface"):
    """The synthetic leaf, in millimetres."""
    sample = o3l.samples.wheat_scan(count=800 if quick else 6300)
    volume, _ = o3l.samples.wheat_ct(**(QUICK_CT if quick else {}))
    return o3l.create_multiscale_leaf(sample.cloud, volume, sample.midrib, blade=o3l.BladeOptions(frame=frame))


def spread(leaf, count, rng):
    """Flat coordinates over the outline, through the patch and half of its height beyond."""
    low, high = leaf.blade.outline.bounds
    bottom, top = leaf.texture.cell[:, 2] / leaf.scale
    flat = rng.uniform([*low, 1.5 * bottom - 0.5 * top], [*high, 1.5 * top - 0.5 * bottom], (3 * count, 3))
    return flat[leaf.blade.outline.contains(flat[:, :2])][:count]


def blade_calls(blade, points, flat):
    """Return what takes world points to flat coordinates and back: the paper's two steps each, or the surface's one."""
    if not isinstance(blade, o3l.HeightMapBlade):
        return {"flatten": lambda: blade.flatten(points), "lift": lambda: blade.lift(flat)}
    coordinates = blade.frame.to_leaf(points)
    return {
        "world to leaf": lambda: blade.frame.to_leaf(points),
        "leaf to world": lambda: blade.frame.to_world(coordinates),
        "height map": lambda: blade.height_map(flat[:, :2]),
    }


def rate_rows(leaf, flat):
    """Return a row for each part of the field, at all the points."""
    blade, points = leaf.blade, leaf.blade.lift(flat)
    on = leaf.closest_points(points[: len(points) // 4])
    calls = blade_calls(blade, points, flat) | {
        "outline membership": lambda: blade.outline.contains(flat[:, :2]),
        "G, frame and tiling": lambda: leaf(points),
        "gradient of G": lambda: leaf.gradient(points),
        "project": lambda: leaf.project(on),
        "normals": lambda: leaf.normals(on),
        "mean curvature": lambda: leaf.mean_curvature(on),
    }
    rows = []
    for name, call in calls.items():
        call()
        result, seconds, peak = measure(call, 3)
        rows.append(Row(name, f"{len(result):,} points", seconds, peak_mb=max(peak - result.nbytes / 2**20, 0.0)))
        print(f"{name}: {len(result) / seconds / 1e6:.2f} million points a second")
    return rows


def distance_rows(leaf, near, far, mesh):
    """Return the rows of the signed distance, near, far and both, index and scene with their queries; and the scene."""
    half = len(near) // 2
    kinds = {"near": near, "far": far, "both": np.concatenate([near[:half], far[:half]])}
    leaf.signed_distance(near[:10], closed=True)
    index, build, _ = measure(lambda: SurfaceIndex.build(leaf, closed=True))
    before = resident()
    scene, scene_build, _ = measure(lambda: scene_of(mesh))
    rows = []
    for name, points in kinds.items():
        leaf.__dict__["solid_index"] = index
        _, seconds, _ = measure(lambda points=points: leaf.signed_distance(points, closed=True))
        tensor = o3d.core.Tensor(points.astype(np.float32))
        _, theirs, _ = measure(lambda tensor=tensor: scene.compute_signed_distance(tensor))
        print(f"{name}: {len(points) / seconds / 1e6:.3f} million distances a second, {theirs:.2f} s with the scene")
        row = Row(f"signed distance, {name}", f"{len(points):,} points", build + seconds, peer="RaycastingScene")
        row.peer_seconds = scene_build + theirs
        row.ratio = row.peer_seconds / row.seconds
        rows.append(row)
    kept, ours = resident() - before, held(leaf, points)
    rows[-1].peak_mb = ours
    parts = mesh.vertex.positions.numpy().nbytes + mesh.triangle.indices.numpy().nbytes
    print(
        f"index: {build:.2f} s, at most {ours:.1f} MB with its queries; scene of {len(mesh.triangle.indices):,} "
        f"triangles: {scene_build:.2f} s, {kept:.0f} MB, {kept / ours:.0f} times as much; with the mesh "
        f"{kept + parts / 2**20:.0f} MB"
    )
    return rows, scene


def held(leaf, points):
    """Return the most megabytes that NumPy holds while an index is built and asked, without the result."""
    del leaf.__dict__["solid_index"]
    tracemalloc.start()
    try:
        result = leaf.signed_distance(points, closed=True)
        return (tracemalloc.get_traced_memory()[1] - result.nbytes) / 2**20
    finally:
        tracemalloc.stop()


def beside(leaf, scene, mesh, count):
    """Print how far the distances are apart at vertices of the mesh, moved by a few micrometres."""
    rng, vertices = np.random.default_rng(1), mesh.vertex.positions.numpy()
    points = vertices[rng.integers(len(vertices), size=count)] + rng.normal(scale=0.01, size=(count, 3))
    found = leaf.signed_distance(points, closed=True)
    expected = scene.compute_signed_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()
    error = np.abs(found - expected) * 1000
    signs = np.mean((found < 0) == (expected < 0))
    print(
        f"beside the closed mesh they differ by {np.median(error):.2g} µm (median), {np.quantile(error, 0.99):.2g} "
        f"(99 %), {error.max():.2g} (most), and {signs:.1%} of the signs agree"
    )


def closed_mesh(leaf, spacing):
    """Return the leaf's closed mesh, at `spacing` or as fine as memory allows."""
    while True:
        plan = leaf.plan_mesh(spacing, closed=True)
        if plan.triangles * BYTES <= free_memory():
            return o3d.t.geometry.TriangleMesh.from_legacy(plan.extract().mesh)
        print(f"no memory for the scene at {spacing:.3g} mm: {2 * spacing:.3g} mm instead")
        spacing *= 2


def free_memory():
    """Return the bytes that the system says can be had, or no limit where it does not say."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return np.inf
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))


def scene_of(mesh):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh)
    scene.compute_distance(o3d.core.Tensor(np.zeros((1, 3), dtype=np.float32)))
    return scene


def agreement(leaf, count, rng):
    """Print how far our distances are from those to a fine mesh of a window, of which the middle is asked."""
    bounds = leaf.blade.outline.bounds
    bottom, top = leaf.texture.cell[:, 2] / leaf.scale
    middle = np.append(bounds.mean(axis=0), 0.0)
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (bottom, top)]) * [WINDOW, WINDOW, 1]
    world = leaf.blade.lift(middle + corners)
    spacing = float(np.median(leaf.texture.field.cover.radii)) / leaf.scale / 9
    mesh = o3l.extract_isosurface(leaf, spacing, [world.min(axis=0), world.max(axis=0)])
    scene = scene_of(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    z = rng.uniform(1.5 * bottom - 0.5 * top, 1.5 * top - 0.5 * bottom, count)
    flat = middle + np.column_stack([rng.uniform(-WINDOW / 2, WINDOW / 2, (count, 2)), z])
    points = leaf.blade.lift(flat)
    found = leaf.signed_distance(points)
    expected = scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()
    # Nearer to the middle than the window's edge is: what is outside of it cannot be nearer.
    asked = expected < WINDOW / 2
    error = np.abs(np.abs(found) - expected)[asked] * 1000
    edge = np.linalg.norm(np.diff(np.asarray(mesh.vertices)[np.asarray(mesh.triangles)[:, :2]], axis=1), axis=2)
    print(
        f"window mesh of {spacing * 1000:.1f} µm lattice, edges of {np.median(edge) * 1000:.1f} µm: they differ by "
        f"{np.median(error):.2g} µm (median), {np.quantile(error, 0.99):.2g} (99 %), {error.max():.2g} (most)"
    )
    feet = leaf.closest_points(points[asked])
    print(f"largest |G| at the closest points, of its spread: {np.abs(leaf(feet)).max() / leaf(points).std():.1g}")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaf", metavar="MODEL", help="a leaf that was saved, in millimetres")
    parser.add_argument("--frame", choices=("surface", "paper"), default="surface", help="of the leaf made here")
    parser.add_argument("--mesh", metavar="FILE", help="closed mesh of the whole leaf for the scene")
    parser.add_argument("--spacing", type=float, default=0.024, help="of the mesh made where none is given, in mm")
    parser.add_argument("--json", metavar="FILE", help="write the rows there as well")
    parser.add_argument("--quick", action="store_true", help="small scales, to see that it runs")
    options = parser.parse_args(arguments)
    rng, quick = np.random.default_rng(0), options.quick
    leaf = o3l.load(options.leaf) if options.leaf else make_leaf(quick, options.frame)
    count = 500 if quick else 1_000_000
    flat = spread(leaf, count, rng)
    rows = rate_rows(leaf, flat)
    if options.mesh:
        mesh = o3d.t.io.read_triangle_mesh(options.mesh)
    else:
        mesh = closed_mesh(leaf, QUICK_SPACING if quick else options.spacing)
    box = leaf.bounds
    far = box.mean(axis=0) + 3 * np.ptp(box, axis=0) * (rng.random((count, 3)) - 0.5)
    distances, scene = distance_rows(leaf, leaf.blade.lift(flat), far, mesh)
    rows += distances
    beside(leaf, scene, mesh, 500 if quick else 100_000)
    agreement(leaf, 500 if quick else 200_000, rng)
    show("The field of the multi-scale leaf", rows, "peer")
    if options.json:
        write_json(options.json, rows)
    return rows


if __name__ == "__main__":
    main()
