"""The bench of the peers measures what it says: errors against the truth, kinds of meshes, failures, verdicts."""

import importlib
import json
import math
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import KDTree

import o3dleaf as o3l
from o3dleaf import mesh_report
from o3dleaf.samples import Sphere, Torus
from tolerances import BENCH_SAG, BENCH_SPACING, POISSON_SPHERE, SOLID_FOOT

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"
KEYS = [
    "shape",
    "points",
    "noise",
    "method",
    "accuracy",
    "completeness",
    "hausdorff95",
    "hausdorff",
    "normal_consistency",
    "fscore",
    "components",
    "manifold",
    "boundary_edges",
    "seconds",
    "peak_mb",
]
OFFSET = 0.01


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    return importlib.import_module


@pytest.fixture
def errors(script):
    return script("surface_errors")


@pytest.fixture(scope="module")
def offset():
    """A mesh of the sphere, too large by OFFSET all over."""
    solid = Sphere()
    mesh = o3d.geometry.TriangleMesh.create_sphere(solid.radius + OFFSET, 100)
    centre = solid.closest([[0.0, 0.0, 0.0]])
    centre = centre.points[0] - solid.radius * centre.normals[0]
    return solid, np.asarray(mesh.vertices) + centre, np.asarray(mesh.triangles)


def test_a_sphere_too_large_is_off_by_its_offset_in_every_measure(errors, offset):
    solid, vertices, triangles = offset
    found = errors.errors_to_truth(vertices, triangles, solid, 1.5 * OFFSET, samples=20_000)
    for measure in ("accuracy", "completeness", "hausdorff95", "hausdorff"):
        assert abs(found[measure] - OFFSET) < BENCH_SAG
    assert found["fscore"] == 1
    assert found["normal_consistency"] > 1 - BENCH_SAG


def test_nothing_counts_that_is_beyond_the_threshold(errors, offset):
    solid, vertices, triangles = offset
    assert errors.errors_to_truth(vertices, triangles, solid, 0.5 * OFFSET, samples=2000)["fscore"] == 0


def test_a_surface_turned_inside_out_is_known_by_its_normals(errors, offset):
    solid, vertices, triangles = offset
    found = errors.errors_to_truth(vertices, triangles[:, ::-1], solid, OFFSET, samples=2000)
    assert found["normal_consistency"] < BENCH_SAG - 1


def test_a_tiny_far_fragment_decides_the_largest_distance_alone(errors, offset):
    solid, vertices, triangles = offset
    far = vertices.mean(axis=0) + [3.0, 0.0, 0.0] + 1e-4 * np.eye(3)
    more = np.concatenate([vertices, far]), np.concatenate([triangles, len(vertices) + np.arange(3)[np.newaxis]])
    found = errors.errors_to_truth(*more, solid, 1.5 * OFFSET, samples=2000)
    assert abs(found["hausdorff"] - (3.0 - solid.radius)) < 1e-3
    assert abs(found["hausdorff95"] - OFFSET) < BENCH_SAG


def test_a_missing_half_is_incomplete_but_accurate(errors, offset):
    solid, vertices, triangles = offset
    low = vertices[triangles].mean(axis=1)[:, 2] < vertices[:, 2].mean()
    found = errors.errors_to_truth(vertices, triangles[low], solid, 1.5 * OFFSET, samples=20_000)
    assert abs(found["accuracy"] - OFFSET) < BENCH_SAG
    assert abs(found["hausdorff"] - math.hypot(solid.radius, solid.radius + OFFSET)) < 0.01
    assert abs(found["fscore"] - 2 / 3) < 0.02, "all of the mesh is near, half of the truth is"


def test_distances_to_a_scan_are_those_to_its_points(errors, offset):
    solid, vertices, triangles = offset
    points, normals = solid.sample(5000)
    held_out = solid.sample(500, 1)[0]
    found = errors.errors_to_scan(vertices, triangles, (points, normals), held_out, 0.05, samples=2000)
    assert abs(found["completeness"] - OFFSET) < BENCH_SAG
    assert OFFSET < found["accuracy"] < np.hypot(OFFSET, np.sqrt(solid.area / 5000))


