"""Print what each job compiles and how long that takes; with --write, list it for `o3dleaf warm-up` and the wheel.

    scripts/list_compiled.py                  # a table: functions, seconds of compiling, the slowest ones
    scripts/list_compiled.py --jobs demo qa   # of some jobs
    scripts/list_compiled.py --write          # all jobs, then the tests, into o3dleaf/core/compiled/signatures.txt

Each job runs in a process of its own. Without --write nothing compiled is kept from one job to the next, so that the
seconds are those of a first run: processor time of the process's main thread while Numba compiles, callees included.
"""

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import open3d as o3d
from numba.core import event

from o3dleaf.commands.cli import main as command_line
from o3dleaf.core.compiled.signatures import LIST, SECTIONS, called

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "data_samples"
SCAN, MIDRIB, CT = (SAMPLES / name for name in ("wheat_scan.ply", "wheat_midrib.ply", "wheat_ct_24um.tif"))
JOBS = {
    "demo": "demo -o {folder}/demo",
    "demo, coarse": "demo --spacing 0.5 -o {folder}/coarse",
    "leaf": "leaf {scan} --spacing 0.4 -o {folder}/blade.ply",
    "leaf closed": "leaf {scan} --ct {ct} --closed --remesh 0.6 --spacing 0.6 -o {folder}/closed.ply",
    "leaf window": "leaf {scan} --ct {ct} --region 90 -2 94 2 --closed --spacing 0.05 --remesh 0.05 --period best "
    "-o {folder}/window.ply",
    "leaf paper": "leaf {scan} --midrib {midrib} --frame paper --ct {ct} --spacing 0.5 -o {folder}/paper.ply",
    "reconstruct": "reconstruct {folder}/oriented.ply -o {folder}/surface.ply --model {folder}/surface.o3l "
    "--picture {folder}/surface.png",
    "reconstruct a leaf": "reconstruct {folder}/coarse/leaf.ply --measure residual -o {folder}/leaf_surface.ply",
    "reconstruct a noisy ball": "reconstruct {folder}/ball.ply -o {folder}/ball_surface.ply",
    "reconstruct without normals": "reconstruct {folder}/points.ply -o {folder}/points_surface.ply",
    "reconstruct a thin part": "reconstruct {folder}/lens.ply -o {folder}/lens_surface.ply",
    "reconstruct an uneven roof": "reconstruct {folder}/roof.ply -o {folder}/roof_surface.ply",
    "reconstruct hermite": "reconstruct {folder}/oriented.ply --local hermite -o {folder}/hermite.ply",
    "qa": "qa {folder}/surface.ply --field {folder}/surface.o3l --cloud {folder}/oriented.ply --html {folder}/qa.html",
    "qa of a leaf": "qa {folder}/leaf_surface.ply --cloud {folder}/coarse/leaf.ply --html {folder}/qa_leaf.html",
    "clean": "clean {folder}/surface.ply --triangles 2000 -o {folder}/clean.ply",
    "export": "export {folder}/demo/leaf.o3l --for openfoam --region 90 -2 96 2 --spacing 0.1 -o {folder}/leaf.stl",
    "export particles": "export {folder}/closed.ply --what surface-particles --step 0.5 -o {folder}/particles.csv",
    "export volume": "export {folder}/closed.ply --what volume-particles --step 0.5 -o {folder}/volume.csv",
    "export distance": "export {folder}/closed.ply --what distance --step 2 -o {folder}/distance.vti",
    "export sph": "export {folder}/demo/leaf.o3l --for sph --region 90 -2 94 2 --spacing 0.1 --step 0.1 "
    "-o {folder}/sph.csv",
    "leaf levels": "leaf {scan} --ct {ct} --spacing 0.4 --fine '70 -2 74 1 0.1' -o {folder}/levels.ply",
    "leaf grid": "leaf {scan} --ct {ct} --spacing 0.6 --rim-radius 1 --closed --grid {folder}/leaf.vti "
    "--grid-of distance --grid-step 1 -o {folder}/rim.ply",
    "leaf wang": "leaf {scan} --ct {ct} --tiles wang --spacing 0.4 -o {folder}/wang.ply",
    "render": "render {folder}/surface.ply -o {folder}/render.png",
}
"""Command lines, each of which may read what those before it wrote."""


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--jobs", nargs="+", choices=JOBS, default=list(JOBS), help="some jobs, and what they read")
    options.add_argument("--write", action="store_true", help="run all jobs and write the list")
    options.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.one:
        run_here(*given.one)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_clouds(folder)
        lines = {}
        for job, command in JOBS.items():
            words = command.format(folder=folder, scan=SCAN, midrib=MIDRIB, ct=CT)
            done = run_apart(words, folder, keep=given.write or job not in given.jobs)
            lines[job] = set(done["lines"])
            if job in given.jobs:
                print_job(job, done)
        if given.write:
            sections = {"demo": lines["demo"], "all": set().union(*lines.values()), "tests": set()}
            write_list(sections)  # a test of the jobs' part is among those that are run next
            sections["tests"] = called_by_tests(folder / "called.txt")
            write_list(sections)


