import numpy as np
import pytest
import shapely

from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.leaf.chart.flatten import LARGEST_FLAP, WORST, lay_flat
from o3dleaf.leaf.chart.flattening.embedding import (
    conformal_chart,
    convex_chart,
    flip_free_descent,
    relax_rigidly,
    relax_without_flips,
)
from o3dleaf.leaf.chart.flattening.one_layer import lies_over_itself, relax_in_one_layer
from o3dleaf.leaf.chart.flattening.overlap import find_overlap, without_flaps
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet, rim_first
from o3dleaf.leaf.chart.flattening.stretch import Stretch, chart_areas, stretch_quantiles, triangle_stretch
from o3dleaf.leaf.chart.flattening.untangle import untangle, winds_twice
from o3dleaf.leaf.chart.sheet_chart import chart_sheet
from tests import tolerances as tol
from tests.sheet_shapes import blade, ellipse, rolled, spiral, triangulated


@pytest.fixture(scope="module")
def eaten():
    """A blade with a hole, flat."""
    return triangulated(blade(width=20.0).difference(shapely.Point(50, 2).buffer(4)), 2.5)


def helicoid(flat, turn, length):
    """A blade twisted about its own axis: its margins get longer, as (1 + (turn v / length)^2)^(1/2)."""
    angle = turn * flat[:, 0] / length
    return np.stack([flat[:, 0], flat[:, 1] * np.cos(angle), flat[:, 1] * np.sin(angle)], axis=1)


def test_a_sheet_that_was_rolled_up_is_flattened_to_itself(eaten):
    flat, triangles = eaten
    sheet = rolled(flat, radius=15.0)
    chart = lay_flat(sheet, triangles)
    # What the triangles are short of the cylinder's arcs is of the square of their size over its radius.
    assert np.abs(triangle_stretch(sheet, triangles, chart) - 1).max() < tol.CHORDS_OF_A_ROLL
    apart = np.linalg.norm(chart[:, None] - chart[None], axis=2), np.linalg.norm(flat[:, None] - flat[None], axis=2)
    assert np.abs(apart[0] - apart[1]).max() < tol.CHORDS_OF_A_ROLL * 120
    assert np.all(chart_areas(chart, triangles) > 0)


def test_the_stretch_is_that_of_the_affine_map():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    shear = np.array([[2.0, 0.0], [0.7, 0.5]])
    chart = vertices[:, :2] @ shear
    found = triangle_stretch(vertices, np.array([[0, 1, 2]]), chart)[0]
    np.testing.assert_allclose(found, np.linalg.svd(shear, compute_uv=False), rtol=1e-12)


