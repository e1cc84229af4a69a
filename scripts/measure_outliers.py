"""Measure which points of solids, sampled evenly and unevenly, are taken for outliers: outliers, and the solids' own.

    python scripts/measure_outliers.py [--points 6000] [--held-out]

One half of a solid, or what is in a ball, has the full density, the rest a twentieth or an eightieth of it. Outliers
are points in the box around it, points five to fifteen spacings above the surface, and groups of two, three and five
at such heights, each two percent of the points; those within 4.5 spacings of a point do not count. One line each:
outliers that are taken, and points of the solid that are lost. Held out are other solids, ratios and draws.
"""

import argparse

import numpy as np
from scipy.spatial import cKDTree

import o3dleaf as o3l

SOLIDS = {
    "sphere": o3l.samples.Sphere,
    "torus": o3l.samples.Torus,
    "block": o3l.samples.Block,
    "figure": o3l.samples.Figure,
    "fins": o3l.samples.fins,
    "gap": o3l.samples.gap,
    "bumps": o3l.samples.bumps,
}
HELD_OUT = {"sheet": o3l.samples.WavySheet, "fold": o3l.samples.fold, **SOLIDS}
RATIOS, HELD_OUT_RATIOS = (1, 20, 80), (1, 10, 40)
KINDS = ("box", "1", "2", "3", "5")
BALL = 0.25
SHARE = 0.02
BESIDE = 4.5


def sampled(solid, count, ratio, region, seed):
    """Return points and normals of a solid, a `ratio` times fewer outside a half of it or a ball."""
    points, normals = solid.sample(count)
    rng = np.random.default_rng([seed, 7])
    low, extent = points[:, seed % 3].min(), np.ptp(points[:, seed % 3])
    dense = points[:, seed % 3] < low + extent / 2
    if region == "ball":
        dense = np.linalg.norm(points - points[37 * seed], axis=1) < BALL * extent
    kept = dense | (rng.random(count) < 1 / ratio)
    return points[kept], normals[kept]


def drawn(points, normals, kind, seed):
    """Return outliers of a kind, without those that are beside a point."""
    rng = np.random.default_rng([seed, 5])
    spacing = o3l.point_spacing(points)
    count = max(int(SHARE * len(points)), 12)
    if kind == "box":
        low, high = points.min(axis=0), points.max(axis=0)
        outliers = (low + high) / 2 + 1.3 * (high - low) * (rng.random((count, 3)) - 0.5)
    else:
        size = int(kind)
        foot = rng.choice(len(points), max(count // size, 3), replace=False)
        middle = points[foot] + rng.uniform(5, 15, (len(foot), 1)) * spacing[foot, np.newaxis] * normals[foot]
        spread = (0.0 if size == 1 else 0.5) * np.repeat(spacing[foot], size)
        outliers = np.repeat(middle, size, axis=0) + spread[:, np.newaxis] * rng.normal(size=(size * len(foot), 3))
    distance, nearest = cKDTree(points).query(outliers)
    return outliers[distance > BESIDE * spacing[nearest]]


def main():
    """Measure every ratio and kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=6_000)
    parser.add_argument("--held-out", action="store_true")
    given = parser.parse_args()
    solids, ratios, seeds = (HELD_OUT, HELD_OUT_RATIOS, (2, 3)) if given.held_out else (SOLIDS, RATIOS, (0, 1))
    for ratio in ratios:
        for region in ("half", "ball") if ratio > 1 else ("half",):
            print(f"{ratio}:1, {region}")
            clouds = [
                (*sampled(make(), given.points, ratio, region, seed), seed)
                for make in solids.values()
                for seed in seeds
            ]
            lost = sum(int(o3l.detect_outliers(points).sum()) for points, _, _ in clouds)
            print(f"    none   lost {lost / sum(len(points) for points, _, _ in clouds):.3%}")
            for kind in KINDS:
                taken, lost = zip(*[measure(*cloud, kind) for cloud in clouds], strict=True)
                print(f"    {kind:<6} taken {np.concatenate(taken).mean():.1%}, lost {np.concatenate(lost).mean():.3%}")


def measure(points, normals, seed, kind):
    """Return which of the outliers, and which of a cloud's points, are taken."""
    outliers = drawn(points, normals, kind, seed)
    found = o3l.detect_outliers(np.vstack([points, outliers]))
    return found[len(points) :], found[: len(points)]


if __name__ == "__main__":
    main()
