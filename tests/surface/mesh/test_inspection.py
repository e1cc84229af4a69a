"""The report says what MeshLab and Open3D say, finds every planted defect, and depends on the surface alone."""

import os
from dataclasses import dataclass

import numpy as np
import open3d as o3d
import pymeshlab
import pytest
from scipy.spatial.transform import Rotation

import reference
from mesh_fields import DEFECTS, Analytic, planted, sphere, torus, wavy_sheets
from o3dleaf import (
    BladeOptions,
    MultiscaleLeaf,
    create_blade,
    create_texture,
    extract_isosurface,
    inspect_mesh,
    mesh_report,
)
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.scan import wheat_scan
from o3dleaf.surface.mesh.defects import find_defects
from o3dleaf.surface.mesh.deviation import SUPPORT, distance_to_mesh, nearest_on_mesh
from o3dleaf.surface.mesh.topology import EdgeTable, fans_per_vertex, label_fans
from tolerances import MESHLAB_AREA, NEWTON_STEP, RIGHT_ANGLE, SCENE, SMALL_ANGLE, TURNED_MESH

HEALTHY = ["sphere", "torus", "open sheets", "moebius", "leaf window"]


@pytest.fixture(scope="module")
def ball():
    return mesh_arrays(extract_isosurface(sphere(), 0.19, method="tetrahedra"))


@pytest.fixture(scope="module")
def leaf():
    return MultiscaleLeaf(
        create_texture(wheat_ct()[0]),
        blade=create_blade(*wheat_scan(count=800)[:2], options=BladeOptions(frame="paper")),
    )


@pytest.fixture(scope="module")
def meshes(ball, leaf):
    made = {
        "sphere": ball,
        "torus": extract_isosurface(torus(), 0.15),
        "open sheets": extract_isosurface(wavy_sheets(), 0.15, [[-1] * 3, [1] * 3]),
        "moebius": o3d.geometry.TriangleMesh.create_mobius(),
        "leaf window": leaf.extract_mesh(0.1, [[60, -1], [62, 1]], closed=True),
    }
    return {name: mesh_arrays(mesh) for name, mesh in made.items()} | {name: planted(name, ball)[0] for name in DEFECTS}


@dataclass
class MeshLab:
    """A session that holds one mesh, and what its filters say of it."""

    vertices: np.ndarray
    triangles: np.ndarray

    def __post_init__(self):
        self.session = pymeshlab.MeshSet(verbose=False)
        self.session.add_mesh(pymeshlab.Mesh(self.vertices, np.asarray(self.triangles, dtype=np.int32)))
        self.counts = self.session.get_topological_measures()
        self.sizes = self.session.get_geometric_measures()

    def selected(self, name):
        getattr(self.session, name)()
        return np.flatnonzero(self.session.current_mesh().face_selection_array())

    def removed(self, name):
        before = self.session.current_mesh().face_number()
        getattr(self.session, name)()
        return before - self.session.current_mesh().face_number()


@pytest.mark.parametrize("name", HEALTHY + DEFECTS)
def test_the_report_agrees_with_meshlab(name, meshes):
    found, lab = inspect_mesh(meshes[name]), MeshLab(*meshes[name])
    report, defects, told = found.report, found.defects, lab.counts
    assert report.boundary_edges == told["boundary_edges"]
    assert report.components == told["connected_components_number"]
    assert len(found.measurements.edges.ends) == told["edges_number"]
    assert report.manifold == told["is_mesh_two_manifold"]
    assert report.nonmanifold_vertices == told["non_two_manifold_vertices"]
    # Not its edges: an edge of three triangles it counts twice.
    assert len(defects.nonmanifold_edge) == told["incident_faces_on_non_two_manifold_edges"]
    assert len(defects.nonmanifold_vertex) == told["incident_faces_on_non_two_manifold_vertices"]
    if report.manifold:
        assert report.boundary_loops == told["number_holes"]
    if report.genus is not None:
        assert report.genus == told["genus"]
    assert report.area == pytest.approx(lab.sizes["surface_area"], rel=MESHLAB_AREA)
    assert report.mean_edge == pytest.approx(lab.sizes["avg_edge_length"])
    if report.watertight and report.oriented:
        assert report.volume == pytest.approx(lab.sizes["mesh_volume"])
    crossing = lab.selected("compute_selection_by_self_intersections_per_face")
    if name == "leaf window":
        assert_apart(*meshes[name], np.setdiff1d(crossing, defects.self_intersecting)[:30])
        crossing = np.intersect1d(crossing, defects.self_intersecting)
    assert np.array_equal(defects.self_intersecting, crossing)
    assert report.duplicate_triangles == lab.removed("meshing_remove_duplicate_faces")
    assert report.degenerate_triangles == lab.removed("meshing_remove_null_faces")


