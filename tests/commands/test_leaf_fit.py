"""The leaf command says what is not held, draws it, and shows where a scan was refused."""

import json

import numpy as np
import open3d as o3d
import pytest
from matplotlib.image import imread

from blade_fields import RolledBlade
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.leaf import pipeline
from o3dleaf.samples import leaf_shape, scan_leaf


@pytest.fixture
def scan(tmp_path):
    """A blade, and the file of a scan that lacks a disc of it."""
    blade = RolledBlade()
    points, places = blade.scan(0.6, 0.1)
    kept = points[np.hypot(*(places - [40, 0]).T) > 4]
    o3d.io.write_point_cloud(tmp_path / "scan.ply", o3d.geometry.PointCloud(o3d.utility.Vector3dVector(kept)))
    return blade, tmp_path / "scan.ply"


@pytest.mark.slow
def test_what_is_not_held_is_noted_and_drawn(run, scan, monkeypatch, tmp_path):
    blade, file = scan
    monkeypatch.setattr(pipeline, "create_blade", lambda *_, **__: blade)
    result = run("leaf", file, "--fit-map", "-o", tmp_path / "leaf.ply")
    assert result.returncode == 0, result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {
        "scan.ply",
        "leaf.ply",
        "leaf.png",
        "leaf.json",
        "leaf.fit.png",
    }
    (warning,) = json.loads((tmp_path / "leaf.json").read_text())["fit"]["warnings"]
    said = " ".join(result.stderr.split())
    assert f"warning: {warning}" in said
    assert "residuals: half below" in said
    assert "laid flat" in said
    # The picture says so above the leaf, where nothing is drawn of a leaf that is held.
    assert np.ptp(imread(tmp_path / "leaf.png")[:45, :800, :3]) > 0.5


@pytest.mark.parametrize("places", [None, np.array([[40.0, 0.0, 0.0], [60.0, 1.0, 0.1]])])
def test_a_refusal_shows_where(run, scan, monkeypatch, tmp_path, places):
    """A picture where the error has places, and nothing else is left."""
    _, file = scan

    def refuse(*_, **__):
        raise ReconstructionError("scan: 2 sheets meet; cut them apart", places)

    monkeypatch.setattr(pipeline, "create_blade", refuse)
    result = run("leaf", file, "-o", tmp_path / "leaf.ply", "-q")
    assert result.returncode == 2
    see = "" if places is None else "; see leaf.refused.png"
    assert result.stderr.strip() == f"o3dleaf: error: scan: 2 sheets meet; cut them apart{see}"
    left = {path.name for path in tmp_path.iterdir()} - {"scan.ply"}
    assert left == (set() if places is None else {"leaf.refused.png"})
    if left:
        red, green, blue = np.moveaxis(imread(tmp_path / "leaf.refused.png")[:, :, :3], 2, 0)
        assert np.sum((red > 2 * green) & (red > 3 * blue)) > 1e-4 * red.size
    assert "leaf.refused.png" not in run("leaf", file, "--no-picture", "-o", tmp_path / "leaf.ply", "-q").stderr


def test_places_that_a_camera_did_not_see_are_left_out_and_told(run, scan, monkeypatch, tmp_path):
    blade, file = scan
    points = np.asarray(o3d.io.read_point_cloud(file).points)
    seen = np.concatenate([points, np.full((7, 3), np.nan)])
    o3d.io.write_point_cloud(tmp_path / "grid.pcd", o3d.geometry.PointCloud(o3d.utility.Vector3dVector(seen)))
    given = []
    monkeypatch.setattr(pipeline, "create_blade", lambda cloud, *_, **__: given.append(len(cloud.points)) or blade)
    result = run("leaf", tmp_path / "grid.pcd", "--no-picture", "-o", tmp_path / "leaf.ply")
    assert result.returncode == 0, result.stderr
    assert given == [len(points)]
    assert "left out: 7 points that are NaN or infinite" in result.stderr
    summary = json.loads((tmp_path / "leaf.json").read_text())
    assert summary["scan"] == {"points": len(points), "not_finite": 7}


@pytest.mark.slow
def test_of_a_piece_that_is_asked_for_that_piece_is_measured(run, tmp_path):
    large, small = (
        scan_leaf(leaf_shape("cupped", length=length, width=20), seed=0, spacing=1.1).points for length in (30, 24)
    )
    points = o3d.utility.Vector3dVector(np.concatenate([large, small + [0, 60, 0]]))
    o3d.io.write_point_cloud(tmp_path / "two.ply", o3d.geometry.PointCloud(points))
    result = run("leaf", tmp_path / "two.ply", "--piece", "2", "--fit-map", "-o", tmp_path / "leaf.ply")
    assert result.returncode == 0, result.stderr
    fit = json.loads((tmp_path / "leaf.json").read_text())["fit"]
    assert (fit["points"], fit["others"], fit["warnings"]) == (len(small), len(large), [])
    said = " ".join(result.stderr.split())
    assert said.count("belong to other pieces") == 1
    assert "warning" not in said
    assert "the scan's 2 pieces, with their numbers: see leaf.pieces.png" in said
    assert imread(tmp_path / "leaf.pieces.png").std() > 0
