"""Kernels with a shape: SciPy's own, positive definite where their tail vanishes, with derivatives of all orders."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from scipy.stats.qmc import Halton

import reference
from o3dleaf import PUInterpolant, RBFInterpolant, load
from o3dleaf.core.errors import IllPosedError, InputError
from o3dleaf.fitting.rbf.kernels import NAMES, as_kernel
from o3dleaf.fitting.rbf.shaped.dense_system import solve_symmetric
from o3dleaf.fitting.rbf.shaped.shaped_kernels import PROFILES, Shaped
from tolerances import ROUNDING, SCIPY_PARITY, SHAPED_SLOPE

EPSILON = {1: 30.0, 2: 5.0, 3: 3.0}
"""About 0.7 over the spacing of the points, where systems are well conditioned."""


def waves(d, count=80):
    rng = np.random.default_rng(0)
    points, queries = 3 * Halton(d, rng=rng).random(count) - 1, rng.uniform(-1.2, 2.2, (60, d))
    return points, np.column_stack([np.sin(2 * points).sum(axis=1), points[:, 0] ** 2]), queries


def close(found, expected, share=SCIPY_PARITY):
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("kernel", PROFILES)
@pytest.mark.parametrize("degree", [None, -1, 0, 2])
@pytest.mark.parametrize("smoothing", [0.0, 0.1])
def test_it_agrees_with_scipy(kernel, d, degree, smoothing):
    points, values, queries = waves(d)
    options = {"kernel": kernel, "epsilon": EPSILON[d], "degree": degree, "smoothing": smoothing}
    peer = RBFInterpolator(points, values, **options)(queries)
    close(RBFInterpolant.fit(points, values, **options)(queries), peer)
    close(RBFInterpolant.fit(points, values[:, 1], **options)(queries), peer[:, 1])


@pytest.mark.parametrize("kernel", NAMES)
@pytest.mark.parametrize("smoothing", [0.0, 0.1])
def test_without_the_tail_that_it_needs_it_still_agrees_with_scipy(kernel, smoothing):
    points, values, queries = waves(2)
    for epsilon in (1.0, 2.5):
        options = {"kernel": kernel, "epsilon": epsilon, "degree": -1, "smoothing": smoothing}
        close(
            RBFInterpolant.fit(points, values, **options)(queries), RBFInterpolator(points, values, **options)(queries)
        )


@pytest.mark.parametrize("kernel", NAMES)
def test_a_kernel_without_a_shape_takes_epsilon_as_scipy_does(kernel):
    points, values, queries = waves(2)
    options = {"kernel": kernel, "epsilon": 2.5, "degree": as_kernel(kernel, 2).least_degree}
    for smoothing in (0.0, 0.1):
        peer = RBFInterpolator(points, values, smoothing=smoothing, **options)(queries)
        close(RBFInterpolant.fit(points, values, smoothing=smoothing, **options)(queries), peer)
    if as_kernel(kernel, 2).theta:
        one, other = (RBFInterpolant.fit(points, values, kernel=kernel, rho=0.1, epsilon=e) for e in (None, 9.0))
        close(other(queries), one(queries))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("kernel", PROFILES)
def test_the_kernel_is_positive_definite_where_the_tail_vanishes(kernel, d):
    points, _, _ = waves(d, 40)
    phi = Shaped(kernel, EPSILON[d], d)
    matrix = phi(reference.distances(points, points))
    if phi.least_degree == 0:
        null = np.linalg.svd(np.ones((1, len(points))))[2][1:]
        matrix = null @ matrix @ null.T
    assert np.linalg.eigvalsh(matrix).min() > 0


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("kernel", PROFILES)
def test_slopes_are_limits_of_differences(kernel, d):
    points, values, queries = waves(d)
    field = RBFInterpolant.fit(points, values[:, 0], kernel=kernel, epsilon=EPSILON[d], degree=2)
    at, step = np.vstack([queries, points[:10]]), 3e-3 / EPSILON[d]
    close(field.gradient(at), reference.difference(field, at, step), SHAPED_SLOPE)
    bends = [reference.difference(lambda x, k=k: field.gradient(x)[:, k], at, step) for k in range(d)]
    close(field.hessian(at), np.stack(bends, axis=1), SHAPED_SLOPE)


@pytest.mark.parametrize("kernel", PROFILES)
def test_the_unit_of_length_does_not_matter(kernel):
    points, values, queries = waves(2)
    noisy = values + 0.1 * np.random.default_rng(1).standard_normal(values.shape)
    small = RBFInterpolant.fit(points, noisy, kernel=kernel, epsilon=5.0, smoothing="gcv")
    large = RBFInterpolant.fit(1e3 * points, noisy, kernel=kernel, epsilon=5e-3, smoothing="gcv")
    assert large.smoothing.value == pytest.approx(small.smoothing.value)
    close(large(1e3 * queries), small(queries))
    exact = RBFInterpolant.fit(points, values, kernel=kernel, epsilon=5.0)
    assert np.abs(exact(points) - values).max() < 1e-3 * np.abs(small(points) - noisy).max()


def test_a_flat_kernel_keeps_near_the_values_though_its_system_is_singular_to_rounding():
    points, values, _ = waves(1)
    for kernel in PROFILES:
        for degree in (None, -1):
            field = RBFInterpolant.fit(points, values, kernel=kernel, epsilon=0.5, degree=degree)
            close(field(points), values, 1e-4)


def test_it_comes_back_from_a_file(tmp_path):
    points, values, queries = waves(2)
    field = RBFInterpolant.fit(points, values, kernel="gaussian", epsilon=5.0)
    field.save(tmp_path / "gaussian.o3l")
    np.testing.assert_array_equal(load(tmp_path / "gaussian.o3l")(queries), field(queries))
    assert "gaussian of 5 r" in repr(field)
    again = RBFInterpolant.fit(points, values, kernel=field.kernel)
    np.testing.assert_array_equal(again(queries), field(queries))


def test_what_makes_no_sense_is_refused():
    points, values, _ = waves(2)
    with pytest.raises(InputError, match="epsilon: is missing"):
        RBFInterpolant.fit(points, values, kernel="gaussian")
    for epsilon in (0.0, -1.0, np.nan):
        for kernel in ("gaussian", "cubic"):
            with pytest.raises(InputError, match=r"epsilon: is .*; give a number"):
                RBFInterpolant.fit(points, values, kernel=kernel, epsilon=epsilon)
    with pytest.raises(InputError, match="give one of them"):
        RBFInterpolant.fit(points, values, kernel=Shaped("gaussian", 1.0, 2), epsilon=2.0)
    with pytest.raises(InputError, match="is for 3-D points"):
        RBFInterpolant.fit(points, values, kernel=Shaped("gaussian", 1.0, 3))
    with pytest.raises(InputError, match=r"unknown 'gauss'; choose one of linear, .*, inverse_quadratic"):
        RBFInterpolant.fit(points, values, kernel="gauss", epsilon=1.0)
    with pytest.raises(InputError, match="no theta"):
        RBFInterpolant.fit(points, values, kernel="gaussian", epsilon=1.0, rho=1.0)
    with pytest.raises(InputError, match="'gcv' needs the kernel's tail"):
        RBFInterpolant.fit(points, values, kernel="multiquadric", epsilon=1.0, degree=-1, smoothing="gcv")
    with pytest.raises(IllPosedError, match="at least 2"):
        RBFInterpolant.fit(points, values, kernel="quintic", degree=1)
    with pytest.raises(IllPosedError, match="singular"):
        RBFInterpolant.fit(np.zeros((2, 2)), values[:2], kernel="cubic", degree=-1)
    with pytest.raises(InputError, match="'gaussian' is for RBFInterpolant only; choose one of linear"):
        PUInterpolant.fit(points, values, kernel="gaussian")
    with pytest.raises(InputError, match="kernel: is of type Shaped; give text or a Polyharmonic"):
        PUInterpolant.fit(points, values, kernel=Shaped("gaussian", 1.0, 2))
    with pytest.raises(IllPosedError, match="at least"):
        PUInterpolant.fit(points, values, degree=-1)


def test_a_direction_that_is_lost_to_rounding_is_left_out_or_missed():
    """A matrix that an elimination takes for regular: λ has nothing of the lost direction, values must not."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(8, 8)))[0]
    sizes = np.append(np.linspace(1, 2, 7), 1e-18)
    matrix, lost = turn * sizes @ turn.T, turn[:, -1]
    weights = turn[:, :-1] @ np.ones(7)
    np.testing.assert_allclose(solve_symmetric(matrix, (matrix @ weights)[np.newaxis])[0], weights, atol=ROUNDING)
    with pytest.raises(IllPosedError, match="singular"):
        solve_symmetric(matrix, (weights + lost)[np.newaxis])
    np.testing.assert_array_equal(solve_symmetric(matrix, np.zeros((1, 8))), np.zeros((1, 8)))


def test_ball_by_ball_it_makes_a_blend():
    """It takes the values, as every local interpolant does, and its slope is the limit of differences."""
    points, values, queries = waves(2, 300)
    field = PUInterpolant.fit(
        points,
        values[:, 0],
        local=lambda x, f: RBFInterpolant.fit(x, f, kernel="inverse_multiquadric", epsilon=5.0),
        points_per_ball=(40, 80),
    )
    assert len(field.cover.radii) > 3
    close(field(points), values[:, 0])
    inside = np.clip(queries, -0.9, 1.9)
    close(field.gradient(inside), reference.difference(field, inside), SHAPED_SLOPE)
