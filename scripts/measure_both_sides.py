"""Scans that have both sides of a leaf: the area of the blade through them, and how far it is from their middle.

python scripts/measure_both_sides.py [--kinds KIND ...] [--thickness SPACINGS ...] [--noise SPACINGS ...] [--share S]

Half of the points, or another share, are put on one side of the leaf and the others on the other, half its thickness
off its middle along the normal. Errors of the middle are of the mesh's vertices, the median, in spacings.
"""

import argparse
import warnings

import numpy as np
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError

SPACING = 0.7
"""Of both sides together, in millimeters."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", default=["lobed", "curled"])
    parser.add_argument("--thickness", type=float, nargs="+", default=[1.0, 2.0, 3.0, 4.0, 6.0])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.2])
    parser.add_argument("--share", type=float, default=0.5, help="of the points that lie on the upper side")
    args = parser.parse_args()
    table = Table(title="Blades through both sides of a leaf")
    for name in ("leaf", "thickness", "noise", "area", "off the middle", "layers told"):
        table.add_column(name)
    for kind in args.kinds:
        for thickness in args.thickness:
            for noise in args.noise:
                found = blade_between(o3l.samples.leaf_shape(kind), thickness, noise, args.share)
                table.add_row(kind, f"{thickness:g}", f"{noise:g}", *found)
    Console(width=110).print(table)


def blade_between(leaf, thickness, noise, share):
    """Return in words the relative error of a blade's area, its distance from the middle, and if layers are told."""
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=SPACING, noise=noise)
    side = np.where(np.random.default_rng(1).random(len(scan.places)) < share, 0.5, -0.5)
    points = scan.points + (thickness * SPACING * side)[:, np.newaxis] * leaf.normals(scan.places)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            blade = o3l.create_blade(points, unit="mm")
        except O3DLeafError as cause:
            return "refused", "-", str(cause).split(":")[0]
    mesh = blade.extract_mesh(SPACING / 2)
    vertices = np.asarray(mesh.vertices)
    off = np.linalg.norm(vertices - leaf.closest(vertices)[0], axis=1) / SPACING
    told = [note for note in blade.notes if "sides of a leaf" in note or "both sides" in note]
    return f"{mesh.get_surface_area() / leaf.area - 1:+.1%}", f"{np.median(off):.2f}", "yes" if told else "no"


if __name__ == "__main__":
    main()
