"""The README's Python runs as it stands there, on data that are small enough."""

import re
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from cloud_shapes import torus
from o3dleaf import write_volume
from o3dleaf.samples import wheat_ct

README = Path(__file__).resolve().parents[1] / "README.md"
TEXT = README.read_text(encoding="utf-8")
BLOCKS = [*re.finditer(r"```python\n(.*?)```", TEXT, re.DOTALL)]
WRITTEN = [
    {"leaf.ply", "leaf.vti", "solid.obj", "leaf.o3l", "qa.json", "pieces.png"},
    {"surface.ply"},
    set(),
    set(),
    set(),
]
SHORTER = {
    '"qa.html"': '"qa.json"',
    "spacing=0.012, closed": "spacing=0.05, closed",
    "(drop, 3), 0.05), (leaf.blade.window(drop, 1), 0.0125)": "(drop, 1), 0.05), (leaf.blade.window(drop, 0.3), 0.025)",
    "spacing=0.024, region=leaf.blade.window(drop, size=3)": "spacing=0.05, region=leaf.blade.window(drop, size=1)",
    "0.1, closed=True, remesh=0.1": "0.4, closed=True, remesh=0.4",
}


@pytest.fixture(scope="module")
def given():
    """What a reader has: a blade 8 mm long, one square millimetre of volume, and names of the README's own."""
    rng = np.random.default_rng(0)
    across = rng.uniform([0, -1.3], [8, 1.3], (1000, 2))
    across[0] = 4, 0
    blade = np.column_stack([across, 0.02 * across[:, 0] ** 2 + 0.03 * across[:, 1] ** 2])
    volume, _ = wheat_ct(size=(720, 720, 480))
    voxels, intensities = volume.to_samples(volume.threshold())
    points = rng.random((500, 3))
    ring = 5 * torus(1500, tube=0.5)[0]
    return {
        "o3d": o3d,
        "o3l": o3l,
        "scan_points": blade + rng.normal(0, 0.01, blade.shape),
        "drop": blade[0],
        "x": blade[:5],
        "volume": volume,
        "voxels": voxels,
        "intensities": intensities,
        "pcd": o3d.geometry.PointCloud(o3d.utility.Vector3dVector(ring)),
        "points": points,
        "values": points[:, 0],
        "any_mesh": o3d.geometry.TriangleMesh.create_sphere(0.4),
        "any_field": o3l.samples.Sphere(0.4),
    }


def test_every_block_is_known():
    assert len(BLOCKS) == len(WRITTEN)
    assert all(long in TEXT for long in SHORTER)


@pytest.mark.parametrize(
    ("block", "written"), [*zip(BLOCKS, WRITTEN, strict=False)], ids=["leaf", "cloud", "steps", "engine", "progress"]
)
def test_a_block_runs(given, small_pictures, tmp_path, monkeypatch, block, written):
    """But for lines that are as long as all the rest: meshes are coarser, and the page of `write_report` is data."""
    monkeypatch.chdir(tmp_path)
    o3d.io.write_point_cloud("scan.ply", o3d.geometry.PointCloud(o3d.utility.Vector3dVector(given["scan_points"])))
    o3d.io.write_point_cloud("cloud.ply", given["pcd"])
    write_volume(given["volume"], "ct.tif")
    before = {path.name for path in tmp_path.iterdir()}
    lines = "\n" * TEXT.count("\n", 0, block.start(1)) + block[1]
    for long, short in SHORTER.items():
        lines = lines.replace(long, short)
    exec(compile(lines, README, "exec"), dict(given))
    assert {path.name for path in tmp_path.iterdir()} == before | written
