"""Blades of scans with points between the edge of a leaf and what is behind it: their areas, and what is told of them.

python scripts/measure_flying.py [--kinds KIND ...] [--depths SPACINGS ...] [--spacing MM]

A point a spacing of the margin lies behind it, as deep as the beam's depth at most; a depth of 0 leaves none.
"""

import argparse

from rich.console import Console
from rich.table import Table

import o3dleaf as o3l

KINDS = ("lobed", "eaten", "petiole", "cupped", "curled", "twisted")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", default=KINDS)
    parser.add_argument("--depths", type=float, nargs="+", default=[0.0, 2.0, 3.0, 4.0], help="in spacings")
    parser.add_argument("--spacing", type=float, default=0.7)
    args = parser.parse_args()
    table = Table(title="Points behind the margin, noise 0.2 spacings")
    for name in ("leaf", "depth", "error of area", "margin that bends off", "area that does", "told"):
        table.add_column(name, justify="left" if name == "leaf" else "right")
    for kind in args.kinds:
        leaf = o3l.samples.leaf_shape(kind)
        for depth in args.depths:
            points = o3l.samples.scan_leaf(leaf, spacing=args.spacing, noise=0.2, flying=depth, seed=1).points
            quality = o3l.FitQuality.of(o3l.create_blade(points, unit="mm"), points)
            error, bent = quality.area[0] / leaf.area - 1, quality.bent
            told = "yes" if bent.warnings else "no"
            table.add_row(kind, f"{depth:g}", f"{error:+.1%}", f"{bent.length:.0%}", f"{bent.area:.1%}", told)
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
