"""What the costly functions hold at most, beside what they were given, how long they take, and what is foretold.

python scripts/measure_costs.py [CASE ...] [--threads N]

Each case runs in a process of its own, at three sizes, after a small one that loads what it needs. "held" is what the
process held beyond what it held before, "reserved" its addresses, which `ulimit -v` counts; "foretold" is what
`require_resources` asks for, from `o3dleaf.core.resources.measured`. It is to be above what is held, and above the
processor time on the machine of the reference. Compilation is not counted: run it twice.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import SAFETY
from o3dleaf.leaf.tile_lattice import tile_lattice
from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.scan import wheat_scan

SPHERE = 4 * np.pi


class Ball:
    """A ball of radius 1."""

    bounds = np.array([[-1.2] * 3, [1.2] * 3])
    unit = None

    def __call__(self, points):
        return 1 - np.linalg.norm(points, axis=1)

    def gradient(self, points):
        return -points / np.linalg.norm(points, axis=1, keepdims=True)


class Case(NamedTuple):
    """What is made of a size, what is called with it and returns how many things it worked on, and what each holds.

    `whole` is what it takes whatever the size.
    """

    make: Any
    call: Any
    sizes: tuple[int, int, int]
    each: measured.Each
    whole: measured.Cost = measured.Cost(0)


def bumpy(count, noise):
    """Return points of a closed surface with bumps."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    height = 1 + 0.1 * np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1])
    return points * height[:, None] + noise * rng.normal(size=(count, 3))


def sheet(count):
    """Return points of an open sheet."""
    x, y = np.random.default_rng(0).random((2, count))
    return np.column_stack([x, y, 0.1 * np.sin(6 * x) * np.cos(5 * y)])


def scattered(count):
    """Return points in a cube and their values."""
    points = np.random.default_rng(0).random((count, 3))
    return points, np.sin(5 * points).sum(axis=1)


def ball_mesh(count):
    """Return a closed mesh of about `count` triangles."""
    rows = max(round(np.sqrt(count) / 2), 4)
    columns = 2 * rows
    polar, around = np.pi * np.arange(1, rows) / rows, 2 * np.pi * np.arange(columns) / columns
    polar, around = (part.ravel() for part in np.meshgrid(polar, around, indexing="ij"))
    ring = np.column_stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])
    number = np.arange(len(ring)).reshape(rows - 1, columns)
    a, b = number[:-1].ravel(), number[1:].ravel()
    c, d = np.roll(number[1:], -1, axis=1).ravel(), np.roll(number[:-1], -1, axis=1).ravel()
    top, bottom = (np.full(columns, len(ring) + end) for end in (0, 1))
    caps = [
        np.column_stack([top, number[0], np.roll(number[0], -1)]),
        np.column_stack([bottom, np.roll(number[-1], -1), number[-1]]),
    ]
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1), *caps])
    return build_mesh(np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]), triangles)


