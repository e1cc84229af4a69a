"""Blades of leaves with veins, ruffles and blisters: the area that they lack, and what is told of it.

python scripts/measure_relief.py [--only NAME ...] [--noise SPACINGS ...] [--seeds N] [--held-out]
    [--samples CONDITION ...] [--real SCAN UNIT ...] [--bandwidth SPACINGS]

Heights stand along the normal of a leaf that curls up by 40°: veins with a Gaussian profile of a width at half height,
side veins 7 mm apart; waves that grow to the margin with the cube of the distance from the midrib; waves both ways.
Points are random, of two passes a noise deviation apart where their number says so. Lengths are in millimeters.
"""

import argparse
import time

import numpy as np
import shapely
from leaf_cases import CONDITIONS, KINDS, cases

import o3dleaf as o3l
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.fitting.rbf.kernels import as_kernel

SIDE = np.radians(50.0)
CELLS = 400_000
FAMILY = {
    "smooth": (),
    "smooth, two passes": ("passes",),
    "veins 0.5 high, 1 wide": ("veins", 0.5, 1.0, 7.0),
    "veins 0.5 high, 1.5 wide": ("veins", 0.5, 1.5, 7.0),
    "veins 0.5 high, 2.5 wide": ("veins", 0.5, 2.5, 7.0),
    "ruffles 5 high, 12 long": ("ruffles", 5.0, 12.0),
    "ruffles 5 high, 8 long": ("ruffles", 5.0, 8.0),
    "ruffles 3 high, 6 long": ("ruffles", 3.0, 6.0),
    "blisters 0.5 high, 6 long": ("blisters", 0.5, 6.0),
    "blisters 0.5 high, 4 long": ("blisters", 0.5, 4.0),
    "blisters 0.4 high, 2.8 long": ("blisters", 0.4, 2.8),
    "blisters 0.4 high, 2.1 long": ("blisters", 0.4, 2.1),
    "blisters 0.4 high, 1.4 long": ("blisters", 0.4, 1.4),
}
HELD_OUT = {
    "smooth": (),
    "smooth, two passes": ("passes",),
    "veins 0.7 high, 1.2 wide": ("veins", 0.7, 1.2, 9.0),
    "veins 0.3 high, 0.8 wide": ("veins", 0.3, 0.8, 5.0),
    "veins 0.6 high, 2 wide": ("veins", 0.6, 2.0, 8.0),
    "ruffles 4 high, 9 long": ("ruffles", 4.0, 9.0),
    "ruffles 2.5 high, 5 long": ("ruffles", 2.5, 5.0),
    "blisters 0.6 high, 5 long": ("blisters", 0.6, 5.0),
    "blisters 0.3 high, 3.3 long": ("blisters", 0.3, 3.3),
    "blisters 0.2 high, 1.5 long": ("blisters", 0.2, 1.5),
    "veins 0.2 high, 0.5 wide": ("veins", 0.2, 0.5, 2.0),
}
"""With another leaf, spacing and seeds; to be run once, when all choices are made."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", help="words that names begin with")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.2, 0.5], help="in spacings")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--held-out", action="store_true", help="other leaves and seeds, to be run once, at the end")
    parser.add_argument(
        "--samples", nargs="+", default=[], choices=CONDITIONS, help="smooth leaves so scanned, instead"
    )
    parser.add_argument("--real", nargs="+", default=[], help="scans, each with its unit, instead")
    parser.add_argument("--bandwidth", type=float, help="of the smoothing, in spacings, instead of the one chosen")
    args = parser.parse_args()
    row("leaf", "noise", "points", "area", "lacks", "deviation", "told", "read-out")
    for path, unit in zip(args.real[::2], args.real[1::2], strict=True):
        show(path.split("/")[-1], "-", o3l.read_point_cloud(path), unit)
    words = tuple(args.only or [""])
    for case in cases([kind for kind in KINDS if kind.startswith(words)], args.samples, 1):
        sample = case.scan()
        show(
            f"{case.name}, {case.condition}",
            f"{sample.noise / sample.spacing:g}",
            sample.points,
            "mm",
            (sample.truth, ()),
        )
    family = HELD_OUT if args.held_out else FAMILY
    for name, relief in family.items() if not (args.real or args.samples) else ():
        for noise in args.noise if name.startswith(words) else ():
            for seed in range(args.seeds):
                leaf, points = scan(relief, noise, seed, held_out=args.held_out)
                show(name, f"{noise:g}", points, "mm", leaf, args.bandwidth)


def row(name, *cells):
    print(f"{name:<30}" + "".join(f"{cell:>11}" for cell in cells), flush=True)


def show(name, noise, points, unit, leaf=None, bandwidth=None):
    """Print the row of a scan; of a leaf (shape, relief) with the error of its area."""
    smoothing = "robust"
    if bandwidth is not None:
        spacing = np.sqrt(area_of(*leaf) / len(points))
        smoothing = as_kernel("cubic", 2).smoothing_for(bandwidth * spacing, 1 / spacing**2)
    try:
        blade = o3l.create_blade(points, unit=unit, options=o3l.BladeOptions(smoothing=smoothing))
    except ReconstructionError:
        row(name, noise, "refused")
        return
    start = time.process_time()
    quality = o3l.FitQuality.of(blade, points)
    seconds = time.process_time() - start
    lost, error = quality.lost, "-" if leaf is None else f"{quality.area[0] / area_of(*leaf) - 1:+.1%}"
    where = "short" if lost.is_short else f"{len(lost.places)} places" if lost.places else "all over"
    figures = f"{len(quality.plane):,}", error, f"{lost.share:+.1%}", f"{lost.deviation:.1%}"
    row(name, noise, *figures, where if lost.told else "no", f"{seconds:.1f} s")


def scan(relief, noise, seed, *, held_out):
    """Return a leaf with its relief, and the points (n, 3) of a scan."""
    length, width, spacing = (65.0, 44.0, 0.6) if held_out else (80.0, 36.0, 0.7)
    leaf = o3l.samples.leaf_shape("curled", length=length, width=width, angle=40)
    passes = {"passes": 2} if relief == ("passes",) else {}
    sample = o3l.samples.scan_leaf(leaf, spacing=spacing, noise=noise, seed=seed + 500 * held_out, **passes)
    height = heights(relief, sample.places, width / 2)
    return (leaf, relief), sample.points + height[:, np.newaxis] * leaf.normals(sample.places)


def heights(relief, plane, half):
    """Return the heights (n,) of a relief at (n, 2) places of a leaf of half a width."""
    u, v = plane.T
    match relief:
        case ("veins", high, wide, apart):
            away = (np.mod(u - np.abs(v) / np.tan(SIDE) + apart / 2, apart) - apart / 2) * np.sin(SIDE)
            return high * np.exp2(-((2 * np.minimum(np.abs(away), np.abs(v)) / wide) ** 2))
        case ("ruffles", high, long):
            return high * (np.abs(v) / half) ** 3 * np.sin(2 * np.pi * u / long)
        case ("blisters", high, long):
            return high * np.sin(2 * np.pi * u / long) * np.sin(2 * np.pi * v / long)
    return np.zeros(len(plane))


def area_of(leaf, relief, reach=1e-3):
    """Return the area of a leaf with a relief, by difference quotients on a lattice."""
    low, high = np.reshape(leaf.outline.bounds, (2, 2))
    step = np.sqrt(np.prod(high - low) / CELLS)
    lattice = np.meshgrid(*(np.arange(*ends, step) + step / 2 for ends in zip(low, high, strict=True)), indexing="ij")
    places = np.stack(lattice, axis=-1).reshape(-1, 2)
    places = places[shapely.contains_xy(leaf.outline, places)]

    def difference(way):
        ends = [np.clip(places + sign * reach * way, low, high) for sign in (1, -1)]
        space = [leaf.lift(p) + heights(relief, p, high[1])[:, np.newaxis] * leaf.normals(p) for p in ends]
        return (space[0] - space[1]) / ((ends[0] - ends[1]) @ way)[:, np.newaxis]

    cross = np.cross(difference(np.array([1.0, 0.0])), difference(np.array([0.0, 1.0])))
    return float(np.linalg.norm(cross, axis=1).mean() * leaf.outline.area)


if __name__ == "__main__":
    main()
