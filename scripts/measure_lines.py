"""Blades of scan lines that lie farther apart than the points along them: errors of areas, deviations told, margins.

python scripts/measure_lines.py [--kinds ...] [--ratios R ...] [--angles DEGREES ...] [--noise SPACINGS ...]
    [--jitter S] [--seeds N] [--held-out]

Lines are straight in the chart, at an angle to the midrib, their distance R times the step of the points along them;
each begins anywhere, and points are off their places along it and across by `jitter` steps. Areas are relative to the
leaf's; `told` is the deviation that the blade has of its area by chance, and the last two lines the root mean squares
of errors and of errors over what is told.
"""

import argparse

import numpy as np
from leaf_cases import HELD_OUT, HELD_OUT_SEED, HELD_OUT_SPACING, KINDS, SPACING, SPACINGS
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=["curled", "winding", "lobed"])
    parser.add_argument("--ratios", type=float, nargs="+", default=[1.0, 4.0, 6.0, 8.0])
    parser.add_argument("--angles", type=float, nargs="+", default=[0.0, 20.0, 90.0])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.2], help="in spacings")
    parser.add_argument("--jitter", type=float, default=0.1, help="in steps along a line")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    args = parser.parse_args()
    table = Table(title="Scan lines")
    for name in ("leaf", "ratio", "angle", "noise", "points", "area", "told", "holes"):
        table.add_column(name, justify="left" if name == "leaf" else "right")
    errors = []
    for kind in args.kinds:
        parameters = dict((HELD_OUT if args.held_out else KINDS)[kind])
        leaf = o3l.samples.leaf_shape(parameters.pop("kind", kind), **parameters)
        spacing = SPACINGS.get(kind, SPACING) * (HELD_OUT_SPACING if args.held_out else 1.0)
        for ratio in args.ratios:
            for angle in args.angles:
                for noise in args.noise:
                    for seed in range(args.seeds):
                        rng = np.random.default_rng(seed + HELD_OUT_SEED * args.held_out)
                        places = scan_lines(leaf, spacing, ratio, np.radians(angle), args.jitter, rng)
                        count, error, told, holes = measure(leaf, places, noise * spacing, rng)
                        errors.append((error, error / told))
                        row = (
                            kind,
                            f"{ratio:g}",
                            f"{angle:g}",
                            f"{noise:g}",
                            f"{count:,}",
                            f"{error:+.2%}",
                            f"{told:.2%}",
                        )
                        table.add_row(*row, f"{holes} of {leaf.holes}")
                        print(*row, holes, flush=True)
    Console(width=100).print(table)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"errors: root mean square {rms[0]:.2%}, largest {np.abs(errors).max(axis=0)[0]:.2%}")
    print(f"errors over what is told: root mean square {rms[1]:.2f}, largest {np.abs(errors).max(axis=0)[1]:.2f}")


def measure(leaf, places, noise, rng):
    """Return the number of points, the error of a blade's area, the deviation told, both as shares, and its holes."""
    points = leaf.lift(places)
    points += rng.normal(0.0, noise, points.shape)
    blade = o3l.create_blade(points, unit="mm")
    quality = o3l.FitQuality.of(blade, points)
    told = quality.area_deviation / leaf.area
    return len(points), quality.area[0] / leaf.area - 1, told, len(blade.outline.hole_rings)


def scan_lines(leaf, spacing, ratio, angle, jitter, rng):
    """Return places (n, 2) on lines in the chart, `ratio` times as far apart as along them."""
    low, high = np.reshape(leaf.outline.bounds, (2, 2))
    middle, reach = (low + high) / 2, np.linalg.norm(high - low) / 2
    step, apart = spacing / np.sqrt(ratio), spacing * np.sqrt(ratio)
    along, across = (np.arange(-reach - each, reach + each, each) for each in (step, apart))
    begin = np.stack([rng.uniform(0, step, len(across)), np.full(len(across), rng.uniform(0, apart))], axis=1)
    places = np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1) + begin
    places = places.reshape(-1, 2) + rng.normal(0.0, jitter * step, (along.size * across.size, 2))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    places = middle + places @ turn
    return places[leaf.contains(places)]


if __name__ == "__main__":
    main()
