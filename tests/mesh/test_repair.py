"""Defects are planted and found; cleaning heals them, twice is once; simplifying leaves the border alone."""

import numpy as np
import open3d as o3d
import pytest

from mesh_fields import sphere, wavy_sheets
from o3dleaf.errors import InputError
from o3dleaf.mesh.arrays import build_mesh, mesh_arrays
from o3dleaf.mesh.clean import clean_mesh, count_self_intersections, simplify_mesh
from o3dleaf.mesh.isosurface import extract_isosurface
from o3dleaf.mesh.quality import mesh_report
from o3dleaf.mesh.topology import EdgeTable
from tolerances import RIGHT_ANGLE, SIMPLIFIED_SPHERE


@pytest.fixture(scope="module")
def ball():
    return mesh_arrays(extract_isosurface(sphere(), 0.13, method="tetrahedra"))


def joined(*parts):
    """Return several (vertices, triangles) as one mesh."""
    start = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    triangles = [np.asarray(part[1]) + first for part, first in zip(parts, start, strict=True)]
    return np.concatenate([part[0] for part in parts]), np.concatenate(triangles)


def planted(defect, ball):
    """Return the sphere with one defect, and what a report must then say."""
    vertices, triangles = ball
    count = len(vertices)
    fin = np.append(triangles, [[*triangles[0, :2], count]], axis=0)
    mirrored = joined(ball, (2 * vertices[0] - vertices, triangles[:, ::-1]))
    touching = mirrored[0], np.where(mirrored[1] == count, 0, mirrored[1])
    thin, null = (np.array([[3.0, 0, 0], [4, 0, 0], [3.5, height, 0]]) for height in (1e-3, 0.0))
    return {
        "missing face": (
            (vertices, triangles[1:]),
            {"boundary_edges": 3, "holes": 1, "watertight": False, "manifold": True},
        ),
        "flipped face": (
            (vertices, np.concatenate([triangles[:1, ::-1], triangles[1:]])),
            {"oriented": False, "inconsistent_edges": 3, "manifold": True, "genus": None},
        ),
        "duplicated face": (
            (vertices, np.concatenate([triangles, triangles[:1]])),
            {"duplicate_triangles": 1, "nonmanifold_edges": 3, "manifold": False},
        ),
        "non-manifold edge": (
            (np.append(vertices, [[3.0, 0, 0]], axis=0), fin),
            {"nonmanifold_edges": 1, "manifold": False, "boundary_edges": 2},
        ),
        "non-manifold vertex": (touching, {"nonmanifold_vertices": 1, "components": 2, "manifold": False}),
        "intersecting sheets": (
            joined(ball, (vertices + 0.5, triangles)),
            {"watertight": False, "components": 2, "manifold": True},
        ),
        "sliver": (joined(ball, (thin, [[0, 1, 2]])), {"degenerate_triangles": 0, "components": 2}),
        "null face": (joined(ball, (null, [[0, 1, 2]])), {"degenerate_triangles": 1, "min_angle_deg": 0.0}),
        "stray component": (
            joined(ball, (0.05 * vertices + 2, triangles)),
            {"components": 2, "watertight": True, "genus": 0},
        ),
    }[defect]


DEFECTS = [
    "missing face",
    "flipped face",
    "duplicated face",
    "non-manifold edge",
    "non-manifold vertex",
    "intersecting sheets",
    "sliver",
    "null face",
    "stray component",
]


@pytest.mark.parametrize("defect", DEFECTS)
def test_a_planted_defect_is_found(defect, ball):
    sound = mesh_report(ball)
    assert (sound.watertight, sound.oriented, sound.holes, sound.duplicate_triangles) == (True, True, 0, 0)
    mesh, expected = planted(defect, ball)
    found = mesh_report(mesh).to_dict()
    assert {name: found[name] for name in expected} == expected
    if defect == "intersecting sheets":
        assert found["self_intersections"] > 10
    if defect == "sliver":
        assert found["min_angle_deg"] == pytest.approx(np.degrees(np.arctan(2e-3)), rel=RIGHT_ANGLE)


@pytest.mark.parametrize("defect", DEFECTS)
def test_the_report_agrees_with_open3d(defect, ball):
    mesh = planted(defect, ball)[0]
    report, oracle = mesh_report(mesh), build_mesh(*mesh)
    edge_manifold = oracle.is_edge_manifold(allow_boundary_edges=True)
    assert (report.nonmanifold_edges == 0) == edge_manifold
    if edge_manifold:
        assert report.nonmanifold_vertices == len(oracle.get_non_manifold_vertices())
    assert report.components == len(oracle.cluster_connected_triangles()[1])
    assert report.area == pytest.approx(oracle.get_surface_area())
    if defect not in {"null face", "sliver"}:
        assert report.watertight == oracle.is_watertight()


