"""The benchmarks run, say what they promise, and their baseline is the published algorithm."""

import importlib
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from scipy.spatial import KDTree

import reference
from o3dleaf import samples
from tolerances import BASELINE, COUNTED_AREA, CROSSING_HEIGHT, EFFICIENCY_TWIN

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"
KEYS = {
    "operation",
    "scale",
    "seconds",
    "paper_seconds",
    "baseline_seconds",
    "peer",
    "peer_seconds",
    "ratio",
    "rms_error",
    "peak_mb",
}


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    return importlib.import_module


@pytest.fixture
def baselines(script):
    return script("baselines")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bench_paper", "bench_field"])
def test_a_quick_run_writes_rows_of_numbers(name, script, capsys, tmp_path):
    script(name).main(["--quick", "--json", str(tmp_path / "rows.json")])
    check_rows(tmp_path / "rows.json", capsys.readouterr().out)


@pytest.mark.slow
def test_a_quick_run_is_a_program(tmp_path):
    found = tmp_path / "rows.json"
    command = [sys.executable, str(SCRIPTS / "bench_engine.py"), "--quick", "--json", str(found)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=400, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    check_rows(found, run.stdout)


def check_rows(found, said):
    rows = json.loads(found.read_text())
    assert len(rows) >= 10
    for row in rows:
        assert set(row) >= KEYS
        assert row["seconds"] > 0
        numbers = [value for name, value in row.items() if isinstance(value, float)]
        assert all(math.isfinite(value) and value >= 0 for value in numbers)
        other = row["peer_seconds"] if row["peer"] else row["baseline_seconds"]
        assert row["ratio"] == (None if other is None else pytest.approx(other / row["seconds"]))
        assert row["operation"] in said


def test_the_baseline_solves_the_papers_system(baselines):
    rng = np.random.default_rng(0)
    points, queries = rng.random((2, 150, 3))
    values = np.sin(5 * points).sum(axis=1)
    ball = np.full(3, 0.5), 1.0
    part = baselines.Subdomain(points, values, ball, baselines.cubic, 2, 1e-5)
    twin = reference.solve_spline(points, values, 3, 2, 150 * 1e-5)
    np.testing.assert_allclose(part(queries), twin(queries), rtol=0, atol=BASELINE)


def test_the_baseline_blends_what_its_balls_say(baselines):
    rng = np.random.default_rng(1)
    points, queries = rng.random((2, 600, 3))
    values = points[:, 0] ** 2 - 3 * points[:, 1] * points[:, 2] + 1
    field = baselines.PartitionOfUnity(points, values, 2, baselines.cubic, 2, 0.3)
    inside = np.clip(queries, points.min(axis=0), points.max(axis=0))
    expected = inside[:, 0] ** 2 - 3 * inside[:, 1] * inside[:, 2] + 1
    np.testing.assert_allclose(field(inside), expected, rtol=0, atol=BASELINE)


def test_the_baselines_frame_goes_there_and_back(baselines):
    t = np.linspace(0, 1, 12)
    control = np.column_stack([100 * t, 10 * np.sin(2 * t), 5 * t**2])
    rng = np.random.default_rng(2)
    scan = np.repeat(control, 60, axis=0) + rng.normal(size=(720, 3)) * [2.0, 2.0, 0.01]
    frame = baselines.Frame(scan, control, 10.0)
    inner = scan[(scan[:, 0] > 10) & (scan[:, 0] < 90)]
    np.testing.assert_allclose(frame.to_world(frame.to_leaf(inner)), inner, rtol=0, atol=BASELINE)


def test_the_baselines_tetrahedra_close_a_sphere(baselines):
    axis = np.linspace(-1, 1, 21)
    samples = 0.7 - np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2)
    triangles = baselines.marching_tetrahedra(samples) / 10 - 1
    assert np.abs(np.linalg.norm(triangles.reshape(-1, 3), axis=1) - 0.7).max() < 0.01
    sides = np.sort(np.round(triangles[:, [[0, 1], [1, 2], [2, 0]]] * 1e9).astype(int).reshape(-1, 2, 3), axis=1)
    pairs = np.sort(sides.reshape(-1, 2, 3).view([("", int)] * 3).reshape(-1, 2), axis=1)
    _, counts = np.unique(pairs, axis=0, return_counts=True)
    assert np.all(counts % 2 == 0)


def test_the_errors_of_every_smoothing_are_those_of_refits(script):
    measuring, rng = script("measure_smoothing"), np.random.default_rng(0)
    balls = [
        (points, measuring.wavy(points, rng), rng.standard_normal(len(points))) for points in rng.random((2, 60, 3))
    ]
    case = measuring.Case.of(balls, 3, 2)
    amounts = np.array([1e-6, 1e-3, 1.0])
    squares = np.zeros(3)
    for points, clean, noise in balls:
        for at, amount in enumerate(amounts):
            # The script's balls are unit balls: no change of coordinates between its amounts and s.
            fit = RBFInterpolator(points, clean + 0.1 * noise, kernel="cubic", degree=2, smoothing=amount * len(points))
            squares[at] += np.sum((fit(points) - clean) ** 2)
    np.testing.assert_allclose(case.errors(amounts, 0.1), np.sqrt(squares), rtol=EFFICIENCY_TWIN)
    assert all(ratio >= 1 for rule, ratio in measuring.efficiencies(case, 0.1).items() if rule != "this rule")


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(2))
def test_crossings_of_a_lattice_stand_for_the_area_of_their_leaf(script, seed):
    """They lie on it, two of three coordinates on the lattice; those seen and whole cells are ever fewer."""
    leaf = samples.leaf_shape("twisted", length=30, width=10, angle=60)
    fused = script("measure_lattice").fuse(leaf, 0.7, seed)
    (points, counted), (_, seen), (_, cells) = (fused.ending(how) for how in ("leaf", "seen", "cells"))
    assert counted == pytest.approx(leaf.area, rel=COUNTED_AREA)
    assert cells < seen < (1 - 4 * COUNTED_AREA) * leaf.area
    assert np.abs(0.1 - leaf(points)).max() < CROSSING_HEIGHT * 0.7
    trimmed, _ = fused.ending("trimmed")
    assert leaf.contains(fused.places).sum() == len(points)
    rim = np.concatenate(leaf.margin(0.01))
    assert KDTree(rim).query(trimmed[len(points) :])[0].max() < 0.01
