"""Leaves of known shape: lengths and areas are what the formulas say, distances are true distances."""

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon

from o3dleaf import Field
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.samples import LEAF_KINDS, leaf_shape
from o3dleaf.samples.leaves.outlines import long_outline
from o3dleaf.samples.leaves.plane_mesh import integrate, triangulate
from o3dleaf.samples.leaves.sweep import Sweep
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from tolerances import (
    AREA_ORDER,
    LIFTED_DIFFERENCE,
    LIFTED_DISTANCE,
    LIFTED_METRIC,
    LIFTED_QUADRATURE,
    PLANE_COVERED,
)

ISOMETRIC = ["curled", "wavy", "eaten", "lobed", "layers"]
RATIO = 2.0


@pytest.fixture(scope="module")
def shapes():
    return {kind: leaf_shape(kind) for kind in LEAF_KINDS}


@pytest.fixture(params=sorted(LEAF_KINDS))
def leaf(request, shapes):
    return shapes[request.param]


def places_of(leaf, count=400, seed=3):
    """Return places in the outline."""
    plane, triangles = triangulate(leaf.outline, 2.0)
    return plane[triangles].mean(axis=1)[np.random.default_rng(seed).permutation(len(triangles))[:count]]


def metric(leaf, places):
    J = leaf.jacobian(places)
    return np.einsum("nck,ncl->nkl", J, J)


def test_the_jacobian_is_the_limit_of_differences(leaf):
    places, h = places_of(leaf), 1e-3
    for axis in range(2):
        shift = h * np.eye(2)[axis]
        difference = (leaf.lift(places + shift) - leaf.lift(places - shift)) / (2 * h)
        assert np.abs(difference - leaf.jacobian(places)[:, :, axis]).max() < LIFTED_DIFFERENCE


def test_normals_are_units_on_the_side_of_u_cross_v(leaf):
    places = places_of(leaf)
    J, normals = leaf.jacobian(places), leaf.normals(places)
    assert np.abs(np.einsum("nck,nc->nk", J, normals)).max() < LIFTED_METRIC
    frames = np.concatenate([J, normals[:, :, np.newaxis]], axis=2)
    np.testing.assert_allclose(np.linalg.det(frames), leaf.stretch(places), rtol=LIFTED_METRIC)


@pytest.mark.parametrize("kind", ISOMETRIC)
def test_lengths_and_area_are_those_of_the_plane(shapes, kind):
    leaf = shapes[kind]
    assert np.abs(metric(leaf, places_of(leaf)) - np.eye(2)).max() < LIFTED_METRIC
    assert leaf.area == pytest.approx(leaf.outline.area, rel=PLANE_COVERED)


def test_a_twisted_strip_is_a_helicoid(shapes):
    leaf = shapes["twisted"]
    places = places_of(leaf)
    found, rate = metric(leaf, places), np.pi / leaf.sweep.length
    np.testing.assert_allclose(found[:, 0, 0], 1 + (rate * places[:, 1]) ** 2, rtol=LIFTED_METRIC)
    np.testing.assert_allclose(found[:, 0, 1], 0, atol=LIFTED_METRIC)
    np.testing.assert_allclose(found[:, 1, 1], 1, rtol=LIFTED_METRIC)
    base, tip = leaf.sweep.frame(np.array([0.0, leaf.sweep.length]))
    np.testing.assert_allclose(base * [1, -1, -1], tip, atol=LIFTED_METRIC)


def test_a_winding_leaf_is_flat_and_bends_sideways(shapes):
    leaf = shapes["winding"]
    normals = leaf.normals(places_of(leaf))
    assert np.abs(normals - normals[0]).max() < LIFTED_METRIC
    start, half = leaf.sweep.frame(np.array([0.0, leaf.sweep.length / 2]))
    assert np.degrees(np.arccos(start[:, 0] @ half[:, 0])) == pytest.approx(120.0)


