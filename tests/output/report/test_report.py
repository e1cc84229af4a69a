"""The summary of a run says what was chosen and how good it is, in JSON that any reader takes."""

import json

import numpy as np
import pytest

import o3dleaf as o3l
from blade_fields import RolledBlade
from leaf_fields import leaf_of, texture
from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.leaf.fit_quality import FitQuality
from o3dleaf.output.report.summary import summarize, warnings_of


@pytest.fixture(scope="module")
def blade():
    sample = o3l.samples.wheat_scan(count=800)
    return o3l.create_blade(sample.cloud, sample.midrib, options=o3l.BladeOptions(frame="paper")), sample.cloud


def test_what_was_chosen_and_how_good_it_is_can_be_read(blade):
    blade, scan = blade
    summary = summarize(blade, blade.extract_mesh(0.5), {}, scan=scan)
    read = json.loads(json.dumps(summary, allow_nan=False))
    assert read["outline"]["alpha"] == blade.outline.alpha
    assert read["outline"]["alpha_chosen"]
    choice = blade.height_map.choice
    chosen = read["height_map"]
    assert [chosen["smoothing"], chosen["bandwidth"], chosen["scan_noise"]] == pytest.approx(
        [choice.smoothing, choice.bandwidth, choice.noise], rel=1e-12
    )
    assert chosen["share_trusted"] == np.mean(choice.weights == 1)
    assert read["frame"] == json.loads(json.dumps(blade.frame_quality(scan).to_dict()))
    least, median, greatest = read["distortion"]["thickness"]
    assert 0 < least <= median <= greatest <= 1 + 1e-12


@pytest.mark.slow
def test_of_a_surface_the_chart_and_its_fit_can_be_read():
    """All that is measured of any blade is there too, and its warnings are those of the summary."""
    sample = o3l.samples.wheat_scan(count=600)
    blade = o3l.create_blade(sample.cloud)
    summary = summarize(blade, blade.extract_mesh(0.5), {}, scan=sample.cloud)
    read = json.loads(json.dumps(summary, allow_nan=False))
    along, across = np.ptp(blade.outline.bounds, axis=0)
    assert [read["chart"]["length"], read["chart"]["width"]] == pytest.approx([along, across])
    assert read["outline"]["area_in_the_plane"] == pytest.approx(blade.outline.area)
    measured = json.loads(json.dumps(FitQuality.of(blade, sample.cloud).to_dict()))
    assert {name: read["fit"][name] for name in measured if name not in ("area", "warnings")} == {
        name: value for name, value in measured.items() if name not in ("area", "warnings")
    }
    assert read["notes"] == list(blade.notes)
    assert warnings_of(summary) == blade.warnings + read["fit"]["warnings"]
    assert not {"frame", "height_map"} & set(read)
    least, median, greatest = read["distortion"]["thickness"]
    assert 0 < least <= median <= greatest <= 1 + 1e-12


def test_a_flat_blade_folds_nowhere_and_is_still_json():
    rng = np.random.default_rng(0)
    scan = np.column_stack([rng.uniform(0, 60, 800), rng.uniform(-4, 4, 800), np.zeros(800)])
    frame = o3l.LeafFrame.fit(scan, [[0, 0, 0], [30, 0, 0], [60, 0, 0]])
    leaf = frame.to_leaf(scan)
    blade = o3l.HeightMapBlade(frame, o3l.HeightMap.fit(leaf, smoothing=1.0), o3l.AlphaShape(leaf[:, :2]))
    summary = summarize(blade, blade.extract_mesh(1.0), {})
    assert json.loads(json.dumps(summary, allow_nan=False))["distortion"]["focal"] is None
    assert "frame" not in summary
    assert summary["height_map"]["robust"] is False


def test_the_fit_stands_in_the_summary_with_the_area_of_the_mesh():
    blade = RolledBlade()
    blade.notes = ("3 points were left out",)
    scan, places = blade.scan(0.5, 0.1)
    lacking = scan[np.hypot(*(places - [40, 0]).T) > 4]
    mesh, fit = blade.extract_mesh(0.5), FitQuality.of(blade, lacking)
    summary = json.loads(json.dumps(summarize(blade, mesh, {}, scan=lacking), allow_nan=False))
    assert summary["notes"] == ["3 points were left out"]
    assert summary["fit"]["area"] == fit.to_dict()["area"] | {"mesh": summary["mesh"]["area"]}
    assert summary["fit"]["coverage"] == fit.coverage
    assert warnings_of(summary) == fit.warnings != []
    assert summarize(blade, mesh, {}, fit=fit)["fit"] == summarize(blade, mesh, {}, scan=lacking)["fit"]


def pierced(mesh):
    """Return a mesh with one more triangle, upright through one of its own."""
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    corners = vertices[triangles[len(triangles) // 2]]
    up = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    up /= np.linalg.norm(up)
    through = corners.mean(axis=0) + 0.1 * np.array([up, -up, corners[1] - corners[0]])
    more = np.concatenate([triangles, len(vertices) + np.array([[0, 1, 2]])])
    return build_mesh(np.concatenate([vertices, through]), more)


def test_triangles_of_a_blade_that_cross_others_are_told_with_their_place():
    blade = RolledBlade()
    summary = summarize(blade, pierced(blade.extract_mesh(0.5)), {}, scan=blade.scan(0.5)[0])
    (warning,) = warnings_of(summary)
    assert f"{summary['mesh']['self_intersections']} triangles of the mesh cross others, most at" in warning
    assert "than the scan can tell apart" in warning


@pytest.mark.slow
def test_triangles_of_a_leaf_that_cross_others_are_told_with_their_place():
    leaf, lift = leaf_of(texture(lambda x, y, z: 0.04 - z**2))
    places = np.random.default_rng(0).uniform([0, -3], [20, 3], (400, 2))
    scan, plain = lift(*places.T, np.zeros(400)), leaf.extract_mesh(0.5)
    whole = warnings_of(summarize(leaf.blade, plain, {}, leaf=leaf, scan=scan))
    assert not any("cross" in warning for warning in whole)
    summary = summarize(leaf.blade, pierced(plain), {}, leaf=leaf, scan=scan)
    (warning,) = [each for each in warnings_of(summary) if each not in whole]
    assert f"{summary['mesh']['self_intersections']} triangles of the mesh cross others, most at" in warning
    assert "than its triangles can follow" in warning


def test_a_mesh_that_lacks_area_is_told_unless_it_shows_a_part():
    blade = RolledBlade()
    scan, mesh = blade.scan(0.5)[0], blade.extract_mesh(0.5)
    mesh.remove_triangles_by_index(range(len(mesh.triangles) // 20))
    (warning,) = warnings_of(summarize(blade, mesh, {}, scan=scan))
    assert "less area than the blade" in warning
    assert warnings_of(summarize(blade, mesh, {"region": [[0, 0], [1, 1]]}, scan=scan)) == []
