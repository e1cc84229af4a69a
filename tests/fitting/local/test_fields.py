"""What lives in a ball is not pivotal: any Field will do, and the weights sum to one."""

import numpy as np
import pytest

import reference
from o3dleaf import Field, PUInterpolant, RBFInterpolant
from tolerances import FIELD_GRADIENT, FIELD_TWIN, LOCAL_METHOD, ROUNDING

BALLS = (25, 50)


class Polynomial:
    """The second method: a plain least-squares polynomial of degree 2 about the ball's mean."""

    unit = None

    def __init__(self, points, values):
        self.bounds = np.array([points.min(axis=0), points.max(axis=0)])
        self.mean = points.mean(axis=0)
        self.exponents = np.array(reference.powers(points.shape[1], 2))
        self.coefficients = np.linalg.lstsq(self.matrix(points), values)[0]

    def matrix(self, points):
        return np.prod((points - self.mean)[:, None] ** self.exponents, axis=2)

    def __call__(self, points):
        return self.matrix(points) @ self.coefficients

    def gradient(self, points):
        columns = []
        for axis in range(points.shape[1]):
            lower = np.maximum(self.exponents - (np.arange(points.shape[1]) == axis), 0)
            factor = self.exponents[:, axis] * np.prod((points - self.mean)[:, None] ** lower, axis=2)
            columns.append(factor @ self.coefficients)
        return np.array(columns).T


class Constant(Polynomial):
    def __init__(self, points, values):
        super().__init__(points, np.zeros(len(values)))
        self.coefficients[self.exponents.sum(axis=1) == 0] = 1.0


def wavy(d, count=300):
    rng = np.random.default_rng(d)
    points, queries = rng.uniform(-1, 2, (2, count, d))
    return points, np.sin(2 * points).sum(axis=1), queries


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_the_weights_sum_to_one_everywhere(d):
    points, values, queries = wavy(d)
    field = PUInterpolant.fit(points, values, local=Constant, points_per_ball=BALLS)
    at = np.vstack([np.clip(queries, *field.bounds), field.bounds, points, field.cover.centers])
    np.testing.assert_allclose(field(at), 1.0, rtol=ROUNDING)
    reach = 1 / field.cover.radii.min()
    np.testing.assert_allclose(field.gradient(at), 0.0, atol=100 * ROUNDING * reach)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_least_squares_polynomial_a_ball_is_blended_by_the_same_formula(d):
    points, values, queries = wavy(d)
    field = PUInterpolant.fit(points, values, local=Polynomial, points_per_ball=BALLS, bounds=[[-1.1] * d, [2.1] * d])
    assert isinstance(Polynomial(points, values), Field)
    expected = reference.partition_of_unity(queries, field.cover.centers, field.cover.radii, field.local.fields)
    np.testing.assert_allclose(field(queries), expected, rtol=0, atol=FIELD_TWIN)
    at = np.vstack([queries, points[:20], field.cover.centers])
    differences = reference.difference(field, at)
    np.testing.assert_allclose(field.gradient(at), differences, rtol=0, atol=FIELD_GRADIENT * np.abs(differences).max())


def test_the_choice_of_the_local_method_is_not_pivotal():
    """With small balls, spline and polynomial find the truth, the waves of which are of size one, equally well."""
    points, values, queries = wavy(2, 4000)
    inside = queries[np.all((queries > -0.9) & (queries < 1.9), axis=1)]
    truth = np.sin(2 * inside).sum(axis=1)
    spline = PUInterpolant.fit(points, values, points_per_ball=BALLS)
    polynomial = PUInterpolant.fit(points, values, local=Polynomial, points_per_ball=BALLS)
    for field in (spline, polynomial):
        assert np.sqrt(np.mean((field(inside) - truth) ** 2)) < LOCAL_METHOD


@pytest.mark.parametrize("d", [1, 2, 3])
def test_splines_put_in_as_fields_equal_the_compiled_path(d):
    points, values, queries = wavy(d)
    compiled = PUInterpolant.fit(points, values, smoothing=0.1, points_per_ball=BALLS)
    plain = PUInterpolant.fit(
        points, values, local=lambda p, f: RBFInterpolant.fit(p, f, smoothing=0.1), points_per_ball=BALLS
    )
    at = np.clip(np.vstack([queries, points, compiled.cover.centers]), *compiled.bounds)
    np.testing.assert_allclose(compiled(at), plain(at), rtol=0, atol=FIELD_TWIN)
    slopes = plain.gradient(at)
    np.testing.assert_allclose(compiled.gradient(at), slopes, rtol=0, atol=FIELD_TWIN * np.abs(slopes).max())
