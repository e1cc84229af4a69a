"""Measure surfaces of clouds whose density differs: terrain with a dense patch, closed solids, and open surfaces.

    python scripts/measure_uneven.py [--patch 2000 10000 40000]
    python scripts/measure_uneven.py --closed | --open [--held-out] [--points 6000] [--seeds 0 1]

Terrain of 50 by 50 with waves 4.8 long has 3,000 random points, and a patch of 10 by 10 in its middle so many more.
One line each: points taken for outliers, triangles, the mesh's area over that of the terrain, processor time, and the
mean and largest error of its heights within the patch, beside it and far from it.

Closed solids and open surfaces have about as many points, 4, 20 or 80 times fewer to an area on one half, outside a
ball, or by a gradient from end to end. One line each: whether pieces, handles and rims are those of the truth, the
rims' edges, and the mean and largest distance to the truth and from it, in the spacing that was drawn there. Of open
surfaces: the distance of vertices of the rims from the true ones, and the other way. Held out are other shapes, ratios
and draws.
"""

import argparse
import time
import warnings

import numpy as np
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.samples.solids import CENTER, TURN
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes

SIZE, HALF, SPARSE = 50.0, 5.0, 3_000
RINGS = (("patch", 0.0, HALF - 0.5), ("beside", HALF + 0.5, HALF + 3.0), ("far", HALF + 3.0, SIZE / 2 - 2.0))

CLOSED = {
    "sphere": o3l.samples.Sphere,
    "torus": o3l.samples.Torus,
    "block": o3l.samples.Block,
    "figure": o3l.samples.Figure,
    "gap": o3l.samples.gap,
    "fins": o3l.samples.fins,
    "bumps": o3l.samples.bumps,
}
HELD_OUT_CLOSED = {"fold": o3l.samples.fold, "sheet": o3l.samples.WavySheet, **CLOSED}
RATIOS, HELD_OUT_RATIOS = (1, 4, 20, 80), (10, 40)
REGIONS = ("half", "ball", "gradient")
CAPS = {"hemisphere": 0.0, "cap": 0.5, "bowl": -0.4}
HOLES = ("hole 4", "hole 6", "hole 10")
MAX_RADIUS = 0.4
BALL = 0.25
TRUTH = 20_000


def heights(x, y):
    """Return the terrain."""
    return 3 * np.sin(x / 7) * np.cos(y / 9) + 0.5 * np.sin(1.3 * x) * np.cos(0.9 * y)


def terrain(patch):
    """Return points of the terrain, those of the patch last."""
    rng = np.random.default_rng(1)
    middle = SIZE / 2
    places = np.vstack([rng.uniform(0, SIZE, (SPARSE, 2)), rng.uniform(middle - HALF, middle + HALF, (patch, 2))])
    return np.column_stack([places, heights(*places.T)])


def area():
    """Return the terrain's area, by triangles of a fine lattice."""
    x, y = np.meshgrid(*2 * [np.linspace(0, SIZE, 2_001)], indexing="ij")
    slopes = np.gradient(heights(x, y), SIZE / 2_000)
    return float(np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2).mean() * SIZE**2)


def measure(patch):
    """Print what comes of one patch."""
    points = terrain(patch)
    outliers = int(o3l.detect_outliers(points).sum())
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh, _ = o3l.create_from_point_cloud_rbfpu(points, measure=None)
    seconds = time.process_time() - start
    x, y, z = np.asarray(mesh.vertices).T
    error, away = np.abs(z - heights(x, y)), np.maximum(np.abs(x - SIZE / 2), np.abs(y - SIZE / 2))
    share = mesh.get_surface_area() / area()
    print(
        f"{patch:,} more: {outliers:,} outliers, {len(mesh.triangles):,} triangles, area {share:.3f}, {seconds:.1f} s"
    )
    for name, least, most in RINGS:
        here = error[(away >= least) & (away < most)]
        print(f"    {name:<7} " + (f"mean {here.mean():.4f}, largest {here.max():.3f}" if len(here) else "no surface"))


def share_kept(points, ratio, region, seed):
    """Return the share (n,) of points that are kept, a ratio lower on one half, outside a ball or at the far end."""
    along = points[:, seed % 3 if np.ptp(points[:, seed % 3]) > 0 else 0]
    along = (along - along.min()) / np.ptp(along)
    if region == "half":
        return np.where(along < 0.5, 1.0, 1 / ratio)
    if region == "ball":
        away = np.linalg.norm(points - points[37 * seed], axis=1)
        return np.where(away < BALL * np.ptp(points, axis=0).max(), 1.0, 1 / ratio)
    return float(ratio) ** -along


def cap(height):
    """Return a shape that is a sphere above so many radii, and its rim."""
    circle = np.sqrt(1 - height**2) * ring()
    return lambda points: points[:, 2] > 0.5 * height, 0.5 * np.column_stack([circle, np.full(len(circle), height)])


def ring():
    """Return points (n, 2) of the unit circle."""
    angle = np.linspace(0, 2 * np.pi, 1_000, endpoint=False)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def border(wide, deep):
    """Return points (n, 2) of the border of a rectangle around the origin."""
    step = np.linspace(-0.5, 0.5, 500)
    end = np.full_like(step, 0.5)
    sides = [np.column_stack([step, end]), np.column_stack([end, step])]
    return np.vstack([side * sign for side in sides for sign in (1, -1)]) * [wide, deep]


def closed_cloud(solid, count, ratio, region, seed):
    """Return points, normals and spacings of a solid, about so many."""
    some = solid.sample(count, seed=seed)[0]
    whole = int(count**2 / share_kept(some, ratio, region, seed).sum())
    points, normals = solid.sample(whole, seed=seed)
    share = share_kept(points, ratio, region, seed)
    kept = np.random.default_rng([seed, 7]).random(whole) < share
    return points[kept], normals[kept], np.sqrt(solid.area / whole / share[kept])


