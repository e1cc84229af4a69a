"""Measure surfaces of clouds whose density steps up in one place: terrain with a patch of many more points.

    python scripts/measure_uneven.py [--patch 2000 10000 40000]

Terrain of 50 by 50 with waves 4.8 long has 3,000 random points, and a patch of 10 by 10 in its middle so many more.
One line each: points taken for outliers, triangles, the mesh's area over that of the terrain, processor time, and the
mean and largest error of its heights within the patch, beside it and far from it.
"""

import argparse
import time
import warnings

import numpy as np

import o3dleaf as o3l

SIZE, HALF, SPARSE = 50.0, 5.0, 3_000
RINGS = (("patch", 0.0, HALF - 0.5), ("beside", HALF + 0.5, HALF + 3.0), ("far", HALF + 3.0, SIZE / 2 - 2.0))


def heights(x, y):
    """Return the terrain."""
    return 3 * np.sin(x / 7) * np.cos(y / 9) + 0.5 * np.sin(1.3 * x) * np.cos(0.9 * y)


def terrain(patch):
    """Return points of the terrain, those of the patch last."""
    rng = np.random.default_rng(1)
    middle = SIZE / 2
    places = np.vstack([rng.uniform(0, SIZE, (SPARSE, 2)), rng.uniform(middle - HALF, middle + HALF, (patch, 2))])
    return np.column_stack([places, heights(*places.T)])


def area():
    """Return the terrain's area, by triangles of a fine lattice."""
    x, y = np.meshgrid(*2 * [np.linspace(0, SIZE, 2_001)], indexing="ij")
    slopes = np.gradient(heights(x, y), SIZE / 2_000)
    return float(np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2).mean() * SIZE**2)


def measure(patch):
    """Print what comes of one patch."""
    points = terrain(patch)
    outliers = int(o3l.detect_outliers(points).sum())
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh, _ = o3l.create_from_point_cloud_rbfpu(points, measure=None)
    seconds = time.process_time() - start
    x, y, z = np.asarray(mesh.vertices).T
    error, away = np.abs(z - heights(x, y)), np.maximum(np.abs(x - SIZE / 2), np.abs(y - SIZE / 2))
    share = mesh.get_surface_area() / area()
    print(
        f"{patch:,} more: {outliers:,} outliers, {len(mesh.triangles):,} triangles, area {share:.3f}, {seconds:.1f} s"
    )
    for name, least, most in RINGS:
        here = error[(away >= least) & (away < most)]
        print(f"    {name:<7} " + (f"mean {here.mean():.4f}, largest {here.max():.3f}" if len(here) else "no surface"))


def main():
    """Measure every patch."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--patch", type=int, nargs="+", default=[2_000, 10_000, 40_000])
    for patch in parser.parse_args().patch:
        measure(patch)


if __name__ == "__main__":
    main()
