"""What comes out is the same surface in good triangles: on its field, or near the mesh, with its creases and border."""

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

import reference
from o3dleaf import LabelledMesh, extract_isosurface, get_num_threads, mesh_report, remesh, set_num_threads
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.remeshing import blocks
from o3dleaf.surface.remeshing.projection_target import FieldTarget, MeshTarget
from o3dleaf.surface.remeshing.remesh import remesh_charted
from remesh_fields import VOLUMES, angles, charted, edge_lengths, turned
from tolerances import (
    ANGLE_SHARES,
    DEVIATION_ALL,
    EDGE_RANGE,
    FLAT_SHEET,
    ON_FIELD,
    REMESHED_ORDER,
    REMESHED_VOLUME,
)

GENUS = {"sphere": 0, "torus": 1, "ellipsoid": 0}


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch):
    monkeypatch.setattr(blocks, "MAX_TRIANGLES", 900)


def labelled(vertices, triangles, labels):
    return LabelledMesh(build_mesh(vertices, triangles), labels)


def cubes_of(name, step, seed=0):
    field = turned(name, seed)
    return field, mesh_arrays(extract_isosurface(field, step))


def check_good(vertices, triangles, genus=0):
    """Raise where a closed mesh is none that a solver accepts; return its report."""
    report = mesh_report((vertices, triangles))
    assert report.watertight
    assert report.oriented
    assert report.self_intersections == 0
    assert (report.components, report.genus) == (1, genus)
    smallest = angles(vertices, triangles)
    assert [np.mean(smallest < degrees) <= share for degrees, share in ANGLE_SHARES.items()] == [True] * 3
    return report


def check_lengths(vertices, triangles, edge):
    least, middle, most = EDGE_RANGE
    length = edge_lengths(vertices, triangles) / edge
    assert length.min() > least
    assert middle[0] < np.median(length) < middle[1]
    assert length.max() < most


@pytest.mark.few(name=1, seed=1)
@pytest.mark.parametrize("seed", [1, 4])
@pytest.mark.parametrize("name", [*GENUS])
def test_with_a_field_all_vertices_lie_on_it_in_good_triangles_and_the_volume_converges(name, seed):
    """Of second order: a triangle's middle lies h²/8R under the surface."""
    errors = []
    for edge in (0.2, 0.1):
        field, mesh = cubes_of(name, 0.8 * edge, seed)
        vertices, triangles = mesh_arrays(remesh(mesh, edge, field))
        assert np.abs(field(vertices)).max() < ON_FIELD
        report = check_good(vertices, triangles, GENUS[name])
        check_lengths(vertices, triangles, edge)
        errors.append(VOLUMES[name] - report.volume)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=REMESHED_ORDER)


def test_an_isovalue_is_another_surface():
    field, mesh = cubes_of("torus", 0.1)
    vertices, _ = mesh_arrays(remesh(mesh, 0.1, field, isovalue=0.05))
    assert np.abs(field(vertices) - 0.05).max() < ON_FIELD


def test_a_coarse_or_a_fine_mesh_comes_to_the_same_edges():
    for step in (0.08, 0.4):
        field, mesh = cubes_of("sphere", step)
        vertices, triangles = mesh_arrays(remesh(mesh, 0.2, field))
        check_good(vertices, triangles)
        check_lengths(vertices, triangles, 0.2)


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.1, 0.35])
def test_a_noisy_mesh_whose_triangles_cross_comes_to_rest_on_the_field(noise):
    field = turned("sphere")
    mesh = charted("sphere", 4, noise)
    crossing = find_crossings(mesh.places, mesh.triangles).sum()
    assert (crossing > 100) == (noise > 0.2)
    vertices, triangles = mesh_arrays(remesh((mesh.places, mesh.triangles), 0.12, field))
    check_good(vertices, triangles)
    assert np.abs(field(vertices)).max() < ON_FIELD


