"""Print a hash of every output that a change of the code's shape, not of its results, must leave byte for byte.

    scripts/print_hashes.py                     # print them
    scripts/print_hashes.py > before.txt        # ... in one checkout; then, in another:
    scripts/print_hashes.py --against before.txt    # ... and say which differ

Everything goes through the command line. Real scans come from ../shared/data, where it is there.
Of a model file the arrays are hashed too, without the header that names the classes. Leaves are those of the paper's
frame; those of the default frame, a surface over a chart, are called surface_....
"""

import argparse
import hashlib
import json
import os
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import open3d as o3d

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "data_samples"
DATA = ROOT.parent / "shared" / "data"
SCAN = DATA / "wheat/wheat_leaf.ply"
MIDRIB = DATA / "wheat/wheat_leaf_midrib.ply"
CT = SAMPLES / "wheat_ct_24um.tif"
WINDOW = ["--region", "90", "-2", "96", "2"]
LEAVES = ["leaf.ply", "leaf.o3l", "blade.ply", "closed.ply", "remeshed.ply"]
CLOUDS = [
    "oriented/homer.ply",
    "oriented/interlocked_tori.ply",
    "leaves/sugarbeet.ply",
    "leaves/soybean_with_normals.ply",
]


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--against", type=Path, help="hashes printed before")
    options.add_argument("--only", nargs="+", metavar="FILE", help="the files to make, not all")
    given = options.parse_args()
    before = dict(line.split("  ") for line in given.against.read_text().splitlines()) if given.against else {}
    changed = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for command, outputs in jobs(folder):
            if given.only and not {each.name for each in outputs} & set(given.only):
                continue
            run(command)
            for output in outputs:
                for label, digest in hashes(output):
                    known = before.get(label)
                    mark = "" if known is None else "  same" if known == digest else "  CHANGED"
                    changed += [label] if mark == "  CHANGED" else []
                    print(f"{label}  {digest}{mark}", flush=True)
    sys.exit(1 if changed else 0)


def jobs(folder):
    """Yield what to run and the files to hash then."""
    sample = [SAMPLES / "wheat_scan.ply", "--midrib", SAMPLES / "wheat_midrib.ply", "--no-picture"]
    real = [SCAN, "--midrib", MIDRIB, "--no-picture"]
    # The paper's frame has the names that its files have had since the first release.
    for frame, prefix in (("paper", ""), ("surface", "surface_")):
        files = {name: folder / f"{prefix}{name}" for name in LEAVES}
        # Of the paper's frame what was printed before the mixture chose the level can be compared with still.
        way = ["--frame", frame, "--ct", CT, *(["--level", "valley"] if frame == "paper" else [])]
        model = ["--model", files["leaf.o3l"], "-o", files["leaf.ply"]]
        yield ["leaf", *sample, *way, "--spacing", "0.1", *model], [files["leaf.ply"], files["leaf.o3l"]]
        if SCAN.is_file():
            yield ["leaf", *real, *way[:2], "--spacing", "0.2", "-o", files["blade.ply"]], [files["blade.ply"]]
            closed = [*real, *way, "--closed"]
            yield ["leaf", *closed, "--spacing", "0.1", "-o", files["closed.ply"]], [files["closed.ply"]]
            solver = [*closed, *WINDOW, "--spacing", "0.05", "--remesh", "0.05"]
            yield ["leaf", *solver, "-o", files["remeshed.ply"]], [files["remeshed.ply"]]
    clouds = [DATA / name for name in CLOUDS if (DATA / name).is_file()]
    for cloud in [*clouds, noisy_torus(folder / "noisy_torus_cloud.ply")]:
        name = f"surface_of_{cloud.stem}.ply"
        yield ["reconstruct", cloud, "-o", folder / name], [folder / name]


def noisy_torus(path):
    """Write 20,000 points of a torus of radii 1 and 0.4 with noise of 0.01."""
    rng = np.random.default_rng(0)
    turn, tube = rng.uniform(0, 2 * np.pi, (2, 20_000))
    ring = 1 + 0.4 * np.cos(tube)
    points = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), 0.4 * np.sin(tube)])
    points += rng.normal(0, 0.01, points.shape)
    o3d.io.write_point_cloud(path, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    return path


def run(command):
    """Run a command of this checkout's package, quietly."""
    words = [sys.executable, "-c", "from o3dleaf.commands.cli import main; main()", *map(str, command), "--quiet"]
    subprocess.run(words, check=True, env=os.environ | {"PYTHONPATH": str(ROOT)})


def hashes(path):
    """Yield (name, digest) of a file and, of a model, of its arrays alone."""
    content = path.read_bytes()
    yield path.name, hashlib.sha256(content).hexdigest()[:16]
    if path.suffix == ".o3l":
        _, length, _ = struct.unpack("<8sQI", content[:20])
        arrays = json.loads(content[20 : 20 + length])["arrays"]
        parts = sorted(content[20 + length + a["offset"] :][: nbytes(a)] for a in arrays)
        yield f"{path.name}:arrays", hashlib.sha256(b"".join(parts)).hexdigest()[:16]


def nbytes(array):
    """Return the bytes of an array that a model's header describes."""
    return np.dtype(array["dtype"]).itemsize * int(np.prod(array["shape"]))


if __name__ == "__main__":
    main()
