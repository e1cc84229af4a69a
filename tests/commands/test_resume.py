"""Runs that are killed and go on: the same bytes as those of a run that was left alone."""

import json
import os
import signal
import subprocess
import sys
import time

import open3d as o3d
import pytest

from o3dleaf.core.resume.parts import STATE, SUFFIX
from o3dleaf.leaf.meshing import ROWS
from o3dleaf.samples import Torus
from o3dleaf.samples.files import write_samples

PROGRAM = "import sys; {}; from o3dleaf.__main__ import main; sys.argv[0] = 'o3dleaf'; main()"
STREAMED = "import o3dleaf.commands.leaf.mesh as mesh; mesh.MAX_CHECKED = 0"
"""As leaves of more triangles than are kept in memory are."""
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL"),
]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    home = tmp_path_factory.mktemp("inputs")
    write_samples(home)
    points, _ = Torus().sample(4_000, seed=0)
    o3d.io.write_point_cloud(home / "torus.ply", o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    return home


def start(folder, before, words):
    path = os.pathsep.join(map(os.path.abspath, sys.path))
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(before), *map(str, words)],
        cwd=folder, env=os.environ | {"PYTHONPATH": path}, stderr=subprocess.PIPE, encoding="utf-8",
    )  # fmt: skip


def finish(folder, before, words):
    run = start(folder, before, words)
    _, said = run.communicate(timeout=600)
    assert run.returncode == 0, said
    return said


def rows_of(parts):
    """Return how many rows of tiles are finished."""
    try:
        return json.loads((parts / STATE).read_text()).get(ROWS, 0)
    except (OSError, ValueError):
        return 0


def kill_when(run, is_time):
    end = time.monotonic() + 600
    while not is_time():
        assert run.poll() is None, run.stderr.read()
        assert time.monotonic() < end
        time.sleep(0.005)
    run.send_signal(signal.SIGKILL)
    run.communicate()
    assert run.returncode == -signal.SIGKILL


def contents(folder):
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir()) if file.suffix != ".json"}


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
def test_a_streamed_leaf_that_is_killed_twice_comes_to_the_same_bytes(tmp_path, inputs, suffix):
    words = ["leaf", inputs / "wheat_scan.ply", "--ct", inputs / "wheat_ct_24um.tif"]
    words += ["--midrib", inputs / "wheat_midrib.ply", "--spacing", "0.1", "--no-picture", "-o", f"leaf{suffix}"]
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    for folder in (whole, killed):
        folder.mkdir()
    finish(whole, STREAMED, words)
    parts = killed / f"leaf{suffix}{SUFFIX}"
    for least in (1, 2):
        kill_when(start(killed, STREAMED, [*words, "--resume"]), lambda least=least: rows_of(parts) >= least)
        assert [file.name for file in killed.iterdir() if not file.name.startswith(".")] == [parts.name]
    done = rows_of(parts)
    assert "goes on from" in finish(killed, STREAMED, [*words, "--resume"])
    assert done >= 2
    assert contents(killed) == contents(whole)


def test_a_reconstruction_that_is_killed_comes_to_the_same_bytes(tmp_path, inputs):
    words = ["reconstruct", inputs / "torus.ply", "-o", "out.ply", "--model", "out.o3l"]
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    for folder in (whole, killed):
        folder.mkdir()
    finish(whole, "pass", words)
    parts = killed / f"out.ply{SUFFIX}"
    kill_when(start(killed, "pass", [*words, "--resume"]), (parts / "fit-0.blocks").exists)
    kill_when(start(killed, "pass", [*words, "--resume"]), (parts / "surface-0.blocks").exists)
    kept = (parts / "fit.o3l").stat().st_mtime_ns
    kill_when(start(killed, "pass", [*words, "--resume"]), lambda: time.time() > 0)
    assert (parts / "fit.o3l").stat().st_mtime_ns == kept
    assert "goes on from" in finish(killed, "pass", [*words, "--resume"])
    assert contents(killed) == contents(whole)
