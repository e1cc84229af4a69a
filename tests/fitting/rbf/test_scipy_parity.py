"""Parity with SciPy's `RBFInterpolator`, and the properties that its own tests state, on our single interpolant."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

import reference
from o3dleaf import RBFInterpolant
from o3dleaf.core.errors import IllPosedError, InputError
from o3dleaf.fitting.rbf.kernels import NAMES, as_kernel
from o3dleaf.fitting.rbf.smoothing import Spectrum, choose_by_gcv
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from tolerances import EXTREME_DOMAIN, GCV_CHOICE, LEAST_SQUARES_LIMIT, OUTLIER, ROUNDING, SCIPY_PARITY

KERNELS = list(NAMES)


def waves(d, count=90, seed=0):
    rng = np.random.default_rng(seed)
    points, queries = rng.uniform(-1, 2, (2, count, d))
    return points, np.sin(2 * points).sum(axis=1) + np.cos(points[:, 0]), queries


def least(kernel, d):
    return as_kernel(kernel, d).least_degree


def close(found, expected, share):
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("more", [0, 1, 2])
@pytest.mark.parametrize("smoothing", [0.0, 1e-3, 1.0])
def test_it_agrees_with_scipy(kernel, d, more, smoothing):
    points, values, queries = waves(d)
    degree = least(kernel, d) + more
    ours = RBFInterpolant.fit(points, values, kernel=kernel, degree=degree, smoothing=smoothing)
    peer = RBFInterpolator(points, values, kernel=kernel, degree=degree, smoothing=smoothing)
    close(ours(queries), peer(queries), SCIPY_PARITY)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("smoothing", [0.0, 0.1])
def test_vector_values_agree_with_scipy_and_with_their_columns(kernel, smoothing):
    points, values, queries = waves(2)
    many = np.column_stack([values, values**2, np.exp(points[:, 1])])
    degree = least(kernel, 2)
    ours = RBFInterpolant.fit(points, many, kernel=kernel, degree=degree, smoothing=smoothing)
    peer = RBFInterpolator(points, many, kernel=kernel, degree=degree, smoothing=smoothing)
    found = ours(queries)
    assert found.shape == (len(queries), 3)
    close(found, peer(queries), SCIPY_PARITY)
    for column in range(3):
        one = RBFInterpolant.fit(points, many[:, column], kernel=kernel, degree=degree, smoothing=smoothing)
        close(found[:, column], one(queries), SCIPY_PARITY)
        close(ours.gradient(queries)[:, column], one.gradient(queries), SCIPY_PARITY)
        if as_kernel(kernel, 2).power >= 3:
            close(ours.hessian(queries)[:, column], one.hessian(queries), SCIPY_PARITY)


@pytest.mark.filterwarnings("ignore::o3dleaf.core.errors.DataWarning")
def test_vector_values_at_coinciding_points_go_through_their_means():
    points, values, queries = waves(2, 30)
    twice, many = np.vstack([points, points]), np.column_stack([values, values**2])
    apart = RBFInterpolant.fit(twice, np.vstack([many - 1, many + 1]))
    close(apart(queries), RBFInterpolant.fit(points, many)(queries), SCIPY_PARITY)


def test_one_smoothing_is_chosen_for_all_columns():
    """That of the pooled score of the columns, each judged by its own spectrum."""
    points, values, queries = waves(2)
    noisy = values[:, None] + 0.1 * np.random.default_rng(1).normal(size=(len(values), 2))
    both = RBFInterpolant.fit(points, noisy, smoothing="gcv")
    local, one = both.points, np.ones(len(points))
    parts = [spectra(local, column[np.newaxis].copy(), one, both.exponents, 3) for column in noisy.T]
    pooled = Spectrum.pooled(Spectrum(e * both.radius**3, c[0], len(points)) for e, c in parts)
    assert both.smoothing.value == pytest.approx(choose_by_gcv(pooled), rel=GCV_CHOICE)
    given = RBFInterpolant.fit(points, noisy, smoothing=both.smoothing.value)
    np.testing.assert_array_equal(both(queries), given(queries))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("kernel", KERNELS)
def test_the_kernel_is_positive_definite_where_the_tail_vanishes(kernel, d):
    points, _, _ = waves(d, 40)
    phi = as_kernel(kernel, d)
    null = np.linalg.svd(reference.polynomials(points, phi.least_degree).T)[2][
        reference.polynomials(points, phi.least_degree).shape[1] :
    ]
    matrix = null @ phi(reference.distances(points, points)) @ null.T
    assert np.linalg.eigvalsh(matrix).min() > 0


@pytest.mark.parametrize("kernel", KERNELS)
def test_its_own_polynomials_are_reproduced_whatever_the_smoothing(kernel):
    points, _, queries = waves(3)
    degree = least(kernel, 3) + 1
    terms = len(reference.powers(3, degree))
    coefficients = np.random.default_rng(2).normal(size=terms)
    field = RBFInterpolant.fit(
        points, reference.polynomials(points, degree) @ coefficients, kernel=kernel, degree=degree, smoothing=7.0
    )
    close(field(queries), reference.polynomials(queries, degree) @ coefficients, SCIPY_PARITY)


@pytest.mark.parametrize("kernel", KERNELS)
def test_much_smoothing_is_the_least_squares_polynomial(kernel):
    points, values, queries = waves(2)
    degree = least(kernel, 2) + 1
    field = RBFInterpolant.fit(points, values, kernel=kernel, degree=degree, smoothing=1e10)
    coefficients = np.linalg.lstsq(reference.polynomials(points, degree), values)[0]
    close(field(queries), reference.polynomials(queries, degree) @ coefficients, LEAST_SQUARES_LIMIT)


@pytest.mark.parametrize("kernel", KERNELS)
def test_an_outlier_that_is_not_trusted_is_ignored(kernel):
    points, values, queries = waves(2)
    degree = least(kernel, 2)
    wrong, weights = values.copy(), np.ones(len(values))
    wrong[0], weights[0] = 1e3, 1e-12
    field = RBFInterpolant.fit(points, wrong, kernel=kernel, degree=degree, smoothing=1e-3, weights=weights)
    without = RBFInterpolant.fit(points[1:], values[1:], kernel=kernel, degree=degree, smoothing=1e-3)
    close(field(queries), without(queries), OUTLIER)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("d", [1, 2, 3])
def test_scale_and_shift_may_be_huge(kernel, d):
    points, values, queries = waves(d)
    degree = least(kernel, d)
    plain = RBFInterpolant.fit(points, values, kernel=kernel, degree=degree)
    for scale, shift in ((1e-50, 0.0), (1e50, 0.0), (1e50, 1e55)):
        field = RBFInterpolant.fit(scale * points + shift, values, kernel=kernel, degree=degree)
        close(field(scale * queries + shift), plain(queries), EXTREME_DOMAIN)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_one_point_is_a_constant(d):
    field = RBFInterpolant.fit([[0.5] * d], [3.0], kernel="linear", degree=0)
    np.testing.assert_allclose(field([[0.5] * d, [0.7] * d]), field([[0.5] * d])[0], rtol=0, atol=ROUNDING)
    assert field([[0.5] * d])[0] == pytest.approx(3.0, rel=ROUNDING)


def test_too_few_or_collinear_points_are_told_with_the_rank():
    line = np.column_stack([np.linspace(0, 1, 20), np.linspace(0, 2, 20)])
    with pytest.raises(IllPosedError, match="rank 2 of the 3 terms"):
        RBFInterpolant.fit(line, line[:, 0], kernel="thin_plate_spline", degree=1)
    with pytest.raises(IllPosedError, match="rank 2 of the 3 terms"):
        RBFInterpolant.fit(line, np.column_stack([line, line]), kernel="thin_plate_spline", degree=1)
    with pytest.raises(IllPosedError, match="rank 1 of the 3 terms"):
        RBFInterpolant.fit(line[:1], [1.0], kernel="thin_plate_spline", degree=1)


@pytest.mark.parametrize("kernel", ["thin_plate_spline", "cubic", "quintic"])
def test_a_tail_below_the_least_degree_is_refused(kernel):
    points, values, _ = waves(2)
    with pytest.raises(IllPosedError, match="at least"):
        RBFInterpolant.fit(points, values, kernel=kernel, degree=least(kernel, 2) - 1)


def test_input_of_other_shapes_is_refused():
    points, values, _ = waves(2)
    for bad in (values[:-1], np.ones((len(values), 2, 2)), np.ones((len(values), 0)), np.array(1.0)):
        with pytest.raises(InputError, match="one value per point"):
            RBFInterpolant.fit(points, bad)
    with pytest.raises(InputError, match="shape"):
        RBFInterpolant.fit(points, values)(np.ones((3, 3)))
    with pytest.raises(InputError, match="unknown 'cosine'"):
        RBFInterpolant.fit(points, values, kernel="cosine")


def test_calls_from_many_threads_give_the_same_bits():
    points, values, queries = waves(3, 400)
    field = RBFInterpolant.fit(points, np.column_stack([values, -values]))
    with ThreadPoolExecutor(8) as pool:
        found = [each.tobytes() for each in pool.map(field, [queries] * 32)]
    assert set(found) == {field(queries).tobytes()}


def test_it_may_be_pickled():
    points, values, queries = waves(2)
    field = RBFInterpolant.fit(points, values, smoothing=0.1)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(field))(queries), field(queries))
