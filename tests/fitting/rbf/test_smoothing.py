"""Smoothing: what ρ puts on the diagonal, its two limits, and the literal score of cross-validation."""

import math

import numpy as np
import pytest

import reference
from o3dleaf import RBFInterpolant, polyharmonic
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing, Spectrum, as_smoothing, choose_by_gcv, gcv_score
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import tail_exponents
from tolerances import BANDWIDTH, FIELD_TWIN, GCV_CHOICE, GCV_EFFICIENCY, GCV_MINIMUM, GCV_TWIN, RHO_LIMIT


def noisy(d, count=60, seed=1):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (count, d))
    truth = np.sin(2 * points).sum(axis=1)
    return points, truth, truth + 0.1 * rng.standard_normal(count)


@pytest.mark.parametrize(("m", "d"), [(2, 1), (2, 2), (3, 2), (2, 3), (3, 3), (3, 4)])
def test_rho_puts_rho_times_n_over_theta_on_the_diagonal(m, d):
    points, _, values = noisy(d)
    kernel = polyharmonic(m, d)
    diagonal = 1e-3 * len(points) / abs(reference.theta(m, d))
    fast = RBFInterpolant.fit(points, values, kernel=kernel, rho=1e-3)
    slow = reference.solve_spline(points, values, kernel.power, m - 1, diagonal)
    np.testing.assert_allclose(fast(points), slow(points), rtol=0, atol=FIELD_TWIN)


def test_the_paper_s_rho_of_3e_5_is_96_pi_rho_n():
    points, _, values = noisy(3)
    fast = RBFInterpolant.fit(points, values, kernel="cubic", rho=3e-5)
    slow = reference.solve_spline(points, values, 3, 2, 96 * math.pi * 3e-5 * len(points))
    np.testing.assert_allclose(fast(points), slow(points), rtol=0, atol=FIELD_TWIN)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_large_rho_gives_the_least_squares_polynomial(d):
    points, _, values = noisy(d)
    field = RBFInterpolant.fit(points, values, kernel=polyharmonic(3, d), rho=1e9)
    P = reference.polynomials(points, 2)
    expected = P @ np.linalg.lstsq(P, values)[0]
    np.testing.assert_allclose(field(points), expected, rtol=0, atol=RHO_LIMIT)


def test_a_small_rho_interpolates():
    points, _, values = noisy(3)
    field = RBFInterpolant.fit(points, values, rho=1e-16)
    np.testing.assert_allclose(field(points), values, rtol=0, atol=RHO_LIMIT)


def seen(points, values, power, degree, weights=None):
    """The spectrum of one system, as cross-validation sees it."""
    roots = np.ones(len(points)) if weights is None else np.sqrt(weights)
    exponents = tail_exponents(points.shape[1], degree)
    found, coefficients = spectra(np.ascontiguousarray(points.T), values[np.newaxis], roots, exponents, power)
    return Spectrum(found, coefficients[0], len(points))


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize(("power", "d", "degree"), [(1, 1, 0), (3, 1, 1), (2, 2, 1), (3, 3, 2), (5, 2, 3)])
@pytest.mark.parametrize("value", [1e-4, 1e-1, 10.0])
def test_the_score_is_the_literal_one(power, d, degree, value, weighted):
    points, _, values = noisy(d)
    weights = np.random.default_rng(3).uniform(0.1, 2, len(points)) if weighted else np.ones(len(points))
    score = gcv_score(value, seen(points, values, power, degree, weights))
    assert score == pytest.approx(reference.gcv(points, values, power, degree, value, weights), rel=GCV_TWIN)


@pytest.mark.parametrize("smoothing", [1e-3, 1.0])
def test_points_that_coincide_are_averaged_at_any_smoothing(smoothing):
    """What no spline can tell apart is all in the residual: an eigenvalue of zero for each point beyond the first."""
    points, _, values = noisy(2)
    points[-3:], values[-3:] = points[0], values[0] + [0.5, -1.0, 0.25]
    found = seen(points, values, 3, 1)
    assert (found.eigenvalues == 0).sum() == 3
    influence = reference.influence_matrix(points, 3, 1, smoothing)
    expected = np.sum((values - influence @ values) ** 2)
    residual = np.sum((smoothing * found.coefficients / (found.eigenvalues + smoothing)) ** 2)
    assert residual == pytest.approx(expected, rel=FIELD_TWIN)


