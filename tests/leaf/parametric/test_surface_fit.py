"""A surface fitted to a scan lies on its points, follows the majority of its passes, and moves with it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

import tolerances as tol
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.rbf.kernels import as_kernel
from o3dleaf.leaf.blade.outline_area import in_polygon
from o3dleaf.leaf.chart.flatten import lay_flat
from o3dleaf.leaf.chart.flattening.one_layer import lies_over_itself
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet, rim_first
from o3dleaf.leaf.chart.flattening.stretch import chart_areas
from o3dleaf.leaf.chart.flattening.untangle import untangle
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.parametric import fitted, surface_fit, tight_bends
from o3dleaf.leaf.parametric.fitted import ChartMesh
from o3dleaf.leaf.parametric.local_smoothing import choose_by_place
from o3dleaf.leaf.parametric.surface_fit import extend_fit, fit_chart_surface
from o3dleaf.leaf.parametric.tight_bends import FOLDED, tight_bends_on_sheet, without_folds
from tests.sheet_shapes import spiral

RADIUS, LENGTH, HALF_WIDTH = 6.0, 16.0, 5.0
NOISE = 0.02
COUNT = 1200


def roll(plane, height=0.0):
    """Return points over a strip that is rolled about a line along it: an isometry of the plane at height 0."""
    u, v = plane.T
    reach = RADIUS + height
    return np.column_stack([u, reach * np.sin(v / RADIUS), reach * np.cos(v / RADIUS)])


def places(count, seed):
    return np.random.default_rng(seed).uniform([0, -HALF_WIDTH], [LENGTH, HALF_WIDTH], (count, 2))


def strip(bias=0.0, step=1.0, length=LENGTH):
    """Return a sheet of the strip; its chart is the plane, stretched along by `bias`."""
    ends = (0.0, length), (-HALF_WIDTH, HALF_WIDTH)
    u, v = np.meshgrid(*(np.linspace(*each, round(np.ptp(each) / step) + 1) for each in ends), indexing="ij")
    plane = np.column_stack([u.ravel(), v.ravel()])
    triangles = Delaunay(plane).simplices.astype(np.int64)
    a, b, c = (plane[triangles[:, k]] for k in range(3))
    turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[turned] = triangles[turned][:, ::-1]
    return ChartMesh(roll(plane), triangles, plane * [1 + bias, 1.0])


@pytest.fixture(scope="module")
def scan():
    plane = places(COUNT, 0)
    return plane, roll(plane, np.random.default_rng(1).normal(0, NOISE, len(plane)))


@pytest.fixture(scope="module")
def fit(scan):
    return fit_chart_surface(scan[1], strip())


def off_cylinder(fit, margin=0.5):
    """Return the distances from the cylinder of points of the surface, but for those at its edge."""
    places = fit.mesh.chart
    inner = (np.abs(places - places.mean(axis=0)) < np.ptp(places, axis=0) / 2 - margin).all(axis=1)
    return np.abs(np.hypot(*fit.surface.jet(places[inner], 0)[0][:, 1:].T) - RADIUS)


def test_the_surface_lies_between_its_points(fit):
    assert off_cylinder(fit).max() < tol.BESIDE_A_FIT * NOISE
    assert np.std(fit.heights) == pytest.approx(NOISE, rel=tol.NOISE_LEFT)


def test_the_parameters_are_the_feet_of_the_points(fit, scan):
    position, tangents = fit.surface.jet(fit.feet, 1)
    along = np.einsum("nkd,nd->nk", tangents, scan[1] - position)
    assert np.abs(along).max() < tol.CHART_FOOT * LENGTH


def test_a_fit_goes_on_to_points_beyond_its_sheet(fit, scan):
    beyond = np.random.default_rng(5).uniform([LENGTH, -HALF_WIDTH], [LENGTH + 4, HALF_WIDTH], (300, 2))
    near = beyond + np.random.default_rng(6).normal(0, 0.02, beyond.shape)
    whole = extend_fit(fit, roll(beyond), near)
    assert np.array_equal(whole.mesh.chart, fit.mesh.chart)
    assert np.array_equal(whole.points, np.concatenate([scan[1], roll(beyond)]))
    assert np.abs(whole.heights[len(scan[1]) :]).max() < tol.BESIDE_A_FIT * NOISE
    assert np.abs(fit.surface.feet(roll(beyond), near)[1]).max() > 10 * tol.BESIDE_A_FIT * NOISE
    assert whole.feet[len(scan[1]) :] == pytest.approx(beyond, abs=tol.EXTENDED_FEET)
    inner = fit.feet[:, 0] < LENGTH - 3
    moved = whole.surface.jet(fit.feet[inner], 0)[0] - fit.surface.jet(fit.feet[inner], 0)[0]
    assert np.abs(moved).max() < NOISE


def test_a_stretched_chart_becomes_that_of_the_surface(scan):
    fit = fit_chart_surface(scan[1], strip(bias=0.2))
    metric = fit.surface.metric(fit.mesh.chart)
    assert np.linalg.eigvalsh(metric) == pytest.approx(1.0, abs=tol.FLATTENED_AGAIN)


def test_the_surface_moves_with_its_scan(fit, scan):
    turn, shift = Rotation.from_euler("xyz", [0.3, -1.0, 2.0]).as_matrix(), np.array([30.0, -200.0, 7.0])
    mesh = strip()
    elsewhere = ChartMesh(mesh.vertices @ turn.T + shift, mesh.triangles, mesh.chart)
    moved = fit_chart_surface(scan[1] @ turn.T + shift, elsewhere)
    assert moved.heights == pytest.approx(fit.heights, abs=tol.MOVED_SURFACE)


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.2, 0.5])
def test_smoothing_leaves_a_twist(noise):
    """Its saddles are what a smoothing by far too wide takes first: of each ball a plane is left."""
    turn, plane = 0.04, places(COUNT, 3)

    def twist(plane, height=0.0):
        u, v = plane.T
        x, y = v * np.cos(turn * u), v * np.sin(turn * u)
        normal = np.column_stack([turn * v, np.sin(turn * u), -np.cos(turn * u)])
        return np.column_stack([u, x, y]) + np.reshape(height, (-1, 1)) * normal / np.hypot(1, turn * v)[:, np.newaxis]

    sheet, spacing = strip(), np.sqrt(2 * LENGTH * HALF_WIDTH / len(plane))
    points = twist(plane, np.random.default_rng(4).normal(0, noise * spacing, len(plane)))
    fit = fit_chart_surface(points, replace(sheet, vertices=twist(sheet.chart)))
    _, x, y = fit.surface.jet(fit.feet, 0)[0].T
    off = y * np.cos(turn * plane[:, 0]) - x * np.sin(turn * plane[:, 0])
    assert off.std() < tol.LEFT_OF_A_TWIST * noise * spacing


def test_a_minority_that_lies_off_is_not_followed(scan):
    plane, points = scan
    beside = (plane[:, 0] > 4) & (plane[:, 0] < 10) & (np.arange(len(plane)) % 4 == 0)
    points = np.where(beside[:, np.newaxis], roll(plane, 0.5), points)
    fit = fit_chart_surface(points, strip())
    assert off_cylinder(fit).max() < tol.BESIDE_A_MAJORITY * NOISE
    assert np.median(fit.heights[beside]) == pytest.approx(0.5, abs=tol.BESIDE_A_MAJORITY * NOISE)


@pytest.mark.slow
def test_nor_is_it_without_noise_but_within_the_least_corner():
    plane = places(1800, 0) * [1.5, 1.0]
    beside = (plane[:, 0] > 6) & (plane[:, 0] < 15) & (np.arange(len(plane)) % 4 == 0)
    points = np.where(beside[:, np.newaxis], roll(plane, 0.5), roll(plane))
    fit = fit_chart_surface(points, strip(length=1.5 * LENGTH))
    off = np.quantile(off_cylinder(fit), 0.99)
    assert off < tol.BESIDE_AN_EXACT_MAJORITY * fit.problem.spacing


@pytest.mark.slow
def test_ruffles_beside_a_flat_part_are_followed_without_noise():
    """Waves six spacings long, up to 57° steep, of a strip that keeps its lengths: planes show no noise."""
    spacing, way = np.sqrt(2 * LENGTH * HALF_WIDTH / COUNT), np.linspace(-5, LENGTH + 5, 20_001)
    turn = np.sin(2 * np.pi * np.maximum(way - 8, 0) / (6 * spacing))
    along, up = (np.cumsum(part(turn)) * (way[1] - way[0]) for part in (np.cos, np.sin))

    def ruffled(plane):
        return np.column_stack([np.interp(plane[:, 0], way, along), plane[:, 1], np.interp(plane[:, 0], way, up)])

    plane, sheet = places(COUNT, 0), strip(step=0.5)
    fit = fit_chart_surface(ruffled(plane), replace(sheet, vertices=ruffled(sheet.chart)))
    ends = (plane[:, 0] > 8) & (plane[:, 0] < LENGTH - 2) & (np.abs(plane[:, 1]) < HALF_WIDTH - 1)
    assert np.sqrt(np.mean(fit.heights[ends] ** 2)) < tol.BESIDE_RUFFLES * spacing


def test_a_flat_scan_without_noise_is_followed_where_it_bends():
    """Its own planes show no noise, of which the bend is no error either."""
    bent = LENGTH * 0.7

    def hook(plane):
        u, v = plane.T
        turn = np.maximum(u - bent, 0) / 3.0
        return np.column_stack([np.minimum(u, bent) + 3.0 * np.sin(turn), v, 3.0 * (1 - np.cos(turn))])

    points, sheet = hook(places(600, 2)), strip()
    heights = np.abs(fit_chart_surface(points, replace(sheet, vertices=hook(sheet.chart))).heights)
    assert heights.max() < tol.BENT_TIP * np.sqrt(2 * LENGTH * HALF_WIDTH / len(points))


@pytest.mark.slow
def test_a_chart_comes_to_lie_over_itself_in_no_round():
    """A strip that winds by more than a turn: charts that keep its lengths do, and S cannot go through both ends."""
    sheet, triangles = spiral(1.15, step=1.5)
    chart = surface_fit._relaxed(ChartMesh(sheet, triangles, lay_flat(sheet, triangles)))
    assert not lies_over_itself(chart, rim_first(require_sheet(sheet, triangles)))


def test_smoothing_is_less_where_the_leaf_is_wavy():
    length = 1.5 * LENGTH
    plane = places(1600, 2) * [1.5, 1.0]
    waves = np.where(plane[:, 0] > 0.8 * length, 0.15 * np.sin(2.5 * plane[:, 0]) * np.cos(2.5 * plane[:, 1]), 0.0)
    heights = waves + np.random.default_rng(3).normal(0, 0.05, len(plane))
    bounds = np.array([plane.min(axis=0), plane.max(axis=0)])
    cover = Cover.fit(plane, bounds, (200, 400), 1.25)
    flat = np.column_stack([plane, heights])
    up = np.tile([0.0, 0.0, 1.0], (len(flat), 1))
    choice = choose_by_place(cover, flat, as_kernel("cubic", 2), HALF_WIDTH, flat, up)
    calm, wavy = choice.factors[plane[:, 0] < length / 2], choice.factors[plane[:, 0] > 0.85 * length]
    assert np.median(calm) < np.median(wavy)


@pytest.mark.few(noise=1)
@pytest.mark.parametrize(("noise", "smoothing"), [(0.25, 0.05), (0.4, 0.1)])
def test_no_surface_folds_between_points_however_little_smoothing_was_chosen(monkeypatch, noise, smoothing):
    points = roll(places(400, 0)) + np.random.default_rng(1).normal(0, noise, (400, 3))

    def too_little(*arguments):
        return replace(choose_by_place(*arguments), smoothing=smoothing)

    monkeypatch.setattr(fitted, "choose_by_place", too_little)
    fit = fit_chart_surface(points, strip())
    spacing = np.sqrt(strip().area / len(points))
    assert not len(tight_bends_on_sheet(fit.surface, fit.mesh, fit.feet, spacing, 1 / np.pi).radii)
    note, *others = fit.notes
    assert note.startswith("smoothing raised by ")
    assert not others
    assert "left" not in note


def test_a_fit_without_folds_is_not_smoothed_more_nor_one_by_a_number(fit):
    points = roll(places(400, 0)) + np.random.default_rng(1).normal(0, 0.25, (400, 3))
    assert fit.notes == ()
    assert fit_chart_surface(points, strip(), smoothing=0.05).notes == ()


def test_vertices_at_one_place_of_a_chart_are_put_apart(scan):
    """A vertex of a rough sheet is carried to where another one is; the triangles between have no area."""
    mesh = strip()
    one, other, _ = mesh.triangles[len(mesh.triangles) // 2]
    chart = mesh.chart.copy()
    chart[other] = chart[one]
    found = fit_chart_surface(scan[1], replace(mesh, chart=chart)).mesh
    assert (found.triangles == mesh.triangles).all()
    assert (chart_areas(found.chart, found.triangles) > 0).all()


@pytest.mark.few(knot=1)
@pytest.mark.parametrize("knot", ["one place", "past each other", "at the margin"])
def test_a_sheet_whose_chart_is_tangled_beyond_repair_is_triangulated_anew(scan, knot):
    """Vertices of a rough sheet are carried there all to one place, or past each other: no chart relaxes from that.

    At the margin the outline then meets itself in single points.
    """
    mesh = strip()
    middle, reach = ([LENGTH / 2, HALF_WIDTH], 2.5) if knot == "at the margin" else ([LENGTH / 2, 0.0], 1.6)
    near = np.flatnonzero(np.linalg.norm(mesh.chart - middle, axis=1) < reach)
    chart = mesh.chart.copy()
    chart[near] = middle if knot == "one place" else chart[np.random.default_rng(1).permutation(near)]
    assert untangle(chart, mesh.triangles) is None
    fit = fit_chart_surface(scan[1], replace(mesh, chart=chart))
    assert (chart_areas(fit.mesh.chart, fit.mesh.triangles) > 0).all()
    assert fit.mesh.area == pytest.approx(mesh.area, rel=tol.TANGLED_AREA)
    assert fit.notes == ()
    assert np.sqrt(np.mean(off_cylinder(fit) ** 2)) < NOISE


def rough_scan(scan, monkeypatch, noise=0.1):
    """Return the points of a scan that is rough near one end, and where (n,): smoothing is chosen far too little there.

    All folds lie in it.
    """
    plane, points = scan
    rough = np.hypot(plane[:, 0] - 3, plane[:, 1]) < 2
    points = points + np.where(rough[:, np.newaxis], np.random.default_rng(7).normal(0, noise, points.shape), 0)

    def too_little_there(*arguments):
        choice = choose_by_place(*arguments)
        return replace(choice, factors=np.where(rough, 1000.0, 1.0))

    monkeypatch.setattr(fitted, "choose_by_place", too_little_there)
    return points, rough


def test_smoothing_is_raised_only_around_a_fold(scan, monkeypatch):
    """Elsewhere the fit is as it was; raised all over, it is another one."""
    points, rough = rough_scan(scan, monkeypatch)
    fit = fit_chart_surface(points, strip())
    spacing = fit.problem.spacing
    assert not len(tight_bends_on_sheet(fit.surface, fit.mesh, fit.near, spacing, FOLDED).radii)
    assert fit.notes
    assert "left" not in fit.notes[0]
    beyond = scan[0][:, 0] > 5 + 2 * np.median(fit.surface.cover.radii)
    factors = fit.problem.choice.factors
    assert (factors[beyond] == 1.0).all()
    assert factors[rough].min() < 1000.0
    monkeypatch.setattr(surface_fit, "MAX_RAISES", 0)
    folded = fit_chart_surface(points, strip())
    assert "left" in folded.notes[0]
    moved = np.abs(fit.heights - folded.heights)[beyond]
    assert moved.max() < tol.ELSEWHERE_THAN_A_FOLD * spacing


def test_no_blade_is_where_its_surface_is_folded_and_all_of_it_where_it_is_not(scan, fit, monkeypatch):
    """Relief on a fold would pass through itself. What is cut away is told."""
    whole = Margin.fit(fit.feet)
    assert without_folds(fit, whole) == (whole, ())
    points, rough = rough_scan(scan, monkeypatch, 0.2)
    monkeypatch.setattr(surface_fit, "MAX_RAISES", 0)
    folded = fit_chart_surface(points, strip())
    spacing, whole = folded.problem.spacing, Margin.fit(folded.feet)
    left, (said,) = without_folds(folded, whole)
    axes = [np.arange(*ends, spacing / 10) for ends in whole.bounds.T]
    places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    folds = places[np.abs(folded.surface.curvatures(places)).max(axis=1) * FOLDED * spacing > 1]
    before, after = (in_polygon(each.polygon, folds).sum() for each in (whole, left))
    assert before > 30
    assert after < tol.FOLDS_LEFT * before
    assert whole.polygon.contains(left.polygon)
    kept = folded.feet[~rough & in_polygon(whole.polygon, folded.feet)]
    assert in_polygon(left.polygon, kept).mean() > 0.99
    cut = float(re.search(r"left out: ([\d.]+),", said)[1])
    assert cut == pytest.approx(whole.area - left.area, rel=tol.THREE_DIGITS)
    monkeypatch.setattr(tight_bends, "LEAST_LEFT", 1.0)
    assert without_folds(folded, whole) == (whole, ())


@pytest.mark.parametrize("growing", [True, False])
def test_the_surface_that_is_kept_has_the_fewest_points_beside_folds_or_lost(scan, monkeypatch, growing):
    """The least folded one is the last, with the most smoothing."""
    points, _ = rough_scan(scan, monkeypatch)
    smoothings = []

    def cost(settled):
        smoothings.append(settled.problem.weights)
        return 1000 + len(smoothings) if growing else 1000 - len(smoothings)

    monkeypatch.setattr(surface_fit._Settled, "cost", property(cost))
    fit = fit_chart_surface(points, strip())
    assert ("smoothing kept" in fit.notes[0]) == growing
    assert ("folds are left" in fit.notes[0]) == growing


def test_points_beside_folds_and_crossings_and_lost_ones_are_counted_once(fit):
    """Of the smooth surface none, and half of the points where they lie far off it."""
    settled = surface_fit._Settled(fit.problem, fit.surface, fit.mesh, fit.near)
    assert settled.cost == 0
    away = np.where(np.arange(len(fit.near)) % 2, 2 * fit.problem.spacing, 0)[:, np.newaxis]
    far = fit.problem.sites + away * fit.surface.normals(fit.near)
    assert replace(settled, problem=replace(fit.problem, sites=far)).cost == len(far) // 2


@pytest.mark.slow
def test_around_a_fold_that_stays_smoothing_is_raised_farther_and_not_for_ever(scan, monkeypatch):
    points, rough = rough_scan(scan, monkeypatch)
    little, settled, tried = 1.2, surface_fit._settle, []
    monkeypatch.setattr(surface_fit, "STIFFER", little)
    monkeypatch.setattr(surface_fit, "_settle", lambda problem, *rest: tried.append(problem) or settled(problem, *rest))
    fit_chart_surface(points, strip())
    assert len(tried) == 1 + surface_fit.MAX_RAISES
    factors = np.array([problem.choice.factors for problem in tried])
    raised = -np.log(factors / np.where(rough, 1000.0, 1.0)) / np.log(little)
    assert raised.max() == pytest.approx(surface_fit.MAX_RAISED)
    assert (np.diff(raised, axis=0) > -1e-9).all()
    beside, far = (raised[:, np.abs(scan[0][:, 0] - at) < 1].mean(axis=1) for at in (7, LENGTH - 1))
    assert (far[1:] < beside[1:]).all()
    soon = np.argmax(beside > 0.5)
    assert far[soon] < beside[soon] / 10
