"""Blades of scans whose density varies over the leaf: errors of areas, margins, holes.

python scripts/measure_density.py [--kinds ...] [--densities ...] [--noise SPACINGS ...] [--seeds N] [--held-out]

Densities step or change smoothly along the leaf or across it, are higher in a stripe, as where passes overlap, or are
those of scanners: rays on a regular angular grid from one or two places. Each scan has as many points as an even one of
the leaf's usual spacing. Areas are relative to what is seen of the leaf; margins are judged by the spacing there;
`told` is the deviation that the blade has of its area by chance.
"""

import argparse
from dataclasses import dataclass

import numpy as np
import open3d as o3d
from leaf_cases import HELD_OUT, HELD_OUT_SEED, HELD_OUT_SPACING, KINDS, SPACING, SPACINGS
from leaf_errors import MARGIN, boundary_points
from rich.console import Console
from rich.table import Table
from scipy.spatial import KDTree

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import mesh_arrays

LEAVES = tuple(kind for kind in KINDS if kind not in ("petiole", "layers"))
STRIPE = 0.2
"""Width of a dense stripe, as a share of the leaf's."""
AWAY = 2.5
"""Distance of a scanner from the middle of the leaf, in its lengths."""
OBLIQUE = np.radians(40.0)
"""Angle between its view and the normal in the middle of the leaf."""
HIDDEN = 0.02
"""Share of a leaf from which on a scanner that does not see it is passed over: gaps are no matter of density."""


@dataclass(frozen=True)
class Density:
    """A density `ratio` times as high in some places as in others: a step, a slope or a stripe, along u or v."""

    shape: str
    axis: int
    ratio: float

    def scan(self, leaf, spacing, noise, seed):
        """Return points, and a function of the spacing at places (u, v)."""
        low, high = np.reshape(leaf.outline.bounds, (2, 2))[:, self.axis]
        mean = self._weights(o3l.samples.scan_leaf(leaf, spacing=spacing, seed=0).places, low, high).mean()
        all_of = o3l.samples.scan_leaf(leaf, spacing=spacing * np.sqrt(mean), seed=seed, noise=noise / np.sqrt(mean))
        kept = np.random.default_rng(seed).random(len(all_of.places)) < self._weights(all_of.places, low, high)
        local = lambda places: spacing * np.sqrt(mean / self._weights(places, low, high))  # noqa: E731
        return all_of.points[kept], local, 0.0

    def _weights(self, places, low, high):
        """Return the density (n,) as a share of the highest one."""
        part = (places[:, self.axis] - low) / (high - low)
        power = {
            "step": (part < 0.5).astype(float),
            "slope": part,
            "stripe": (np.abs(part - 0.6) < STRIPE / 2).astype(float),
        }[self.shape]
        return self.ratio ** (power - 1)


@dataclass(frozen=True)
class Scanner:
    """Rays on a regular angular grid from places that look at the middle of the leaf at some angles to its normal.

    They stand on its normal, on either side of it along the leaf (axis 0), or across it.
    """

    angles: tuple
    axis: int = 0

    def scan(self, leaf, spacing, noise, seed):
        """Return points, a function of the spacing at places (u, v), and the share of the leaf that is hidden."""
        rng = np.random.default_rng(seed)
        mesh, scene = leaf.mesh(0.25 * spacing), o3d.t.geometry.RaycastingScene()
        scene.add_triangles(mesh[0].astype(np.float32), mesh[1].astype(np.uint32))
        views = [_view(leaf, angle, self.axis, rng.uniform(0, 2 * np.pi)) for angle in self.angles]
        sample = o3l.samples.scan_leaf(leaf, spacing=spacing, seed=0).places
        seen = np.sum([_per_angle(leaf, view, sample, scene) for view in views], axis=0)
        step = spacing * np.sqrt(seen[seen > 0].mean())
        points = np.concatenate([_hits(scene, view, step, rng) for view in views])
        points += rng.normal(0.0, noise * spacing, points.shape)

        def local(places):
            per_angle = np.sum([_per_angle(leaf, view, places) for view in views], axis=0)
            return step / np.sqrt(np.maximum(per_angle, 1e-6))

        return points, local, float(np.mean(seen == 0))


def _view(leaf, angle, axis, turn):
    """Return where a scanner is, and its axes (3, 3), the last one its view: it is turned about that."""
    middle = np.mean(np.reshape(leaf.outline.bounds, (2, 2)), axis=0, keepdims=True)
    ways = leaf.jacobian(middle)[0].T
    way, side = (ways[each] / np.linalg.norm(ways[each]) for each in (axis, 1 - axis))
    back = np.cos(angle) * leaf.normals(middle)[0] + np.sin(angle) * way
    up = np.cross(back, side)
    axes = np.stack([np.cos(turn) * side + np.sin(turn) * up, np.cos(turn) * up - np.sin(turn) * side, -back])
    return leaf.lift(middle)[0] + AWAY * leaf.sweep.length * back, axes