def assert_apart(vertices, triangles, rows):
    """MeshLab takes triangles side by side in one plane, to rounding, for crossing: in fractions they are apart."""
    lower, upper = vertices[triangles].min(axis=1), vertices[triangles].max(axis=1)
    assert len(rows) > 0
    for row in rows:
        near = ((lower <= upper[row]) & (lower[row] <= upper)).all(axis=1)
        for other in np.flatnonzero(near & (np.arange(len(triangles)) != row)):
            assert not reference.meet(vertices[triangles[row]], vertices[triangles[other]])


@pytest.mark.parametrize("name", HEALTHY + DEFECTS)
def test_the_report_agrees_with_open3d(name, meshes):
    found, oracle = inspect_mesh(meshes[name]), build_mesh(*meshes[name])
    report, edges = found.report, found.measurements.edges
    heavy = oracle.get_non_manifold_edges(allow_boundary_edges=True)
    assert {tuple(pair) for pair in edges.ends[edges.count > 2].tolist()} == {tuple(pair) for pair in heavy}
    if not report.nonmanifold_edges:
        assert np.flatnonzero(found.measurements.bowtie).tolist() == sorted(oracle.get_non_manifold_vertices())
        assert report.orientable == oracle.is_orientable()
    assert report.watertight == oracle.is_watertight()
    assert report.components == len(oracle.cluster_connected_triangles()[1])
    assert report.area == pytest.approx(oracle.get_surface_area())
    if report.watertight and report.oriented:
        assert report.volume == pytest.approx(oracle.get_volume())
    assert report.lower == pytest.approx(oracle.get_min_bound())
    assert report.upper == pytest.approx(oracle.get_max_bound())
    if name != "duplicated face":
        # Open3D leaves out whatever shares a corner.
        pairs = np.asarray(oracle.get_self_intersecting_triangles())
        assert np.array_equal(found.defects.self_intersecting, np.unique(pairs))


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_mesh_has_no_defect(name, meshes):
    defects = find_defects(meshes[name])
    ring = {"boundary"} if name in {"open sheets", "moebius"} else set()
    assert {kind for kind, rows in defects.rows().items() if len(rows)} == ring


@pytest.mark.parametrize("defect", DEFECTS)
def test_a_planted_defect_is_found_where_it_is(defect, ball):
    mesh, expected = planted(defect, ball)
    found = inspect_mesh(mesh)
    told = found.report.to_dict()
    assert {name: told[name] for name in expected} == expected
    last, defects = len(mesh[1]) - 1, found.defects
    if defect == "missing face":
        assert set(defects.rings[0]) == set(ball[1][0])
        assert defects.rings.is_hole.tolist() == [True]
        assert np.array_equal(defects.hole, defects.boundary)
    elif defect == "flipped face":
        assert defects.flipped.tolist() == [0]
    elif defect == "duplicated face":
        assert defects.duplicate.tolist() == [last]
        beside = np.isin(mesh[1], mesh[1][0]).sum(axis=1) >= 2
        assert np.array_equal(defects.nonmanifold_edge, np.flatnonzero(beside))
    elif defect == "non-manifold edge":
        assert {0, last} < set(defects.nonmanifold_edge)
    elif defect == "non-manifold vertex":
        assert np.array_equal(defects.nonmanifold_vertex, np.flatnonzero((mesh[1] == 0).any(axis=1)))
    elif defect == "intersecting sheets":
        assert 100 < told["self_intersections"] == len(defects.self_intersecting)
    elif defect == "sliver":
        assert defects.sharpest[0] == last
        assert told["min_angle_deg"] == pytest.approx(np.degrees(np.arctan(2e-3)), rel=RIGHT_ANGLE)
    elif defect == "null face":
        assert defects.degenerate.tolist() == [last]
    elif defect == "stray component":
        assert defects.stray.tolist() == list(range(len(ball[1]), len(mesh[1])))


@pytest.mark.parametrize("name", ["flipped face", "non-manifold vertex", "intersecting sheets", "leaf window"])
def test_names_and_order_change_nothing(name, meshes):
    vertices, triangles = meshes[name]
    rng = np.random.default_rng(3)
    place, row = rng.permutation(len(vertices)), rng.permutation(len(triangles))
    named = np.argsort(place)[triangles][row]
    turned = np.take_along_axis(named, (np.arange(3) + rng.integers(0, 3, size=(len(named), 1))) % 3, axis=1)
    before, after = inspect_mesh((vertices, triangles)), inspect_mesh((vertices[place], turned))
    assert figures(after.report) == pytest.approx(figures(before.report), rel=TURNED_MESH)
    for kind, rows in before.defects.rows().items():
        assert np.array_equal(np.sort(row[after.defects.rows()[kind]]), rows)