def volume(count):
    """Return the synthetic patch, repeated in the plane."""
    one = wheat_ct()[0]
    side = round(np.sqrt(count / one.data.shape[2]))
    times = [-(-side // length) for length in one.data.shape[:2]]
    return o3l.Volume(np.tile(np.asarray(one.data), [*times, 1])[:side, :side], one.spacing, one.origin, one.unit)


def leaf():
    """Return the synthetic leaf."""
    sample = wheat_scan()
    return o3l.create_multiscale_leaf(sample.cloud, wheat_ct()[0], sample.midrib)


def tile(made, step, axes):
    """Polygonize a tile, and return how many points its lattice has along some axes."""
    made.plan_mesh(step, [[50, -1], [51, 1]])
    return int(np.prod(tile_lattice(made.texture, made.scale, step).shape[:axes]))


def written(mesh):
    """Write a mesh to a file and read it again."""
    with tempfile.TemporaryDirectory() as folder:
        o3l.export_mesh(mesh, Path(folder) / "mesh.ply")
        o3l.read_mesh(Path(folder) / "mesh.ply")


def samples(mesh, step):
    """Cover a mesh with particles, and return among how many samples they were chosen."""
    o3l.sample_particles(mesh, step)
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return int((np.ceil(longest / (step / 2)) ** 2).sum())


def of_cloud(make, sizes=(50_000, 200_000, 500_000)):
    """Return the case of a reconstruction."""
    return Case(make, lambda p: (o3l.create_from_point_cloud_rbfpu(p), len(p))[1], sizes, measured.RECONSTRUCTED_POINT)


def of_mesh(call, sizes, each):
    """Return the case of a function of a mesh."""
    return Case(ball_mesh, lambda mesh: (call(mesh), len(mesh.triangles))[1], sizes, each)


def of_edge(start):
    """Return the case of a mesh remeshed from a number of triangles to another, which may be the same."""
    sizes, each = (50_000, 200_000, 500_000), measured.REMESHED_TRIANGLE
    edges = lambda n: (ball_mesh(start or n), np.sqrt(2.3 * SPHERE / n))  # noqa: E731
    return Case(edges, lambda given: len(o3l.remesh(*given).triangles), sizes, each)


LARGE = (200_000, 1_000_000, 4_000_000)
CASES = {
    "reconstruct, clean": of_cloud(lambda n: bumpy(n, 0.0)),
    "reconstruct, noisy": of_cloud(lambda n: bumpy(n, 0.004)),
    "reconstruct, sheet": of_cloud(sheet),
    "fit": Case(
        scattered,
        lambda data: (o3l.PUInterpolant.fit(*data), len(data[0]))[1],
        (50_000, 200_000, 500_000),
        measured.FITTED_POINT,
    ),
    "fit, Hermite": Case(
        lambda n: (bumpy(n, 0.0),) * 2,
        lambda data: (o3l.PUInterpolant.fit_oriented(*data, local="hermite"), len(data[0]))[1],
        (20_000, 50_000, 100_000),
        measured.FITTED_POINT,
    ),
    "march": Case(
        lambda n: round(n ** (1 / 3)),
        lambda side: (o3l.extract_isosurface(Ball(), 2.4 / side), side**3)[1],
        (1_000_000, 8_000_000, 30_000_000),
        measured.LATTICE_POINT,
    ),
    "follow": Case(
        lambda n: np.sqrt(2 * SPHERE / n),
        lambda step: len(o3l.extract_isosurface(Ball(), step, seeds=[[1.0, 0, 0]]).triangles),
        (100_000, 400_000, 1_600_000),
        measured.FOLLOWED_TRIANGLE,
    ),
    "texture": Case(
        volume,
        lambda v: (o3l.create_texture(v), v.data.size)[1],
        (500_000, 2_000_000, 8_000_000),
        measured.FITTED_VOXEL,
        measured.VOLUME,
    ),
    "blade": Case(
        lambda n: wheat_scan(count=n).cloud,
        lambda scan: (o3l.create_blade(scan), len(scan.points))[1],
        (20_000, 100_000, 300_000),
        measured.BLADE_POINT,
    ),
    "tile": Case(
        lambda n: (leaf(), 2.0 / np.sqrt(n)),
        lambda given: tile(*given, axes=2),
        (50_000, 200_000, 1_000_000),
        measured.TILE_COLUMN,
    ),
    "tile, samples": Case(
        lambda n: (leaf(), 2.0 / np.sqrt(n)),
        lambda given: tile(*given, axes=3),
        (20_000, 50_000, 200_000),
        measured.TILE_SAMPLE,
    ),
    "sheet": Case(
        lambda n: (leaf().blade, 0.1 * np.sqrt(300_000 / n)),
        lambda given: len(given[0].extract_mesh(given[1]).triangles),
        (300_000, 1_000_000, 3_000_000),
        measured.SHEET_TRIANGLE,
    ),
    "mesh": Case(
        lambda n: leaf().plan_mesh(0.1 * np.sqrt(1_300_000 / n)),
        lambda plan: len(plan.extract().mesh.triangles),
        LARGE,
        measured.TRIANGLE,
    ),
    "remesh": of_edge(None),
    "refine": of_edge(5000),
    "fill": Case(
        lambda n: (ball_mesh(20_000), (SPHERE / 3 / n) ** (1 / 3)),
        lambda given: len(o3l.fill_particles(*given).points),
        (1_000_000, 4_000_000, 16_000_000),
        measured.PARTICLE,
    ),
    "cover": Case(
        lambda n: (ball_mesh(20_000), np.sqrt(4 * SPHERE / n)),
        lambda given: samples(*given),
        (500_000, 2_000_000, 8_000_000),
        measured.SAMPLE,
    ),
    "report": of_mesh(o3l.mesh_report, LARGE, measured.REPORTED_TRIANGLE),
    "clean": of_mesh(lambda mesh: o3l.clean_mesh(mesh, untangle=True), LARGE, measured.CLEANED_TRIANGLE),
    "simplify": of_mesh(
        lambda mesh: o3l.simplify_mesh(mesh, target_triangles=len(mesh.triangles) // 2),
        (100_000, 400_000, 1_000_000),
        measured.SIMPLIFIED_TRIANGLE,
    ),
    "render": of_mesh(lambda mesh: o3l.view.render(mesh, size=(800, 500)), LARGE, measured.DRAWN_TRIANGLE),
    "files": of_mesh(written, LARGE, measured.FILED_TRIANGLE),
}


def status():
    """Return what the process holds and has reserved, in bytes."""
    lines = (line.split() for line in Path("/proc/self/status").read_text().splitlines())
    return np.array([int(words[1]) * 1024 for words in lines if words and words[0] in {"VmSize:", "VmRSS:"}])


def measure(name, count):
    """Print what one case takes at one size, as JSON."""
    make, call, sizes, *_ = CASES[name]
    call(make(sizes[0] // 5))
    given = make(count)
    before = most = status()
    done = threading.Event()

    def watch():
        nonlocal most
        while not done.wait(0.005):
            most = np.maximum(most, status())

    watcher = threading.Thread(target=watch)
    watcher.start()
    start = time.process_time()
    items = call(given)
    seconds = time.process_time() - start
    done.set()
    watcher.join()
    reserved, held = (most - before).tolist()
    print(json.dumps({"items": items, "held": held, "reserved": reserved, "seconds": seconds}))


def main():
    """Measure the cases that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--size", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    o3l.set_num_threads(given.threads)
    if given.size:
        measure(given.cases[0], given.size)
        return
    memory = ("held [MB]", "a thing [B]", "reserved [MB]", "foretold [MB]")
    heads = ("case", "things", *memory, "processor [s]", "a thing [µs]", "foretold [s]")
    table = Table(*heads, title=f"{given.threads} threads, o3dleaf {o3l.__version__}")
    for name in given.cases or CASES:
        for size in CASES[name].sizes:
            line = [sys.executable, __file__, name, "--size", str(size), "--threads", str(given.threads)]
            ended = subprocess.run(line, capture_output=True, text=True, check=False)
            if ended.returncode:
                table.add_row(name, f"{size:,}", ended.stderr.strip().splitlines()[-1])
                continue
            row = json.loads(ended.stdout.splitlines()[-1])
            case = CASES[name]
            foretold = case.each * (SAFETY * row["items"]) + measured.Cost(SAFETY * case.whole.bytes)
            megabytes = [f"{each / 1e6:,.0f}" for each in (row["held"], row["reserved"], foretold.bytes)]
            each = [f"{unit * row[kind] / row['items']:.3g}" for kind, unit in (("held", 1), ("seconds", 1e6))]
            seconds = f"{row['seconds']:.1f}", each[1], f"{foretold.seconds:.1f}"
            table.add_row(name, f"{row['items']:,}", megabytes[0], each[0], *megabytes[1:], *seconds)
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
