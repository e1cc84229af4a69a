"""Outside its bounds a blended field goes on as the local fits of the nearest point's balls do."""

import numpy as np
import pytest

import reference
from o3dleaf import RBFInterpolant, get_num_threads, set_num_threads
from o3dleaf.core.errors import InputError
from o3dleaf.core.outside_loops import fall_outside
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from tolerances import FIELD_GRADIENT, FIELD_HESSIAN_OUTSIDE, OUTSIDE_POLYNOMIAL, RIM, ROUNDING


@pytest.fixture(scope="module")
def data():
    points = np.random.default_rng(0).random((200, 3))
    return points, np.sin(3 * points).sum(axis=1)


@pytest.fixture(scope="module")
def field(data):
    return PUInterpolant.fit(*data, points_per_ball=60)


@pytest.fixture(scope="module")
def oriented():
    """Points and normals of a sphere, fitted with values and gradients."""
    normals = np.random.default_rng(3).normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return PUInterpolant.fit_oriented(normals, normals, local="hermite", points_per_ball=60)


def outside(field, count=200, reach=2.0):
    """Queries beyond faces, edges and corners."""
    low, high = field.bounds
    queries = np.random.default_rng(1).uniform(low - reach, high + reach, (count, 3))
    return queries[np.any((queries < low) | (queries > high), axis=1)]


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_polynomials_of_the_tail_are_reproduced_outside(data, degree):
    points, _ = data
    coefficients = np.random.default_rng(2).normal(size=len(reference.powers(3, degree)))
    values = reference.polynomials(points, degree) @ coefficients
    kernel = "linear" if degree == 1 else "cubic"
    field = PUInterpolant.fit(points, values, kernel=kernel, degree=degree, points_per_ball=60)
    for reach in (0.1, 2.0, 30.0):
        queries = outside(field, reach=reach)
        expected = reference.polynomials(queries, degree) @ coefficients
        np.testing.assert_allclose(field(queries), expected, rtol=0, atol=OUTSIDE_POLYNOMIAL * np.abs(expected).max())


def test_one_ball_goes_on_as_its_spline(data):
    """A field of one ball is that ball's fit, everywhere."""
    field, spline = PUInterpolant.fit(*data, points_per_ball=500), RBFInterpolant.fit(*data)
    queries = outside(field)
    np.testing.assert_allclose(field(queries), spline(queries), rtol=0, atol=OUTSIDE_POLYNOMIAL)
    np.testing.assert_allclose(field.gradient(queries), spline.gradient(queries), rtol=0, atol=OUTSIDE_POLYNOMIAL)


