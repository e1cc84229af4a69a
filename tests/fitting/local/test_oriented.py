"""Fits to oriented points: values 0 and slopes −n, whatever the shape; polynomials of the tail exactly."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf import CurlFree, Hermite, MovingLeastSquares, PUInterpolant, get_num_threads, set_num_threads
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.local.fitter import LocalFits, ScatteredData
from o3dleaf.fitting.local.oriented_loops import PotentialKind, ball_spectrum
from o3dleaf.fitting.local.polynomials import LocalPolynomials
from o3dleaf.fitting.local.potentials import LocalPotentials
from reference import blended_functions, hermite_functions
from tolerances import (
    FIELD_GRADIENT,
    HERMITE_ORDER,
    HESSIAN_DIFFERENCE,
    ORIENTED_DATA,
    ORIENTED_PLANE,
    ORIENTED_TURN,
    ORIENTED_TWIN,
    QUADRIC,
    REFINED_NORMALS,
    TURNED_NORMALS,
)

BOX = np.array([[-1.6, -1.6, -1.6], [1.6, 1.6, 1.6]])
FITTERS = [Hermite(), Hermite("cubic"), CurlFree(), MovingLeastSquares(2), MovingLeastSquares(3)]


def torus(count, seed=0):
    """Points and normals of a torus of radii 1 and 0.4, even to within a factor."""
    u, v = np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, count))
    normals = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=1)
    return np.stack([np.cos(u), np.sin(u), 0 * u], axis=1) + 0.4 * normals, normals


def sphere(count, seed=0):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def slopes_by_difference(field, queries, step=1e-5):
    steps = step * np.eye(queries.shape[1])
    return np.stack([(field(queries + e) - field(queries - e)) / (2 * step) for e in steps], axis=-1)


def fit(points, normals, local="hermite", **options):
    return PUInterpolant.fit_oriented(points, normals, local=local, bounds=BOX, **options)


@pytest.mark.few(kernel=1, smoothing=1)
@pytest.mark.parametrize("kernel", ["cubic", "quintic"])
@pytest.mark.parametrize("smoothing", [0.0, 1e-4])
def test_blended_hermite_equals_its_literal_twin(kernel, smoothing):
    points, normals = torus(70)
    field = fit(points, normals, Hermite(kernel, smoothing=smoothing), points_per_ball=40)
    cover, power = field.cover, {"cubic": 3, "quintic": 5}[kernel]
    twins = []
    for ball, (centre, radius) in enumerate(zip(cover.centers, cover.radii, strict=True)):
        rows = cover.members[cover.offsets[ball] : cover.offsets[ball + 1]]
        reach = max(radius, 1.1 * np.linalg.norm(points[rows] - centre, axis=1).max())
        ridge = smoothing * np.array([1, len(rows) / (np.pi * reach**2)])
        degree = field.local.kernel.degree
        twins.append(hermite_functions(points[rows], normals[rows], power, degree, ridge, centre, radius))
    queries = np.random.default_rng(1).uniform(-1.2, 1.2, (20, 3))
    expected = blended_functions(queries, cover.centers, cover.radii, twins)
    np.testing.assert_allclose(field(queries), expected, rtol=0, atol=ORIENTED_TWIN * np.abs(expected).max())


@pytest.mark.parametrize("local", [Hermite(), Hermite("cubic")], ids=str)
def test_hermite_has_the_values_and_slopes_of_its_data(local):
    points, normals = torus(1500)
    field = fit(points, normals, local)
    assert np.abs(field(points)).max() < ORIENTED_DATA
    assert np.abs(field.gradient(points) + normals).max() < ORIENTED_DATA


def test_curl_free_has_the_values_where_exact_and_else_the_slopes():
    points, normals = torus(60)
    inexact, exact = (fit(points, normals, CurlFree(exact=exact), points_per_ball=60) for exact in (False, True))
    assert len(exact.cover.radii) == 1
    assert np.abs(exact(points)).max() < ORIENTED_DATA
    assert np.abs(inexact.gradient(points) + normals).max() < ORIENTED_DATA
    assert abs(inexact(points).mean()) < ORIENTED_DATA
    assert np.abs(inexact(points)).max() > 100 * ORIENTED_DATA


@pytest.mark.parametrize("local", [*FITTERS, CurlFree(exact=False)], ids=str)
def test_gradients_are_the_slopes_of_the_values(local):
    points, normals = torus(600)
    field = fit(points, normals, local)
    queries = points[:200] + 0.02 * sphere(200, 1)
    found = field.gradient(queries)
    np.testing.assert_allclose(found, slopes_by_difference(field, queries), rtol=0, atol=FIELD_GRADIENT)


def test_hessians_are_the_slopes_of_the_gradients():
    points, normals = torus(600)
    field = fit(points, normals)
    queries = points[:200] + 0.02 * sphere(200, 1)
    steps = 1e-4 * np.eye(3)
    expected = np.stack([(field.gradient(queries + e) - field.gradient(queries - e)) / 2e-4 for e in steps], axis=-1)
    assert np.abs(field.hessian(queries) - expected).max() < HESSIAN_DIFFERENCE * np.abs(expected).max()
    with pytest.raises(InputError, match="kinks"):
        fit(points, normals, Hermite("cubic")).hessian(queries)


@pytest.mark.parametrize("local", FITTERS, ids=str)
def test_a_quadric_comes_back(local):
    points = sphere(500)
    queries = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3))
    expected = (1 - np.sum(queries**2, axis=1)) / 2
    np.testing.assert_allclose(fit(points, points, local)(queries), expected, rtol=0, atol=QUADRIC)


@pytest.mark.parametrize("local", [*FITTERS, MovingLeastSquares(1), "auto"], ids=str)
def test_coplanar_points_are_a_plane(local):
    rng = np.random.default_rng(0)
    normal = sphere(1)[0]
    points = rng.uniform(-0.8, 0.8, (300, 3))
    points -= np.outer(points @ normal, normal)
    queries = rng.uniform(-0.8, 0.8, (200, 3))
    field = fit(points, np.tile(3 * normal, (300, 1)), local)
    np.testing.assert_allclose(field(queries), -queries @ normal, rtol=0, atol=ORIENTED_PLANE)


@pytest.mark.parametrize("local", FITTERS, ids=str)
def test_a_turn_commutes_with_the_fit(local):
    points, normals = torus(60)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    queries = 0.8 * sphere(100, 1)
    plain = fit(points, normals, local, points_per_ball=60)
    turned = fit(points @ turn.T, normals @ turn.T, local, points_per_ball=60)
    assert np.abs(turned(queries @ turn.T) - plain(queries)).max() < ORIENTED_TURN


def test_the_error_of_hermite_falls_with_a_high_power_of_the_spacing():
    at, _ = torus(2000, seed=5)
    errors = [np.median(np.abs(fit(*torus(count))(at))) for count in (700, 5600)]
    assert np.log(errors[0] / errors[1]) / np.log(np.sqrt(8)) > HERMITE_ORDER


def test_a_curve_is_fitted_in_the_plane():
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    queries = np.random.default_rng(0).uniform(-1, 1, (100, 2))
    for local in (Hermite(), MovingLeastSquares()):
        field = PUInterpolant.fit_oriented(circle, circle, local=local)
        np.testing.assert_allclose(field(queries), (1 - np.sum(queries**2, axis=1)) / 2, rtol=0, atol=QUADRIC)


def noisy(count, noise):
    """A torus whose points are off by `noise`, with the normals of its patches of 30 points."""
    points, normals = torus(count)
    points = points + np.random.default_rng(3).normal(size=(count, 3)) * noise
    patches = points[cKDTree(points).query(points, k=30)[1]]
    patches -= patches.mean(axis=1, keepdims=True)
    found = np.linalg.eigh(np.einsum("nki,nkj->nij", patches, patches))[1][:, :, 0]
    return points, found * np.sign(np.sum(found * normals, axis=1, keepdims=True))


def error(field):
    at, _ = torus(2000, seed=5)
    return np.mean(np.abs(field(at)) / np.linalg.norm(field.gradient(at), axis=1))


def test_smoothing_by_gcv_takes_noise_away():
    points, normals = noisy(2000, 0.02)
    assert 2 * error(fit(points, normals, Hermite(smoothing="gcv"))) < error(fit(points, normals, Hermite()))


@pytest.mark.parametrize("local", [Hermite("cubic"), Hermite(step=2.0), CurlFree(exact=False)], ids=str)
def test_the_spectrum_of_a_ball_tells_the_residuals_of_its_fit(local):
    """What a smoothing s leaves of the data is Σ (s c / (λ + s))², by which cross-validation judges it."""
    points, normals = torus(45)
    normals = normals + np.random.default_rng(2).standard_normal(normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    field = fit(points, normals, replace(local, smoothing=1e-2), points_per_ball=len(points))
    assert len(field.cover.radii) == 1
    kind = PotentialKind(field.local.exponents, field.local.kernel.power, field.local.method, field.local.step)
    data = ScatteredData.on_surface(points, normals)
    eigenvalues, coefficients = ball_spectrum(0, data.oriented, field.cover.balls, kind)
    left = np.sum((field.gradient(points) + normals) ** 2)
    if isinstance(local, Hermite):  # gradients count by the square of `step` spacings of the sheet
        reach = max(field.cover.radii[0], 1.1 * np.linalg.norm(points - field.cover.centers, axis=1).max())
        spacing = reach * np.sqrt(np.pi / len(points))
        left = np.sum(field(points) ** 2) + (local.step * spacing) ** 2 * left
    expected = np.sum((1e-2 * coefficients / (eigenvalues + 1e-2)) ** 2)
    assert left == pytest.approx(expected, rel=ORIENTED_DATA)


def test_auto_fits_clean_points_exactly_and_noisy_ones_in_large_balls():
    clean, cloud = fit(*torus(4000), "auto"), noisy(8000, 0.04)
    rough = fit(*cloud, "auto")
    assert isinstance(clean.local, LocalPotentials)
    assert isinstance(rough.local, LocalPolynomials)
    assert rough.cover.counts.max() > 200
    assert 1.5 * error(rough) < error(fit(*cloud, Hermite(smoothing="gcv")))


@pytest.mark.parametrize("local", ["hermite", "mls"])
def test_a_model_comes_back_from_its_file_and_from_any_number_of_threads(local, tmp_path):
    points, normals = torus(800)
    before, bits = get_num_threads(), []
    try:
        for count in (1, 4):
            set_num_threads(count)
            bits.append(
                np.concatenate([part.ravel() for part in fit(points, normals, local).jets(points, 1)]).tobytes()
            )
    finally:
        set_num_threads(before)
    assert bits[0] == bits[1]
    field = fit(points, normals, local)
    field.save(tmp_path / "field.o3l")
    assert np.array_equal(o3l.load(tmp_path / "field.o3l")(points), field(points))


class Nothing:
    """A fitter of one's own: the blend of constant fields."""

    points_per_ball = 100

    def fit(self, cover, data) -> LocalFits:
        return LocalPolynomials(np.full((len(cover.radii), 1), 7.0), np.zeros((1, 3), dtype=np.int64), cover.counts)


