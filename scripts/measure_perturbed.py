"""Blades of a real scan as it is and perturbed as by its users: areas, points held, holes, crossings.

python scripts/measure_perturbed.py SCAN ... [--ways ...]

A blade should hardly depend on the order of the points, on their frame, on noise below their own, on a few strays,
or on some of the points left out. Areas are told relative to that of the scan as it is; *held* is the share of the
points within two median spacings of the blade, *near* that of the blade within as much of a point.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import open3d as o3d
from leaf_errors import judge_scan, spacing_of
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

import o3dleaf as o3l
from o3dleaf.core.errors import O3DLeafError

SEED = 7


def shuffled(seed):
    """Return a way to put points in another order."""
    return lambda points, _: np.random.default_rng(seed).permutation(points)


def part(share):
    """Return a way to leave out points at random."""
    return lambda points, _: points[np.random.default_rng(SEED).random(len(points)) < share]


def with_strays(points, _):
    """Return points and one in a hundred more, anywhere in the box around them."""
    strays = np.random.default_rng(SEED).uniform(points.min(axis=0), points.max(axis=0), (len(points) // 100, 3))
    return np.concatenate([points, strays])


def averaged(points, spacing):
    """Return the averages of voxels of 1.5 spacings."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    return np.asarray(cloud.voxel_down_sample(1.5 * spacing).points)


WAYS = {
    "as it is": lambda points, _: points,
    "order 1": shuffled(1),
    "order 2": shuffled(2),
    "turned": lambda points, _: Rotation.random(random_state=1).apply(points),
    "mirrored": lambda points, _: points * [1.0, 1.0, -1.0],
    "noise of 0.2 spacings": lambda points, spacing: (
        points + np.random.default_rng(SEED).normal(0, 0.2 * spacing, points.shape)
    ),
    "strays": with_strays,
    "voxels": averaged,
    "half": part(0.5),
    "a fifth": part(0.2),
    "every third": lambda points, _: points[::3],
}


def measure(points, unit):
    """Return the cells of a row but its name and number of points, and the area; or why there is no blade."""
    start = time.process_time()
    try:
        mesh = o3l.create_blade(points, unit=unit).extract_mesh(spacing_of(points))
    except O3DLeafError as cause:
        return [str(cause)[:60]], np.nan
    found = judge_scan(mesh, points)
    cells = [f"{found['recall']:.1%}", f"{found['precision']:.1%}", str(found["components"]), str(found["holes"])]
    return [*cells, str(found["self_intersections"]), f"{time.process_time() - start:.1f}"], found["area"]


def main():
    """Measure every scan."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", metavar="SCAN", type=Path, nargs="+", help="in millimeters, or meters if below one")
    parser.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    options = parser.parse_args()
    for path in options.scans:
        points = np.asarray(o3l.read_point_cloud(path).points)
        points, unit = points - points.mean(axis=0), "m" if np.ptp(points, axis=0).max() < 1 else "mm"
        spacing, whole = spacing_of(points), None
        table = Table("way", "points", "area", "held", "near", "parts", "holes", "crossings", "s", title=path.name)
        for name in options.ways:
            some = WAYS[name](points, spacing)
            cells, area = measure(some, unit)
            whole = area if whole is None else whole
            change = f"{area:.5g}" if area == whole else f"{area / whole - 1:+.1%}"
            table.add_row(name, f"{len(some):,}", change, *cells)
        Console(width=120).print(table)


if __name__ == "__main__":
    main()
