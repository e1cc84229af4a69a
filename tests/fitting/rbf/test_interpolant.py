"""One interpolant: it is the dense saddle-point solution, reproduces polynomials, and says when it cannot."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RBFInterpolator

import reference
from o3dleaf import Field, RBFInterpolant, polyharmonic
from o3dleaf.core.errors import IllPosedError, InputError, UnitError
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from tolerances import FIELD_GRADIENT, FIELD_TWIN, MEAN_OF_DUPLICATES, POLYNOMIAL, SCIPY, SIMILARITY

KERNELS = ["linear", "thin_plate_spline", "cubic", "quintic"]
SCIPY_CASES = [(name, least + more) for least, name in zip((0, 1, 1, 2), KERNELS, strict=True) for more in (0, 1)]
EVERY_KERNEL_AND_DIMENSION = [(power, d) for power in (1, 2, 3, 4, 5) for d in (1, 2, 3, 4)]


def scattered(d, count=60, seed=0):
    """Points in a box that is not the unit box, a wavy function of them, and queries in the same box."""
    rng = np.random.default_rng(seed)
    points, queries = rng.uniform(-2, 3, (2, count, d))
    return points, np.sin(points).sum(axis=1) + points[:, 0] ** 2, queries


@pytest.mark.parametrize("smoothing", [0.0, 0.3])
@pytest.mark.parametrize(("power", "d"), EVERY_KERNEL_AND_DIMENSION)
def test_it_equals_the_dense_saddle_point_solution(power, d, smoothing):
    points, values, queries = scattered(d)
    kernel = Polyharmonic(power, d)
    fast = RBFInterpolant.fit(points, values, kernel=kernel, smoothing=smoothing)
    slow = reference.solve_spline(points, values, power, kernel.degree, smoothing)
    at = np.vstack([queries, points])
    np.testing.assert_allclose(fast(at), slow(at), rtol=0, atol=FIELD_TWIN * np.abs(values).max())


@pytest.mark.parametrize("smoothing", [0.0, 0.1])
@pytest.mark.parametrize(("kernel", "degree"), SCIPY_CASES)
@pytest.mark.parametrize("d", [1, 2, 3])
def test_it_equals_scipy(kernel, degree, smoothing, d):
    points, values, queries = scattered(d)
    ours = RBFInterpolant.fit(points, values, kernel=kernel, degree=degree, smoothing=smoothing)
    theirs = RBFInterpolator(points, values, kernel=kernel, degree=degree, smoothing=smoothing)
    at = np.vstack([queries, points])
    np.testing.assert_allclose(ours(at), theirs(at), rtol=0, atol=SCIPY * np.abs(values).max())


@pytest.mark.parametrize(("power", "d"), EVERY_KERNEL_AND_DIMENSION)
def test_the_gradient_is_the_difference_quotient_at_data_points_too(power, d):
    points, values, queries = scattered(d)
    field = RBFInterpolant.fit(points, values, kernel=Polyharmonic(power, d), smoothing=0.1)
    at = queries if power < 3 else np.vstack([queries, points])  # r has no gradient at 0, r² log r no second one
    expected = reference.difference(field, at)
    np.testing.assert_allclose(field.gradient(at), expected, rtol=0, atol=FIELD_GRADIENT * np.abs(expected).max())


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_gradient_is_finite_at_data_points(kernel):
    points, values, _ = scattered(3)
    assert np.isfinite(RBFInterpolant.fit(points, values, kernel=kernel).gradient(points)).all()


@settings(max_examples=15)
@given(
    seed=st.integers(0, 2**31),
    d=st.integers(1, 4),
    degree=st.integers(1, 3),
    shift=st.sampled_from([0.0, 1e3, -1e6]),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
    smoothing=st.sampled_from([0.0, 10.0]),
)
def test_polynomials_of_its_degree_are_reproduced(seed, d, degree, shift, scale, smoothing):
    """Smoothed or not, far from the origin and at any size: their energy is zero."""
    rng = np.random.default_rng(seed)
    points, queries = shift + scale * rng.random((2, 60, d))
    coefficients = rng.uniform(-1, 1, len(reference.powers(d, degree)))

    def polynomial(x):
        return reference.polynomials((x - shift) / scale, degree) @ coefficients

    field = RBFInterpolant.fit(points, polynomial(points), degree=degree, smoothing=smoothing)
    np.testing.assert_allclose(field(queries), polynomial(queries), rtol=0, atol=POLYNOMIAL)


@settings(max_examples=15)
@given(scale=st.floats(1e-3, 1e3), shift=st.floats(-10, 10), d=st.integers(1, 3))
def test_a_change_of_unit_changes_nothing_when_rho_changes_with_it(scale, shift, d):
    """ρ has the unit length^(2m − d); the shift shows that nothing depends on the origin."""
    points, values, queries = scattered(d)
    kernel = polyharmonic(2, d)
    plain = RBFInterpolant.fit(points, values, kernel=kernel, rho=1e-3)
    moved = RBFInterpolant.fit(scale * (points + shift), values, kernel=kernel, rho=1e-3 * scale**kernel.power)
    np.testing.assert_allclose(moved(scale * (queries + shift)), plain(queries), rtol=0, atol=SIMILARITY)
    gradient = scale * moved.gradient(scale * (queries + shift))
    np.testing.assert_allclose(gradient, plain.gradient(queries), rtol=0, atol=SIMILARITY)


def test_without_smoothing_it_takes_the_values():
    points, values, _ = scattered(3)
    for kernel in KERNELS:
        field = RBFInterpolant.fit(points, values, kernel=kernel)
        np.testing.assert_allclose(field(points), values, rtol=0, atol=FIELD_TWIN * np.abs(values).max())


@pytest.mark.filterwarnings("ignore::o3dleaf.core.errors.DataWarning")
def test_points_on_a_plane_cannot_determine_a_tail_that_was_asked_for():
    points, values, _ = scattered(2)
    plane = points @ np.array([[1.0, 2.0, 0.5], [0.0, 1.0, -1.0]])
    with pytest.raises(IllPosedError, match="60 points determine rank 3 of the 4 terms of degree 1; lower"):
        RBFInterpolant.fit(plane, values, degree=1)
    with pytest.raises(IllPosedError, match="rank 6 of the 10"):
        RBFInterpolant.fit(plane, values, degree=2)
    with pytest.raises(IllPosedError, match="rank 1 of the 4"):
        RBFInterpolant.fit(np.ones((5, 3)), np.ones(5), degree=1)
    np.testing.assert_allclose(RBFInterpolant.fit(plane, values)(plane), values, rtol=0, atol=FIELD_TWIN * 10)


def test_a_degree_below_the_order_of_the_kernel_is_refused():
    points, values, _ = scattered(3)
    with pytest.raises(IllPosedError, match="is 1; this kernel needs at least 2"):
        RBFInterpolant.fit(points, values, kernel="quintic", degree=1)


@pytest.mark.filterwarnings("ignore::o3dleaf.core.errors.DataWarning")
def test_coinciding_points_are_fitted_through_their_mean():
    points, values, queries = scattered(3)
    twice = np.vstack([points, points[:4]])
    apart = np.concatenate([values, values[:4] + 0.5])
    mean = values + 0.25 * (np.arange(len(values)) < 4)
    expected = RBFInterpolant.fit(points, mean)
    field = RBFInterpolant.fit(twice, apart)
    np.testing.assert_allclose(field(queries), expected(queries), rtol=0, atol=MEAN_OF_DUPLICATES)
    np.testing.assert_allclose(field(points), mean, rtol=0, atol=MEAN_OF_DUPLICATES)


def test_weights_divide_the_diagonal_and_a_weight_of_two_is_the_point_twice():
    points, values, queries = scattered(3)
    weights = np.where(np.arange(len(points)) < 5, 2.0, 1.0)
    weighted = RBFInterpolant.fit(points, values, smoothing=0.4, weights=weights)
    slow = reference.solve_spline(points, values, 3, 2, 0.4 / weights)
    np.testing.assert_allclose(weighted(queries), slow(queries), rtol=0, atol=FIELD_TWIN * np.abs(values).max())
    twice = np.vstack([points, points[:5]]), np.concatenate([values, values[:5]])
    doubled = RBFInterpolant.fit(*twice, smoothing=0.4)
    np.testing.assert_allclose(weighted(queries), doubled(queries), rtol=0, atol=FIELD_TWIN * np.abs(values).max())


def test_it_is_a_field_with_bounds_and_unit():
    points, values, _ = scattered(3)
    field = RBFInterpolant.fit(points, values, unit="µm")
    assert isinstance(field, Field)
    assert field.unit == "um"
    np.testing.assert_array_equal(field.bounds, [points.min(axis=0), points.max(axis=0)])
    assert field(np.empty((0, 3))).shape == (0,)
    assert field.gradient(np.empty((0, 3))).shape == (0, 3)
    assert field(points[0]).shape == (1,)


def test_inputs_are_left_alone():
    points, values, queries = scattered(3)
    for array in (points, values, queries):
        array.setflags(write=False)
    field = RBFInterpolant.fit(points, values, rho="gcv")
    field(queries)
    field.gradient(queries)


def test_bad_input_is_named():
    points, values, _ = scattered(3)
    field = RBFInterpolant.fit(points, values)
    hole = points.copy()
    hole[3, 1] = np.nan
    with pytest.raises(InputError, match="1 values are NaN or infinite, the first at index \\(3, 1\\)"):
        RBFInterpolant.fit(hole, values)
    with pytest.raises(InputError, match="NaN"):
        field(hole)
    with pytest.raises(InputError, match="NaN"):
        field.gradient(hole)
    with pytest.raises(InputError, match="one value per point"):
        RBFInterpolant.fit(points, values[:-1])
    with pytest.raises(InputError, match="at least 1"):
        RBFInterpolant.fit(np.empty((0, 3)), np.empty(0))
    with pytest.raises(InputError, match="\\(n, 3\\)"):
        field(points[:, :2])
    with pytest.raises(UnitError, match="furlong"):
        RBFInterpolant.fit(points, values, unit="furlong")