def farthest(one, other, count=8):
    """Return the largest distance of points in the triangles of one mesh from the other."""
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        *(o3d.core.Tensor(part.astype(kind)) for part, kind in zip(other, (np.float32, np.uint32), strict=True))
    )
    shares = [(i / count, j / count) for i in range(count + 1) for j in range(count + 1 - i)]
    shares = np.array([(s, t, 1 - s - t) for s, t in shares])
    points = np.einsum("kc,mcd->mkd", shares, one[0][one[1]]).reshape(-1, 3)
    return scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy().max()


@pytest.mark.few(name=1)
@pytest.mark.parametrize(("name", "deviation"), [("sphere", None), ("torus", 0.004), ("ellipsoid", 0.02)])
def test_without_a_field_the_mesh_stays_near_what_it_was(name, deviation):
    _, mesh = cubes_of(name, 0.08)
    found = mesh_arrays(remesh(mesh, 0.1, deviation=deviation))
    check_good(*found, GENUS[name])
    most = DEVIATION_ALL * (0.01 if deviation is None else deviation)
    assert farthest(found, mesh) < most
    assert farthest(mesh, found) < most


def test_a_small_deviation_keeps_small_triangles_where_the_surface_bends():
    _, mesh = cubes_of("torus", 0.08)
    many, few = (len(remesh(mesh, 0.2, deviation=deviation).triangles) for deviation in (0.002, 0.1))
    assert many > 1.5 * few


def open_sheet(seed=0, count=600):
    """A flat sheet of random triangles, their border a square."""
    rng = np.random.default_rng(seed)
    side = np.linspace(0, 1, 16)[:-1]
    sides = (side, 0 * side), (0 * side + 1, side), (1 - side, 0 * side + 1), (0 * side, 1 - side)
    rim = np.concatenate([np.column_stack(part) for part in sides])
    plane = np.vstack([rim, rng.uniform(0.02, 0.98, (count, 2))])
    triangles = Delaunay(plane).simplices.astype(np.int64)
    a, b, c = (plane[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    return np.column_stack([plane, 0 * plane[:, 0]]), triangles[np.abs(area) > 1e-12]


def border_places(vertices, triangles):
    return {frozenset(vertices[n].tobytes() for n in edge) for edge in reference.border(triangles)}


@pytest.mark.parametrize("turn", [None, 3])
def test_a_flat_sheet_stays_flat_and_keeps_its_border_bit_for_bit(turn):
    vertices, triangles = open_sheet()
    motion = np.eye(3) if turn is None else Rotation.random(random_state=turn).as_matrix()
    vertices = vertices @ motion.T + (0 if turn is None else 5.0)
    found = mesh_arrays(remesh((vertices, triangles), 0.07))
    assert border_places(*found) == border_places(vertices, triangles)
    flat = (found[0] - (0 if turn is None else 5.0)) @ motion
    assert np.abs(flat[:, 2]).max() <= (0 if turn is None else FLAT_SHEET)
    report = mesh_report(found)
    assert (report.area, report.boundary_loops, report.components) == (pytest.approx(1, abs=FLAT_SHEET), 1, 1)
    assert report.self_intersections == 0
    assert np.mean(angles(vertices, triangles) < 20) > 0.2
    assert np.mean(angles(*found) < 20) < 0.01


def cube(times):
    """A cube of side 1 with the label of its face at each triangle."""
    vertices, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_box().subdivide_midpoint(times))
    p, q, r = np.moveaxis(vertices[triangles], 1, 0)
    normals = np.cross(q - p, r - p)
    axis = np.abs(normals).argmax(axis=1)
    return vertices, triangles, 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0)


