"""A leaf remeshed: a solid in good triangles, its faces on F = 0, its rim over the outline, its border as it was."""

import numpy as np
import pytest
import shapely

import reference
from leaf_fields import MAIN_FRAME, leaf_of
from leaf_fields import texture as texture_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.io.labelled_mesh import ABAXIAL, ADAXIAL, RIM
from o3dleaf.leaf.remeshing import ON_RIM, LeafTarget, _without_chamfers
from o3dleaf.surface.mesh.mesh_report import mesh_report
from o3dleaf.surface.remeshing import blocks
from remesh_fields import angles, edge_lengths
from tolerances import BLUNT, EDGE_RANGE, LEAF_ANGLE_SHARES, LEAF_VOLUME, ON_FACES, ON_OUTLINE, SETTLED_PLACE

HALF = 0.2037
WINDOW = [[5.03, -1.07], [8.9, 1.9]]
"""Some two tiles by two of the strip, of 2 by 2 each."""
EDGE = 0.15


@pytest.fixture(scope="module", params=MAIN_FRAME)
def leaf(request):
    """A strip of 12 by 6 with ridges across, bent about a circle of radius 15."""

    def ridged(x, y, z):
        return HALF + 0.05 * np.cos(np.pi * x) + 0.03 * np.sin(np.pi * y) - np.abs(z)

    return leaf_of(texture_of(ridged, per_ball=80), bend=15.0, length=12.0, frame=request.param)[0]


@pytest.fixture(scope="module")
def solid(leaf):
    counted = leaf.plan_mesh(EDGE, WINDOW, closed=True)
    return counted, counted.extract(remesh=EDGE)


@pytest.fixture(scope="module")
def sheet(leaf):
    counted = leaf.plan_mesh(EDGE, WINDOW)
    return counted, counted.extract(), counted.extract(remesh=EDGE)


def corners_of(mesh, *labels):
    """Return the vertices of the triangles with some labels."""
    return np.unique(mesh_arrays(mesh.mesh)[1][np.isin(mesh.labels, labels)])


def test_a_closed_leaf_is_a_solid_in_good_triangles(leaf, solid):
    fine = mesh_report(leaf.plan_mesh(0.05, WINDOW, closed=True).extract().mesh)
    vertices, triangles = mesh_arrays(solid[1].mesh)
    report = mesh_report((vertices, triangles))
    assert report.watertight
    assert report.oriented
    assert (report.components, report.genus, report.self_intersections) == (1, 0, 0)
    smallest = angles(vertices, triangles)
    assert [np.mean(smallest < d) <= share for d, share in LEAF_ANGLE_SHARES.items()] == [True] * 3
    length = edge_lengths(vertices, triangles) / EDGE
    assert EDGE_RANGE[1][0] < np.median(length) < EDGE_RANGE[1][1]
    assert length.max() < EDGE_RANGE[2]
    assert report.volume == pytest.approx(fine.volume, rel=LEAF_VOLUME)


def test_the_faces_lie_on_the_surface_and_the_rim_over_the_outline(leaf, solid):
    counted, mesh = solid
    vertices, _ = mesh_arrays(mesh.mesh)
    faces, rim = corners_of(mesh, ADAXIAL, ABAXIAL), corners_of(mesh, RIM)
    assert set(mesh.labels) == {ADAXIAL, ABAXIAL, RIM}
    edge = np.intersect1d(faces, rim)
    assert len(edge) > 100
    assert np.abs(leaf(vertices[np.setdiff1d(faces, rim)])).max() < ON_FACES
    # Sharp: what is on both is on the surface as well, but where that would spoil a triangle.
    assert np.mean(np.abs(leaf(vertices[edge])) > ON_FACES) < BLUNT
    flat = leaf.blade.flatten(vertices)
    away = shapely.distance(counted.outline.boundary, shapely.points(flat[rim, :2]))
    assert away.max() < ON_OUTLINE
    inner = np.setdiff1d(faces, rim)
    assert shapely.contains_properly(counted.outline, shapely.points(flat[inner, :2])).all()
    assert np.all(flat[np.setdiff1d(corners_of(mesh, ADAXIAL), rim), 2] > 0)
    assert np.all(flat[np.setdiff1d(corners_of(mesh, ABAXIAL), rim), 2] < 0)


def test_each_face_is_a_disc_and_the_rim_a_ring(solid):
    vertices, triangles = mesh_arrays(solid[1].mesh)
    for label, loops in ((ADAXIAL, 1), (ABAXIAL, 1), (RIM, 2)):
        report = mesh_report((vertices, triangles[solid[1].labels == label]))
        assert (report.components, report.boundary_loops, report.genus) == (1, loops, 0)


@pytest.mark.slow
def test_a_whole_leaf_keeps_within_a_tenth_of_the_spacing_of_its_solid(leaf):
    mesh = leaf.plan_mesh(0.3, closed=True).extract(remesh=0.3)
    vertices, triangles = mesh_arrays(mesh.mesh)
    assert mesh_report((vertices, triangles)).watertight
    assert np.mean(angles(vertices, triangles) < 10) < 1e-3
    assert np.abs(leaf.signed_distance(vertices, closed=True)).max() < 0.1 * 0.3


