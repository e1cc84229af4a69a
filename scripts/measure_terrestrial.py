"""Measure surfaces of scans from one place: density falls with the square of the distance, and what hides is missing.

    python scripts/measure_terrestrial.py [--step 0.8] [--noise 0.005] [--ground pit plain] [--spacing NUMBER ...]
    python scripts/measure_terrestrial.py --ground --hills 1 2 3 --eye 1.2 1.8 4 --depth    # other grounds, and heights

A scanner 1.8 m above undulating ground, a wall, a box, a trunk and a pole sends a ray every `step` degrees; what it
meets between 2 and 60 m is known with noise along the ray. A pit rises to 14 m at 60 m, on a plain rays graze; hills
are four random waves. Printed is which share of the prepared cloud's normals face the wrong side and, for each surface,
in rings by distance from the scanner: the mean distance of its area from the truth and the 95 % quantile, the mean in
spacings (distance times step), the mean distance of held out hits, half a step beside the scan's, from the surface and
the share of those nearer than two spacings; and triangles, processor time, rims, and handles.
"""

import argparse
import time
import warnings
from itertools import product
from typing import NamedTuple

import numpy as np
import open3d as o3d
from peers import TRIMMED, cloud_of
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from surface_errors import sample_triangles

import o3dleaf as o3l

EYE, NEAREST, FARTHEST = 1.8, 2.0, 60.0
RINGS = (("near", 2.0, 6.0), ("middle", 6.0, 18.0), ("far", 18.0, 60.0))
CELLS, HALF = 600, 75.0
"""Cells of the ground along either side, of 150 m."""
SAMPLES, NEIGHBOURS = 300_000, 30


class Ground(NamedTuple):
    """A paraboloid that rises by so much times the square of the distance, and waves: height, and phase a m along x, y.

    A wave is h sin(a x + c) cos(b y + d).
    """

    rise: float
    waves: tuple[tuple[float, ...], ...]

    def heights(self, x, y):
        """Return the heights at places."""
        total = self.rise * (x * x + y * y)
        for height, a, b, c, d in self.waves:
            total = total + height * np.sin(a * x + c) * np.cos(b * y + d)
        return total


WAVES = ((0.5, 1 / 6, 1 / 7, 0.0, 0.0), (0.12, 1 / 1.5, 1 / 1.7, 0.0, 0.0))
"""Waves of 38 to 44 m and of 9 to 11 m."""
GROUNDS = {"pit": Ground(0.004, WAVES), "plain": Ground(0.0, WAVES)}
SLOPE = 0.2
"""Steepest that a wave of a random ground may be."""


def hills(seed):
    """Return four random waves, of 6 to 60 m."""
    rng = np.random.default_rng(seed)
    waves = []
    for length in np.exp(rng.uniform(np.log(6.0), np.log(60.0), 4)):
        a, b = 2 * np.pi / length * rng.uniform(0.7, 1.4, 2)
        waves.append((rng.uniform(0, SLOPE) / max(a, b), a, b, *rng.uniform(0, 2 * np.pi, 2)))
    return Ground(0.0, tuple(waves))


def truth(kind):
    """Return the scene on a ground, as one mesh; the scanner stands at x = y = 0."""
    ticks = np.linspace(-HALF, HALF, CELLS + 1)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    corner = np.arange((CELLS + 1) ** 2).reshape(x.shape)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel(), corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    ground = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.column_stack([x.ravel(), y.ravel(), kind.heights(x, y).ravel()])),
        o3d.utility.Vector3iVector(np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])),
    )
    make = o3d.geometry.TriangleMesh
    things = [
        (make.create_box(10.0, 0.5, 4.0).translate([-5.0, -0.25, -1.0]), (3.0, 16.0), 0.3),
        (make.create_box(1.6, 1.2, 1.6).translate([-0.8, -0.6, -0.5]), (-5.0, 2.0), 0.6),
        (make.create_cylinder(0.35, 7.0, 48).translate([0.0, 0.0, 3.0]), (4.0, -7.0), 0.0),
        (make.create_cylinder(0.15, 4.0, 32).translate([0.0, 0.0, 1.5]), (-3.0, -3.5), 0.0),
    ]
    for thing, (east, north), turn in things:
        thing.rotate(make.get_rotation_matrix_from_xyz([0, 0, turn]), center=[0, 0, 0])
        ground += thing.translate([east, north, kind.heights(east, north)])
    return ground


def rays(step, shift=0.0):
    """Return the (n, 3) directions of a raster of so many degrees, shifted by a part of a step."""
    azimuth = np.radians(np.arange(0, 360, step) + shift * step)
    elevation = np.radians(np.arange(-65, 35, step) + shift * step)
    a, e = (each.ravel() for each in np.meshgrid(azimuth, elevation, indexing="ij"))
    return np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def cast(scene, eye, directions, noise=0.0, seed=1):
    """Return the (n, 3) places that rays meet within the scanner's range, with noise along the rays."""
    ray = np.column_stack([np.broadcast_to(eye, directions.shape), directions]).astype(np.float32)
    reach = scene.cast_rays(o3d.core.Tensor(ray))["t_hit"].numpy().astype(np.float64)
    hit = (reach > NEAREST) & (reach < FARTHEST)
    far = reach[hit] + np.random.default_rng(seed).normal(0, noise, hit.sum())
    return eye + far[:, np.newaxis] * directions[hit]


