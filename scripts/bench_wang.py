"""Measure a leaf of Wang tiles beside the periodic one: time and memory beyond the tiles' own polygonizing, repetition.

    python scripts/bench_wang.py [--spacing 0.024] [--seed 1] [--rounds 2] [--hairs SHARE]

The leaf is `samples.wheat_scan`, the patch `samples.wheat_ct` (1.68 mm at 24 µm, with noise and drift); both leaves are
closed solids, written to a PLY file in a temporary folder. Processor time of all threads, the least of the rounds,
which alternate; the process' largest resident memory, fit included, each leaf in a process of its own. "tiles" is the
time of polygonizing the tiles, "rest" that of counting and writing. Correlations are of the field, at a height where
flanks of ridges are, at the same places of tiles a lattice vector apart, over 24 x 24 tiles, less its mean section: 1
where the surface repeats. With `--hairs` a map keeps this share of
the Wang leaf's hairs.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import o3dleaf as o3l
from o3dleaf.leaf.tile_lattice import extract_tiles

SHIFTS = ((1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (4, 4))


def measure(kind, spacing, seed, hairs):
    scan = o3l.samples.wheat_scan(seed=1)[0]
    volume, _ = o3l.samples.wheat_ct(seed=1)
    texture = o3l.create_texture(volume, options=o3l.TextureOptions(tiles=kind, seed=seed))
    thinned = o3l.BladeOptions() if hairs is None or kind == "periodic" else o3l.BladeOptions(hair_density=[[hairs]])
    leaf = o3l.create_multiscale_leaf(scan, texture, blade=thinned)
    leaf.plan_mesh(spacing, [[50.0, -1.0], [51.0, 1.0]], closed=True)  # compiled, if it was not
    start = time.process_time()
    extract_tiles(leaf, spacing, 0, together=True)
    tiles = time.process_time() - start
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        plan = leaf.plan_mesh(spacing, closed=True)
        plan.write(Path(folder) / "leaf.ply")
    rest = time.process_time() - start - tiles
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(kind, plan.triangles, tiles, rest, memory, texture.seam_energy().total, *correlations(texture))


def correlations(laid, places=24, within=12):
    share = (np.arange(within) + 0.5) / within
    at = np.stack(np.meshgrid(share, share, indexing="ij"), axis=-1).reshape(-1, 2)
    tile = np.stack(np.meshgrid(np.arange(places), np.arange(places), indexing="ij"), axis=-1)
    plane = ((tile[:, :, np.newaxis] + at) * laid.period).reshape(-1, 2)
    values = laid(np.column_stack([plane, np.full(len(plane), 100.0)])).reshape(places, places, -1)
    # Ridges run through all tiles, as they do on a leaf: what differs from their mean section is what might repeat.
    rest = values - values.reshape(places, places, within, within).mean(axis=(0, 1, 2))[np.newaxis].repeat(
        within, axis=0
    ).reshape(-1)
    pairs = [(rest[: places - a, : places - b], rest[a:, b:]) for a, b in SHIFTS]
    return [float(np.mean(one * other) / rest.var()) for one, other in pairs]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=0.024, help="mesh step in mm")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--hairs", type=float, help="share of the Wang leaf's hairs that are kept")
    parser.add_argument("--only", choices=("periodic", "wang"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        measure(options.only, options.spacing, options.seed, options.hairs)
        return
    found = {"periodic": [], "wang": []}
    for _ in range(options.rounds):
        for kind, rows in found.items():
            words = [sys.executable, __file__, "--only", kind, f"--spacing={options.spacing}", f"--seed={options.seed}"]
            words += [] if options.hairs is None else [f"--hairs={options.hairs}"]
            line = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()[-1]
            rows.append([float(word) for word in line.split()[1:]])
    best = {kind: np.min(rows, axis=0) for kind, rows in found.items()}
    names = ("triangles", "tiles s", "rest s", "memory MB", "seam energy", *(f"{shift}" for shift in SHIFTS))
    print(f"{'':>14}{'periodic':>14}{'wang':>14}{'ratio':>10}")
    for name, one, other in zip(names, *best.values(), strict=True):
        print(f"{name:>14}{one:>14.5g}{other:>14.5g}{other / one:>10.3f}")


if __name__ == "__main__":
    main()
