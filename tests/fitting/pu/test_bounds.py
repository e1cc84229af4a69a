"""Outside its bounds a blended field is its value at the nearest point less the distance to it."""

import numpy as np
import pytest

import reference
from o3dleaf.core.errors import InputError
from o3dleaf.core.outside_loops import fall_outside
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from tolerances import FIELD_GRADIENT, RIM, ROUNDING


@pytest.fixture(scope="module")
def field():
    points = np.random.default_rng(0).random((200, 3))
    return PUInterpolant.fit(points, np.sin(3 * points).sum(axis=1), points_per_ball=60)


def outside(field, count=200):
    """Queries beyond faces, edges and corners."""
    low, high = field.bounds
    queries = np.random.default_rng(1).uniform(low - 2, high + 2, (count, 3))
    return queries[np.any((queries < low) | (queries > high), axis=1)]


def test_the_value_is_the_nearest_one_less_the_distance(field):
    queries = outside(field)
    nearest = np.clip(queries, *field.bounds)
    expected = field(nearest) - np.linalg.norm(queries - nearest, axis=1)
    np.testing.assert_allclose(field(queries), expected, rtol=ROUNDING, atol=ROUNDING)


def test_the_gradient_outside_is_the_difference_quotient(field):
    queries = outside(field)
    expected = reference.difference(field, queries)
    np.testing.assert_allclose(field.gradient(queries), expected, rtol=0, atol=FIELD_GRADIENT)


def test_it_is_continuous_across_the_bounds(field):
    low, high = field.bounds
    rim = np.random.default_rng(2).uniform(low, high, (50, 3))
    rim[:, 0] = high[0]
    np.testing.assert_allclose(field(rim + [1e-12, 0, 0]), field(rim), rtol=0, atol=RIM)


def test_far_away_is_outside_and_finite(field):
    far = np.array([[1e6, -1e6, 1e6]])
    assert field(far)[0] < -1e6
    np.testing.assert_allclose(np.linalg.norm(field.gradient(far), axis=1), 1.0, rtol=ROUNDING)


def test_outside_a_field_falls_with_the_distance_along_the_way_out():
    bounds, points = np.array([[0.0, 0.0], [1.0, 2.0]]), np.array([[0.5, 1.0], [-3.0, 1.0], [4.0, 6.0], [1.0, 2.0]])
    jets = np.repeat([[10.0], [7.0], [8.0], [1.0], [2.0], [3.0]], 4, axis=1)
    fall_outside(0, 4, jets, points, bounds, np.zeros(2))
    np.testing.assert_array_equal(jets[0], [10, 7, 5, 10])
    np.testing.assert_allclose(jets[1:3].T, [[7, 8], [1, 8], [-0.6, -0.8], [7, 8]], rtol=ROUNDING)
    np.testing.assert_array_equal(jets[3:, [0, 3]].T, [[1, 2, 3]] * 2)
    np.testing.assert_allclose(jets[3:, 2], [(0.36 - 1) / 5, 0.48 / 5, (0.64 - 1) / 5], rtol=ROUNDING)


def test_along_an_axis_that_repeats_there_is_no_outside():
    bounds, points = np.array([[0.0, 0.0], [1.0, 2.0]]), np.array([[-3.0, 1.0], [4.0, 6.0]])
    jets = np.ones((1, 2))
    fall_outside(0, 2, jets, points, bounds, np.array([1.0, 0.0]))
    np.testing.assert_array_equal(jets, [[1, -3]])


def test_a_query_that_is_no_point_is_an_error(field):
    for bad in (np.nan, np.inf, -np.inf):
        for call in (field, field.gradient):
            with pytest.raises(InputError, match="NaN or infinite"):
                call([[0.5, bad, 0.5]])