def test_any_object_with_a_fit_is_a_local_method():
    assert np.allclose(fit(*torus(300), Nothing())(torus(50, 1)[0]), 7)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda: {"normals": np.ones((9, 3))}, "give one for each point"),
        (lambda: {"normals": np.zeros((10, 3))}, "10 have length zero"),
        (lambda: {"local": "voronoi"}, "local: unknown"),
        (lambda: {"local": Hermite("linear")}, "not smooth enough"),
        (lambda: {"local": Hermite(smoothing=-1.0)}, "smoothing: is -1"),
        (lambda: {"local": Hermite(step=0.0)}, "step"),
        (lambda: {"local": MovingLeastSquares(4)}, "give 1, 2 or 3"),
    ],
)
def test_what_makes_no_sense_is_said(change, message):
    def fit_oriented(change):
        return PUInterpolant.fit_oriented(
            **({"points": sphere(10), "normals": sphere(10), "local": "hermite"} | change)
        )

    with pytest.raises(InputError, match=message):
        fit_oriented(change())


def with_values(points, normals, sites, values):
    """Points and normals, and behind them sites of which the value alone is known."""
    known = ScatteredData.on_surface(points, normals)
    return ScatteredData(
        np.concatenate([known.points, sites]),
        np.concatenate([known.values, values]),
        normals=np.concatenate([known.normals, np.zeros(sites.shape)]),
    )


