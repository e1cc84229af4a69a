"""The whole leaf, timed: the paper's job from files to a file, and meshes at the scanner's resolution.

python scripts/whole_leaf.py MODEL SPACING OUTPUT [--closed]

writes one mesh and prints what it took as JSON; the process does nothing else, so that its peak memory is the mesh's.
`bench_paper.py` calls it. The scan is the real wheat leaf where ../shared/data has it, else the synthetic one.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import open3d as o3d
from measuring import Row, measure

import o3dleaf as o3l

REAL = Path(__file__).resolve().parents[2] / "shared" / "data" / "wheat"
PAPER, PAPER_RUN = o3l.BladeOptions(frame="paper"), 39 * 60.0
CHUNK = bytes(1 << 24)
QUICK_CT = {"spacing": 48.0, "size": (1440.0, 1440.0, 480.0)}
"""Large tiles of few voxels: few copies of a tile, and each is small."""


def inputs(folder, quick):
    """Write the CT volume, and return the paths of scan, midrib and volume."""
    volume, _ = o3l.samples.wheat_ct(**(QUICK_CT if quick else {}))
    o3l.write_volume(volume, folder / "ct.tif")
    scan, midrib = REAL / "wheat_leaf.ply", REAL / "wheat_leaf_midrib.ply"
    if quick or not scan.is_file():
        sample = o3l.samples.wheat_scan(count=800 if quick else 6300)
        scan, midrib = folder / "scan.ply", folder / "midrib.ply"
        o3d.io.write_point_cloud(scan, sample.cloud)
        o3d.io.write_point_cloud(midrib, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(sample.midrib)))
    return scan, midrib, folder / "ct.tif"


def job(paths, output, spacing):
    """Everything that the paper's run does: from the files to the file."""
    scan, midrib = (o3l.read_point_cloud(path, least=2) for path in paths[:2])
    leaf = o3l.create_multiscale_leaf(scan, o3l.read_volume(paths[2]), midrib, blade=PAPER)
    leaf.write_mesh(output, spacing)
    return leaf


def rows(quick):
    """Return the rows of the whole leaf, and the leaf."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = inputs(folder, quick)
        output = folder / "leaf.ply"
        job(paths, output, 0.5)
        leaf, seconds, peak = measure(lambda: job(paths, output, 0.2 if quick else 0.1))
        count = leaf.plan_mesh(0.2 if quick else 0.1).triangles
        found = [Row("whole run, 100 µm step", f"{count:,} triangles", seconds, PAPER_RUN, peak_mb=peak)]
        leaf.save(folder / "leaf.o3l")
        steps = [(0.3, True)] if quick else [(0.024, False), (0.024, True), (0.012, False), (0.006, False)]
        for step, closed in steps:
            found.append(mesh_row(folder, step, closed=closed))
    return found, leaf


def mesh_row(folder, step, *, closed):
    """Mesh the leaf in a process of its own, and write as many bytes plainly beside it."""
    output = folder / "leaf.ply"
    command = [sys.executable, __file__, str(folder / "leaf.o3l"), str(step), str(output)] + ["--closed"] * closed
    took = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    size = output.stat().st_size
    output.unlink()
    start = time.perf_counter()
    with output.open("wb") as plain:
        for _ in range(size // len(CHUNK)):
            plain.write(CHUNK)
    plain_seconds = time.perf_counter() - start
    output.unlink()
    name = f"{'closed' if closed else 'open'} leaf at {step * 1000:g} µm, written"
    print(
        f"{name}: {size / 1e9:.2f} GB, {took['triangles'] / took['seconds'] / 1e6:.2f} million triangles a second, "
        f"process at most {took['peak_mb']:.0f} MB; as many bytes written plainly take {plain_seconds:.2f} s, "
        f"{plain_seconds / took['seconds']:.0%} of it"
    )
    return Row(name, f"{took['triangles']:,} triangles", took["seconds"], peak_mb=took["peak_mb"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model")
    parser.add_argument("spacing", type=float)
    parser.add_argument("output", type=Path)
    parser.add_argument("--closed", action="store_true")
    options = parser.parse_args()
    leaf = o3l.load(options.model)
    # What is compiled, and read from the cache, is not counted.
    leaf.write_mesh(options.output, 20 * options.spacing if options.spacing < 0.05 else 0.5, closed=options.closed)
    start = time.perf_counter()
    surface = leaf.plan_mesh(options.spacing, closed=options.closed)
    surface.write(options.output)
    seconds = time.perf_counter() - start
    status = Path("/proc/self/status").read_text()
    peak = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM")) / 1024
    print(json.dumps({"seconds": seconds, "peak_mb": peak, "triangles": surface.triangles}))


if __name__ == "__main__":
    main()