@pytest.mark.parametrize("edge", [0.3, 0.1])
def test_a_cube_with_its_faces_labelled_keeps_its_corners_and_edges(edge):
    vertices, triangles, labels = cube(4)
    parts = remesh(labelled(vertices, triangles, labels), edge)
    found, corners = mesh_arrays(parts.mesh)
    sides = found[corners].mean(axis=1)
    # Beside an edge of the cube a triangle's middle is nearer to its own face than to any other.
    assert (np.abs(sides - [0.5] * 3).argmax(axis=1) == parts.labels // 2).all()
    report = check_good(found, corners)
    assert report.volume == pytest.approx(1, rel=REMESHED_VOLUME)
    assert {tuple(p) for p in np.ndindex(2, 2, 2)} <= {tuple(p) for p in found.tolist()}
    ends = np.unique(np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)), axis=0)
    on = (found[:, :, np.newaxis] == [0.0, 1.0]).reshape(-1, 6)
    along = (on[ends[:, 0]] & on[ends[:, 1]]).sum(axis=1) == 2
    length = np.linalg.norm(found[ends[:, 0]] - found[ends[:, 1]], axis=1)
    assert length[along].sum() == pytest.approx(12, rel=REMESHED_VOLUME)
    assert length[along].max() < 1.7 * edge
    assert len(found) < len(vertices)


def test_a_mesh_of_a_few_large_triangles_comes_to_the_edges_asked_for():
    vertices, triangles, labels = cube(0)
    found = mesh_arrays(remesh(labelled(vertices, triangles, labels), 0.07).mesh)
    assert check_good(*found).volume == pytest.approx(1, rel=REMESHED_VOLUME)
    check_lengths(*found, 0.07)