@pytest.mark.parametrize("local", [*FITTERS, Hermite(smoothing=1e-4)], ids=str)
def test_balls_that_get_more_points_are_fitted_as_if_they_had_them_from_the_start(local):
    """To values beside the surface, without a normal; no other ball changes."""
    points, normals = torus(600)
    field, site, value = fit(points, normals, local), np.array([[0.1, 0.05, 0.2]]), np.array([-0.3])
    data = with_values(points, normals, site, value)
    changed = field.with_points(data, 1)
    near = np.linalg.norm(field.cover.centers - site, axis=1) < field.cover.radii
    asked = np.random.default_rng(1).uniform(-1.2, 1.2, (400, 3))
    apart = np.linalg.norm(asked[:, np.newaxis] - field.cover.centers[near], axis=2) >= field.cover.radii[near]
    kept = apart.all(axis=1)
    assert 0 < near.sum() < len(near)
    assert 0 < kept.sum() < len(asked)
    np.testing.assert_array_equal(changed(asked[kept]), field(asked[kept]))
    whole = local.fit(changed.cover, data).blend(changed.index, asked, level=0, dtype=np.dtype(float))[0]
    np.testing.assert_array_equal(changed(asked), whole)


@pytest.mark.parametrize("local", [Hermite(), CurlFree()], ids=str)
def test_values_without_a_normal_are_met(local):
    points, normals = torus(600)
    sites, values = np.array([[0.0, 0.0, 0.0], [0.2, 0.1, 0.3]]), np.array([-0.6, -0.4])
    data = with_values(points, normals, sites, values)
    field = fit(points, normals, local).with_points(data, 2)
    assert np.abs(field(data.points) - data.values).max() < ORIENTED_DATA


