"""Measure triangles that cross others at the tapered rims of closed leaves with notches, slits and narrow lobes.

    python scripts/measure_rims.py [--kinds star clover ginkgo] [--parts N ...] [--shares S ...] [--rims MM ...]
        [--steps MM ...] [--turn DEGREES] [--seed N] [--each] [--remesh] [--reduce] [--real SCAN ...]

Stars have so many tips and straight sides between them, down to a share of their radius of 3 mm; clovers so many
round leaflets with sharp notches between them; ginkgos are fans of so many lobes with slits between them. All lie on a
cylinder and carry the hairs of a synthetic CT volume; by default they are 108 leaves. Real scans in millimeters carry
them too. Printed are, for each kind and with `--each` for each leaf: those that are sound, one watertight solid, and
the triangles that cross others with nothing lowered beside the rim and as they are meshed, with the vertices lowered
and by how many millimeters at most; with `--remesh` the same of the mesh remeshed to edges of a step, and with
`--reduce` of tiles simplified to a third and of tiles remeshed to edges of a step. A rim of 0 is no taper.
"""

import argparse
import itertools
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely

import o3dleaf as o3l
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.surface.mesh.crossings import find_crossings

RADIUS, BEND = 3.0, 15.0
"""Of a leaf, and of the cylinder that it lies on, in millimeters."""
FAN, SLIT = 200.0, 7.0
"""Angle of a ginkgo, and of each of its slits, in degrees."""
SHARE = 1 / 3
"""Of its triangles that a tile is simplified to."""


def polar(angle, radius):
    """Return the points (n, 2) at angles and distances from the origin."""
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def star(parts, share, turn):
    """Return a star whose notches are at a share of its radius."""
    number = np.arange(2 * parts)
    return shapely.Polygon(polar(number * np.pi / parts + turn, RADIUS * np.where(number % 2, share, 1.0)))


def clover(parts, share, turn):
    """Return leaflets that meet at a share of the radius."""
    angle = np.linspace(0, 2 * np.pi, 120 * parts, endpoint=False)
    radius = RADIUS * (share + (1 - share) * np.abs(np.cos(parts * angle / 2)))
    return shapely.Polygon(polar(angle + turn, radius))


def ginkgo(parts, share, turn):
    """Return a fan with slits down to a share of its radius."""
    half, wide = np.radians(FAN / 2), np.radians(SLIT / 2)
    angle = np.linspace(-half, half, 241) + turn
    area = shapely.Polygon(np.vstack([[0.0, 0.0], polar(angle, RADIUS * (1 + 0.06 * np.cos(9 * angle)))]))
    for middle in np.linspace(-half, half, parts + 1)[1:-1] + turn:
        corners = np.array([middle, middle - wide, middle + wide]), RADIUS * np.array([share, 1.3, 1.3])
        area = area - shapely.Polygon(polar(*corners))
    return area


KINDS = {"star": star, "clover": clover, "ginkgo": ginkgo}


def bent_surface():
    """Return a cylinder over its chart, with room for the largest leaf."""
    ticks = np.linspace(-1.3 * RADIUS, 1.3 * RADIUS, 21)
    s, c = (each.ravel() for each in np.meshgrid(ticks, ticks, indexing="ij"))
    points = np.column_stack([BEND * np.sin(s / BEND), c, BEND * np.cos(s / BEND) - BEND])
    return o3l.ChartSurface.fit(np.column_stack([s, c]), points, smoothing=0.0, unit="mm", points_per_ball=2 * len(s))


def leaf_of(texture, surface, area, radius):
    """Return the leaf over an area of the chart, its rim as wide as the radius."""
    ring = shapely.get_coordinates(area.exterior)[:-1]
    margin = o3l.Margin(ring, ring, spacing=0.1, unit="mm")
    return o3l.MultiscaleLeaf(texture, blade=o3l.ParametricBlade(surface, margin, rim_radius=radius or None))


