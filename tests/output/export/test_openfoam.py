"""The check with OpenFOAM: its case holds the leaf, its verdict is OpenFOAM's, and it says what is missing."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mesh_fields import sphere
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.surface.isosurface.isosurface import extract_isosurface

SCRIPT = Path(__file__).resolve().parents[3] / "scripts" / "check_openfoam.py"
GOOD = """
Triangles    : 12 in 1 region(s)
Surface has no illegal triangles.
    0 .. 0.05  : 0
    min 0.7 for triangle 3
Surface is closed. All edges connected to two faces.
Number of unconnected parts : 1
Number of zones (connected area with consistent normal) : 1
"""


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("check_openfoam", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["check_openfoam"] = module  # dataclasses look it up
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("old", "new", "wrong"),
    [
        ("", "", []),
        ("has no illegal triangles", "has 339 illegal triangles", ["illegal triangles"]),
        ("Surface is closed.", "Surface is not closed since not all edges (9) connected to two faces:", ["closed"]),
        ("normal) : 1", "normal) : 3", ["zones of one orientation"]),
        (GOOD, "--> FOAM FATAL", ["illegal triangles", "closed", "zones of one orientation"]),
    ],
)
def test_the_verdict_is_that_of_the_log(script, old, new, wrong):
    verdict = script.Verdict("x")
    script.judge_surface(verdict, GOOD.replace(old, new) if old else GOOD, well=True)
    assert verdict.wrong == wrong
    assert ("FAILED" in str(verdict)) == bool(wrong)


def test_the_box_holds_the_leaf_and_the_point_is_in_the_air(script, tmp_path):
    mesh = extract_isosurface(sphere(), 0.1)
    vertices = mesh_arrays(mesh)[0]
    cell, volume = script.write_case(mesh, tmp_path / "case", None)
    text = (tmp_path / "case" / "system" / "leafDict").read_text()
    values = {name: float(value) for name, value in re.findall(r"(\w+) (\S+);", text)}
    low, high, cells, inside = (
        np.array([values[axis + word] for axis in "xyz"]) for word in ("Min", "Max", "Cells", "Inside")
    )
    background = cell * 2 ** values["level"]
    assert np.allclose((high - low) / cells, background)
    assert np.isclose(np.prod(high - low), volume)
    assert (vertices.min(axis=0) - low >= 3.9 * background).all()
    assert (high - vertices.max(axis=0) >= 3.9 * background).all()
    assert (vertices.max(axis=0) < inside).all()
    assert (inside < high).all()
    # Not on a face of a cell of any level.
    part = (inside - low) / cell % 1
    assert ((part > 0.1) & (part < 0.9)).all()
    assert (tmp_path / "case" / "system" / "snappyHexMeshDict").is_file()


def test_the_box_over_one_period_is_as_wide_as_it(script, tmp_path):
    mesh = extract_isosurface(sphere(), 0.1)
    vertices = mesh_arrays(mesh)[0]
    script.write_case(mesh, tmp_path / "case", 0.05, period=True)
    text = (tmp_path / "case" / "system" / "leafDict").read_text()
    values = {name: float(value) for name, value in re.findall(r"(\w+) (\S+);", text)}
    for axis in range(2):
        sides = [values["xy"[axis] + word] for word in ("Min", "Max")]
        assert np.allclose(sides, [vertices[:, axis].min(), vertices[:, axis].max()])
        assert values["xy"[axis] + "Cells"] == round(np.ptp(vertices[:, axis]) / 0.2)
    assert values["zMax"] > vertices[:, 2].max() + 0.6


@pytest.mark.skipif(shutil.which("surfaceCheck") is None, reason="OpenFOAM is not installed")
def test_openfoam_finds_a_planted_hole_and_a_flipped_triangle(script, tmp_path):
    vertices, triangles = mesh_arrays(extract_isosurface(sphere(), 0.2))
    flipped = np.vstack([triangles[:1, ::-1], triangles[1:]])
    for name, faces, wrong in (
        ("whole", triangles, []),
        ("hole", triangles[1:], ["closed"]),
        ("flipped", flipped, ["zones of one orientation"]),
    ):
        mesh = LabelledMesh(build_mesh(vertices, faces), unit="mm")
        assert script.check_surface(name, mesh, tmp_path, ".obj").wrong == wrong


@pytest.mark.slow
def test_what_is_missing_is_said_in_one_line(tmp_path):
    words = [sys.executable, str(SCRIPT)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=os.environ | {"PATH": str(tmp_path)})
    assert done.returncode == 2
    assert len([line for line in done.stderr.splitlines() if "check_openfoam" in line]) == 1
    assert "apt-get install" in done.stderr
