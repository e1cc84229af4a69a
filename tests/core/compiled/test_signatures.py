"""The list of what the main jobs call is complete, and reads as it was written."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import open3d as o3d
import pytest
from numba import typeof

import called_functions
from cloud_shapes import block, sphere
from o3dleaf.core.compiled import signatures
from o3dleaf.leaf.ct.formats.tiff import write_volume
from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.files import MIDRIB, PATCH, SCAN, write_points
from o3dleaf.samples.scan import wheat_scan

ROOT = Path(__file__).resolve().parents[3]

JOBS = """
import sys
from o3dleaf.commands.cli import main
from o3dleaf.core.compiled.signatures import called
from o3dleaf.output.report import shots
from o3dleaf.output.view import leaf_picture
from o3dleaf.output.view.picture import render
render.__wrapped__.__kwdefaults__["size"], shots.FINER = (400, 250), 0.5  # pixels do not decide what is called
leaf_picture.STEPS = 50  # nor do the steps of an inset
folder = sys.argv[1]
for words in (
    "demo --samples {0} --spacing 1 -o {0}",
    "reconstruct {0}/rough.xyz -o {0}/rough.ply",
    "reconstruct {0}/block.ply -o {0}/creased.ply",
    "reconstruct {0}/leaf.ply -o {0}/surface.ply",
    "qa {0}/surface.ply --cloud {0}/leaf.ply --html {0}/qa.html",
):
    sys.argv = ["o3dleaf", *words.format(folder).split(), "--quiet"]
    try:
        main()
    except SystemExit as stop:
        assert stop.code in (0, 1, None), words
print("CALLED", *called(), sep="\\n")
"""


def write_small_samples(folder):
    """A quarter of the leaf in few points and voxels: kinds of data decide what is called, their number how often."""
    scan = wheat_scan(count=800)
    points = np.asarray(scan.cloud.points)
    write_points(folder / SCAN, points[np.abs(points[:, 0] - np.median(points[:, 0])) < 25])
    write_points(folder / MIDRIB, scan.midrib)
    write_volume(wheat_ct(size=(720, 720, 480))[0], folder / PATCH)


@pytest.mark.slow
def test_it_has_all_that_the_main_jobs_call(tmp_path):
    """Otherwise `scripts/list_compiled.py --write` makes it anew."""
    write_small_samples(tmp_path)
    np.savetxt(tmp_path / "rough.xyz", sphere(800)[0] + 0.1 * np.random.default_rng(1).standard_normal((800, 3)))
    cloud = o3d.geometry.PointCloud()
    cloud.points, cloud.normals = map(o3d.utility.Vector3dVector, block(800))
    o3d.io.write_point_cloud(tmp_path / "block.ply", cloud)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", JOBS, str(tmp_path)]
    done = subprocess.run(command, check=True, env=environment, capture_output=True, text=True)
    called = done.stdout.partition("CALLED\n")[2].splitlines()
    assert len(called) > 50
    assert sorted(set(called) - set(signatures.listed())) == []


def test_each_line_is_a_function_and_types_that_read_as_they_were_written():
    assert len(signatures.listed()) > 100
    for line in signatures.listed("tests"):
        function, types = signatures.read(line)
        assert signatures.written(function, types) == line


def test_each_part_adds_to_those_before_it_in_rising_order():
    demo, jobs, tests = map(signatures.listed, ("demo", "all", "tests"))
    assert jobs[: len(demo)] == demo
    assert tests[: len(jobs)] == jobs
    assert len(set(tests)) == len(tests)
    for part in (demo, jobs[len(demo) :], tests[len(jobs) :]):
        assert part == sorted(part)


def test_what_the_tests_call_that_is_not_listed_is_said_at_their_end():
    *_, listed = signatures.listed("tests")
    new = f"{listed.partition(' ')[0]} int8"
    option, terminal = SimpleNamespace(called=None, slow=False), Mock()
    called_functions.pytest_terminal_summary(
        terminal, SimpleNamespace(stash={called_functions.CALLED: {listed, new}}, option=option)
    )
    said = [call.args[0] for call in terminal.write_line.call_args_list]
    assert said == [new, "1 in all; scripts/list_compiled.py --write lists them"]
    terminal.reset_mock()
    called_functions.pytest_terminal_summary(
        terminal, SimpleNamespace(stash={called_functions.CALLED: {listed}}, option=option)
    )
    assert not terminal.method_calls


@pytest.mark.parametrize(
    "value",
    [1, 2.0, True, None, (1, 2.0), (1, 2), np.zeros(2), np.zeros((2, 2)).T, np.zeros(4)[::2], np.zeros(2, np.float32)],
)
def test_types_read_as_they_were_written(value):
    line = signatures.written(signatures.read(signatures.listed()[0])[0], (typeof(value),))
    assert signatures.read(line)[1] == (typeof(value),)


def test_an_array_that_cannot_be_written_to_is_another_type():
    array = np.zeros(2)
    array.flags.writeable = False
    line = signatures.written(signatures.read(signatures.listed()[0])[0], (typeof(array),))
    assert signatures.read(line)[1] == (typeof(array),)
    assert signatures.read(line)[1] != (typeof(np.zeros(2)),)