def test_the_kind_of_a_mesh_is_counted(errors, offset):
    _, vertices, triangles = offset
    whole = errors.shape_of(vertices, triangles)
    assert (whole["components"], whole["manifold"], whole["boundary_edges"]) == (1, True, 0)
    assert errors.shape_of(vertices, triangles[1:])["boundary_edges"] == 3
    fin = np.concatenate([triangles, [[*triangles[0, :2], triangles[-1, 0]]]])
    assert not errors.shape_of(vertices, fin)["manifold"]
    both = np.concatenate([triangles, triangles + len(vertices)])
    assert errors.shape_of(np.concatenate([vertices, vertices + 9]), both)["components"] == 2


@pytest.mark.parametrize("method", ["meshlab_poisson", "apss", "rimls", "ball_pivoting"])
def test_triangles_are_as_fine_as_the_cloud(script, method):
    solid, count = Sphere(), 3000
    points, normals = solid.sample(count)
    spacing = np.sqrt(solid.area / count)
    vertices, triangles = script("peers").METHODS[method](points, normals, spacing, False)
    edge = np.median(np.linalg.norm(np.diff(vertices[triangles[:, :2]], axis=1), axis=2)) / spacing
    # An octree's depth is a whole number; the edges of ball pivoting are those between the points. Open3D's Poisson,
    # which has the depth of MeshLab's, is not called here: now and then it crashes the process that it runs in.
    assert {"apss": 0.9, "rimls": 0.9}.get(method, 0.5) < edge < 1.1


def test_meshlabs_poisson_of_a_sphere_is_a_sphere(script):
    rng, scale = np.random.default_rng(0), script("peers").SCALE
    points = rng.normal(size=(4000, 3))
    points /= np.linalg.norm(points, axis=1)[:, np.newaxis]
    mesh = script("peers").meshlab_poisson(points, points, scale * np.ptp(points, axis=0).max() / 2**5, False)
    assert mesh_report(mesh).volume == pytest.approx(4 / 3 * np.pi, rel=POISSON_SPHERE)


def test_an_open_truth_loses_the_vertices_of_the_lowest_densities(script):
    vertices, triangles = np.zeros((200, 3)), np.arange(198)[:, np.newaxis] + np.arange(3)
    density = np.arange(200.0)[::-1]
    trim = script("peers").trim
    assert trim(vertices, triangles, density, False)[1] is triangles
    assert trim(vertices, triangles, density, True)[1].max() == 197


def test_the_clouds_are_what_they_say(script):
    clouds = script("clouds")
    clean, noisy = (clouds.synthetic("sphere", 4000, noise) for noise in (0.0, 0.005))
    solid = clouds.solid_of("sphere")
    assert np.abs(solid.signed_distance(clean.points)).max() < 1e-9
    amount = 0.005 * np.linalg.norm(np.ptp(clean.points, axis=0))
    shift = noisy.points - clean.points
    assert np.abs(shift.std(axis=0) / amount - 1).max() < 0.05
    assert np.abs(np.mean(shift * clean.normals)) < 0.1 * amount, "noise that knows the surface"
    facing = (noisy.normals * solid.closest(noisy.points).normals).sum(axis=1)
    assert facing.min() >= 0
    assert facing.mean() > 0.9
    assert np.abs(noisy.normals - clean.normals).max() > 0.01
    exact = clouds.synthetic("sphere", 4000, 0.005, normals="truth")
    assert np.array_equal(exact.normals, clean.normals)


def test_a_file_of_a_closed_mesh_is_a_truth(script, tmp_path):
    clouds, path = script("clouds"), tmp_path / "block.ply"
    o3d.io.write_triangle_mesh(str(path), o3d.geometry.TriangleMesh.create_box(1.0, 0.7, 0.4))
    case = clouds.synthetic(str(path), 500, 0.0, samples=100)
    assert (case.shape, case.euler, case.oriented) == ("block", 2, True)
    assert np.abs(clouds.solid_of(str(path)).signed_distance(case.points)).max() < SOLID_FOOT