@dataclass
class Figures:
    """Sums over leaves."""

    leaves: int = 0
    sound: int = 0
    triangles: int = 0
    crossed: int = 0
    crossing: int = 0
    lowered: int = 0
    most: float = 0.0
    others: dict = field(default_factory=dict)

    def add(self, other):
        """Add those of other leaves."""
        for name in ("leaves", "sound", "triangles", "crossed", "crossing", "lowered"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.most = max(self.most, other.most)
        for name, (crossing, sound) in other.others.items():
            old = self.others.get(name, (0, 0))
            self.others[name] = old[0] + crossing, old[1] + sound

    def __str__(self):
        said = (
            f"{self.leaves} leaves, {self.sound} sound, {self.triangles:,} triangles, {self.crossed} crossed, "
            f"{self.crossing} cross, {self.lowered:,} vertices lowered by {self.most:.3f}"
        )
        more = [f"; {name} {crossing} cross, {sound} sound" for name, (crossing, sound) in self.others.items()]
        return said + "".join(more)


def judge(mesh):
    """Return the triangles that cross others, and whether a mesh is one watertight solid."""
    report = o3l.mesh_report(mesh)
    return report.self_intersections, int(report.watertight and report.oriented and report.components == 1)


def figures(leaf, step, *, remesh, reduce):
    """Return the figures of one leaf."""
    plan = leaf.plan_mesh(step, closed=True)
    arrays = Arrays(plan.assembly)
    plan.assembly.emit(arrays, leaf.blade.lift)
    crossing, sound = judge(plan.extract().mesh)
    crossed = int(find_crossings(arrays.vertices, arrays.triangles).sum())
    found = Figures(1, sound, plan.triangles, crossed, crossing, len(plan.lowered.flat), plan.lowered.most)
    if remesh:
        found.others["remeshed"] = judge(plan.extract(remesh=step).mesh)
    if reduce:
        found.others["tiles simplified"] = judge(leaf.plan_mesh(step, closed=True, simplify=SHARE).extract().mesh)
        found.others["tiles remeshed"] = judge(leaf.plan_mesh(step, closed=True, remesh_tile=step).extract().mesh)
    return found


def real_leaf(path, texture, radius):
    """Return the leaf of a scan in millimeters."""
    blade = o3l.create_blade(o3l.read_point_cloud(path), unit="mm", options=o3l.BladeOptions(rim_radius=radius or None))
    return o3l.MultiscaleLeaf(texture, blade=blade)


def main():
    """Measure all leaves."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    parser.add_argument("--parts", type=int, nargs="+", default=[3, 5, 8])
    parser.add_argument("--shares", type=float, nargs="+", default=[0.35, 0.6, 0.8])
    parser.add_argument("--rims", type=float, nargs="+", default=[0.1, 0.4])
    parser.add_argument("--steps", type=float, nargs="+", default=[0.1, 0.06])
    parser.add_argument("--turn", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0, help="of the CT volume")
    parser.add_argument("--each", action="store_true")
    parser.add_argument("--remesh", action="store_true")
    parser.add_argument("--reduce", action="store_true")
    parser.add_argument("--real", type=Path, nargs="*", default=[])
    options = parser.parse_args()
    texture, surface = o3l.create_texture(o3l.samples.wheat_ct(seed=options.seed)[0]), bent_surface()
    made = {"remesh": options.remesh, "reduce": options.reduce}
    for kind in options.kinds:
        total = Figures()
        for case in itertools.product(options.parts, options.shares, options.rims, options.steps):
            parts, share, rim, step = case
            area = KINDS[kind](parts, share, np.radians(options.turn))
            found = figures(leaf_of(texture, surface, area, rim), step, **made)
            total.add(found)
            if options.each:
                print(f"    {kind} of {parts}, {share:g}, rim {rim:g}, step {step:g}: {found}", flush=True)
        print(f"{kind}: {total}", flush=True)
    for path, rim, step in itertools.product(options.real, options.rims, options.steps):
        print(f"{path.stem}, rim {rim:g}, step {step:g}: {figures(real_leaf(path, texture, rim), step, **made)}")


if __name__ == "__main__":
    main()
