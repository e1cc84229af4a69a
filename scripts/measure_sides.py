"""Clouds without normals, of thin parts under noise: at which scale they are a surface, and how many sides are right.

python scripts/measure_sides.py [--points N] [--noise SHARE ...] [--seeds N]

Flatness is that of neighborhoods of sixteen points, and of twelve over it; balls and boxes that points fill are there
to compare with. Noise is in shares of the diagonal; a side is right where a normal faces as the solid's does at the
nearest place.
"""

import argparse
import warnings

import numpy as np
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import FEW, flatness_of

SOLIDS = ("fold", "fins", "gap", "bumps")
FILLED = ("ball", "box")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.002, 0.005], help="of the box's diagonal")
    parser.add_argument("--seeds", type=int, default=3)
    args = parser.parse_args()
    table = Table(title="Sides of clouds without normals")
    for name in ("cloud", "noise", "seed", "flatness", "of twelve", "thinned", "planes of", "right"):
        table.add_column(name)
    for kind in FILLED:
        for seed in range(args.seeds):
            table.add_row(kind, "-", str(seed), *scale_of(filled(kind, args.points, seed)), "-")
    for kind in SOLIDS:
        solid = getattr(o3l.samples, kind)()
        exact, _ = solid.sample(args.points)
        for noise in args.noise:
            sigma = noise * np.linalg.norm(np.ptp(exact, axis=0))
            for seed in range(args.seeds):
                points = exact + sigma * np.random.default_rng(seed).normal(size=exact.shape)
                table.add_row(kind, f"{noise:.1%}", str(seed), *scale_of(points), share_right(solid, points))
    Console(width=100).print(table)


def filled(kind, count, seed):
    """Return points (count, 3) that fill a ball or a box."""
    random = np.random.default_rng(seed)
    if kind == "box":
        return random.uniform(size=(count, 3)) * [3, 2, 1]
    direction = random.normal(size=(count, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True) * np.cbrt(random.uniform(size=(count, 1)))


def scale_of(points):
    """Return the flatness of a cloud, that of fewer neighbors over it, its thinning and the neighbors of its planes."""
    cloud = OrientedCloud.of(points)
    rows = cloud.neighbors.row
    flat, few = flatness_of(points, rows), flatness_of(points, np.ascontiguousarray(rows[:, :FEW]))
    scale = cloud.surfels.scale
    return f"{flat:.3f}", f"{few / flat:.3f}", str(scale.thinning), "none" if scale.full else str(scale.neighbors)


def share_right(solid, points):
    """Return in words the share of normals on the right side, or that the cloud was refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            cloud = o3l.preprocess_point_cloud(points)
        except O3DLeafError:
            return "refused"
    normals = solid.closest(cloud.points).normals
    return f"{np.mean(np.einsum('ij,ij->i', cloud.normals, normals) > 0):.2%}"


if __name__ == "__main__":
    main()