def open_cloud(name, count, ratio, region, seed):
    """Return points, normals, spacings, points of the true rims, and the number of these; None of too wide a hole.

    "hole 6" is a sheet with a hole of a radius of six spacings of its sparse part, on the step of "half".
    """
    rims = 1
    if name.startswith("hole"):
        solid, kept = o3l.samples.Block((1.0, 1.0, 0.01)), lambda points: points[:, 2] > 0.0049
        rim = np.column_stack([border(1.0, 1.0), np.full(2_000, 0.005)])
        count *= 2
    elif name == "box":
        solid, kept = o3l.samples.Block((1.0, 0.7, 0.4)), lambda points: points[:, 2] < 0.1999
        rim = np.column_stack([border(1.0, 0.7), np.full(2_000, 0.2)])
    else:
        solid = o3l.samples.Sphere()
        kept, rim = cap(CAPS[name])
    points, normals, spacing = closed_cloud(solid, count, ratio, region, seed)
    points, normals = (points - CENTER) @ TURN, normals @ TURN
    some = kept(points)
    if name.startswith("hole"):
        radius, rims = float(name.split()[1]) * spacing[some].max(), 2
        if radius > MAX_RADIUS:
            return None
        some &= np.linalg.norm(points, axis=1) > radius
        rim = np.vstack([rim, np.column_stack([radius * ring(), np.full(1_000, 0.005)])])
    return points[some], normals[some], spacing[some], rim, rims


def surface_of(points, normals):
    """Return the mesh of a cloud, and the seconds it took; None where it is refused."""
    cloud = o3l.OrientedCloud.of(points, normals)
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            mesh, _ = o3l.create_from_point_cloud_rbfpu(cloud, measure=None)
        except O3DLeafError as error:
            print(f"    refused: {error}")
            return None, 0.0
    return mesh, time.process_time() - start


def measure_closed(name, make, *drawn):
    """Print what comes of one closed solid; return whether pieces, handles and rims are the truth's."""
    solid = make()
    points, normals, spacing = closed_cloud(solid, *drawn)
    mesh, seconds = surface_of(points, normals)
    if mesh is None:
        return False
    report, vertices, tree = o3l.mesh_report(mesh), np.asarray(mesh.vertices), cKDTree(points)
    truth = solid.sample(TRUTH, seed=99)[0]
    there = np.abs(solid.closest(vertices).distance) / spacing[tree.query(vertices)[1]]
    back = distance_to_mesh(vertices, np.asarray(mesh.triangles), truth) / spacing[tree.query(truth)[1]]
    found = (report.components, report.genus, report.boundary_edges)
    right = found == (1, int(name == "torus"), 0)
    print(
        f"    {name:<8} {'right' if right else 'wrong'}: pieces {found[0]}, handles {found[1]}, rim {found[2]:,}; "
        f"there {there.mean():.3f}, {there.max():.2f}; back {back.mean():.3f}, {back.max():.2f}; {seconds:.1f} s"
    )
    return right


def measure_open(name, *drawn):
    """Print what comes of one open surface; return whether it is as open as the truth, None if it was not drawn."""
    cloud = open_cloud(name, *drawn)
    if cloud is None:
        return None
    points, normals, spacing, rim, rims = cloud
    mesh, seconds = surface_of(points, normals)
    if mesh is None:
        return False
    vertices, triangles, tree = np.asarray(mesh.vertices), np.asarray(mesh.triangles), cKDTree(points)
    report, edges = o3l.mesh_report(mesh), EdgeTable.of(triangles)
    found = (report.components, report.genus, len(find_holes(vertices, triangles).perimeter))
    right = found == (1, 0, rims)
    text = f"    {name:<10} {'right' if right else 'wrong'}: pieces {found[0]}, handles {found[1]}, rims {found[2]}; "
    if found[2]:
        own = vertices[np.unique(edges.ends[edges.count == 1])]
        there = cKDTree(rim).query(own)[0] / spacing[tree.query(own)[1]]
        back = cKDTree(own).query(rim)[0] / spacing[tree.query(rim)[1]]
        text += f"rim there {there.mean():.2f}, {there.max():.2f}; back {back.mean():.2f}, {back.max():.2f}; "
    print(f"{text}{seconds:.1f} s")
    return right


def measure_shapes(given):
    """Measure every ratio and region of closed or open shapes."""
    closed = HELD_OUT_CLOSED if given.held_out else CLOSED
    for ratio in HELD_OUT_RATIOS if given.held_out else RATIOS:
        for region in REGIONS if ratio > 1 else REGIONS[:1]:
            print(f"{ratio}:1, {region}")
            drawn = [(given.points, ratio, region, seed) for seed in given.seeds]
            if given.closed:
                right = [measure_closed(name, make, *each) for name, make in closed.items() for each in drawn]
            else:
                names = ("bowl", "hole 5", "hole 8", "box") if given.held_out else ("hemisphere", "cap", *HOLES, "box")
                right = [measure_open(name, *each) for name in names for each in drawn]
            right = [each for each in right if each is not None]
            print(f"    {sum(right)} of {len(right)} right", flush=True)


def main():
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--patch", type=int, nargs="+", default=[2_000, 10_000, 40_000])
    parser.add_argument("--closed", action="store_true")
    parser.add_argument("--open", action="store_true")
    parser.add_argument("--held-out", action="store_true")
    parser.add_argument("--points", type=int, default=6_000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    given = parser.parse_args()
    if given.closed or given.open:
        measure_shapes(given)
        return
    for patch in given.patch:
        measure(patch)


if __name__ == "__main__":
    main()
