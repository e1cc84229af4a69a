"""See that an installed o3dleaf runs its main jobs without compiling, and gives the same bytes in any way.

Called by scripts/check_wheel with the interpreter of an empty environment; prints seconds, how many functions were
compiled, and hashes of the demo's mesh.
"""

import hashlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

RUN = """
import json, sys
from numba.core import event
class Count(event.Listener):
    number = 0
    def on_start(self, event):
        Count.number += 1
        if Count.number <= 5:
            print(event.data["dispatcher"].py_func, event.data["args"], file=sys.stderr)
    def on_end(self, event): pass
event.register("numba:compile", Count())
from o3dleaf.commands.cli import main
sys.argv = ["o3dleaf", *sys.argv[1:]]
try:
    main()
except SystemExit as stop:
    assert stop.code in (0, 1, None), sys.argv
print(json.dumps(Count.number))
"""

CLOUD = """
import numpy as np, open3d as o3d
u, v = np.random.default_rng(0).uniform(0, 2 * np.pi, (2, 20000))
normals = np.column_stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)])
cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.column_stack([2*np.cos(u), 2*np.sin(u), 0*u]) + normals))
cloud.normals = o3d.utility.Vector3dVector(normals)
o3d.io.write_point_cloud("cloud.ply", cloud)
"""

JOBS = {
    "demo": "demo -o demo",
    "demo again": "demo -o demo2",
    "demo, 1 thread": "demo -o demo3 --threads 1",
    "demo, 4 threads": "demo -o demo4 --threads 4",
    "reconstruct, 20,000 points": "reconstruct cloud.ply -o surface.ply",
    "qa": "qa surface.ply --cloud cloud.ply --html qa.html",
    "leaf, remeshed": "leaf {samples}/wheat_scan.ply --ct {samples}/wheat_ct_24um.tif --closed --remesh 0.6 "
    "--spacing 0.6 -o remeshed.ply",
    "export": "export surface.ply --for openfoam --unit mm -o surface.stl",
}


def main():
    samples = Path(sys.argv[1])
    subprocess.run([sys.executable, "-c", CLOUD], check=True)
    failed = False
    for name, words in JOBS.items():
        failed |= job(name, words.format(samples=samples).split(), os.environ) > 0
    elsewhere = os.environ | {"NUMBA_CACHE_DIR": "empty"}
    shipped = next(Path(sys.prefix).rglob("o3dleaf/core/compiled/machine_code"))
    shipped.rename(shipped.with_name("away"))
    job("demo, nothing shipped", ["demo", "-o", "demo5"], elsewhere)
    shipped.with_name("away").rename(shipped)
    hashes = {
        each.name: hashlib.sha256((each / "leaf.ply").read_bytes()).hexdigest()[:16] for each in Path().glob("demo*")
    }
    print(json.dumps(hashes, indent=1))
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import o3dleaf"], check=True)
    print(f"import o3dleaf: {time.perf_counter() - start:.2f} s, the interpreter's start included")
    sys.exit(failed or len(set(hashes.values())) > 1)


def job(name, words, environment):
    """Run a job, print its time and how many functions it compiled, and return that."""
    start = time.perf_counter()
    command = [sys.executable, "-c", RUN, *words, "--quiet"]
    done = subprocess.run(command, check=True, env=environment, stdout=subprocess.PIPE, text=True)
    compiled = int(done.stdout.splitlines()[-1])
    print(f"{name}: {time.perf_counter() - start:.1f} s, {compiled} functions compiled", flush=True)
    return compiled


if __name__ == "__main__":
    main()
