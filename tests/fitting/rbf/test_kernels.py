"""Kernels carry their mathematics: θ, sign, order of conditional positive definiteness, derivatives."""

import math

import numpy as np
import pytest
from scipy.linalg import null_space

import reference
from o3dleaf import polyharmonic
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf import radial_loops
from o3dleaf.fitting.rbf.kernels import NAMES, Polyharmonic, as_kernel
from tolerances import KERNEL_SLOPE, ROOT, ROUNDING

ORDERS = [(m, d) for d in range(1, 7) for m in range(1, 7) if 2 * m > d]
POWERS = [1, 2, 3, 4, 5, 6, 7]


@pytest.mark.parametrize(("m", "d"), ORDERS)
def test_theta_and_sign_are_those_of_the_paper(m, d):
    kernel = polyharmonic(m, d)
    assert kernel.sign * kernel.theta == pytest.approx(reference.theta(m, d), rel=ROUNDING)
    assert (kernel.m, kernel.power, kernel.degree) == (m, 2 * m - d, m - 1)


def test_theta_takes_the_two_values_that_the_paper_prints():
    assert 1 / polyharmonic(2, 2).theta == pytest.approx(8 * math.pi, rel=ROUNDING)
    assert 1 / polyharmonic(3, 3).theta == pytest.approx(96 * math.pi, rel=ROUNDING)


@pytest.mark.parametrize(("power", "d"), [(3, 2), (2, 3), (1, 2), (4, 1)])
def test_a_power_that_minimises_no_energy_has_neither_m_nor_theta(power, d):
    kernel = Polyharmonic(power, d)
    assert kernel.m is None
    assert kernel.theta is None
    assert kernel.degree == kernel.least_degree


@pytest.mark.parametrize("power", POWERS)
def test_the_value_is_the_literal_formula_in_kernel_and_in_loop(power):
    r = np.concatenate([[0.0], np.geomspace(1e-6, 10, 60)])
    expected = reference.PHI[power](r)
    np.testing.assert_allclose(Polyharmonic(power, 3)(r), expected, rtol=ROUNDING)
    squared = r**2
    radial_loops.radial_values(power, squared, len(squared), squared)
    np.testing.assert_allclose(squared, expected, rtol=ROUNDING, atol=ROUNDING * 1e-6)


@pytest.mark.parametrize("power", POWERS)
def test_the_derivative_is_the_difference_quotient_and_finite_at_zero(power):
    r = np.linspace(0.1, 3, 40)
    step = 1e-5
    kernel = Polyharmonic(power, 3)
    expected = (kernel(r + step) - kernel(r - step)) / (2 * step)
    both = np.concatenate([[0.0], r])
    found = np.full(len(both), np.nan)
    radial_loops.derivatives_over_r(power, both**2, len(both), found)
    assert found[0] == 0.0
    np.testing.assert_allclose(found[1:] * r, expected, rtol=KERNEL_SLOPE, atol=KERNEL_SLOPE)
    np.testing.assert_allclose(found[1:], reference.radial_derivatives(power, r)[0] / r, rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("power", POWERS[2:])
def test_the_second_derivative_over_r_is_that_of_the_first_one_and_zero_at_zero(power):
    """ψ′/r = (φ″ − φ′/r)/r² for ψ = φ′/r."""
    r = np.linspace(0.1, 3, 40)
    first, second = reference.radial_derivatives(power, r)
    found = np.full(41, np.nan)
    radial_loops.second_derivatives_over_r(power, np.append(0.0, r) ** 2, 41, found)
    np.testing.assert_allclose(found, np.append(0.0, (second - first / r) / r**2), rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("power", POWERS)
def test_order_is_the_order_of_conditional_positive_definiteness(power, d):
    """On the null space of Pᵀ all eigenvalues are positive; with one degree less some are not."""
    kernel = Polyharmonic(power, d)
    # Far apart, so that log r > 0: close by, −r² log r happens to have the right sign without a tail.
    points = 20 * np.random.default_rng(power).random((40, d))
    matrix = kernel(reference.distances(points, points))

    def least_eigenvalue(degree):
        P = reference.polynomials(points / 20, degree)
        free = null_space(P.T) if P.shape[1] else np.eye(len(points))
        eigenvalues = np.linalg.eigvalsh(free.T @ matrix @ free)
        return eigenvalues[0] / eigenvalues[-1]

    assert least_eigenvalue(kernel.least_degree) > 0
    assert least_eigenvalue(kernel.least_degree - 1) < 0


@pytest.mark.parametrize(("name", "power"), NAMES.items())
def test_a_name_of_scipy_means_the_same_power(name, power):
    assert as_kernel(name, 3) == Polyharmonic(power, 3)
    assert as_kernel(Polyharmonic(power, 2), 2) == Polyharmonic(power, 2)


def test_impossible_kernels_are_refused():
    for m, d in [(1, 2), (1, 3), (2, 4), (1, 0)]:
        with pytest.raises(InputError, match="2m > d"):
            polyharmonic(m, d)
    with pytest.raises(InputError, match="choose one of linear"):
        as_kernel("gaussian", 3)
    with pytest.raises(InputError, match="2-D points, these are 3-D"):
        as_kernel(polyharmonic(2, 2), 3)


def test_the_root_by_multiplication_is_right_to_a_rounding():
    squares = np.concatenate([np.geomspace(1e-300, 1e300, 20001), np.random.default_rng(0).uniform(0, 4, 20000)])
    roots = np.array([radial_loops.square_root(s) for s in squares])
    np.testing.assert_allclose(roots, np.sqrt(squares), rtol=ROOT)
    assert radial_loops.square_root(0.0) == 0.0
    assert radial_loops.square_root(5e-324) < 1e-150