def test_without_normals_the_peers_get_consistent_ones(script):
    clouds = script("clouds")
    case = clouds.synthetic("torus", 2000, 0.0, normals="none", samples=100)
    agree = (case.normals * clouds.solid_of("torus").closest(case.points).normals).sum(axis=1)
    assert not case.oriented
    assert abs(np.sign(agree).mean()) > 0.99


@pytest.mark.parametrize("method", ["rsr", "advancing_front", "alpha_wrap"])
def test_peers_of_the_extra_mesh_a_torus(script, method):
    peers = script("peers")
    if not peers.is_there(method):
        pytest.skip(f"{peers.EXTRAS[method]} is not installed (extra: bench)")
    points, normals = Torus().sample(2000)
    vertices, triangles = peers.METHODS[method](points, normals, np.sqrt(Torus().area / 2000), False)
    assert np.abs(Torus().signed_distance(vertices)).max() < 0.05
    assert len(triangles) > 1000


def test_the_spacing_of_a_scan_is_that_of_its_density(script):
    points = Sphere().sample(20_000)[0]
    assert abs(script("clouds").spacing_of(points) / np.sqrt(np.pi / 20_000) - 1) < BENCH_SPACING


def test_normals_at_odds_are_found_anew(script):
    # Not a sphere: Open3D orients by way of a Delaunay tetrahedralisation, which fails on points of one sphere.
    clouds, (points, normals) = script("clouds"), Torus().sample(2000)
    signs = np.where(np.random.default_rng(0).random(2000) < 0.2, -1.0, 1.0)[:, np.newaxis]
    assert abs(clouds.at_odds(points, signs * normals) - 2 * 0.2 * 0.8) < 0.03
    kept = clouds.facing_of(clouds.cloud_of(points, normals))
    assert np.abs(kept - normals).max() < SOLID_FOOT
    found = clouds.facing_of(clouds.cloud_of(points, signs * normals))
    assert abs((found * normals).sum(axis=1).mean()) > 0.95


def test_a_scan_is_judged_by_points_that_no_method_has_seen(script):
    clouds = script("clouds")
    if not clouds.SHARED.exists():
        pytest.skip(f"{clouds.SHARED} is not there")
    case = clouds.scanned("homer")
    held_out = case.errors.keywords["held_out"]
    assert abs(len(held_out) / (len(held_out) + len(case.points)) - clouds.HELD_OUT) < 1e-3
    assert KDTree(case.points).query(held_out)[0].min() > 0


def test_what_takes_too_long_or_fails_is_a_record_without_figures(script, tmp_path):
    bench = script("bench_peers")
    case = script("clouds").synthetic("sphere", 200, 0.0, samples=100)
    late = bench.judge(case, "ball_pivoting", 0.01)
    assert late.failed == "timed out"
    assert late.accuracy is late.seconds is None
    script("measuring").write_json(tmp_path / "found.json", [late])
    assert json.loads((tmp_path / "found.json").read_text())[0]["accuracy"] is None


def test_what_crashes_gets_another_chance_but_not_for_ever(script, monkeypatch, offset):
    bench, (_, vertices, triangles) = script("bench_peers"), offset
    case = script("clouds").synthetic("sphere", 200, 0.0, samples=100)
    left = [1]

    def crash(*_, **__):
        if left[0] == 0:
            return vertices, triangles, 1.0, 1.0, 1.0
        left[0] -= 1
        raise o3l.errors.O3DLeafError("apss: died of SIGSEGV; it is reported as failed")

    monkeypatch.setattr(bench, "reconstruct", crash)
    once = bench.judge(case, "apss", 10)
    assert (once.crashes, once.failed, once.components) == (1, None, 1)
    left[0] = 99
    ever = bench.judge(case, "apss", 10)
    assert ever.crashes == bench.TRIES == 99 - left[0]
    assert "SIGSEGV" in ever.failed


