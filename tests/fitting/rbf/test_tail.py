"""The polynomial tail: all monomials of a total degree, none twice, and their slopes."""

import math

import numpy as np
import pytest

import reference
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf import evaluation_loops, solve_loops
from o3dleaf.fitting.rbf.tail import tail_exponents
from tolerances import ROUNDING


@pytest.mark.parametrize("d", [1, 2, 3, 4])
@pytest.mark.parametrize("degree", [-1, 0, 1, 2, 3])
def test_the_tail_holds_every_monomial_once_lowest_degree_first(d, degree):
    exponents = tail_exponents(d, degree)
    assert exponents.shape == (math.comb(degree + d, d) if degree >= 0 else 0, d)
    assert {tuple(row) for row in exponents.tolist()} == set(reference.powers(d, degree))
    assert np.all(np.diff(exponents.sum(axis=1)) >= 0)


def test_ten_terms_for_degree_two_in_space():
    assert len(tail_exponents(3, 2)) == 10


def test_a_degree_below_minus_one_is_refused():
    with pytest.raises(InputError, match="-1 \\(no tail\\)"):
        tail_exponents(3, -2)


def derivative(z, exponent, axes):
    """The derivative of z^exponent along each of the axes in turn, as one learns it at school."""
    factor, lower = 1.0, exponent.astype(float)
    for axis in axes:
        factor *= lower[axis]
        lower[axis] -= 1
    return factor * np.prod(z ** np.maximum(lower, 0))


def tail_jets(z, tail, exponents, order):
    """The jet of a tail at one point, by the compiled functions."""
    lowered = evaluation_loops.lower_exponents(exponents)
    coefficients = np.full((evaluation_loops.jet_size(len(z), order), len(tail)), np.nan)
    evaluation_loops.tail_derivatives(tail, exponents, lowered, order, coefficients)
    jets = np.full((len(coefficients), 1), np.nan)
    evaluation_loops.tail_jets(z[:, np.newaxis], 1, coefficients, lowered, np.empty((len(tail), 1)), jets)
    return jets[:, 0]


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_monomials_and_their_derivatives(d):
    """The slope of zᵅ along an axis is α z^(α − e), 0 where α is 0, also at z = 0; and so on for the slope's slope."""
    exponents = tail_exponents(d, 4)
    pairs = list(zip(*np.triu_indices(d), strict=True))
    for z in (np.zeros(d), np.random.default_rng(d).uniform(-1, 1, d)):
        terms = solve_loops.tail_matrix(z[:, np.newaxis], exponents)[0]
        for exponent, one, term in zip(exponents, np.eye(len(exponents)), terms, strict=True):
            assert term == pytest.approx(np.prod(z**exponent), rel=ROUNDING)
            slopes = [derivative(z, exponent, [axis]) for axis in range(d)]
            bends = [derivative(z, exponent, pair) for pair in pairs]
            for order, expected in enumerate(([], slopes, slopes + bends)):
                jet = np.array([np.prod(z**exponent), *expected])
                np.testing.assert_allclose(tail_jets(z, one, exponents, order), jet, rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_natural_monomials_turn_orthogonally_about_the_mean(d):
    """Σ p_α(z) p_α(y) over total degree t is ((z − z̄)·(y − z̄))^t, which no rotation about the mean z̄ changes."""
    exponents = tail_exponents(d, 3)
    points, (z, y) = np.random.default_rng(0).random((d, 20)), np.random.default_rng(1).random((2, d))
    frame = solve_loops.natural_monomials(points, exponents)
    terms = (np.prod(z**exponents, axis=1) @ frame) * (np.prod(y**exponents, axis=1) @ frame)
    mean = points.mean(axis=1)
    for degree in range(4):
        total = terms[exponents.sum(axis=1) == degree].sum()
        assert total == pytest.approx(((z - mean) @ (y - mean)) ** degree, rel=ROUNDING, abs=ROUNDING)