@pytest.mark.parametrize("name", HEALTHY + DEFECTS)
def test_moving_and_scaling_change_sizes_alone(name, meshes):
    vertices, triangles = meshes[name]
    moved = Rotation.from_rotvec([0.3, -0.5, 0.2]).apply(8 * vertices) + [5, -3, 40]
    before, after = (figures(mesh_report((v, triangles))) for v in (vertices, moved))
    for figure in before:
        power = 2 if figure == "area" else 3 if figure == "volume" else 1 if "edge" in figure else 0
        power *= isinstance(before[figure], float)
        assert after[figure] == pytest.approx(before[figure] * 8**power, rel=TURNED_MESH, abs=SMALL_ANGLE), figure


def figures(report):
    """Return the numbers of a report that do not depend on where the mesh is."""
    left_out = {"lower", "upper", "extent", "unit", "angle_histogram"}
    return {name: n for name, n in report.to_dict().items() if name not in left_out and n is not None}


def test_edges_fans_and_duplicates_are_the_literal_ones():
    """Twelve vertices and forty triangles: heavy edges, bow-ties and duplicates everywhere."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        triangles = np.array([rng.choice(12, 3, replace=False) for _ in range(40)])
        triangles[35:] = np.roll(triangles[:5], seed, axis=1)
        edges, literal = EdgeTable.of(triangles), reference.edge_triangles(triangles)
        assert {frozenset(pair) for pair in edges.ends.tolist()} == set(literal)
        for row, pair in enumerate(edges.ends.tolist()):
            assert edges.triangles_of([row]).tolist() == sorted(literal[frozenset(pair)])
            assert edges.count[row] == len(literal[frozenset(pair)])
        many = fans_per_vertex(triangles, label_fans(triangles, edges), 12)
        assert many.tolist() == [reference.fans(triangles, vertex) for vertex in range(12)]
        first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1]
        assert np.array_equal(np.flatnonzero(~edges.duplicates()), np.sort(first))


def test_rings_walk_along_each_boundary_edge_once(meshes):
    for name in ("open sheets", "moebius", "missing face"):
        found = inspect_mesh(meshes[name])
        rings, ends = found.defects.rings, found.measurements.edges.ends
        walked = [
            frozenset(pair) for ring in rings for pair in zip(ring.tolist(), np.roll(ring, -1).tolist(), strict=True)
        ]
        assert len(walked) == len(set(walked)) == found.report.boundary_edges
        assert set(walked) == {frozenset(pair) for pair in ends[found.measurements.edges.count == 1].tolist()}
        assert len(rings) == found.report.boundary_loops


def test_angles_are_those_of_forty_digits():
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(300, 3, 3)) + 50
    corners[:, 2] = corners[:, 1] + 10.0 ** -rng.integers(0, 7, size=(300, 1)) * rng.normal(size=(300, 3))
    found = inspect_mesh((corners.reshape(-1, 3), np.arange(900).reshape(-1, 3)))
    angles = np.array([reference.smallest_angle(*three) for three in corners])
    assert found.measurements.smallest_angle == pytest.approx(angles, rel=SMALL_ANGLE)
    for limit in (1, 5, 10, 20):
        assert found.report.to_dict()[f"share_below_{limit}deg"] == np.mean(angles < limit)
    assert found.report.angle_histogram == tuple(np.histogram(angles, bins=60, range=(0, 60))[0])
    assert angles[found.defects.sharpest] == pytest.approx(np.sort(angles)[:20], rel=SMALL_ANGLE)


@dataclass(frozen=True)
class Paraboloid(Analytic):
    """Has a gradient."""

    def gradient(self, points):
        return -2 * np.asarray(points)


def test_the_distance_to_a_field_is_a_length_in_the_mesh_unit(ball):
    """Of a sphere a thousandth too large, in millimetres, to one in metres: a micrometre."""
    field = Paraboloid(lambda x, y, z: 1 - x**2 - y**2 - z**2, unit="m")
    around = ball[0] / np.linalg.norm(ball[0], axis=1)[:, np.newaxis]
    report = mesh_report((1001 * around, ball[1]), field, unit="mm")
    assert report.field_distance_mean == pytest.approx(1, rel=NEWTON_STEP)
    assert report.field_distance_max == pytest.approx(1, rel=NEWTON_STEP)
    inner = mesh_report((0.5 * around, ball[1]), field, isovalue=0.75)
    assert inner.unit == "m"
    assert inner.field_distance_max < RIGHT_ANGLE
    with pytest.raises(UnitError):
        mesh_report(ball, sphere(), unit="mm")


def test_where_a_field_is_flat_its_surface_is_as_far_as_its_bounds(ball):
    field = Paraboloid(lambda x, y, z: 1 - x**2 - y**2 - z**2)
    report = mesh_report(
        (np.append(ball[0], [[0.0, 0, 0]], axis=0), np.append(ball[1], [[0, 1, len(ball[0])]], axis=0)), field
    )
    assert report.field_distance_max == pytest.approx(np.linalg.norm([2.4] * 3))


@dataclass(frozen=True)
class Ball(Paraboloid):
    """Knows its distance, as a leaf does, to itself as a closed solid."""

    def signed_distance(self, x, *, closed=False):
        return np.linalg.norm(x, axis=1) - (1 if closed else np.inf)


def test_a_closed_mesh_is_measured_by_the_signed_distance(ball):
    """A tenth from the surface the first step of Newton's method is another length."""
    field = Ball(lambda x, y, z: 1 - x**2 - y**2 - z**2)
    around = ball[0] / np.linalg.norm(ball[0], axis=1)[:, np.newaxis]
    assert mesh_report((1.1 * around, ball[1]), field).field_distance_mean == pytest.approx(0.1)
    assert mesh_report((1.1 * around, ball[1][1:]), field).field_distance_mean == pytest.approx(0.21 / 2.2)