def poisson(points, eye, depth):
    """Return Open3D's surface with the least dense vertices cut off, as its documentation has it."""
    cloud = cloud_of(points, np.zeros_like(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    cloud.orient_normals_towards_camera_location(eye)
    mesh, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth)
    mesh.remove_vertices_by_mask(np.asarray(density) < np.quantile(density, TRIMMED))
    return mesh


def ours(points, eye, spacing=None):
    """Return the surface of create_from_point_cloud_rbfpu."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        mesh, _ = o3l.create_from_point_cloud_rbfpu(points, spacing, viewpoint=eye, measure=None)
    for each in told:
        print(f"    said: {each.message}")
    return mesh


def topology(vertices, triangles):
    """Return in words how many pieces, rims and handles a mesh has, and triangles that cross others."""
    edges, count = np.unique(
        np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    pieces, label = parts(triangles[:, [0, 1, 1, 2]].reshape(-1, 2))
    rim = edges[count == 1]
    rims = parts(rim)[0]
    euler = len(label) - len(edges) + len(triangles)
    said = f"{pieces} pieces, {rims} rims, {pieces - (euler + rims) // 2} handles"
    odd = int((count > 2).sum())
    crossing = o3l.mesh_report((vertices, triangles)).self_intersections
    return f"{said}, {crossing} triangles cross others" + (f", {odd} edges of three triangles" if odd else "")


def parts(pairs):
    """Return how many connected parts pairs of nodes (n, 2) make, and the part of each node that they name."""
    nodes, place = np.unique(pairs, return_inverse=True)
    one, other = place.reshape(-1, 2).T
    graph = coo_array((np.ones(len(one)), (one, other)), shape=2 * [len(nodes)])
    return connected_components(graph, directed=False)


def show(name, mesh, seconds, scan):
    """Print the figures of a surface."""
    scene, eye, held_out, step = scan
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    print(f"{name}: {len(triangles):,} triangles, {seconds:.1f} s, {topology(vertices, triangles)}")
    places = sample_triangles(vertices, triangles, SAMPLES, np.random.default_rng(1))[0]
    off = scene.compute_distance(o3d.core.Tensor(places.astype(np.float32))).numpy()
    own = o3d.t.geometry.RaycastingScene()
    own.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    missed = own.compute_distance(o3d.core.Tensor(held_out.astype(np.float32))).numpy()
    away, apart = (np.linalg.norm(each - eye, axis=1) for each in (places, held_out))
    for ring, least, most in RINGS:
        here, there = (away >= least) & (away < most), (apart >= least) & (apart < most)
        spacing = np.radians(step) * away[here]
        print(
            f"    {ring:<7} accuracy {off[here].mean():.4f} (95 % {np.quantile(off[here], 0.95):.4f}, "
            f"{(off[here] / spacing).mean():.3f} spacings), hits missed by {missed[there].mean():.4f}, "
            f"{(missed[there] < 2 * np.radians(step) * apart[there]).mean():.1%} covered"
        )
    print(f"    all     accuracy {off.mean():.4f} (95 % {np.quantile(off, 0.95):.4f}), missed by {missed.mean():.4f}")


def wrong_sides(points, eye, scene):
    """Return the share of the prepared cloud's normals that face away from where their surface was seen from."""
    cloud = o3l.preprocess_point_cloud(points, viewpoint=eye)
    found = scene.compute_closest_points(o3d.core.Tensor(cloud.points.astype(np.float32)))
    own = found["primitive_normals"].numpy()
    facing = np.einsum("ij,ij->i", own, cloud.normals) * np.einsum("ij,ij->i", own, eye - cloud.points)
    return (facing < 0).mean()


def measure(title, ground, height, options):
    """Print what comes of one scene, scanned from a height above its ground."""
    mesh, step, noise = truth(ground), options.step, options.noise
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    eye = np.array([0.0, 0.0, ground.heights(0.0, 0.0) + height])
    points, held_out = cast(scene, eye, rays(step), noise), cast(scene, eye, rays(step, 0.5))
    print(f"{title}: {len(points):,} points, {wrong_sides(points, eye, scene):.2%} of normals on the wrong side")
    jobs = [("ours", lambda: ours(points, eye))]
    jobs += [(f"ours, spacing {each:g}", lambda each=each: ours(points, eye, each)) for each in options.spacing]
    jobs += [(f"Poisson, depth {each}", lambda each=each: poisson(points, eye, each)) for each in options.depth]
    for name, job in jobs:
        start = time.process_time()
        made = job()
        show(name, made, time.process_time() - start, (scene, eye, held_out, step))


def main():
    """Measure every scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ground", nargs="*", choices=GROUNDS, default=[*GROUNDS])
    parser.add_argument("--hills", type=int, nargs="*", default=[], help="seeds of random grounds")
    parser.add_argument("--eye", type=float, nargs="+", default=[EYE], help="heights of the scanner in m")
    parser.add_argument("--step", type=float, default=0.8, help="degrees between rays")
    parser.add_argument("--noise", type=float, default=0.005, help="standard deviation along the ray in m")
    parser.add_argument("--spacing", type=float, nargs="*", default=[], help="of one lattice in m, beside the own")
    parser.add_argument("--depth", type=int, nargs="*", default=[9, 10], help="of Poisson's octree")
    arguments = parser.parse_args()
    grounds = {name: GROUNDS[name] for name in arguments.ground} | {f"hills {n}": hills(n) for n in arguments.hills}
    for (name, ground), eye in product(grounds.items(), arguments.eye):
        measure(f"{name}, scanned from {eye:g} m", ground, eye, arguments)


if __name__ == "__main__":
    main()