def test_a_wavy_leaf_bends_in_the_vertical_plane_of_its_axis(shapes):
    leaf = shapes["wavy"]
    frames = leaf.sweep.frame(np.linspace(0, leaf.sweep.length, 50))
    assert np.abs(frames[:, :, 1] - frames[0, :, 1]).max() < LIFTED_METRIC
    half = leaf.sweep.frame(np.array([leaf.sweep.length / 2]))[0]
    assert np.degrees(np.arccos(frames[0, :, 0] @ half[:, 0])) == pytest.approx(120.0)


def test_margins_are_curled_by_the_angle():
    leaf = leaf_shape("curled", angle=95.0, width=20.0)
    rims = leaf.normals([[40.0, -10.0], [40.0, 0.0], [40.0, 10.0]])
    assert np.degrees(np.arccos(rims[[0, 2]] @ rims[1])) == pytest.approx([95.0, 95.0])


def test_a_cupped_leaf_is_part_of_a_sphere(shapes):
    leaf = shapes["cupped"]
    places = places_of(leaf)
    center = leaf.lift(places) + 40.0 * leaf.normals(places)
    assert np.abs(center - center[0]).max() < LIFTED_DISTANCE


def test_petiole_and_stub_are_round_and_go_on_from_the_base(shapes):
    petiole, stub = shapes["petiole"].tubes
    leaf = shapes["petiole"]
    np.testing.assert_allclose(petiole.path[-1], leaf.lift([[0.0, 0.0]])[0], atol=LIFTED_DISTANCE)
    np.testing.assert_allclose(stub.path.mean(axis=0), petiole.path[0], atol=0.3)
    points = stub.draw(500, np.random.default_rng(0))
    way = stub.path[-1] - stub.path[0]
    aside = np.linalg.norm(np.cross(points - stub.path[0], way / np.linalg.norm(way)), axis=1)
    np.testing.assert_allclose(aside, stub.radius, rtol=LIFTED_METRIC)


@pytest.mark.few(leaf=4)
def test_area_of_triangles_converges_with_the_square_of_their_step(leaf):
    # The short edges of the outline are followed at any step; where only they bend, steps must be shorter.
    step = {"wavy": 0.3, "winding": 0.2}.get(leaf.kind, 2.0)
    errors = [abs(triangle_areas(*leaf.mesh(h)).sum() - leaf.area) for h in (step, step / RATIO)]
    assert np.log(errors[0] / errors[1]) / np.log(RATIO) > 2 - AREA_ORDER


def test_quadrature_is_exact_for_polynomials_of_degree_four():
    square = Polygon([(0, 0), (2, 0), (2, 1), (0, 1)])
    found = integrate(square, lambda x: x[:, 0] ** 3 * x[:, 1] + x[:, 1] ** 4, 0.7)
    assert found == pytest.approx(2**4 / 4 * 0.5 + 2 / 5, rel=LIFTED_QUADRATURE)


@pytest.mark.few(leaf=4)
def test_triangles_cover_the_outline_and_end_on_it(leaf):
    step = 0.6
    plane, triangles = triangulate(leaf.outline, step)
    assert np.linalg.norm(plane[triangles] - plane[np.roll(triangles, 1, axis=1)], axis=2).max() < 2 * step
    a, b, c = plane[triangles].transpose(1, 0, 2)
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (doubled > 0).all()
    assert doubled.sum() / 2 == pytest.approx(leaf.outline.area, rel=PLANE_COVERED)
    edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    assert len(np.unique(triangles)) - len(edges) + len(triangles) == 1 - leaf.holes  # Euler's number: in one piece


def test_only_the_eaten_leaf_has_a_hole_of_the_size_asked_for(shapes):
    assert {kind: leaf.holes for kind, leaf in shapes.items() if leaf.holes} == {"eaten": 1}
    ring = Polygon(leaf_shape("eaten", hole=8.0).outline.interiors[0])
    assert np.sqrt(4 * ring.area / np.pi) == pytest.approx(8.0, rel=1e-3)
    rest = long_outline(110.0, 40.0)
    assert shapes["eaten"].outline.exterior.length > 1.02 * rest.exterior.length  # notched


