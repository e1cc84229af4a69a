"""Measure fits of points and normals by the normals that they take: the cloud's, and what `fit_surface` makes of them.

    python scripts/measure_slopes.py [--points 6000] [--shapes sphere torus bumps fold terrain] [--noise 0 0.002 0.005]

One line for each cloud: the mean error |F|/|∇F| of "rbf" on the surface, in spacings, and how many times as large it is
of each other fit, with the cloud's normals as data and as `fit_surface` fits it, and in brackets how many times as much
processor time the second takes. Normals are estimated by
`preprocess_point_cloud`, exact, or turned by random angles (root mean square of each of two components); noise is in
parts of the diagonal. The terrain is that of `measure_uneven.py`, "patch" the dense part of it.
"""

import argparse
import time
import warnings
from functools import partial

import numpy as np
from clouds import solid_of
from measure_uneven import HALF, SIZE, heights, terrain

import o3dleaf as o3l

LOCALS = ("hermite", "curl-free", "mls", "auto")
PATCH = 10_000
PLACES = 4_000


def surface(shape, count):
    """Return points and exact normals of a shape, places on it, and the spacing."""
    if shape not in {"terrain", "patch"}:
        solid = solid_of(shape)
        return *solid.sample(count), solid.sample(PLACES, 5)[0], np.sqrt(solid.area / count)
    half = HALF - 0.5 if shape == "patch" else SIZE / 2 - 2
    x, y = np.random.default_rng(5).uniform(SIZE / 2 - half, SIZE / 2 + half, (2, PLACES))
    points = terrain(PATCH)
    step = 1e-5 * np.eye(2)
    slopes = [(heights(*(points[:, :2] + d).T) - heights(*(points[:, :2] - d).T)) / 2e-5 for d in step]
    normals = np.column_stack([*(-np.array(slopes)), np.ones(len(points))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return points, normals, np.column_stack([x, y, heights(x, y)]), 2 * HALF / np.sqrt(PATCH)


def error(field, places):
    """Return the mean distance of a field's surface from places on the true one, to first order."""
    return (np.abs(field(places)) / np.linalg.norm(field.gradient(places), axis=1)).mean()


def measure(shape, count, noise, turn):
    """Print the line of one cloud."""
    points, exact, places, spacing = surface(shape, count)
    rng = np.random.default_rng(3)
    size = np.linalg.norm(np.ptp(points, axis=0))
    points = points + noise * size * rng.normal(size=points.shape)
    normals = None if turn is None else exact + turn * rng.normal(size=exact.shape)
    kind = "estimated" if turn is None else f"off by {turn:g}" if turn else "exact"
    cloud = o3l.adaptive_down_sample(o3l.preprocess_point_cloud(points, normals=normals))
    own = error(o3l.fit_surface(cloud), places)
    line = f"{shape:<8} noise {noise:<6g} {kind:<12} rbf {own / spacing:8.2e}"
    for local in LOCALS:
        reach = 4 * cloud.point_spacing.max() * np.array([[-1], [1]])
        bounds = np.array([cloud.points.min(axis=0), cloud.points.max(axis=0)]) + reach
        fits = (
            partial(o3l.PUInterpolant.fit_oriented, cloud.points, cloud.normals, local=local, bounds=bounds),
            partial(o3l.fit_surface, cloud, local=local),
        )
        start = time.process_time()
        before, middle = fits[0](), time.process_time()
        after, end = fits[1](), time.process_time()
        ratios = [error(field, places) / own for field in (before, after)]
        line += f" | {local} {ratios[0]:7.2f} {ratios[1]:7.2f} ({(end - middle) / (middle - start):.1f})"
    print(line, flush=True)


def main():
    """Measure every cloud."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=6_000)
    parser.add_argument("--shapes", nargs="+", default=["sphere", "torus", "bumps", "fold", "terrain", "patch"])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.002, 0.005])
    parser.add_argument("--turns", type=float, nargs="*", default=[0.0, 0.003, 0.03])
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    for shape in options.shapes:
        for noise in options.noise:
            for turn in (None, *options.turns):
                measure(shape, options.points, noise, turn)


if __name__ == "__main__":
    main()