def test_the_pooled_score_adds_residuals_and_traces():
    """Two systems with their own scales: N Σ|(I − H)f|² / (Σ tr(I − H))²."""
    scales, value = np.array([1.0, 7.0]), 0.02
    residual = trace = total = 0.0
    spectra = []
    for seed, scale in enumerate(scales):
        points, _, values = noisy(2, 30 + seed, seed)
        rest = np.eye(len(points)) - reference.influence_matrix(points, 2, 1, value * scale)
        residual += np.sum((rest @ values) ** 2)
        trace += np.trace(rest)
        total += len(points)
        part = seen(points, values, 2, 1)
        spectra.append(Spectrum(part.eigenvalues / scale, part.coefficients, part.count))
    score = gcv_score(value, Spectrum.pooled(spectra))
    assert score == pytest.approx(total * residual / trace**2, rel=GCV_TWIN)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize(("rule", "d"), [({"rho": "gcv"}, 3), ({"smoothing": "gcv"}, 3), ({"rho": "gcv"}, 1)])
def test_gcv_takes_the_largest_amount_that_costs_less_than_a_degree_of_freedom(rule, d, weighted):
    """Against literal scores on a fine grid: V ≤ V_min + 2σ²/N there, and beyond it no more."""
    points, truth, values = noisy(d)
    weights = np.random.default_rng(3).uniform(0.3, 2, len(points)) if weighted else np.ones(len(points))
    kernel = polyharmonic(3, d)
    field = RBFInterpolant.fit(points, values, kernel=kernel, weights=weights, **rule)
    chosen = field.smoothing.diagonal(len(points))

    def score(s):
        return reference.gcv(points, values, kernel.power, 2, s, weights)

    assert field.smoothing.score == pytest.approx(score(chosen), rel=GCV_TWIN)
    trials = chosen * np.concatenate([np.geomspace(1e-5, 1e4, 46), np.geomspace(0.1, 1, 61)])
    scores = np.array([score(s) for s in trials])
    best = trials[np.argmin(scores)]
    rest = values - reference.solve_spline(points, values, kernel.power, 2, best / weights)(points)
    limit = scores.min() + 2 * np.mean(weights * rest**2) / len(points)
    assert best < chosen
    assert score(chosen) == pytest.approx(limit, rel=GCV_MINIMUM)
    assert np.all(scores[trials > 1.001 * chosen] > limit)
    assert np.std(field(points) - truth) < np.std(values - truth)


def test_nothing_but_noise_gets_the_largest_amount_and_the_least_squares_polynomial():
    """The minimum of the flat curve goes astray in 5 of these 20 draws, the rule in none."""
    points = noisy(2, 150)[0]
    P, astray = reference.polynomials(points, 1), 0
    for seed in range(20):
        values = np.random.default_rng(seed).standard_normal(len(points))
        field = RBFInterpolant.fit(points, values, kernel="thin_plate_spline", rho="gcv")
        expected = P @ np.linalg.lstsq(P, values)[0]
        astray += np.std(field(points) - expected) > 0.1
    assert astray <= 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "values", [np.zeros(60), np.full(60, 3.0), 1e6 + noisy(2)[0] @ [2.0, -1.0]], ids=["0", "3", "x"]
)
@pytest.mark.parametrize("rule", [{"rho": "gcv"}, {"smoothing": "gcv"}])
def test_what_the_tail_reproduces_gets_the_largest_amount_and_comes_back(values, rule):
    points = noisy(2)[0]
    field = RBFInterpolant.fit(points, values, kernel="thin_plate_spline", **rule)
    np.testing.assert_allclose(field(points), values, rtol=FIELD_TWIN)
    assert field.smoothing.score == 0
    greatest = seen(points, values, 2, 1).eigenvalues.max() * 100
    assert field.smoothing.diagonal(len(points)) == pytest.approx(greatest, rel=GCV_CHOICE)


def test_data_without_noise_are_interpolated():
    """What is given away at the points is nothing beside the error between them, the root of the score."""
    points = noisy(2, 200)[0]
    values = np.sin(2 * points).sum(axis=1)
    field = RBFInterpolant.fit(points, values, kernel="thin_plate_spline", rho="gcv")
    assert np.std(field(points) - values) < 0.02 * np.sqrt(field.smoothing.score)