@pytest.mark.few(leaf=4)
def test_it_is_a_field_whose_distance_is_true(leaf):
    assert isinstance(leaf, Field)
    rng = np.random.default_rng(5)
    places = places_of(leaf, 150)
    points = leaf.lift(places) + rng.normal(0, 0.7, (len(places), 3))
    vertices, triangles = leaf.mesh(0.7)
    brute = distance_to_mesh(vertices, triangles, points)
    sag = np.abs(distance_to_mesh(vertices, triangles, leaf.lift(places))).max()
    assert np.abs(leaf.half_thickness - leaf(points) - brute).max() < 2 * sag + 1e-4


@pytest.mark.few(leaf=4)
def test_the_surface_is_inside_and_half_a_thickness_off_is_its_zero(leaf):
    places = places_of(leaf, 300)
    S, n = leaf.lift(places), leaf.normals(places)
    assert np.abs(leaf(S) - leaf.half_thickness).max() < LIFTED_DISTANCE
    for side in (-1, 1):
        assert np.abs(leaf(S + side * leaf.half_thickness * n)).max() < LIFTED_DISTANCE
    rim = np.concatenate(leaf.margin(1.0))
    assert np.abs(leaf(rim) - leaf.half_thickness).max() < LIFTED_DISTANCE
    low, high = leaf.bounds
    assert ((low < rim) & (rim < high)).all()


def test_the_gradient_is_the_limit_of_differences(shapes):
    leaf, h = shapes["curled"], 1e-4
    places = places_of(leaf, 100)
    points = leaf.lift(places) + 0.8 * leaf.normals(places)
    for axis in range(3):
        shift = h * np.eye(3)[axis]
        difference = (leaf(points + shift) - leaf(points - shift)) / (2 * h)
        assert np.abs(difference - leaf.gradient(points)[:, axis]).max() < LIFTED_DIFFERENCE


def test_the_axis_runs_by_arc_length_in_a_right_handed_frame():
    sweep = Sweep(100.0, arch=(1.0, 0.5), sway=(0.3, 0.2), twist=(2.0, 0.1), curl=0.02)
    u = np.linspace(-30, 110, 200)
    frame = sweep.frame(u)
    assert np.abs(np.linalg.det(frame) - 1).max() < LIFTED_METRIC
    h = 1e-3
    tangent = (sweep.axis(u + h) - sweep.axis(u - h)) / (2 * h)
    assert np.abs(tangent - frame[:, :, 0]).max() < LIFTED_DIFFERENCE
    plane = np.column_stack([u, np.linspace(-10, 10, 200)])
    difference = (sweep.jet(plane + [h, 0]).points - sweep.jet(plane - [h, 0]).points) / (2 * h)
    assert np.abs(difference - sweep.jet(plane).along).max() < LIFTED_DIFFERENCE


def test_margins_are_closed_rings_no_edge_longer_than_the_step(leaf):
    places = leaf.margin_places(0.15)
    assert len(places) == 1 + leaf.holes
    assert Polygon(places[0], places[1:]).equals_exact(shapely.segmentize(leaf.outline, 0.15), 1e-9)
    for ring in leaf.margin(0.15):
        assert np.linalg.norm(ring - np.roll(ring, -1, axis=0), axis=1).max() < 0.15 * 1.3


def test_what_is_no_kind_is_refused():
    with pytest.raises(InputError, match="kind"):
        leaf_shape("square")


def test_a_leaf_that_is_eaten_through_is_refused():
    with pytest.raises(InputError, match="2 pieces"):
        leaf_shape("eaten", hole=36.0, notch=30.0, width=20.0)