def write_clouds(folder):
    """Write a noisy torus, with normals and, colored, without; a thin lens, a noisier ball, an uneven roof."""
    rng = np.random.default_rng(0)
    u, v = rng.uniform(0, 2 * np.pi, (2, 4000))
    normals = np.column_stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)])
    points = np.column_stack([2 * np.cos(u), 2 * np.sin(u), 0 * u]) + normals + rng.normal(0, 0.01, (4000, 3))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.colors = o3d.utility.Vector3dVector((points - points.min(axis=0)) / np.ptp(points, axis=0))
    o3d.io.write_point_cloud(str(folder / "points.ply"), cloud)
    cloud.colors = o3d.utility.Vector3dVector()
    cloud.normals = o3d.utility.Vector3dVector(normals)
    o3d.io.write_point_cloud(str(folder / "oriented.ply"), cloud)
    ball = rng.normal(size=(3000, 3))
    ball *= (1 + rng.normal(0, 0.02, (3000, 1))) / np.linalg.norm(ball, axis=1, keepdims=True)
    rough = ball[:1500] + rng.normal(0, 0.1, (1500, 3))
    o3d.io.write_point_cloud(str(folder / "ball.ply"), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(rough)))
    lens = ball * [1, 1, 0.1]
    o3d.io.write_point_cloud(str(folder / "lens.ply"), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(lens)))
    places = np.concatenate([rng.uniform(-1, 1, (1000, 2)), rng.uniform(-0.1, 0.1, (3000, 2))])
    roof = np.column_stack([places, -np.abs(places[:, 0])])
    o3d.io.write_point_cloud(str(folder / "roof.ply"), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(roof)))


def run_apart(words, folder, *, keep):
    """Run a command line in a process of its own and return what it compiled."""
    result = folder / "compiled.json"
    with tempfile.TemporaryDirectory(dir=folder) as empty:
        environment = os.environ if keep else os.environ | {"NUMBA_CACHE_DIR": empty}
        command = [sys.executable, __file__, "--one", words, str(result)]
        subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return json.loads(result.read_text())


def called_by_tests(result):
    """Run the tests that are not slow, and return what those of the package's functions are that they call."""
    print("the tests:", flush=True)
    command = [sys.executable, "-m", "pytest", "--numprocesses", "auto", "--quiet", f"--called={result}"]
    subprocess.run(command, check=False, cwd=ROOT)  # what a test calls that fails is called
    return set(result.read_text(encoding="utf-8").splitlines())


def write_list(sections):
    """Write the list: what each section calls and those before it do not."""
    known = set()
    text = []
    for name, head in SECTIONS.items():
        text += [head, *sorted(sections[name] - known)]
        known |= sections[name]
    LIST.write_text("\n".join((*text, "")), encoding="utf-8")
    print(f"{len(known)} functions in {LIST}", flush=True)


def run_here(words, result):
    """Run a command line in this process and write what it compiled, and how long that took."""
    compiling = Compiling()
    event.register("numba:compile", compiling)
    sys.argv = ["o3dleaf", *shlex.split(words)]
    try:
        command_line()
    except SystemExit as stop:
        if stop.code not in (0, 1, None):  # 1: a mesh that does not meet a requirement
            raise
    done = {"lines": list(called()), "seconds": compiling.seconds, "count": compiling.count}
    Path(result).write_text(json.dumps(done))


class Compiling(event.Listener):
    """Processor seconds of each function that is compiled, without those compiled inside it."""

    def __init__(self):
        self.seconds, self.count, self.stack = {}, 0, []

    def on_start(self, event):  # noqa: ARG002 - Numba's
        self.stack.append([time.thread_time(), 0.0])

    def on_end(self, event):
        start, inside = self.stack.pop()
        spent = time.thread_time() - start
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__}.{function.__qualname__}"
        self.seconds[name] = self.seconds.get(name, 0.0) + spent - inside
        self.count += 1
        if self.stack:
            self.stack[-1][1] += spent


def print_job(job, done):
    total = sum(done["seconds"].values())
    print(f"{job}: {len(done['lines'])} functions called, {done['count']} compiled, callees included, in {total:.1f} s")
    for name, seconds in sorted(done["seconds"].items(), key=lambda each: -each[1])[:10]:
        print(f"    {seconds:6.2f} s  {name}")


if __name__ == "__main__":
    main()
