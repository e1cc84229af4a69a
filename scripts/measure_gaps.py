"""How long the gaps are that chance leaves among random points: what `leaf/sheet/slits` takes for a slit is longer.

python scripts/measure_gaps.py [--points N ...] [--draws N]

Prints, for each width of gap, the median, ninth tenth and maximum over draws of the longest gap as wide, in spacings,
and how many draws have one that would be taken for a slit.
"""

import argparse

import numpy as np
from scipy.spatial import Delaunay

from o3dleaf.leaf.sheet.pieces.slits import GAPS, Sheet

BORDER = 2.0
"""Spacings along the border of the square that do not count: triangles of the convex hull are long there."""


def longest_gaps(count, rng):
    """Return the longest gap (w,) of each width among random points one spacing apart on the mean."""
    side = np.sqrt(count)
    flat = rng.uniform(0, side, (count, 2))
    triangles = Delaunay(flat).simplices.astype(np.int64)
    middles = flat[triangles].mean(axis=1)
    inside = np.all((middles > BORDER) & (middles < side - BORDER), axis=1)
    sheet = Sheet.of(np.column_stack([flat, np.zeros(count)]), triangles[inside])
    return [max((sheet.length_of(rows) for rows in sheet.gaps(wide)), default=0.0) for wide, *_ in GAPS]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[2000, 20_000])
    parser.add_argument("--draws", type=int, default=24)
    given = parser.parse_args()
    for count in given.points:
        found = np.array([longest_gaps(count, np.random.default_rng(seed)) for seed in range(given.draws)])
        print(f"{count:,} points, {given.draws} draws")
        for (wide, growth, less), lengths in zip(GAPS, found.T, strict=True):
            long = growth * np.log(count) - less
            middle, most, largest = np.quantile(lengths, [0.5, 0.9, 1.0])
            print(
                f"  {wide:g} across: {middle:.1f}, {most:.1f}, {largest:.1f}; longer than {long:.1f}: "
                f"{np.sum(lengths >= long)}"
            )


if __name__ == "__main__":
    main()
