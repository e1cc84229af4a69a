"""Reflectors all at once, ranks without singular values, and small systems without LAPACK: as the long way says."""

import numpy as np
import pytest

from o3dleaf.fitting.rbf import cholesky_loops, reflector_loops, solve_loops
from tolerances import ROUNDING


def made(columns, count=30):
    """Reflectors of a random tail, and Q as the product of them, one after another."""
    return reflectors_of(np.random.default_rng(columns).normal(size=(count, columns)))


def reflectors_of(tail):
    """Reflectors of a tail, which is overwritten, and Q."""
    vectors, betas = reflector_loops.householder(tail)
    q = np.eye(len(tail))
    for v, beta in zip(vectors, betas, strict=True):
        q = q @ (np.eye(len(tail)) - beta * np.outer(v, v))
    return vectors, betas, q


@pytest.mark.parametrize("size", [(30, 10), (7, 7), (4, 10), (5, 0)])
def test_reflectors_turn_a_tail_into_a_triangle(size):
    """Qᵀ P is R above and 0 below, and R is what P's first rows become; also where a column vanishes."""
    tail = np.random.default_rng(4).normal(size=size)
    if size[1] > 5:
        tail[:, 2] = 0.0
    factored = tail.copy()
    _, _, q = reflectors_of(factored)
    steps = min(size)
    np.testing.assert_allclose(q.T @ q, np.eye(size[0]), atol=ROUNDING)
    np.testing.assert_allclose(np.tril(q.T @ tail, -1), 0.0, atol=ROUNDING * 10)
    np.testing.assert_allclose(np.triu(factored[:steps]), np.triu(q.T @ tail)[:steps], atol=ROUNDING * 10)


@pytest.mark.parametrize("count", [30, 31, 3])
@pytest.mark.parametrize("columns", [0, 1, 4, 9, 10])
def test_all_reflectors_at_once_turn_a_matrix_on_both_sides(columns, count):
    vectors, betas, q = made(columns, count)
    half = np.random.default_rng(1).normal(size=(count, count))
    matrix = half + half.T
    for forward, turned in ((True, q.T @ matrix @ q), (False, q @ matrix @ q.T)):
        found = matrix.copy()
        reflector_loops.reflect_both_sides(found, vectors, betas, forward)
        assert np.array_equal(found, found.T)
        np.testing.assert_allclose(found, turned, atol=ROUNDING * np.abs(turned).max())


def test_the_block_of_reflectors_is_their_product():
    vectors, betas, q = made(7)
    block = np.eye(30) - vectors.T @ reflector_loops.block_reflector(vectors, betas) @ vectors
    np.testing.assert_allclose(block, q, atol=ROUNDING)


@pytest.mark.parametrize("least", [1.0, 1e-3, 1e-5])
def test_the_norms_of_a_triangle_bound_its_condition(least):
    """|R| |R⁻¹| is at least the quotient of the extreme singular values, and at most columns times that."""
    rng = np.random.default_rng(3)
    left, right = (np.linalg.qr(rng.normal(size=(6, 6)))[0] for _ in range(2))
    triangle = np.linalg.qr(left * np.append(np.ones(5), least) @ right)[1]
    bound = reflector_loops.norm(triangle) * reflector_loops.inverse_norm(triangle)
    values = np.linalg.svd(triangle, compute_uv=False)
    condition = values[0] / values[-1]
    assert bound >= condition * (1 - ROUNDING * condition)
    assert bound <= 6 * condition * (1 + ROUNDING * condition)


def test_a_singular_triangle_has_no_inverse_of_any_norm():
    assert not reflector_loops.inverse_norm(np.array([[1.0, 2.0], [0.0, 0.0]])) < np.inf


@pytest.mark.parametrize("share", [1e-3, 1e-7, 1e-9])
def test_a_direction_counts_down_to_the_tolerance_of_the_rank(share):
    """Points off a plane by a share of their extent have the rank of space down to 1e-8 of it, whoever tells it."""
    points = np.random.default_rng(2).uniform(-1, 1, (3, 40))
    points[2] *= share
    exponents = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    tail, frame = solve_loops.tail_matrix(points, exponents), solve_loops.natural_monomials(points, exponents)
    assert len(reflector_loops.restrict_tail(tail, frame)[2]) == (4 if share > reflector_loops.RANK_TOLERANCE else 3)


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_small_systems_are_solved_as_large_ones_are(size):
    """Also singular ones, which leave a direction out."""
    rng = np.random.default_rng(size)
    rows = rng.normal(size=(size, size + 2))
    for factor in (rows, np.repeat(rows[:1], size, axis=0)):
        matrix, right = factor @ factor.T, factor @ rng.normal(size=size + 2)
        few, many = right.copy(), right.copy()
        assert cholesky_loops.solve_few(matrix.copy(), few) == cholesky_loops.solve_positive(matrix.copy(), many)
        np.testing.assert_allclose(few, many, rtol=ROUNDING * np.linalg.cond(factor[: None if factor is rows else 1]))


@pytest.mark.parametrize("count", [1, *(cholesky_loops.BLOCK * np.array([1, 3, 5]) + [0, 5, 1])])
def test_a_triangle_times_its_inverse_is_one(count):
    """Also as Python, which, unlike machine code, raises where an array has no such place."""
    lower = np.tril(np.random.default_rng(count).uniform(-1, 1, (count, count))) / count + np.eye(count)
    for invert in (cholesky_loops.invert_triangle, cholesky_loops.invert_triangle.py_func):
        inverse = invert(lower)
        np.testing.assert_allclose(lower @ inverse, np.eye(count), rtol=0, atol=ROUNDING)
        assert not np.triu(inverse, 1).any()


@pytest.mark.parametrize("count", [0, 1, 3, 4, 5, 30, 31])
def test_a_symmetric_matrix_multiplies_by_what_is_on_and_below_its_diagonal(count):
    rng = np.random.default_rng(count)
    whole, vector, product = rng.normal(size=(count, count)), rng.normal(size=count), np.full(count, np.nan)
    lower = np.where(np.tri(count, dtype=bool), whole, np.nan)
    cholesky_loops.multiply_symmetric(lower, vector, product)
    meant = np.tril(whole) @ vector + np.tril(whole, -1).T @ vector
    np.testing.assert_allclose(product, meant, rtol=ROUNDING, atol=ROUNDING)