def test_fits_that_take_no_more_points_say_so():
    points = sphere(60, 3)
    field = PUInterpolant.fit(points, np.zeros(60), local=o3l.RBFInterpolant.fit, points_per_ball=60)
    with pytest.raises(InputError, match="take no more points"):
        field.with_points(ScatteredData.of(points, np.zeros(60)), 1)


@pytest.mark.few(local=1)
@pytest.mark.parametrize("local", ["hermite", "curl-free"])
def test_normals_that_are_off_put_the_surface_off_by_their_angle_times_the_spacing_at_most(local):
    points, normals = torus(1500)
    at, _ = torus(2000, seed=5)
    spacing = np.sqrt(4 * np.pi**2 * 0.4 / len(points))
    beside = np.cross(normals, sphere(len(points), 1))

    def error(angle):
        return np.sqrt(np.mean(fit(points, normals + angle * beside, local)(at) ** 2))

    assert error(0.0) < TURNED_NORMALS * error(0.05)
    assert error(0.1) == pytest.approx(2 * error(0.05), rel=TURNED_NORMALS)
    assert error(0.05) < 0.05 * spacing


@pytest.mark.few(local=1)
@pytest.mark.parametrize("local", ["hermite", "curl-free"])
def test_slopes_of_a_first_fit_of_values_are_better_normals_than_those_of_planes(local):
    points, planes = noisy(1500, 0.0)
    at, _ = torus(2000, seed=5)
    first = o3l.fit_surface(o3l.OrientedCloud.of(points, planes))
    by_planes, by_slopes = (
        np.median(np.abs(fit(points, each, local)(at))) for each in (planes, -first.gradient(points))
    )
    assert by_slopes < REFINED_NORMALS * by_planes
