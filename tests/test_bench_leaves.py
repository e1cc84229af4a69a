"""The judge of blades gives full marks to the truth, and takes off what is wrong with anything else."""

import importlib
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.samples import leaf_shape, scan_leaf

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


@pytest.fixture
def script(monkeypatch):
    """Return the function that imports a script; judges draw fewer samples, of which shares are."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    monkeypatch.setattr(importlib.import_module("leaf_errors"), "SAMPLES", 5_000)
    return importlib.import_module


@pytest.fixture(scope="module")
def scan():
    return scan_leaf(leaf_shape("eaten", length=40.0, width=20.0), spacing=1.0)


def marks(script, scan, leaf, shift=0.0):
    """Return what holds of the mesh of a leaf that is judged by a scan of another one."""
    vertices, triangles = leaf.mesh(0.5)
    truth = script("leaf_errors").Truth(scan)
    return truth.judge(build_mesh(vertices + np.array([0, 0, shift]), triangles), 1.0).as_dict()["holds"]


def test_the_truth_has_full_marks(script, scan):
    assert all(marks(script, scan, scan.truth).values())


@pytest.mark.few(kind=1)
@pytest.mark.parametrize("kind", ["curled", "petiole"])
def test_so_has_the_truth_with_a_hidden_margin(script, kind):
    hidden = scan_leaf(leaf_shape(kind, length=60.0), spacing=1.0, gaps="margin", noise=0.2)
    assert all(marks(script, hidden, hidden.truth).values())


def test_what_is_missing_costs_its_marks(script, scan):
    small = leaf_shape("eaten", length=37.0, width=16.0)
    lost = {name for name, holds in marks(script, scan, small).items() if not holds}
    assert {"area", "truth to mesh", "margin to truth", "truth to margin"} <= lost
    filled = leaf_shape("layers", length=40.0, width=20.0)
    lost = {name for name, holds in marks(script, scan, filled).items() if not holds}
    assert {"area", "mesh to truth", "truth to margin", "holes"} <= lost


@pytest.mark.slow
def test_what_is_beside_the_truth_is_neither_near_it_nor_it_near_that(script, scan):
    lost = {name for name, holds in marks(script, scan, scan.truth, 1.5).items() if not holds}
    assert {"mesh to truth", "truth to mesh"} <= lost


@pytest.mark.slow
def test_a_run_prints_marks_and_refusals_and_writes_them(script, scan, monkeypatch, tmp_path, capsys):
    bench, some = script("bench_leaves"), script("leaf_cases").cases(["winding", "eaten"], ["clean"], 1)

    def make(points):
        truth = next(case for case in some if np.array_equal(case.scan().points, points)).scan().truth
        if truth.kind == "eaten":
            raise ReconstructionError("blade: eaten; give another one")
        return SimpleNamespace(extract_mesh=lambda step: build_mesh(*truth.mesh(step)))

    monkeypatch.setattr(bench, "chosen", lambda options: (some, {"mine": make}))
    monkeypatch.setattr(bench, "warm_up", lambda make: None)
    bench.main(["--json", str(tmp_path / "found.json")])
    said = capsys.readouterr().out
    assert "16 of 32 requirements hold; all of them on 1 of 2 scans; 1 refused" in said
    assert "give another one" in said
    records = json.loads((tmp_path / "found.json").read_text())["leaves"]
    assert [record["refusal"] is None for record in records] == [True, False]


@pytest.mark.slow
def test_the_held_out_leaves_are_others(script):
    cases = script("leaf_cases")
    for kind in cases.KINDS:
        (judged,), (held_out,) = (cases.cases([kind], ["clean"], 1, held_out=held) for held in (False, True))
        assert judged.seed != held_out.seed
        assert judged.scan().truth.outline.area != pytest.approx(held_out.scan().truth.outline.area, rel=1e-2)