def test_equal_weights_change_the_unit_of_the_amount_and_nothing_else():
    points, _, values = noisy(3)
    plain = RBFInterpolant.fit(points, values, smoothing="gcv")
    heavy = RBFInterpolant.fit(points, values, smoothing="gcv", weights=np.full(len(points), 7.0))
    assert heavy.smoothing.value == pytest.approx(7 * plain.smoothing.value, rel=GCV_CHOICE)
    np.testing.assert_allclose(heavy(points), plain(points), rtol=0, atol=GCV_CHOICE)


def test_a_point_of_tiny_weight_has_no_say_in_the_choice():
    points, _, values = noisy(2, 150)
    spoilt, weights = values.copy(), np.ones(len(points))
    spoilt[17], weights[17] = 1e3, 1e-12
    without = RBFInterpolant.fit(np.delete(points, 17, 0), np.delete(values, 17), kernel="cubic", smoothing="gcv")
    ignoring = RBFInterpolant.fit(points, spoilt, kernel="cubic", smoothing="gcv", weights=weights)
    following = RBFInterpolant.fit(points, spoilt, kernel="cubic", smoothing="gcv")
    assert ignoring.smoothing.value == pytest.approx(without.smoothing.value, rel=0.05)
    assert following.smoothing.value != pytest.approx(without.smoothing.value, rel=0.5)


def test_weights_that_tell_the_noise_lead_to_the_better_fit():
    """Noise ten times as strong in half of the values: with w = 1/σ² the choice is near the best one."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-1, 1, (300, 2))
    truth, sigma = np.sin(3 * points).sum(axis=1), np.where(rng.random(300) < 0.5, 0.03, 0.3)
    values, options = truth + sigma * rng.standard_normal(300), {"kernel": "thin_plate_spline", "weights": sigma**-2}

    def error(value):
        return np.std(RBFInterpolant.fit(points, values, smoothing=value, **options)(points) - truth)

    chosen = RBFInterpolant.fit(points, values, smoothing="gcv", **options)
    assert chosen.smoothing.score == pytest.approx(1, rel=0.3)  # the mean of w σ²
    best = min(error(chosen.smoothing.value * x) for x in np.geomspace(1e-2, 1e2, 17))
    assert error(chosen.smoothing.value) < GCV_EFFICIENCY * best


@pytest.mark.few
@pytest.mark.parametrize(("power", "d"), [(1, 1), (2, 1), (3, 1), (2, 2), (3, 2)])
@pytest.mark.parametrize("frequency", [0.5, 1.0, 2.0])
def test_a_bandwidth_of_h_halves_the_waves_of_frequency_1_over_h(power, d, frequency):
    """A wave on dense data comes back 1/(1 + (hω)^2m) as high, 2m = k + d; there is no m for r³ in 2-D."""
    h, step = 0.5, 0.05 if d == 1 else 0.3
    axis = np.arange(-12 if d == 1 else -6, 12.01 if d == 1 else 6.01, step)
    points = np.stack(np.meshgrid(*[axis] * d, indexing="ij"), axis=-1).reshape(-1, d)
    kernel, wave = Polyharmonic(power, d), np.cos(frequency * points[:, 0])
    field = RBFInterpolant.fit(points, wave, kernel=kernel, smoothing=kernel.smoothing_for(h, step**-d))
    middle = np.all(np.abs(points) < 2, axis=1)
    height = field(points[middle]) @ wave[middle] / (wave[middle] @ wave[middle])
    assert height == pytest.approx(1 / (1 + (h * frequency) ** (power + d)), abs=BANDWIDTH)


def test_a_rule_that_makes_no_sense_is_refused():
    kernel = polyharmonic(3, 3)
    with pytest.raises(InputError, match="both are given"):
        as_smoothing(kernel, 1.0, 1.0)
    for bad in (-1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="number >= 0"):
            as_smoothing(kernel, bad, None)
        with pytest.raises(InputError, match="number >= 0"):
            as_smoothing(kernel, None, bad)
    with pytest.raises(InputError, match="unknown 'best'"):
        as_smoothing(kernel, "best", None)
    with pytest.raises(InputError, match="no theta; give smoothing"):
        as_smoothing(Polyharmonic(3, 2), None, 1.0)
    for word in ("gcv", "gcv-per-ball"):
        with pytest.raises(InputError, match="choose it first"):
            Smoothing(word).diagonal(10)
    with pytest.raises(InputError, match="too few points"):
        choose_by_gcv(Spectrum(np.empty(0), np.empty(0), 4))
    assert as_smoothing(kernel, None, None) == Smoothing(0.0)
