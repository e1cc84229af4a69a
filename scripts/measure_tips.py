"""Tips of leaves of known outline, and where the margin of a random sample of them ends.

python scripts/measure_tips.py [--held-out] [--seeds N]

Each leaf is 45 spacings long, with a tip of some angle whose flanks are straight, concave or convex, along a straight
line or a circle. Within twelve spacings of the end: how far the end is from the margin, the length of margin farther
than a spacing from the true one and of the true one from it, the largest distance, and areas; all in spacings.
"""

import argparse
import itertools

import numpy as np
import shapely
from scipy.spatial import cKDTree

import o3dleaf as o3l

LENGTH, WIDE, BASE, NEAR, STEP = 45.0, 10.0, 8.0, 12.0, 0.05
ANGLES, POWERS, RADII, NOISES = (15, 25, 40, 60), (0.75, 1.0, 1.3), (0, 40), (0.0, 0.0, 0.3)
HELD_OUT = (20, 32, 50), (0.85, 1.15), (0, 25), (0.0, 0.2, 0.4)


def outline(angle, power, radius):
    """Return a leaf with its tip at 0: as wide as an angle has it six spacings from there, by a power of the way."""
    way = np.linspace(0, LENGTH, 1200)
    half = WIDE * np.tanh(np.tan(np.radians(angle) / 2) * 6 * (way / 6) ** power / WIDE)
    half *= np.sqrt(1 - np.maximum((way - LENGTH + BASE) / BASE, 0) ** 2)
    turn = way / radius if radius else np.zeros_like(way)
    x, y = (-radius * np.sin(turn), radius * (1 - np.cos(turn))) if radius else (-way, turn)
    flanks = [np.stack([x + side * np.sin(turn) * half, y + side * np.cos(turn) * half], axis=1) for side in (1, -1)]
    return shapely.Polygon(np.vstack([flanks[0], flanks[1][-2:0:-1]])).buffer(0)


def sample(leaf, noise, rng):
    """Return independent points, one a square of the spacing in the mean."""
    low, high = np.reshape(leaf.bounds, (2, 2))
    points = low + rng.random((rng.poisson(np.prod(high - low)), 2)) * (high - low)
    points = points[shapely.contains_xy(leaf, *points.T)]
    return points + rng.normal(0, noise, points.shape)


def along(polygon):
    """Return places of an outline, close to each other, near the end of the leaf."""
    line = polygon.exterior
    places = shapely.get_coordinates(line.interpolate(np.arange(0, line.length, STEP)))
    return places[np.hypot(*places.T) < NEAR]


def judge(leaf, found):
    """Return what is printed of one margin."""
    true, got = along(leaf), along(found)
    there, back = cKDTree(true).query(got)[0], cKDTree(got).query(true)[0]
    near = shapely.Point(0, 0).buffer(NEAR)
    end = found.exterior.distance(shapely.Point(0, 0))
    area = found.intersection(near).area - leaf.intersection(near).area
    between = found.symmetric_difference(leaf).intersection(near).area
    return end, STEP * (there > 1).sum(), STEP * (back > 1).sum(), max(there.max(), back.max()), area, between


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--held-out", action="store_true", help="other angles, flanks, bends and noise")
    parser.add_argument("--seeds", type=int, default=6)
    asked = parser.parse_args()
    *shapes, noises = HELD_OUT if asked.held_out else (ANGLES, POWERS, RADII, NOISES)
    rows = []
    for place, (*shape, seed) in enumerate(itertools.product(*shapes, range(asked.seeds))):
        leaf, noise = outline(*shape), noises[seed % len(noises)]
        points = sample(leaf, noise, np.random.default_rng([place, asked.held_out]))
        rows.append(judge(leaf, o3l.Margin.fit(points, noise=noise).polygon))
    end, over, missed, largest, area, between = np.transpose(rows)
    print(f"{len(rows)} tips, in spacings")
    print(f"end off: median {np.median(end):.2f}, nine of ten {np.quantile(end, 0.9):.2f}")
    print(f"margin farther than 1 from the true one {over.mean():.2f}, the true one from it {missed.mean():.2f}")
    print(f"largest distance: median {np.median(largest):.2f}, nine of ten {np.quantile(largest, 0.9):.2f}")
    print(f"area off {area.mean():+.2f}, area between {between.mean():.2f}")


if __name__ == "__main__":
    main()
