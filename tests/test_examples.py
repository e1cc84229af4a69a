"""Every numbered example runs, and one thing that it shows is so."""

import importlib.util
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


def load(name):
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_all_examples_are_here():
    assert sorted(path.stem for path in SCRIPTS.glob("[0-9]*.py")) == [
        "01_whole_leaf",
        "02_pieces",
        "03_other_local_fits",
    ]


def test_whole_leaf(tmp_path):
    leaf, mesh = load("01_whole_leaf").main(tmp_path)
    assert len(mesh.cluster_connected_triangles()[1]) == 2
    assert leaf.unit == "mm"
    assert {path.name for path in tmp_path.iterdir()} == {"window.ply", "window.png"}


def test_pieces():
    leaf, found, gradient = load("02_pieces").main()
    assert found[0] < 0 < found[1]
    assert gradient.shape == (1, 3)
    assert leaf.texture.period == pytest.approx([1600, 1600])


def test_other_local_fits():
    errors = load("03_other_local_fits").main()
    assert all(error < 0.03 for error in errors.values())
