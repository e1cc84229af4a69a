"""Measure how a CT volume at full resolution goes through: made, written, read, fitted, meshed.

    python scripts/measure_resolution.py [--spacing UM] [--size UM UM UM] [--coarse UM]

Each step with its seconds, processor time, voxels a second and the most memory that the process has held until then;
at the end the error of the surface, root mean square of the distances from the tile's mesh to the truth, in
micrometers, and that of a volume of `--coarse` voxels of the same leaf. Air pockets are left out: the mesh has none.
"""

import argparse
import resource
import tempfile
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

import o3dleaf as o3l
from o3dleaf.leaf.meshing import extract_flat_tile


@contextmanager
def step(name, voxels):
    """Print what a step took."""
    wall, cpu = time.perf_counter(), time.process_time()
    yield
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"{name:<8} {wall:7.1f} s, {cpu:7.1f} s of processor, {voxels / cpu:12,.0f} voxels/s, {held:.2f} GiB",
        flush=True,
    )


def off_surface(points, truth):
    """Return distances to the truth's surface, to first order twice over."""
    moved = points
    for _ in range(3):
        slope = truth.gradient(moved)
        steepness = np.maximum((slope**2).sum(axis=1), 1e-12)
        move = (truth.level - truth(moved)) / steepness
        move = np.clip(move * np.sqrt(steepness), -truth.blur, truth.blur) / np.sqrt(steepness)
        moved = moved + move[:, np.newaxis] * slope
    return np.linalg.norm(moved - points, axis=1)


def through(spacing, size, folder):
    """Take one volume through all steps, and return the error of its surface."""
    count = int(np.prod(np.round(np.array(size) / spacing)))
    print(f"{spacing:g} µm: {count:,} voxels")
    with step("make", count):
        volume, truth = o3l.samples.wheat_ct(spacing=spacing, size=tuple(size))
    path = folder / f"ct_{spacing:g}.tif"
    with step("write", count):
        o3l.write_volume(volume, path)
    del volume
    with step("read", count):
        volume = o3l.read_volume(path)
    with step("fit", count):
        texture = o3l.create_texture(volume)
    with step("mesh", count):
        mesh = extract_flat_tile(texture, 1.0, spacing).mesh
    vertices = np.asarray(mesh.vertices)
    # The blade of a straight volume is moved along z alone.
    return error(vertices + volume.bounds[0] - texture.field.bounds[0], truth, spacing, len(mesh.triangles))


def error(vertices, truth, spacing, triangles):
    """Return the root mean square of the distances of some vertices that no face of the box cuts."""
    low, high = truth.bounds[:, :2] + 3 * spacing * np.array([[1.0], [-1.0]])
    some = vertices[np.random.default_rng(0).integers(0, len(vertices), 60_000)]
    some = some[((some[:, :2] > low) & (some[:, :2] < high)).all(axis=1)]
    without = replace(truth, pockets=truth.pockets[:0])
    found = float(np.sqrt(np.mean(off_surface(some, without) ** 2)))
    print(f"{len(vertices):,} vertices, {triangles:,} triangles, {found:.3f} µm off the truth")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=3.0)
    parser.add_argument("--size", type=float, nargs=3, default=(2100.0, 2100.0, 480.0))
    parser.add_argument("--coarse", type=float, default=24.0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        coarse, fine = (through(spacing, given.size, Path(name)) for spacing in (given.coarse, given.spacing))
    print(f"error at {given.spacing:g} µm over that at {given.coarse:g} µm: {fine / coarse:.3f}")


if __name__ == "__main__":
    main()
