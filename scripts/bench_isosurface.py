"""What an isosurface of a volume costs and whether it is closed, and what a dense cluster does to a fit beside it.

python scripts/bench_isosurface.py [--quick]

The volume is a ball of noisy voxels, intensities of 0 to 255, that its box cuts on six sides: seconds of processor
time to fit it, to ask the field at every voxel, to extract the surface, and to march given samples; open edges in
several units. The cluster: points in a box, uniform, and as many again at its middle, so many times as dense; noise
0.01; the largest and the mean (root of squares) error in the box with them, and without them. Compiling is not counted.
"""

import argparse
import time

import numpy as np
from scipy import ndimage

import o3dleaf as o3l
from o3dleaf.surface.isosurface.polygonize import polygonize


def ball(count):
    """Voxels of a ball that reaches beyond its box, blurred noise on it."""
    axis = np.linspace(-1, 1, count)
    distance = np.sqrt(sum(x**2 for x in np.meshgrid(axis, axis, axis, indexing="ij")))
    noise = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(count,) * 3), 1.5)
    return 255 / (1 + np.exp(8 * (distance - 1.05 - 0.1 * noise)))


def seconds(work):
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def isosurface(count):
    small = o3l.PUInterpolant.fit_lattice(ball(12), spacing=1.0, isovalue=127.5)
    o3l.extract_isosurface(small, 1.0)
    small(small.bounds)
    voxels = ball(count)
    polygonize(voxels[:3, :3, :3], 1.0)
    field, fitting = seconds(lambda: o3l.PUInterpolant.fit_lattice(voxels, spacing=1.0, isovalue=127.5))
    _, asking = seconds(lambda: field.on_lattice(field.bounds, 1.0))
    mesh, extracting = seconds(lambda: o3l.extract_isosurface(field, 1.0))
    _, marching = seconds(lambda: polygonize(voxels, 127.5))
    print(f"{count}^3 voxels, {len(mesh.triangles):,} triangles, seconds of processor time:")
    print(f"  fit {fitting:.2f}   every voxel {asking:.2f}   extract {extracting:.2f}   march alone {marching:.2f}")
    voxels = ball(min(count, 50))
    for value, length in ((1, 1), (1e-6, 1), (255, 1e-6), (1e6, 1e6)):
        field = o3l.PUInterpolant.fit_lattice(value * voxels, spacing=length, isovalue=value * 127.5)
        report = o3l.mesh_report(o3l.extract_isosurface(field, length))
        print(f"  values times {value:g}, lengths times {length:g}: {report.boundary_edges} open edges")


def cluster(count):
    for ratio in (100, 1e3, 1e5, 1e7):
        rng = np.random.default_rng(0)
        points = np.vstack([rng.random((count, 3)), 0.5 + ratio ** (-1 / 3) * (rng.random((count, 3)) - 0.5)])
        values = np.sin(5 * points).sum(axis=1) + 0.01 * rng.normal(size=2 * count)
        queries = rng.uniform(0.05, 0.95, (4000, 3))
        words = []
        for many in (2 * count, count):
            field = o3l.PUInterpolant.fit(points[:many], values[:many], rho="gcv")
            error = field(queries) - np.sin(5 * queries).sum(axis=1)
            words.append(f"{np.abs(error).max():.3f} {np.sqrt(np.mean(error**2)):.4f}")
        print(f"{ratio:8g} times as dense: {words[0]}, without {words[1]}")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small scales, to see that it runs")
    quick = parser.parse_args(arguments).quick
    isosurface(20 if quick else 200)
    cluster(500 if quick else 2000)


if __name__ == "__main__":
    main()