def sheet(count, height=0.0):
    """Return a flat square of side 1 with (count + 1)^2 vertices."""
    line = np.linspace(0, 1, count + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    rows = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = (part.ravel() for part in (rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]))
    return np.stack([x, y, height + 0 * x], axis=1), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_the_distances_to_a_scan_are_measured_both_ways():
    """A scan of half of a sheet, a tenth of its own spacing above it; the other half is without support."""
    vertices, triangles = sheet(200)
    scan = sheet(20, 0.005)[0]
    scan = scan[scan[:, 0] < 0.51]
    report = mesh_report((np.append(vertices, [[9.0, 9, 9]], axis=0), triangles), cloud=scan)
    assert report.scan_spacing == pytest.approx(0.05)
    assert report.scan_distance_mean == pytest.approx(0.005, rel=SCENE)
    assert report.scan_distance_max == pytest.approx(0.005, rel=SCENE)
    assert report.support_max == pytest.approx(np.linalg.norm([0.5, 0.025, 0.005]))
    # A vertex has the area of half a step on both sides.
    assert report.unsupported_share == pytest.approx(0.5 - SUPPORT * 0.05, abs=0.005)
    both = inspect_mesh((vertices, triangles), cloud=np.append(scan, [[0.5, 0.5, 2.0]], axis=0))
    assert both.report.scan_distance_max == pytest.approx(2.0, rel=SCENE)
    assert len(both.deviation.to_scan) == len(vertices)


def test_what_was_not_asked_is_none_and_the_report_is_flat(ball):
    told = mesh_report(ball, unit="um").to_dict()
    asked = [name for name, value in told.items() if value is None]
    assert asked == [n for n in told if n.startswith(("field_", "scan_", "support_", "unsupported_"))]
    assert not any(isinstance(value, dict) for value in told.values())
    assert told["extent"] == tuple(np.subtract(told["upper"], told["lower"]))
    with pytest.raises(InputError, match="zero"):
        find_defects(ball, worst=-1)


def test_reports_and_defects_are_shown_in_a_line(ball):
    found = inspect_mesh(planted("duplicated face", ball)[0], sphere(), ball[0])
    for each in (found.report, found.defects, found.deviation, found.measurements):
        assert repr(each).startswith(type(each).__name__ + "(")
        assert len(repr(each)) < 160
        assert repr(each) in repr(found) or each is found.measurements
    assert "\n" not in repr(found)
    assert "2 duplicate" not in repr(found.defects)
    assert "1 duplicate" in repr(found.defects)


@pytest.mark.parametrize("field", [None, sphere()])
def test_progress_of_a_report_runs_from_stage_to_stage_to_its_end(ball, field):
    heard = []
    with progress.listening(lambda done, total: heard.append(done / total)):
        mesh_report(ball, field)
        assert heard[-1] == 1
    assert heard == sorted(heard)
    assert len(heard) == (5 if field is None else 6)


def test_threads_beyond_the_cores_change_nothing_and_nobody_warns_of_them(ball, capfd):
    """Open3D's threads are at most as many as cores."""
    points, before = np.random.default_rng(0).uniform(-1, 1, (100, 3)), get_num_threads()
    expected = distance_to_mesh(*ball, points)
    set_num_threads((os.cpu_count() or 1) + 3)
    try:
        assert np.array_equal(distance_to_mesh(*ball, points), expected)
        nearest = nearest_on_mesh(*ball, points)
    finally:
        set_num_threads(before)
    np.testing.assert_allclose(np.linalg.norm(nearest - points, axis=1), expected, rtol=0, atol=SCENE)
    assert capfd.readouterr() == ("", "")
