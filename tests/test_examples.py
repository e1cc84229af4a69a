"""Every numbered example runs, and one thing that it shows is so."""

import importlib.util
from pathlib import Path

import open3d as o3d
import pytest

from o3dleaf.samples import wheat_scan

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


@pytest.fixture
def samples(tmp_path_factory):
    """The samples, the scan with a sixteenth of its points: the blade's fit to all of them has tests of its own."""
    folder = tmp_path_factory.mktemp("samples")
    for source in (SCRIPTS.parent / "data_samples").iterdir():
        (folder / source.name).symlink_to(source)
    (folder / "wheat_scan.ply").unlink()
    o3d.io.write_point_cloud(folder / "wheat_scan.ply", wheat_scan(count=400).cloud)
    return folder


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


@pytest.mark.slow
def test_whole_leaf(samples, small_pictures, monkeypatch, tmp_path):
    example = load("01_whole_leaf")
    monkeypatch.setattr(example, "SAMPLES", samples)
    leaf, mesh = example.main(tmp_path)
    assert len(mesh.cluster_connected_triangles()[1]) == 2
    assert leaf.unit == "mm"
    assert {path.name for path in tmp_path.iterdir()} == {"window.ply", "window.png"}


@pytest.mark.slow
def test_pieces(samples, monkeypatch):
    example = load("02_pieces")
    monkeypatch.setattr(example, "SAMPLES", samples)
    leaf, found, gradient = example.main()
    assert found[0] < 0 < found[1]
    assert gradient.shape == (1, 3)
    assert leaf.texture.period == pytest.approx([1600, 1600])


def test_other_local_fits():
    errors = load("03_other_local_fits").main()
    assert all(error < 0.03 for error in errors.values())