@pytest.mark.parametrize("defect", DEFECTS)
def test_cleaning_heals_and_cleaning_twice_is_cleaning_once(defect, ball):
    mesh = planted(defect, ball)[0]
    size = {"smallest_component": 0.3, "largest_hole": 0.6}
    once = clean_mesh(mesh, **size)
    report = mesh_report(once)
    assert report.manifold
    assert report.oriented
    assert (report.degenerate_triangles, report.duplicate_triangles, report.holes) == (0, 0, 0)
    if defect in {"missing face", "flipped face", "duplicated face", "stray component"}:
        assert report.components == 1
        assert report.volume == pytest.approx(mesh_report(ball).volume)
    given = {tuple(v) for v in np.asarray(mesh[0])}
    assert {tuple(v) for v in np.asarray(once.vertices)} <= given
    twice = clean_mesh(once, **size)
    assert np.array_equal(np.asarray(once.vertices), np.asarray(twice.vertices))
    assert np.array_equal(np.asarray(once.triangles), np.asarray(twice.triangles))


def test_cleaning_leaves_a_sound_mesh_as_it_is(ball):
    again = mesh_arrays(clean_mesh(ball, smallest_component=0.1, largest_hole=1.0))
    assert np.array_equal(again[0], ball[0])
    assert np.array_equal(again[1], ball[1])


def test_a_hole_is_closed_and_a_rim_is_not():
    vertices, triangles = mesh_arrays(extract_isosurface(wavy_sheets(), 0.1, [[-1] * 3, [1] * 3]))
    pierced = np.delete(triangles, [300, 301, 302], axis=0)
    before = mesh_report((vertices, pierced))
    assert before.holes >= 1
    after = mesh_report(clean_mesh((vertices, pierced), largest_hole=1e6))
    assert (after.holes, after.boundary_loops, after.components) == (0, 2, 2)


def test_small_components_are_measured_by_their_diagonal(ball):
    for size, left in [(0.1, 2), (0.5, 1)]:
        mesh = clean_mesh(joined(ball, (0.1 * ball[0] + 3, ball[1])), smallest_component=size)
        assert mesh_report(mesh).components == left


def test_tensor_and_legacy_meshes_and_arrays_are_alike(ball):
    legacy = build_mesh(*ball)
    tensor = o3d.t.geometry.TriangleMesh(
        o3d.core.Tensor.from_numpy(ball[0].copy()), o3d.core.Tensor.from_numpy(ball[1].copy())
    )
    reports = [mesh_report(mesh, unit="mm") for mesh in (ball, legacy, tensor)]
    assert reports[0] == reports[1] == reports[2]
    assert reports[0].unit == "mm"
    assert mesh_report(o3d.t.geometry.TriangleMesh()).triangles == 0


def test_self_intersections_are_counted_by_the_triangle():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.3, 0.2, 1], [0.2, 0.3, 1]])
    assert count_self_intersections((vertices, [[0, 1, 2], [3, 4, 5]])) == 2
    assert count_self_intersections((vertices, [[0, 1, 2]])) == 0


@pytest.mark.parametrize("target", [{"target_triangles": 400}, {"target_edge": 0.2}])
def test_simplifying_leaves_every_border_vertex_bit_for_bit(target):
    vertices, triangles = mesh_arrays(extract_isosurface(wavy_sheets(), 0.05, [[-1] * 3, [1] * 3]))

    def border(vertices, triangles):
        edges = EdgeTable.of(triangles)
        return {tuple(v) for v in vertices[np.unique(edges.ends[edges.count == 1])]}

    mesh = simplify_mesh((vertices, triangles), **target)
    report = mesh_report(mesh)
    assert report.triangles < 0.3 * len(triangles)
    assert (report.components, report.boundary_loops, report.genus, report.manifold) == (2, 2, 0, True)
    assert border(*mesh_arrays(mesh)) == border(vertices, triangles)


def test_a_simplified_sphere_is_still_a_sphere():
    mesh = simplify_mesh(extract_isosurface(sphere(), 0.05), target_triangles=2000)
    report = mesh_report(mesh)
    assert report.triangles == 2000
    assert report.watertight
    assert report.volume == pytest.approx(4 / 3 * np.pi, rel=SIMPLIFIED_SPHERE)


def test_what_cannot_be_meant_is_refused(ball):
    for arguments in ({}, {"target_triangles": 10, "target_edge": 1.0}, {"target_edge": -1.0}, {"target_triangles": 0}):
        with pytest.raises(InputError, match="target"):
            simplify_mesh(ball, **arguments)
    with pytest.raises(InputError, match="no triangles"):
        clean_mesh(o3d.geometry.TriangleMesh())
    with pytest.raises(InputError, match="zero"):
        clean_mesh(ball, smallest_component=-1)


def test_genus_counts_handles_of_all_pieces():
    torus = o3d.geometry.TriangleMesh.create_torus(1, 0.3, 20, 12)
    two = torus + o3d.geometry.TriangleMesh(torus).translate((5, 0, 0))
    assert mesh_report(two).genus == 2
    cylinder = o3d.geometry.TriangleMesh.create_cylinder(1, 2, 16, 4)
    assert mesh_report(cylinder).genus == 0
