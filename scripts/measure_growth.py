"""Measure what a volume of eight times the voxels takes: fitted into a model file, its tile meshed into a file.

    python scripts/measure_growth.py [--spacing UM] [--size UM UM UM] [--memory SIZE] [--repeats N]

One leaf, in voxels of twice the spacing and of the spacing, or with `--area` a leaf of eight times the area in voxels
of one size. Each step runs in a process of its own, the sizes by turns. Printed are processor time, the least of the
repeats; the most anonymous memory that the process held (`RssAnon`) beyond what it held when all was imported; the
pages of mapped files at most (`RssFile`), which the system drops when it needs room; and the slope, the logarithm of
the ratio of the times over that of the voxels.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import o3dleaf as o3l
from o3dleaf.io.models.model_draft import model_draft
from o3dleaf.leaf.meshing import write_flat_tile

MIB = 2**10
"""Of the kB of the system."""
STEPS = ("fit", "mesh")


def memory():
    """Return the anonymous memory of this process and its pages of files, in MiB."""
    words = (line.split() for line in Path("/proc/self/status").read_text().splitlines())
    held = {each[0]: int(each[1]) / MIB for each in words if each[0] in {"RssAnon:", "RssFile:"}}
    return np.array([held["RssAnon:"], held["RssFile:"]])


def measured(call):
    """Return the processor time of a call, and the anonymous memory and pages of files that were added at most."""
    done, before = threading.Event(), memory()
    most = before.copy()

    def watch():
        while not done.wait(0.005):
            most[:] = np.maximum(most, memory())

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    start = time.process_time()
    call()
    seconds = time.process_time() - start
    done.set()
    watcher.join()
    return {"seconds": seconds, "anonymous": most[0] - before[0], "mapped": most[1]}


def fit(folder, _):
    """Fit the volume of a folder into its model file."""
    with model_draft(folder / "ct.o3l"):
        o3l.create_texture(o3l.read_volume(folder / "ct.tif")).save(folder / "ct.o3l")


def mesh(folder, spacing):
    """Mesh one period of the model of a folder into a file."""
    write_flat_tile(o3l.load(folder / "ct.o3l"), 1.0, spacing, folder / "tile.ply")


def in_child(step, folder, spacing, limit):
    """Return what a step takes in a process of its own."""
    words = [sys.executable, __file__, "--step", step, "--folder", str(folder), "--spacing", str(spacing)]
    words += [] if limit is None else ["--memory", limit]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def table(volumes, repeats, limit):
    """Print what the steps take of both volumes: (folder, spacing, voxels)."""
    for step in STEPS:
        runs = [[in_child(step, folder, spacing, limit) for folder, spacing, _ in volumes] for _ in range(repeats)]
        best = [min((run[n] for run in runs), key=lambda run: run["seconds"]) for n in range(2)]
        for (_, spacing, voxels), row in zip(volumes, best, strict=True):
            print(
                f"{step:<5} {voxels:12,} voxels of {spacing:g} µm {row['seconds']:7.1f} s of processor, "
                f"{row['anonymous']:6.0f} MiB anonymous, {row['mapped']:6.0f} MiB of files",
                flush=True,
            )
        times, held = (best[1][name] / best[0][name] for name in ("seconds", "anonymous"))
        slope = np.log(times) / np.log(volumes[1][2] / volumes[0][2])
        print(f"      {times:.1f} times the time (slope {slope:.2f}), {held:.1f} times the memory", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=6.0)
    parser.add_argument("--size", type=float, nargs=3, default=(2100.0, 2100.0, 480.0))
    parser.add_argument("--area", action="store_true")
    parser.add_argument("--memory")
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--step", choices=STEPS, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.step is not None:
        o3l.set_memory_limit(given.memory)  # of what is measured; the volumes are made first
        run = {"fit": fit, "mesh": mesh}[given.step]
        o3l.create_texture, o3l.load  # noqa: B018 - imported before it is measured
        print(json.dumps(measured(lambda: run(given.folder, given.spacing))))
        return
    size, finer = np.array(given.size), given.spacing
    larger = size * [8**0.5, 8**0.5, 1] if given.area else size
    with tempfile.TemporaryDirectory() as name:
        volumes = []
        for spacing, extent in ((finer if given.area else 2 * finer, size), (finer, larger)):
            folder = Path(name) / str(len(volumes))
            folder.mkdir()
            volume, _ = o3l.samples.wheat_ct(spacing=spacing, size=tuple(extent.tolist()))
            o3l.write_volume(volume, folder / "ct.tif")
            volumes.append((folder, spacing, volume.data.size))
        table(volumes, given.repeats, given.memory)


if __name__ == "__main__":
    main()
