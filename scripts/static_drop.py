"""A drop at rest on a leaf, by Surface Evolver: its height, base and contact area, and a picture.

    python scripts/static_drop.py leaf.o3l --at 89.35 0.14 --angle 150 --diameter 0.6 -o drop.png

`--all-waves` keeps the heights along the leaf, too, instead of their mean; a run takes four times as long.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np

import o3dleaf as o3l
from o3dleaf.output.static_drop.evolver import settle_drop, write_drop
from o3dleaf.output.static_drop.shape import DropShape
from o3dleaf.output.static_drop.site import drop_on_leaf

mpl.use("Agg")

from matplotlib import pyplot as plt


def draw(shape: DropShape, path: Path) -> None:
    """Draw the drop on its ground, cut along and across."""
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.4), sharey=True, layout="constrained")
    for axis, (panel, name) in enumerate(zip(axes, ("along", "across"), strict=True)):
        half = 1e3 * min(shape.drop.ground.size[axis] / 2, 0.8 * shape.drop.diameter)
        ticks = np.linspace(-half, half, 400) / 1e3
        places = (ticks, 0 * ticks) if axis == 0 else (0 * ticks, ticks)
        ground = shape.drop.ground
        heights = ground.raised(-ground.coefficients[0, 0])(*places) * 1e3
        corners = 1e3 * shape.vertices[shape.triangles]
        for triangle in corners:  # where the plane through the middle meets the surface
            other = triangle[:, 1 - axis]
            ends = []
            for i, j in ((0, 1), (1, 2), (2, 0)):
                if (other[i] < 0) != (other[j] < 0):
                    t = other[i] / (other[i] - other[j])
                    ends.append(triangle[i] + t * (triangle[j] - triangle[i]))
            if len(ends) == 2:
                panel.plot(*np.array(ends)[:, [axis, 2]].T, color="tab:blue")
        panel.fill_between(ticks * 1e3, heights, heights.min() - 0.05, color="tab:green", alpha=0.6)
        panel.set(aspect="equal", xlabel=f"{name}, mm", xlim=(-half, half))
    axes[0].set_ylabel("mm")
    figure.savefig(path, dpi=130)


def main() -> None:
    """Read the command line, let the drop come to rest, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--at", type=float, nargs=2, required=True, metavar=("ALONG", "ACROSS"))
    parser.add_argument("--angle", type=float, nargs="+", default=[150.0])
    parser.add_argument("--diameter", type=float, default=0.6, help="in millimeters")
    parser.add_argument("--all-waves", action="store_true")
    parser.add_argument("-o", "--output", type=Path, help="a picture; of the last angle")
    parser.add_argument("--file", type=Path, help="the data file, too")
    given = parser.parse_args()
    leaf = o3l.load(given.model)
    drop = drop_on_leaf(leaf, tuple(given.at), diameter=given.diameter, mean_along=not given.all_waves)
    for angle in given.angle:
        drop = replace(drop, angle=angle)
        shape = settle_drop(drop)
        print(f"contact angle {angle:g}°", *shape.lines(), sep="\n    ")
    if given.file is not None:
        write_drop(drop, given.file)
    if given.output is not None:
        draw(shape, given.output)


if __name__ == "__main__":
    main()