def test_vertices_that_are_no_numbers_are_counted_and_go(script, monkeypatch, offset):
    bench, (_, vertices, triangles) = script("bench_peers"), offset
    case = script("clouds").synthetic("sphere", 200, 0.0, samples=100)
    broken = vertices.copy()
    broken[triangles[0, 0]] = np.nan
    monkeypatch.setattr(bench, "reconstruct", lambda *_, **__: (broken, triangles, 1.0, 1.0, 1.0))
    found = bench.judge(case, "rimls", 10)
    assert found.nonfinite_vertices == 1
    assert found.boundary_edges == np.sum(triangles == triangles[0, 0])
    assert np.isfinite(found.hausdorff)


def test_a_verdict_is_against_the_best_peer_and_the_better_poisson(script):
    bench = script("bench_peers")
    figures = {"rbfpu": 2.0, "open3d_poisson": 4.0, "meshlab_poisson": 8.0, "apss": 1.0, "rimls": None}
    records = [
        bench.Record("torus", 5000, 0.0, method, accuracy=x, completeness=x, hausdorff=x, seconds=x, spacing=100.0)
        for method, x in figures.items()
    ]
    (verdict,) = bench.verdicts(records).values()
    assert verdict["accuracy"] == ("apss", 1.0, 2.0)
    assert verdict["poisson accuracy"] == ("open3d_poisson", 4.0, 0.5)
    assert verdict["seconds"] == ("open3d_poisson", 4.0, 0.5)
    assert not bench.holds(verdict, "accuracy")
    records[0].accuracy = records[0].hausdorff = 1.0
    (verdict,) = bench.verdicts(records).values()
    assert bench.holds(verdict, "accuracy")
    assert bench.holds(verdict, "hausdorff")
    assert not bench.holds(verdict, "completeness")
    (without,) = bench.verdicts(records[1:]).values()
    assert without["hausdorff"] == ("apss", 1.0, None)
    assert not bench.holds(without, "hausdorff")
    equal = [
        bench.Record("torus", 5000, 0.0, method, accuracy=1.0, spacing=1.0) for method in ("rbfpu", "open3d_poisson")
    ]
    assert not bench.holds(*bench.verdicts(equal).values(), "accuracy"), "no better than Poisson"


def test_topology_counts_where_a_peer_has_it(script):
    bench = script("bench_peers")

    def record(shape, method, euler, open_edges=0):
        r = bench.Record(shape, 5000, 0.0, method, components=1, boundary_edges=open_edges, euler=euler)
        r.true_euler = 2
        return r

    ours = [record("a", "rbfpu", 2), record("b", "rbfpu", 0), record("c", "rbfpu", 1, 3)]
    peers = [record("a", "apss", 2), record("b", "apss", 2), record("c", "apss", 0)]
    assert bench.topology_of(ours + peers) == (
        "no open edge on 2 of 3 closed truths; one piece of the truth's genus on 1 of 2 where a peer has it"
    )


@pytest.mark.slow
def test_a_quick_run_writes_records_with_the_promised_keys(script, capsys, tmp_path):
    found = tmp_path / "found.json"
    arguments = [
        "--quick",
        "--shapes",
        "sphere",
        "--points",
        "1000",
        "--noise",
        "0",
        "--methods",
        "meshlab_poisson",
        "apss",
        "--json",
    ]
    script("bench_peers").main([*arguments, str(found)])
    records, said = json.loads(found.read_text()), capsys.readouterr().out
    assert [record["method"] for record in records] == ["meshlab_poisson", "apss"]
    for record in records:
        assert list(record)[: len(KEYS)] == KEYS
        assert record["failed"] is None
        assert 0 < record["accuracy"] < record["hausdorff95"] < record["hausdorff"] < 0.1
        assert record["seconds"] > 0
        assert record["peak_mb"] >= 0
        assert record["method"] in said
