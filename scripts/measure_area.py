"""Areas of blades of random scans: their errors over the standard deviation that is told of them.

python scripts/measure_area.py [--points N ...] [--noise SPACINGS ...] [--slenderness RATIO] [--seeds N]

The leaf is a flat ellipse 36 mm wide, its noise the same along all axes. Root mean squares of one say that the
deviation is right; it is an upper bound where they are less.
"""

import argparse

import numpy as np
import shapely
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l

HALF_WIDTH = 18.0
CORNERS = 512
"""Of a quarter of the ellipse."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[250, 400, 1000])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.3], help="in spacings")
    parser.add_argument("--slenderness", type=float, default=5 / 3, help="length over width")
    parser.add_argument("--seeds", type=int, default=16)
    args = parser.parse_args()
    ellipse = shapely.affinity.scale(shapely.Point(0, 0).buffer(1, CORNERS), args.slenderness * HALF_WIDTH, HALF_WIDTH)
    table = Table(title="Errors of areas")
    for name in ("points", "noise", "deviation", "mean error", "rms error", "rms error / deviation"):
        table.add_column(name, justify="right")
    for count in args.points:
        for noise in args.noise:
            error, told = np.array([measure(ellipse, count, noise, seed) for seed in range(args.seeds)]).T
            rms, share = (float(np.sqrt(np.mean(values**2))) for values in (error, error / told))
            table.add_row(
                f"{count:,}", f"{noise:g}", f"{told.mean():.2%}", f"{error.mean():+.2%}", f"{rms:.2%}", f"{share:.2f}"
            )
    Console(width=100).print(table)


def measure(ellipse, count, noise, seed):
    """Return the error of the area of a blade and the deviation told of it, in shares of the true area."""
    random = np.random.default_rng(seed)
    places = random.uniform(ellipse.bounds[:2], ellipse.bounds[2:], (20 * count, 2))
    places = places[shapely.contains_xy(ellipse, *places.T)][:count]
    spacing = np.sqrt(ellipse.area / count)
    points = np.pad(places, ((0, 0), (0, 1))) + noise * spacing * random.normal(size=(count, 3))
    quality = o3l.FitQuality.of(o3l.create_blade(points, unit="mm"), points)
    return quality.area[0] / ellipse.area - 1, quality.area_deviation / ellipse.area


if __name__ == "__main__":
    main()