def test_an_open_leaf_keeps_its_border_bit_for_bit(leaf, sheet):
    _, before, after = sheet
    (vertices, triangles), (found, corners) = mesh_arrays(before.mesh), mesh_arrays(after.mesh)
    was, now = (
        {frozenset(v[n].tobytes() for n in edge) for edge in reference.border(t)}
        for v, t in ((vertices, triangles), (found, corners))
    )
    assert was == now
    report = mesh_report((found, corners))
    assert report.manifold
    assert report.oriented
    assert (report.components, report.boundary_loops, report.self_intersections) == (2, 2, 0)
    inner = np.setdiff1d(corners, [n for edge in reference.border(corners) for n in edge])
    assert np.abs(leaf(found[inner])).max() < ON_FACES
    assert set(after.labels) == {ADAXIAL, ABAXIAL}
    middle = np.isin(corners, inner).all(axis=1)
    assert angles(vertices, triangles).min() < 5
    assert angles(found, corners[middle]).min() > 10


@pytest.mark.slow
def test_a_leaf_does_not_depend_on_threads(leaf, monkeypatch):
    monkeypatch.setattr(blocks, "MAX_TRIANGLES", 250)
    threads, found = get_num_threads(), []
    try:
        for count in (1, 4):
            set_num_threads(count)
            mesh = leaf.plan_mesh(0.2, [[5.03, -1.07], [7.3, 0.9]], closed=True).extract(remesh=0.2)
            found.append((*mesh_arrays(mesh.mesh), mesh.labels))
    finally:
        set_num_threads(threads)
    assert all(np.array_equal(a, b) for a, b in zip(*found, strict=True))


def test_an_edge_length_is_above_zero(leaf):
    with pytest.raises(InputError, match="remesh"):
        leaf.plan_mesh(0.3, WINDOW).extract(remesh=0.0)


@pytest.fixture(scope="module")
def ground(leaf):
    counted = leaf.plan_mesh(EDGE, WINDOW, closed=True)
    return LeafTarget(leaf, counted.outline, counted.tile), counted.outline


def settled(ground, flat, masks, shifts=None):
    shifts = np.zeros_like(flat) if shifts is None else shifts
    return ground.project(flat, shifts, np.full(len(flat), masks, dtype=np.uint8), np.zeros(len(flat), dtype=bool))


def test_points_of_a_face_go_to_it_by_the_shortest_way(leaf, ground):
    """Back again after a small step off the surface along the normal: the foot, to second order in the step."""
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.uniform(5.5, 8.5, 200), rng.uniform(-0.8, 1.6, 200), np.full(200, HALF)])
    charts, places, found = settled(ground[0], flat, 1)
    assert found.all()
    assert np.abs(leaf(places)).max() < ON_FACES
    assert leaf.blade.lift(charts) == pytest.approx(places, abs=SETTLED_PLACE)
    normal = leaf.gradient(places)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for step in (1e-3, 1e-2):
        again = settled(ground[0], charts, 1, step * normal)
        assert again[2].all()
        assert np.linalg.norm(again[1] - places, axis=1).max() < 5 * step**2
    # Along the surface they go where they are sent.
    along = np.cross(normal, [0.0, 1, 0])
    again = settled(ground[0], charts, 1, 0.01 * along)
    assert np.linalg.norm(again[1] - places - 0.01 * along, axis=1).max() < 1e-3


def test_points_of_the_rim_go_to_the_wall_and_those_of_its_edges_to_both(leaf, ground):
    ground, outline = ground
    rng = np.random.default_rng(1)
    plane = np.array([outline.boundary.interpolate(s, normalized=True).coords[0] for s in rng.random(100)])
    flat = np.column_stack([plane + 0.02 * rng.normal(size=plane.shape), rng.uniform(-0.1, 0.1, 100)])
    charts, places, found = settled(ground, flat, ON_RIM)
    assert found.all()
    away = shapely.distance(outline.boundary, shapely.points(charts[:, :2]))
    assert away.max() < SETTLED_PLACE
    # Within the leaf the height stays.
    assert np.array_equal(charts[:, 2], flat[:, 2])
    flat[:, 2] = HALF
    for masks in (ON_RIM | 1, ON_RIM | 2, ON_RIM):
        charts, places, found = settled(ground, flat, masks)
        assert found.mean() > 0.9
        assert shapely.distance(outline.boundary, shapely.points(charts[:, :2])).max() < SETTLED_PLACE
        above = np.ones(len(flat), dtype=bool) if masks != ON_RIM else charts[:, 2] != flat[:, 2]
        assert above.sum() > 20
        assert np.abs(leaf(places))[found & above].max() < ON_FACES


def test_a_point_of_a_face_that_is_sent_over_the_outline_is_refused(ground):
    ground, outline = ground
    low = np.array(outline.bounds[:2])
    flat = np.array([[*(low + 0.3), HALF], [*(low + 0.3), HALF]])
    _, _, found = settled(ground, flat, 1, np.array([[-0.6, -0.6, 0], [0.1, 0.1, 0]]))
    assert found.tolist() == [False, True]


def test_chamfers_go_to_the_face_that_they_touch():
    """A strip of a face, a chamfer and two rows of a wall: what touches the face's own vertices joins it."""
    at = np.arange(5 * 6).reshape(5, 6)
    low = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:]], axis=-1).reshape(-1, 3)
    high = np.stack([at[:-1, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 3)
    triangles = np.concatenate([low, high])
    row = triangles.min(axis=1) // 6
    labels = np.where(row < 1, ADAXIAL, RIM).astype(np.uint8)
    # Vertices of the first two lines lie on the face.
    found = _without_chamfers(triangles, labels, np.arange(30) < 12)
    assert found[row == 0].tolist() == [ADAXIAL] * 10
    assert found[row == 1].tolist() == [ADAXIAL] * 10
    assert found[row > 1].tolist() == [RIM] * 20
    assert labels[row == 1].tolist() == [RIM] * 10