def test_it_is_the_literal_sum_of_the_nearest_points_weights(data):
    """The rule, written out: w_i at the nearest point of the box, F_i at the point itself."""
    one = PUInterpolant.fit(*data, points_per_ball=60, local=RBFInterpolant.fit)
    queries, cover = outside(one, 40), one.cover
    nearest = np.clip(queries, *one.bounds)
    tau = np.linalg.norm(nearest[:, np.newaxis] - cover.centers, axis=2) / cover.radii
    weights = np.maximum(1 - tau, 0) ** 4 * (4 * tau + 1)
    fits = np.stack([fit(queries) for fit in one.local.fields], axis=1)
    expected = (weights * fits).sum(axis=1) / weights.sum(axis=1)
    np.testing.assert_allclose(one(queries), expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    assert (weights > 0).sum(axis=1).max() > 1


@pytest.mark.parametrize("which", ["field", "oriented", "per ball"])
def test_the_gradient_outside_is_the_difference_quotient(which, data, request):
    own = which == "per ball"
    field = (
        PUInterpolant.fit(*data, points_per_ball=60, local=RBFInterpolant.fit)
        if own
        else request.getfixturevalue(which)
    )
    queries = outside(field)
    expected = reference.difference(field, queries)
    scale = max(np.abs(expected).max(), 1.0)
    np.testing.assert_allclose(field.gradient(queries), expected, rtol=0, atol=FIELD_GRADIENT * scale)


def test_the_hessian_outside_is_the_gradients_difference_quotient(field):
    queries = outside(field)
    found, step = field.hessian(queries), 1e-6
    for axis in range(3):
        ahead, behind = queries.copy(), queries.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        expected = (field.gradient(ahead) - field.gradient(behind)) / (2 * step)
        np.testing.assert_allclose(found[:, axis], expected, rtol=0, atol=FIELD_HESSIAN_OUTSIDE * np.abs(found).max())


def test_it_is_continuous_across_the_bounds(field):
    low, high = field.bounds
    rim = np.random.default_rng(2).uniform(low, high, (50, 3))
    rim[:, 0] = high[0]
    np.testing.assert_allclose(field(rim + [1e-12, 0, 0]), field(rim), rtol=0, atol=RIM)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("kernel", ["linear", "cubic", "quintic"])
def test_it_is_finite_at_any_distance(data, kernel, dtype):
    field = PUInterpolant.fit(*data, kernel=kernel, points_per_ball=60)
    ends = np.array([1e3, 1e6, 1e30, 1e154, 1e200, np.finfo(float).max])
    far = np.concatenate([np.outer(ends, toward) for toward in ([1, 0, 0], [-1, 1, 0], [1, -1, 1])])
    assert np.isfinite(field(far, dtype=dtype)).all()
    assert np.isfinite(field.gradient(far, dtype=dtype)).all()
    if kernel != "linear":
        assert np.isfinite(field.hessian(far, dtype=dtype)).all()


def test_neither_threads_nor_company_change_a_bit(field):
    queries, threads = np.concatenate([outside(field, 5000), field.bounds.mean(axis=0)[np.newaxis]]), get_num_threads()
    inside = np.random.default_rng(4).uniform(*field.bounds, (3000, 3))
    try:
        found = []
        for count in (1, 3):
            set_num_threads(count)
            found.append(np.column_stack([field(queries), field.gradient(queries)]))
    finally:
        set_num_threads(threads)
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(field(queries[7:8]), found[0][7:8, 0])
    both = field(np.concatenate([inside, queries]))
    np.testing.assert_array_equal(both, np.concatenate([field(inside), found[0][:, 0]]))


def test_outside_a_falling_field_falls_along_the_way_out():
    bounds, points = np.array([[0.0, 0.0], [1.0, 2.0]]), np.array([[0.5, 1.0], [-3.0, 1.0], [4.0, 6.0], [1.0, 2.0]])
    jets = np.repeat([[10.0], [7.0], [8.0], [1.0], [2.0], [3.0]], 4, axis=1)
    steep = jets.copy()
    fall_outside(0, 4, jets, points, bounds, np.zeros(2), 1.0)
    np.testing.assert_array_equal(jets[0], [10, 7, 5, 10])
    np.testing.assert_allclose(jets[1:3].T, [[7, 8], [1, 8], [-0.6, -0.8], [7, 8]], rtol=ROUNDING)
    np.testing.assert_array_equal(jets[3:, [0, 3]].T, [[1, 2, 3]] * 2)
    np.testing.assert_allclose(jets[3:, 2], [(0.36 - 1) / 5, 0.48 / 5, (0.64 - 1) / 5], rtol=ROUNDING)
    fall_outside(0, 4, steep, points, bounds, np.zeros(2), 3.0)
    np.testing.assert_array_equal(steep[0], [10, 1, -5, 10])
    np.testing.assert_allclose(steep[1:, 2], 3 * jets[1:, 2], rtol=ROUNDING)


def test_along_an_axis_that_repeats_there_is_no_outside():
    bounds, points = np.array([[0.0, 0.0], [1.0, 2.0]]), np.array([[-3.0, 1.0], [4.0, 6.0]])
    jets, period = np.ones((1, 2)), np.array([1.0, 0.0])
    fall_outside(0, 2, jets, points, bounds, period, 1.0)
    np.testing.assert_array_equal(jets, [[1, -3]])
    index = BallIndex.periodic(np.array([[0.5, 1.0]]), np.array([2.0]), bounds, period)
    assert index.is_left(points, index.fold(points)[0])
    assert not index.is_left(points[:1], index.fold(points[:1])[0])


def test_a_query_that_is_no_point_is_an_error(field):
    for bad in (np.nan, np.inf, -np.inf):
        for call in (field, field.gradient):
            with pytest.raises(InputError, match="NaN or infinite"):
                call([[0.5, bad, 0.5]])
