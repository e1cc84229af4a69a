"""Midribs of flat leaves whose own is known: how far the one found lies from it at the base, at the tip, and between.

    python scripts/measure_midribs.py [--roughness SHARE ...] [--count N] [--held-out]

The leaves are bent in their plane and cut off obliquely, their margins rough. Distances are in widths: the median, the
largest of nine tenths of the leaves, and the largest; between the ends it is the largest of the inner eight tenths.
"""

import argparse

import numpy as np
import shapely

from o3dleaf.leaf.chart.midline import find_midline
from o3dleaf.samples.leaves.cut_base import drawn_cut_leaf
from o3dleaf.samples.leaves.plane_mesh import triangulate

STEPS = 14
"""Of the mesh, in a width."""


def measure(leaf):
    """Return the distances of a leaf's midrib at base and tip and between, in widths."""
    vertices, triangles = triangulate(leaf.outline, leaf.width / STEPS)
    world = np.insert(vertices, 2, 0.0, axis=1)
    found = find_midline(world, triangles, vertices, base=np.append(leaf.midrib[0], 0.0))
    ends = np.linalg.norm([found.base - leaf.midrib[0], found.tip - leaf.midrib[-1]], axis=1)
    away = shapely.distance(shapely.points(found.curve), shapely.LineString(leaf.midrib))
    tenth = len(away) // 10
    return np.array([*ends, away[tenth:-tenth].max()]) / leaf.width


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--roughness", type=float, nargs="+", default=[0.0, 0.05, 0.1])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--held-out", action="store_true", help="others, to be run once, at the end")
    args = parser.parse_args()
    for roughness in args.roughness:
        leaves = [drawn_cut_leaf(number, roughness, held_out=args.held_out) for number in range(args.count)]
        found = np.array([measure(leaf) for leaf in leaves])
        print(f"margins rough by {roughness:g}")
        for name, away in zip(("base", "tip", "between"), found.T, strict=True):
            print(f"   {name:8}", *(f"{np.quantile(away, share):.3f}" for share in (0.5, 0.9, 1)), flush=True)
