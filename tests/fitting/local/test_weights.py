"""Wendland's weight: one at the centre, twice continuously gone at the rim, with an exact slope."""

import numpy as np
import pytest

import reference
from o3dleaf.fitting.local.weight_loops import wendland, wendland_derivative_over_tau
from tolerances import ROUNDING, WEIGHT_DIFFERENCE


def w(tau):
    return np.array([wendland(t) for t in np.atleast_1d(tau)])


def test_it_is_the_paper_s_formula():
    tau = np.linspace(0, 1.5, 61)
    np.testing.assert_allclose(w(tau), [reference.wendland(t) for t in tau], rtol=ROUNDING, atol=0)
    assert wendland(0.0) == 1.0


def test_it_falls_all_the_way_and_is_zero_from_the_rim_on():
    assert np.all(np.diff(w(np.linspace(0, 1, 1001))) < 0)
    assert np.all(w([1.0, 1.0 + 1e-15, 2.0]) == 0.0)
    assert wendland_derivative_over_tau(1.0) == wendland_derivative_over_tau(3.0) == 0.0


def test_value_slope_and_curvature_vanish_at_the_rim():
    """w = O(h⁴) there, so the second difference is O(h²): the blend of C² fits is C²."""
    for h in (1e-2, 1e-3):
        left, rim, right = w([1 - h, 1.0, 1 + h])
        assert rim == right == 0.0
        assert 0 < left <= 6 * h**4
        assert abs(left - 2 * rim + right) / h**2 <= 6 * h**2


def test_it_is_even_and_smooth_at_the_centre():
    """The slope is −20 τ (1 − τ)³: it starts at zero, where the direction from the centre is undefined."""
    h = 1e-4
    assert (wendland(h) - 1) / h**2 == pytest.approx(-10, rel=1e-3)


def test_the_slope_is_the_difference_quotient():
    tau, h = np.linspace(0.01, 0.99, 50), 1e-6
    slope = np.array([wendland_derivative_over_tau(t) * t for t in tau])
    np.testing.assert_allclose(slope, (w(tau + h) - w(tau - h)) / (2 * h), rtol=0, atol=WEIGHT_DIFFERENCE)
    assert wendland_derivative_over_tau(0.0) == -20.0