def _per_angle(leaf, view, places, scene=None):
    """Return the solid angle (n,) that an area has at places; 0 for those that another part hides, given a scene."""
    place, _ = view
    points, normals = leaf.lift(places), leaf.normals(places)
    ways = points - place
    away = np.linalg.norm(ways, axis=1)
    angle = np.abs((ways * normals).sum(axis=1)) / away**3
    if scene is None:
        return angle
    rays = np.hstack([np.broadcast_to(place, ways.shape), ways / away[:, None]]).astype(np.float32)
    return np.where(scene.cast_rays(rays)["t_hit"].numpy() > away - 0.1, angle, 0.0)


def _hits(scene, view, step, rng):
    """Return the points (n, 3) that rays meet, in steps of an angle."""
    place, axes = view
    reach = np.arctan(0.6 / AWAY)
    angles = np.arange(-reach, reach, step)
    azimuth, height = (each.ravel() for each in np.meshgrid(*(angles + rng.uniform(0, step) for _ in range(2))))
    ways = np.stack([np.sin(azimuth) * np.cos(height), np.sin(height), np.cos(azimuth) * np.cos(height)], axis=1) @ axes
    hit = scene.cast_rays(np.hstack([np.broadcast_to(place, ways.shape), ways]).astype(np.float32))["t_hit"].numpy()
    met = np.isfinite(hit)
    return place + hit[met, None] * ways[met]


DENSITIES = {
    "even": Density("slope", 0, 1.0),
    "step 2 along": Density("step", 0, 2.0),
    "step 4 along": Density("step", 0, 4.0),
    "step 2 across": Density("step", 1, 2.0),
    "step 4 across": Density("step", 1, 4.0),
    "slope 4 along": Density("slope", 0, 4.0),
    "slope 4 across": Density("slope", 1, 4.0),
    "stripe 2 along": Density("stripe", 0, 2.0),
    "stripe 3 across": Density("stripe", 1, 3.0),
    "scanner straight": Scanner((0.0,)),
    "scanner oblique": Scanner((OBLIQUE,)),
    "two scanners": Scanner((OBLIQUE, -OBLIQUE), 1),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", choices=LEAVES, default=LEAVES)
    parser.add_argument("--densities", nargs="+", choices=list(DENSITIES), default=list(DENSITIES))
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.3], help="in mean spacings")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    args = parser.parse_args()
    table = Table(title="Scans of uneven density")
    for name in ("leaf", "density", "noise", "points", "area", "told", "margin", "holes"):
        table.add_column(name, justify="left" if name in ("leaf", "density") else "right")
    for kind in args.kinds:
        parameters = dict((HELD_OUT if args.held_out else KINDS)[kind])
        leaf = o3l.samples.leaf_shape(parameters.pop("kind", kind), **parameters)
        spacing = SPACINGS.get(kind, SPACING) * (HELD_OUT_SPACING if args.held_out else 1.0)
        for name in args.densities:
            for noise in args.noise:
                for seed in range(args.seeds):
                    row = measure(leaf, DENSITIES[name], spacing, noise, seed + HELD_OUT_SEED * args.held_out)
                    table.add_row(kind, name, f"{noise:g}", *row)
                    print(kind, name, f"{noise:g}", *row, flush=True)
    Console(width=110).print(table)


def measure(leaf, density, spacing, noise, seed):
    """Return points, error of the area and its deviation, share of the margin within a spacing, holes of the leaf."""
    points, local, hidden = density.scan(leaf, spacing, noise, seed)
    if hidden > HIDDEN:
        return f"{len(points):,}", f"{hidden:.0%} hidden", "", "", ""
    try:
        blade = o3l.create_blade(points, unit="mm")
    except o3l.errors.ReconstructionError as refusal:
        return f"{len(points):,}", "refused", str(refusal)[:60], "", ""
    quality = o3l.FitQuality.of(blade, points)
    seen = leaf.area * (1 - hidden)
    vertices, triangles = mesh_arrays(blade.extract_mesh(spacing / 2))
    places = np.concatenate(leaf.margin_places(spacing / 10))
    away = KDTree(boundary_points(vertices, triangles, spacing / 10)).query(leaf.lift(places))[0]
    return (
        f"{len(points):,}",
        f"{quality.area[0] / seen - 1:+.2%}",
        f"{quality.area_deviation / seen:.2%}",
        f"{np.mean(away <= MARGIN * local(places)):.1%}",
        f"{len(blade.outline.hole_rings)} of {leaf.holes}",
    )


if __name__ == "__main__":
    main()