def test_a_share_below_a_hundredth_of_the_area_is_not_told():
    """Of 1,000 triangles alike in area, 9 in each tail have no say; the tenth has."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    vertices, triangles = np.tile(corners, (1000, 1)), np.arange(3000).reshape(1000, 3)
    sizes = np.ones(1000)
    sizes[:9], sizes[-9:] = 0.1, 10.0
    scaled = lambda sizes: (corners[:, :2] * sizes[:, None, None]).reshape(-1, 2)  # noqa: E731
    assert stretch_quantiles(vertices, triangles, scaled(sizes)) == Stretch(pytest.approx(1.0), pytest.approx(1.0))
    sizes[9:12], sizes[-12:-9] = 0.2, 5.0
    assert stretch_quantiles(vertices, triangles, scaled(sizes)) == Stretch(pytest.approx(0.2), pytest.approx(5.0))


def test_a_twist_of_half_a_turn_is_stretched_by_no_more_than_the_curvature_asks():
    flat, triangles = triangulated(shapely.box(0, -8, 200, 8), 3.0)
    sheet = helicoid(flat, np.pi, 200.0)
    chart = lay_flat(sheet, triangles)
    found = stretch_quantiles(sheet, triangles, chart)
    # A margin is longer than the axis by (1 + 0.1257^2)^(1/2) = 1.0079.
    assert 0.992 <= found.least <= 1 <= found.most <= 1.005
    assert chart_areas(chart, triangles).sum() == pytest.approx(triangle_areas(sheet, triangles).sum(), rel=1e-9)


def test_a_cup_is_stretched_less_than_a_map_that_keeps_angles_must():
    flat, triangles = triangulated(ellipse(40.0, 40.0), 2.0)
    flat = flat - [20.0, 0.0]
    distance = np.linalg.norm(flat, axis=1)
    share = np.divide(np.sin(distance / 20), distance, out=np.full(len(flat), 1 / 20), where=distance > 0)
    sheet = 20 * np.column_stack([flat * share[:, None], np.cos(distance / 20)])
    found = stretch_quantiles(sheet, triangles, lay_flat(sheet, triangles))
    # Of a cap of one radian the conformal map is 1 / cos^2(1/2) = 1.298 times larger at the rim than in the middle.
    assert found.most / found.least < 1.25
    exact = triangle_stretch(sheet, triangles, flat)
    # Polar coordinates about the middle stretch the circles alone, at the rim by 1 / sin(1) = 1.19.
    assert exact.max() == pytest.approx(1.19, abs=0.01)


def test_a_fine_sheet_is_carried_along_by_its_coarse_one():
    flat, triangles = triangulated(ellipse(100.0, 50.0), 0.85)
    assert len(triangles) > 10_000
    sheet = rolled(flat)
    chart = lay_flat(sheet, triangles)
    found = stretch_quantiles(sheet, triangles, chart)
    assert max(1 - found.least, found.most - 1) < tol.CARRIED_STRETCH
    assert np.all(chart_areas(chart, triangles) > 0)


def test_a_chart_does_not_depend_on_where_the_sheet_lies(eaten):
    flat, triangles = eaten
    sheet = rolled(flat)
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    charts = [lay_flat(each, triangles) for each in (sheet, sheet @ (turn * np.linalg.det(turn)).T + 100)]
    lengths = [np.linalg.norm(np.diff(chart[triangles], axis=1), axis=2) for chart in charts]
    np.testing.assert_allclose(*lengths, atol=tol.MOVED_SHEET)


def test_a_convex_map_flips_nothing_and_relaxes_without_flips(eaten):
    flat, triangles = eaten
    sheet = rolled(flat)
    chart = convex_chart(sheet, triangles, require_sheet(sheet, triangles))
    assert np.all(chart_areas(chart, triangles) > 0)
    relaxed = relax_without_flips(sheet, triangles, chart)
    assert np.all(chart_areas(relaxed, triangles) > 0)
    found = stretch_quantiles(sheet, triangles, relaxed)
    assert max(1 - found.least, found.most - 1) < 0.05


def test_a_vertex_that_was_moved_across_its_neighbors_is_put_back_inside(eaten):
    flat, triangles = eaten
    inner = np.flatnonzero(np.hypot(*(flat - [90.0, 0.0]).T) < 3)[0]
    knotted = flat.copy()
    knotted[inner] += [7.0, 1.0]
    assert np.any(chart_areas(knotted, triangles) <= 0)
    repaired = untangle(knotted, triangles)
    assert np.all(chart_areas(repaired, triangles) > 0)
    assert (repaired != flat).any(axis=1).sum() < 20


def test_a_triangle_that_is_flat_but_for_rounding_gets_an_area(eaten):
    """Its corners may be one point of a surface, and relaxing it on that surface would divide by its area."""
    flat, triangles = eaten
    inner = int(np.flatnonzero(np.hypot(*(flat - [90.0, 0.0]).T) < 3)[0])
    around = triangles[(triangles == inner).any(axis=1)]
    edge = around[0][around[0] != inner]
    onto = flat.copy()
    onto[inner] = flat[edge].mean(axis=0) + 1e-14 * (flat[inner] - flat[edge].mean(axis=0))
    assert 0 < np.abs(chart_areas(onto, triangles)).min() < 1e-12
    assert np.min(chart_areas(untangle(onto, triangles), triangles)) > tol.UNFLATTENED


def test_a_map_that_winds_twice_around_a_place_is_no_chart(eaten):
    """z ↦ z²/|z| doubles all angles about 0: it flips nothing, and lies over itself everywhere."""
    flat, triangles = triangulated(ellipse(40.0, 40.0), 2.0)
    middle = flat[np.argmin(np.hypot(*(flat - [20.0, 0.0]).T))]
    z = (flat - middle) @ [1.0, 1.0j]
    doubled = z**2 / np.maximum(np.abs(z), 1e-9)
    chart = np.stack([doubled.real, doubled.imag], axis=1)
    assert np.all(chart_areas(chart, triangles) > 0)
    assert winds_twice(chart, triangles)
    assert untangle(chart, triangles) is None
    # A hole is no place inside, nor are triangles at the border of a spiral.
    for sheet, faces in (eaten, spiral(0.8)):
        assert not winds_twice(sheet[:, :2], faces)


@pytest.mark.slow
def test_a_ruffled_sheet_is_laid_flat_without_winding_twice_around_a_place():
    flat, triangles = triangulated(ellipse(90.0, 60.0), 1.75)
    wave = 7.0 * (np.abs(flat[:, 1]) / 30) ** 3 * np.sin(2 * np.pi * flat[:, 0] / 12)
    sheet = np.column_stack([flat, wave])
    conformal = conformal_chart(sheet, triangles, require_sheet(sheet, triangles))
    assert winds_twice(relax_rigidly(sheet, triangles, conformal), triangles)
    chart = lay_flat(sheet, triangles)
    assert np.all(chart_areas(chart, triangles) > 0)
    assert not winds_twice(chart, triangles)


def freely_relaxed(sheet, triangles):
    """The chart of a sheet that may lie over itself, and its rims."""
    rings = require_sheet(sheet, triangles)
    start = relax_without_flips(sheet, triangles, convex_chart(sheet, triangles, rings))
    return relax_rigidly(sheet, triangles, start), rim_first(rings)


def test_a_chart_that_meets_itself_nowhere_is_that_of_least_stretch(eaten):
    flat, triangles = eaten
    sheet = rolled(flat, radius=15.0)
    rings = require_sheet(sheet, triangles)
    chart = relax_in_one_layer(sheet, triangles, convex_chart(sheet, triangles, rings), rim_first(rings))
    assert np.abs(triangle_stretch(sheet, triangles, chart) - 1).max() < tol.NEARLY_AT_REST


def test_vertices_that_are_held_stay_while_the_rest_relaxes(eaten):
    flat, triangles = eaten
    sheet = rolled(flat, radius=15.0)
    start = convex_chart(sheet, triangles, require_sheet(sheet, triangles))
    held = np.arange(0, len(flat), 40)
    moved = np.linalg.norm(flip_free_descent(sheet, triangles, start, held)(10) - start, axis=1)
    free = np.linalg.norm(flip_free_descent(sheet, triangles, start)(10) - start, axis=1)
    assert moved[held].max() < tol.HELD * free[held].max()
    assert moved.max() > tol.HELD * free.max()


def test_ends_that_meet_in_the_plane_touch_and_the_rest_is_stretched_little():
    """Of a strip that winds by 1.4 turns: as a closed ring it bends by less, 4 / 10 (1 - 1 / 1.4) of length at most."""
    sheet, triangles = spiral(1.4, step=2.0)
    rings = require_sheet(sheet, triangles)
    chart = relax_in_one_layer(sheet, triangles, convex_chart(sheet, triangles, rings), rim_first(rings))
    assert chart_areas(chart, triangles).min() > 0
    assert not lies_over_itself(chart, rim_first(rings))
    stretch = stretch_quantiles(sheet, triangles, chart)
    bent = tol.BENT_IN_THE_PLANE * 0.4 * (1 - 1 / 1.4)
    assert 1 / (1 + bent) < stretch.least < stretch.most < 1 + bent


def test_ends_that_lie_over_each_other_by_a_little_come_apart_where_lengths_ask_for_it():
    strip, triangles = triangulated(shapely.box(0, -4, 19.6 * np.pi, 4), 2.0)

    def ring(wound):
        angle, radius = wound * strip[:, 0] / 10, 10 - strip[:, 1]
        return np.stack([radius * np.sin(angle), -radius * np.cos(angle)], axis=1)

    sheet = np.column_stack([ring(1.0), np.zeros(len(strip))])
    rims = rim_first(require_sheet(sheet, triangles))
    assert not lies_over_itself(ring(1.0), rims)
    start = ring(1.03)
    assert lies_over_itself(start, rims)
    chart = relax_in_one_layer(sheet, triangles, start, rims)
    assert np.abs(triangle_stretch(sheet, triangles, chart) - 1).max() < tol.NEARLY_AT_REST


@pytest.mark.slow
def test_a_sheet_that_winds_round_itself_by_a_little_is_laid_flat_in_one_layer():
    """Its isometric chart is a ring of more than a turn: in one layer its ends touch, and lengths give way."""
    sheet, triangles = spiral(1.15, step=2.0)
    free, rims = freely_relaxed(sheet, triangles)
    assert lies_over_itself(free, rims)
    chart = lay_flat(sheet, triangles)
    areas = chart_areas(chart, triangles)
    assert areas.min() > 0
    assert not lies_over_itself(chart, rims)
    # One to one: what its triangles cover is the inside of its outline.
    assert areas.sum() == pytest.approx(shapely.Polygon(chart[rims[0]]).area, rel=1e-9)
    stretch = stretch_quantiles(sheet, triangles, chart)
    assert WORST[0] < stretch.least < stretch.most < WORST[1]


def test_a_chart_in_one_layer_that_stretches_more_than_lay_double_is_not_taken():
    """A tongue three times as long as its slot, whose end lies over the sheet: in one layer it would be squeezed."""
    slot = shapely.box(-5, -1, 5, 6).difference(shapely.box(-4, -2, 4, 4))
    flat, triangles = triangulated(shapely.box(-10, -10, 10, 10).difference(slot), 1.0)
    u, v = flat.T
    in_tongue = (np.abs(u) < 4.5) & (v > -1) & (v < 4.5)
    sheet = np.column_stack([u, np.where(in_tongue, 3 * v + 2, v), np.zeros(len(flat))])
    assert 0 < find_overlap(sheet[:, :2], triangles, require_sheet(sheet, triangles)).share < LARGEST_FLAP
    chart = lay_flat(sheet, triangles)
    assert np.abs(triangle_stretch(sheet, triangles, chart) - 1).max() < tol.NEARLY_AT_REST


def test_a_sheet_that_winds_round_itself_is_refused_with_the_place():
    sheet, triangles = spiral(1.4)
    with pytest.raises(
        ReconstructionError, match=r"lies over itself on .* % of its area, most at -?\d.*; cut"
    ) as refused:
        chart_sheet(sheet, triangles)
    assert refused.value.places.shape[1] == 3
    assert ((refused.value.places >= sheet.min(axis=0)) & (refused.value.places <= sheet.max(axis=0))).all()
    chart_sheet(*spiral(0.8))


def test_what_lies_over_the_rest_is_found_with_its_area_and_the_smaller_layer_goes():
    # A spiral staircase seen from above, turned so that its triangles are counter-clockwise.
    sheet, triangles = spiral(1.2)
    triangles = triangles[:, ::-1].copy()
    folded = sheet[:, :2]
    overlap = find_overlap(folded, triangles, require_sheet(sheet, triangles))
    exact = (14**2 - 6**2) * np.pi * 0.2
    assert overlap.areas.sum() == pytest.approx(exact, rel=0.02)
    kept = without_flaps(sheet, triangles, overlap)
    left = triangles[kept]
    assert find_overlap(folded, left, require_sheet(sheet, left)) is None
    assert chart_areas(folded, left).sum() == pytest.approx((14**2 - 6**2) * np.pi, rel=0.03)


def sphere(open_at):
    """A sphere of 20 mm without its cap above a height; closed at 2."""
    import open3d as o3d

    mesh = o3d.geometry.TriangleMesh.create_sphere(20.0, resolution=20)
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64)
    return vertices, triangles[vertices[triangles][:, :, 2].max(axis=1) < 20 * open_at]


@pytest.mark.parametrize(
    ("open_at", "says"), [(2.0, "closed and has no margin"), (0.9, r"% of the sheet would be stretched .* at -?\d")]
)
def test_a_closed_surface_and_a_bag_are_refused(open_at, says):
    with pytest.raises(ReconstructionError, match=says):
        lay_flat(*sphere(open_at))


def test_a_mesh_that_is_no_sheet_is_refused_with_the_place(eaten):
    flat, triangles = eaten
    sheet = rolled(flat)
    turned = triangles.copy()
    turned[5] = turned[5, ::-1]
    with pytest.raises(ReconstructionError, match=r"face opposite ways, one of them at -?\d"):
        lay_flat(sheet, turned)
    twice = np.concatenate([triangles, triangles + len(sheet)])
    with pytest.raises(ReconstructionError, match="in 2 pieces"):
        lay_flat(np.concatenate([sheet, sheet + 500]), twice)


def test_a_sheet_with_a_handle_is_refused_at_the_shortest_loop_around_it():
    u, v = np.meshgrid(np.arange(24), np.arange(12), indexing="ij")
    corner = lambda i, j: (i % 24) * 12 + j % 12  # noqa: E731
    quads = np.stack([corner(u, v), corner(u + 1, v), corner(u + 1, v + 1), corner(u, v + 1)], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    triangles = np.delete(triangles, [0, len(quads)], axis=0)
    a, b = u.ravel() * 2 * np.pi / 24, v.ravel() * 2 * np.pi / 12
    torus = np.stack([(3 + np.cos(b)) * np.cos(a), (3 + np.cos(b)) * np.sin(a), np.sin(b)], axis=1)
    with pytest.raises(ReconstructionError, match=r"has 1 handle") as caught:
        lay_flat(torus, triangles)
    # Through the hole and around the tube: twelve chords of a circle of radius 1, in one half plane through the axis.
    loop = caught.value.places
    assert len(loop) == 12
    assert np.ptp(np.arctan2(loop[:, 1], loop[:, 0])) < 2 * np.pi / 24 + 1e-9
    ring = np.column_stack([np.hypot(loop[:, 0], loop[:, 1]) - 3, loop[:, 2]])
    assert np.linalg.norm(ring, axis=1) == pytest.approx(np.ones(12))
    assert np.linalg.norm(ring.mean(axis=0)) < 1e-9
