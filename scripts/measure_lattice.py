"""Areas of blades of clouds that lie on the edges of a lattice, as those of fused volumes do: their errors.

python scripts/measure_lattice.py [--kinds ...] [--ends ...] [--turns N] [--noise STEPS ...] [--step X] [--held-out]

Handheld scanners and Kinect fusion export the vertices of marching cubes: where the leaf crosses an edge of a cubic
lattice, here turned and shifted at random. At the margin they end in one of these ways:

leaf      all crossings of the leaf itself
seen      those of edges both of whose ends are over the leaf, as Open3D's `extract_point_cloud` has them
cells     the vertices of cells whose eight corners are over it, as its `extract_triangle_mesh` has them
trimmed   the vertices of a mesh that was cut along the margin

A crossing stands for h²/(|n₁| + |n₂| + |n₃|) of the leaf, h the step and n its normal along the axes; the sum of it is
the area that the cloud can tell ("counted"). That of "seen" and "cells" is smaller than the leaf: along the margin
edges have one end only over it, the more the more they lie along the leaf.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from leaf_cases import HELD_OUT, KINDS, SPACING, SPACINGS
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.samples.leaves.plane_mesh import triangulate
from o3dleaf.surface.isosurface.polygonize import polygonize

LEAVES = ("curled", "twisted", "lobed", "wavy")
ENDS = ("leaf", "seen", "cells", "trimmed")
BEYOND = 2.0
"""Steps that the surface is continued beyond its margin, so that no cell that the margin cuts lacks a corner."""
BISECTIONS = 40
CORNERS = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
AROUND = np.stack(np.meshgrid(*[np.arange(-1, 3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass
class Fused:
    """The mesh of a leaf, continued beyond its margin, by marching cubes on a lattice.

    `points` (n, 3) and their `places` (n, 2) on the leaf; `triangles` (m, 3); whether both ends of a vertex's edge are
    over the leaf (`seen`, n), and all corners of a triangle's cell (`whole`, m); the `area` (n,) a vertex stands for.
    """

    leaf: o3l.samples.LeafShape
    points: np.ndarray
    places: np.ndarray
    triangles: np.ndarray
    seen: np.ndarray
    whole: np.ndarray
    area: np.ndarray

    def ending(self, how):
        """Return the points (k, 3) of an end, and the area that they can tell."""
        inside = self.leaf.contains(self.places)
        if how == "trimmed":
            return np.vstack([self.points[inside], self.on_margin(inside)]), self.leaf.area
        kept = np.unique(self.triangles[self.whole]) if how == "cells" else inside if how == "leaf" else self.seen
        return self.points[kept], self.area[kept].sum()

    def on_margin(self, inside):
        """Return the points (k, 3) where edges of triangles cross the margin."""
        edges = np.unique(np.sort(self.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        edges = edges[inside[edges[:, 0]] != inside[edges[:, 1]]]
        first = inside[edges[:, 0]]
        low, high = self.places[np.where(first, *edges.T)], self.places[np.where(first, *edges.T[::-1])]
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            within = self.leaf.contains(middle)[:, None]
            low, high = np.where(within, middle, low), np.where(within, high, middle)
        return self.leaf.sweep.jet(low).points


def fuse(leaf, step, seed):
    """Return the mesh of a leaf on a lattice of a step, turned and shifted at random."""
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=rng).as_matrix(), rng.uniform(size=3)
    plane, _ = triangulate(leaf.outline.buffer(BEYOND * step), step / 2)
    sheet = leaf.sweep.jet(plane).points
    tree = KDTree(sheet)
    base = np.unique(np.floor(sheet @ turn / step + shift).astype(int), axis=0)
    low = base.min(axis=0) - 1
    near = np.zeros(base.max(axis=0) + 3 - low, dtype=bool)
    for corner in AROUND:
        near[tuple((base + corner - low).T)] = True

    def to_world(nodes):
        return (nodes + low - shift) * step @ turn.T

    def places_of(points):
        return leaf._refine(points, plane[tree.query(points)[1]])  # noqa: SLF001 - `closest` ends at the margin

    nodes = to_world(np.argwhere(near))
    feet = places_of(nodes)
    height = ((nodes - leaf.sweep.jet(feet).points) * _normals(leaf, feet)).sum(axis=1)
    values, over = np.full(near.shape, 9.0), np.zeros(near.shape, dtype=bool)
    values[near], over[near] = -height / step, leaf.contains(feet)
    crossings, triangles = polygonize(values, 0.0)
    cells = np.floor(crossings[triangles].mean(axis=1)).astype(int)
    known, whole = (np.all([flag[tuple((cells + corner).T)] for corner in CORNERS], axis=0) for flag in (near, over))
    used, triangles = np.unique(triangles[known], return_inverse=True)
    crossings = crossings[used]
    seen = over[tuple(np.floor(crossings + 1e-9).astype(int).T)] & over[tuple(np.ceil(crossings - 1e-9).astype(int).T)]
    points = to_world(crossings)
    places = places_of(points)
    area = step**2 / np.abs(_normals(leaf, places) @ turn).sum(axis=1)
    return Fused(leaf, points, places, triangles.reshape(-1, 3), seen, whole[known], area)


def _normals(leaf, places):
    """Return the unit normals (n, 3) of a leaf, or of what continues it, at places (n, 2)."""
    jet = leaf.sweep.jet(places)
    normal = np.cross(jet.along, jet.across)
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=LEAVES)
    parser.add_argument("--ends", nargs="+", choices=ENDS, default=ENDS)
    parser.add_argument("--turns", type=int, default=2, help="lattices, each turned and shifted at random")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.2], help="along all axes, in steps")
    parser.add_argument("--step", type=float, default=1.0, help="times the usual spacing of the leaf")
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    args = parser.parse_args()
    for name in args.kinds:
        parameters = dict((HELD_OUT if args.held_out else KINDS)[name])
        leaf = o3l.samples.leaf_shape(parameters.pop("kind", name), **parameters)
        step = args.step * SPACINGS.get(name, SPACING)
        for turn in range(args.turns):
            fused = fuse(leaf, step, turn + 1000 * args.held_out)
            own = triangle_areas(fused.points, fused.triangles[fused.whole]).sum()
            print(f"{name}, turn {turn}: whole cells cover {own / leaf.area - 1:+.1%}")
            for how in args.ends:
                points, counted = fused.ending(how)
                for noise in args.noise:
                    moved = points + np.random.default_rng(turn).normal(0.0, noise * step, points.shape)
                    tell(f"  {how}, noise {noise:g}", leaf, moved, counted)


def tell(said, leaf, points, counted):
    """Print the errors of the area of a blade: by the leaf, and by what the cloud can tell."""
    blade = o3l.create_blade(points, unit="mm")
    area = o3l.FitQuality.of(blade, points).area[0]
    false = ", taken for averages of voxels" if any("averages of voxels" in note for note in blade.notes) else ""
    errors = f"{area / leaf.area - 1:+.2%} of the leaf, {area / counted - 1:+.2%} of what is counted"
    print(f"{said}: {len(points):,} points, area {errors}{false}", flush=True)


if __name__ == "__main__":
    main()
