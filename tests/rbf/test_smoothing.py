"""Smoothing: what ρ puts on the diagonal, its two limits, and the literal score of cross-validation."""

import math

import numpy as np
import pytest

import reference
from o3dleaf.errors import InputError
from o3dleaf.rbf import solve
from o3dleaf.rbf.interpolant import RBFInterpolant
from o3dleaf.rbf.kernels import Polyharmonic, polyharmonic
from o3dleaf.rbf.smoothing import Smoothing, as_smoothing, choose_by_gcv, gcv_score
from o3dleaf.rbf.tail import tail_exponents
from tolerances import BANDWIDTH, FIELD_TWIN, GCV_MINIMUM, GCV_TWIN, RHO_LIMIT


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


@pytest.mark.parametrize(("power", "d", "degree"), [(1, 1, 0), (3, 1, 1), (2, 2, 1), (3, 3, 2), (5, 2, 3)])
@pytest.mark.parametrize("amount", [1e-4, 1e-1, 10.0])
def test_the_score_is_the_literal_one(power, d, degree, amount):
    """The pooled score counts the n − q free directions where Wahba's counts the n points: a constant factor."""
    points, _, values = noisy(d)
    exponents = tail_exponents(d, degree)
    spectrum = solve.spectrum(np.ascontiguousarray(points.T), values, exponents, power)
    free = len(points) - len(exponents)
    score = gcv_score(amount, [spectrum], np.ones(1)) * len(points) / free
    assert score == pytest.approx(reference.gcv(points, values, power, degree, amount), rel=GCV_TWIN)


def test_the_pooled_score_adds_residuals_and_traces():
    """Two systems with their own scales: n Σ|(I − H)f|² / (Σ tr(I − H))²."""
    exponents = tail_exponents(2, 1)
    scales, amount = np.array([1.0, 7.0]), 0.02
    residual = trace = free = 0.0
    spectra = []
    for seed, scale in enumerate(scales):
        points, _, values = noisy(2, 30 + seed, seed)
        rest = np.eye(len(points)) - reference.influence_matrix(points, 2, 1, amount * scale)
        residual += np.sum((rest @ values) ** 2)
        trace += np.trace(rest)
        free += len(points) - len(exponents)
        spectra.append(solve.spectrum(np.ascontiguousarray(points.T), values, exponents, 2))
    assert gcv_score(amount, spectra, scales) == pytest.approx(free * residual / trace**2, rel=GCV_TWIN)


@pytest.mark.parametrize(("rule", "d"), [({"rho": "gcv"}, 3), ({"smoothing": "gcv"}, 3), ({"rho": "gcv"}, 1)])
def test_gcv_takes_the_least_score_of_a_fine_grid(rule, d):
    points, truth, values = noisy(d)
    kernel = polyharmonic(3, d)
    field = RBFInterpolant.fit(points, values, kernel=kernel, **rule)
    chosen = field.smoothing.diagonal(len(points))
    score = reference.gcv(points, values, kernel.power, 2, chosen)
    factors = np.concatenate([np.geomspace(1e-3, 1e3, 13), np.geomspace(0.8, 1.25, 21)])
    others = [reference.gcv(points, values, kernel.power, 2, chosen * x) for x in factors]
    assert score <= min(others) * (1 + GCV_MINIMUM)
    assert np.std(field(points) - truth) < np.std(values - truth)


def test_a_constant_gets_a_score_of_zero_everywhere_and_still_an_answer():
    points, _, _ = noisy(2)
    field = RBFInterpolant.fit(points, np.full(len(points), 3.0), rho="gcv", kernel="thin_plate_spline")
    np.testing.assert_allclose(field(points), 3.0, rtol=FIELD_TWIN)


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
    with pytest.raises(InputError, match="choose it first"):
        Smoothing("gcv").diagonal(10)
    with pytest.raises(InputError, match="too few points"):
        choose_by_gcv([(np.empty(0), np.empty(0))], np.ones(1))
    assert as_smoothing(kernel, None, None) == Smoothing(0.0)
