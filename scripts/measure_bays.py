"""Margins with narrow bays: errors of areas by the width of bays in spacings, in the plane, where they are known.

    python scripts/measure_bays.py [--samplers ...] [--seeds N] [--held-out]

One line a leaf: for each sampler the mean error of the area of what the sample covers, with what is missing beyond it,
that of the margin, the standard deviation of this, and the mean number of holes kept. Slits are 12 spacings deep,
leaflets 8 wide and 18 long, teeth so many spacings apart and deep; the ellipse and the strip have no bays.
"""

import argparse

import numpy as np
import shapely
import shapely.affinity

from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.sample_region import cover_sample

HELD_OUT_SEED = 1000


def slits(width, depth=12.0, length=90.0, half=13.0, count=6):
    """Return a strip with slits from either side by turns."""
    leaf = shapely.box(0, -half, length, half)
    for number, x in enumerate(np.linspace(0, length, count + 2)[1:-1]):
        side = 1 if number % 2 else -1
        low, high = sorted([side * (half + 1), side * (half - depth)])
        leaf = leaf.difference(shapely.box(x - width / 2, low, x + width / 2, high))
    return leaf


def pinnate(gap, leaflet=8.0, length=18.0, rachis=6.0, count=6):
    """Return leaflets at both sides of a rachis, so many spacings apart."""
    parts = [shapely.box(0, -rachis / 2, count * (leaflet + gap) + 4, rachis / 2)]
    begins, end = 2 + (leaflet + gap) * np.arange(count), length + rachis / 2
    parts += [shapely.box(x, -end, x + leaflet, end) for x in begins]
    return shapely.union_all(parts)


def teeth(pitch, depth, length=100.0, half=14.0):
    """Return a strip with triangular teeth along both sides."""
    count = int(length / pitch)
    up = [(pitch * (i + part), half + 2 * part * depth) for i in range(count) for part in (0.0, 0.5)]
    up.append((count * pitch, half))
    return shapely.Polygon(up + [(x, -y) for x, y in up][::-1])


def family(*, held_out):
    """Return leaves by name, in spacings."""
    if held_out:
        widths, gaps, sizes = (1.8, 2.7, 3.3, 4.4), (2.4, 3.2, 3.8, 4.6), ((5, 6), (10, 7))
        named = {f"slits {width}": slits(width, 15.0, 110.0, 17.0, 7) for width in widths}
        named |= {f"leaflets {gap}": pinnate(gap, 10.0, 14.0, 8.0, 5) for gap in gaps}
    else:
        widths, gaps, sizes = (1.5, 2, 2.5, 3, 3.5, 4, 5), (2, 3, 3.5, 4, 5, 7), ((6, 5), (8, 6), (12, 8))
        named = {f"slits {width:g}": slits(width) for width in widths}
        named |= {f"leaflets {gap:g}": pinnate(gap) for gap in gaps}
    named |= {f"teeth {pitch} by {depth}": teeth(pitch, depth) for pitch, depth in sizes}
    size = 1.1 if held_out else 1.2
    named["ellipse"] = shapely.affinity.scale(shapely.Point(0, 0).buffer(50, quad_segs=500), size, 0.4 * size)
    named["strip"] = shapely.box(0, 0, 250, 8 if held_out else 9)
    return named


def independent(leaf, rng):
    """Return independent points (n, 2), one for each unit of area in the mean."""
    low, high = np.reshape(leaf.bounds, (2, 2))
    places = rng.uniform(low, high, (rng.poisson(np.prod(high - low)), 2))
    return places[shapely.contains_xy(leaf, *places.T)]


def jittered(leaf, rng):
    """Return the points (n, 2) of a lattice, turned and shifted at random, each moved by a fifth of its step."""
    low, high = np.reshape(leaf.bounds, (2, 2))
    reach = int(np.linalg.norm(high - low) / 2) + 3
    places = np.stack(np.meshgrid(*2 * [np.arange(-reach, reach + 1.0)]), axis=-1).reshape(-1, 2)
    places += rng.uniform(0, 1, 2) + rng.normal(0, 0.2, places.shape)
    angle = rng.uniform(0, np.pi)
    places = places @ [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]] + (low + high) / 2
    return places[shapely.contains_xy(leaf, *places.T)]


SAMPLERS = {"independent": independent, "jittered": jittered}


def measure(leaf, sampler, seed):
    """Return errors of what is covered and of the margin, as shares of the area, and the number of holes."""
    rng = np.random.default_rng(seed)
    leaf = shapely.affinity.rotate(leaf, float(rng.uniform(0, 180)), origin="centroid")
    points = SAMPLERS[sampler](leaf, rng)
    region = cover_sample(np.unique(points, axis=0))
    area = shapely.area(shapely.polygons(region.points[region.triangles])).sum() + region.missing.sum()
    margin = Margin.fit(points)
    return area / leaf.area - 1, margin.area / leaf.area - 1, len(margin.hole_rings)


def main():
    """Measure every leaf."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samplers", nargs="+", choices=list(SAMPLERS), default=list(SAMPLERS))
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--held-out", action="store_true", help="other leaves, to be run once, at the end")
    args = parser.parse_args()
    first = HELD_OUT_SEED if args.held_out else 0
    for name, leaf in family(held_out=args.held_out).items():
        row = []
        for sampler in args.samplers:
            found = np.array([measure(leaf, sampler, first + seed) for seed in range(args.seeds)])
            covered, margin, holes = found.mean(axis=0)
            spread = found[:, 1].std()
            row.append(f"{sampler} {covered:+6.1%} {margin:+6.1%} ({spread:.1%}), {holes:.1f} holes")
        print(f"{name:<14}", " | ".join(row), flush=True)


if __name__ == "__main__":
    main()