def test_labels_go_on_and_their_border_keeps_its_course():
    """Two halves of a sphere without a field: a disc each, their common border a circle to within the deviation."""
    vertices, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_sphere(1, 16))
    upper = (vertices[triangles].mean(axis=1)[:, 2] > 0).astype(np.uint8)
    mesh = blocks.Charted.of(vertices, vertices, triangles, upper)
    found = remesh_charted(mesh, MeshTarget(mesh.places, mesh.triangles), 0.4)
    creases = []
    for part in (mesh, found):
        both = [reference.border(part.triangles[part.labels == label]) for label in (0, 1)]
        assert both[0] == both[1]
        creases.append([part.places[[*edge]] for edge in both[0]])
        for label in (0, 1):
            report = mesh_report((part.places, part.triangles[part.labels == label]))
            assert (report.components, report.boundary_loops, report.genus) == (1, 1, 0)
    assert len(creases[1]) < 0.9 * len(creases[0])
    for one, other in ((creases[0], creases[1]), (creases[1], creases[0])):
        ends = np.array(other)
        for a, b in one:
            for x in (a, (a + b) / 2):
                along = ends[:, 1] - ends[:, 0]
                share = np.clip(np.sum((x - ends[:, 0]) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
                gap = np.linalg.norm(ends[:, 0] + share[:, np.newaxis] * along - x, axis=1).min()
                assert gap < DEVIATION_ALL * 0.04


@pytest.mark.few(with_field=1)
@pytest.mark.parametrize("with_field", [False, True])
def test_a_change_of_unit_by_a_power_of_two_changes_no_bit(with_field):
    field, (vertices, triangles) = cubes_of("torus", 0.16)
    found = []
    for factor in (1.0, 2.0**20, 2.0**-20):
        ground = MeshTarget(factor * vertices, triangles)
        if with_field:
            ground = FieldTarget(
                lambda x, factor=factor: (factor * field(x / factor), field.gradient(x / factor)), factor * 0.05
            )
        mesh = blocks.Charted.of(factor * vertices, factor * vertices, triangles, np.zeros(len(triangles), np.uint8))
        part = remesh_charted(mesh, ground, factor * 0.16)
        found.append((part.places / factor, part.triangles))
    for places, corners in found[1:]:
        assert np.array_equal(places, found[0][0])
        assert np.array_equal(corners, found[0][1])


@pytest.mark.slow
def test_a_turned_and_shifted_mesh_has_the_same_figures():
    _, (vertices, triangles) = cubes_of("torus", 0.1)
    figures = []
    for seed in range(3):
        motion = Rotation.random(random_state=seed).as_matrix() if seed else np.eye(3)
        found = mesh_arrays(remesh((vertices @ motion.T + 7.0 * seed, triangles), 0.1))
        report = check_good(*found, 1)
        figures.append((len(found[1]) / 3000, report.volume, report.area))
    assert np.ptp(figures, axis=0) == pytest.approx(0, abs=0.02)


@pytest.mark.slow
def test_to_remesh_again_makes_nothing_worse():
    field, mesh = cubes_of("ellipsoid", 0.1)
    once = mesh_arrays(remesh(mesh, 0.1, field))
    twice = mesh_arrays(remesh(once, 0.1, field))
    check_good(*twice)
    assert len(twice[1]) == pytest.approx(len(once[1]), rel=0.05)
    assert np.median(angles(*twice)) > np.median(angles(*once)) - 0.5
    assert angles(*twice).min() > 30 < angles(*once).min()


def test_the_result_does_not_depend_on_threads():
    field, mesh = cubes_of("torus", 0.1)
    threads, found = get_num_threads(), []
    try:
        for count in (1, 2, 4):
            set_num_threads(count)
            found.append([*mesh_arrays(remesh(mesh, 0.2, field)), *mesh_arrays(remesh(mesh, 0.2))])
    finally:
        set_num_threads(threads)
    for other in found[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(found[0], other, strict=True))


def test_the_input_is_not_touched_and_may_come_in_any_form():
    field, (vertices, triangles) = cubes_of("sphere", 0.2)
    before = vertices.copy(), triangles.copy()
    legacy = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(triangles))
    tensor = o3d.t.geometry.TriangleMesh(o3d.core.Tensor(vertices), o3d.core.Tensor(triangles))
    found = [mesh_arrays(remesh(each, 0.2, field)) for each in ((vertices, triangles), legacy, tensor)]
    assert np.array_equal(vertices, before[0])
    assert np.array_equal(triangles, before[1])
    for other in found[1:]:
        assert np.array_equal(found[0][0], other[0])
        assert np.array_equal(found[0][1], other[1])


def test_progress_runs_from_nothing_to_all():
    field, mesh = cubes_of("sphere", 0.1)
    calls = []
    with progress.listening(lambda done, total: calls.append(done / total)):
        remesh(mesh, 0.1, field)
        assert calls[-1] == 1
    assert calls == sorted(calls)
    assert 0 < calls[0] < 0.2


def test_what_cannot_be_remeshed_is_refused_in_one_line():
    vertices, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_icosahedron())
    fin = np.append(triangles, [[*triangles[0, :2], 2]], axis=0)
    wrong = np.concatenate([triangles[:1, ::-1], triangles[1:]])
    mirrored = 2 * vertices[0] - vertices[1:]
    tie = np.vstack([vertices, mirrored]), np.vstack([triangles, np.where(triangles, triangles + 11, 0)[:, ::-1]])
    cases = [
        ((tie, 0.5), {}, "not manifold"),
        (((vertices, fin), 0.5), {}, "clean it first"),
        (((vertices, wrong), 0.5), {}, "clean it first"),
        (((vertices, triangles[:0]), 0.5), {}, "no triangle"),
        (((vertices, triangles), 0.0), {}, "target_edge"),
        (((vertices, triangles), np.nan), {}, "target_edge"),
        (((vertices, triangles), 0.5), {"deviation": -0.1}, "deviation"),
        (((vertices, triangles), 0.5), {"isovalue": np.nan}, "isovalue"),
        ((labelled(vertices, triangles, np.zeros(3, dtype=int)), 0.5), {}, "labels"),
        ((labelled(vertices, triangles, np.zeros(20)), 0.5), {}, "labels"),
        ((labelled(vertices, triangles, np.full(20, 8)), 0.5), {}, "labels"),
        ((labelled(vertices, triangles, np.full(20, -1)), 0.5), {}, "labels"),
    ]
    for arguments, options, cause in cases:
        with pytest.raises(InputError, match=cause) as caught:
            remesh(*arguments, **options)
        assert "\n" not in str(caught.value)
