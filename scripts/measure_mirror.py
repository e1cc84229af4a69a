"""Hide a stretch of the margin of real leaves, and measure how near its mirror image comes to what was hidden.

    python scripts/measure_mirror.py SCAN [SCAN ...] [--side upper|lower]

Of each scan the points beyond three fifths of one half are taken away over a third of the leaf. Printed are the
shares of them within one and two spacings of the blade without and with `complete_margin`, and the areas of both
over that of the blade of all points.
"""

import argparse

import numpy as np
import shapely
from leaf_errors import spacing_of

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.mesh.deviation import distance_to_mesh

DEPTH = 0.6
"""Of a half's width: what lies beyond is hidden."""
STRETCH = (0.35, 0.68)
"""Of the leaf's length."""
SHORTEST = 0.5
"""Of the hidden stretch: the length that is asked to be completed."""


def hide(points, side):
    """Return the blade of all points, which of them (n,) are hidden, and the length of the stretch."""
    blade = o3l.create_blade(points)
    u, v = blade.flatten(points)[:, :2].T
    start, stop = (blade.outline.bounds[0, 0] + share * np.ptp(blade.outline.bounds[:, 0]) for share in STRETCH)
    ends = float(blade.outline.bounds[int(side == "upper"), 1])
    ways = shapely.linestrings(np.stack([np.stack([u, 0 * u], 1), np.stack([u, 0 * u + ends], 1)], axis=1))
    half = shapely.length(shapely.intersection(ways, blade.outline.polygon))
    return blade, (u > start) & (u < stop) & (np.sign(ends) * v > DEPTH * half), stop - start


def run(path, side):
    """Print the line of one scan."""
    points = np.asarray(o3l.read_point_cloud(path).points)
    spacing = spacing_of(points)
    whole, hidden, length = hide(points, side)
    said = [f"{path}: {hidden.mean():.1%} of {len(points):,} points hidden over {length:.4g}"]
    for asked in (None, SHORTEST * length):
        blade = o3l.create_blade(points[~hidden], options=o3l.BladeOptions(complete_margin=asked))
        away = distance_to_mesh(*mesh_arrays(blade.extract_mesh(spacing)), points[hidden])
        near = ", ".join(f"{np.mean(away <= k * spacing):.1%} within {k}" for k in (1, 2))
        area = blade.outline.area / whole.outline.area
        said.append(f"{'completed' if asked else 'as seen'}: {near}, area {area:.3f}")
    print("; ".join(said), flush=True)
    print("\n".join(f"    {note}" for note in blade.notes if "margin" in note), flush=True)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scans", nargs="+", metavar="SCAN")
    parser.add_argument("--side", choices=("upper", "lower"), default="upper")
    options = parser.parse_args(arguments)
    for path in options.scans:
        run(path, options.side)


if __name__ == "__main__":
    main()
