"""Many balls: the blend is the literal double loop, its gradient is exact, and polynomials pass through."""

import math
from itertools import pairwise

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats.qmc import Halton

import reference
from o3dleaf import Field, PUInterpolant, RBFInterpolant, polyharmonic
from o3dleaf.core import progress
from o3dleaf.core.errors import IllPosedError, InputError, UnitError
from o3dleaf.core.units import unit_scale
from o3dleaf.fitting.local.splines import Splines
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from tolerances import (
    FIELD_GRADIENT,
    FIELD_TWIN,
    POLYNOMIAL,
    POLYNOMIAL_SLOPE,
    RHO_LIMIT,
    ROUNDING,
)

BALLS = (25, 50)


def wavy(d, count=220):
    """Scattered points, no two of which nearly coincide, a wavy function of them, and queries among them."""
    rng = np.random.default_rng(0)
    points = 3 * Halton(d, rng=rng).random(count) - 1
    return points, np.sin(2 * points).sum(axis=1) + points[:, 0] ** 2, rng.uniform(-0.9, 1.9, (60, d))


def everywhere(field, points, queries):
    """Queries, some data points, and the balls' centres."""
    inside = np.clip(queries, *field.bounds)
    return np.vstack([inside, points[:20], field.cover.centers[:20]])


@pytest.mark.few
@pytest.mark.parametrize("rule", [{}, {"smoothing": 0.2}], ids=["exact", "smoothed"])
@pytest.mark.parametrize(("power", "d"), [(1, 1), (3, 1), (2, 2), (4, 2), (3, 2), (1, 3), (3, 3), (5, 3), (2, 4)])
def test_it_equals_the_literal_double_loop(power, d, rule):
    points, values, queries = wavy(d)
    kernel = Polyharmonic(power, d)
    field = PUInterpolant.fit(points, values, kernel=kernel, points_per_ball=BALLS, **rule)
    centres, radii = field.cover.centers, field.cover.radii
    assert len(radii) > 3
    rows = [reference.members(points, c, r, BALLS[0]) for c, r in zip(centres, radii, strict=True)]
    local = [reference.solve_spline(points[r], values[r], power, kernel.degree, rule.get("smoothing", 0)) for r in rows]
    at = everywhere(field, points, queries)
    expected = reference.partition_of_unity(at, centres, radii, local)
    np.testing.assert_allclose(field(at), expected, rtol=0, atol=FIELD_TWIN * np.abs(values).max())


def test_rho_enters_each_ball_with_its_own_number_of_points():
    points, values, queries = wavy(3)
    field = PUInterpolant.fit(points, values, rho=1e-3, points_per_ball=BALLS)
    centres, radii = field.cover.centers, field.cover.radii
    rows = [reference.members(points, c, r, BALLS[0]) for c, r in zip(centres, radii, strict=True)]
    assert len({len(r) for r in rows}) > 3
    local = [
        reference.solve_spline(points[r], values[r], 3, 2, 1e-3 * len(r) / abs(reference.theta(3, 3))) for r in rows
    ]
    at = everywhere(field, points, queries)
    expected = reference.partition_of_unity(at, centres, radii, local)
    np.testing.assert_allclose(field(at), expected, rtol=0, atol=FIELD_TWIN * np.abs(values).max())


def test_the_paper_s_rho_in_one_ball_is_96_pi_rho_n():
    points, values, _ = wavy(3)
    field = PUInterpolant.fit(points, values, rho=3e-5, points_per_ball=len(points))
    assert len(field.cover.radii) == 1
    expected = reference.solve_spline(points, values, 3, 2, 96 * math.pi * 3e-5 * len(points))
    np.testing.assert_allclose(field(points), expected(points), rtol=0, atol=FIELD_TWIN * np.abs(values).max())


@pytest.mark.parametrize("rule", [{}, {"smoothing": 0.2}, {"rho": 1e-3}, {"rho": "gcv"}], ids=str)
@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_one_ball_around_everything_is_the_single_interpolant(d, rule):
    points, values, queries = wavy(d)
    kernel = polyharmonic((d + 3) // 2, d)
    many = PUInterpolant.fit(points, values, kernel=kernel, points_per_ball=len(points), **rule)
    one = RBFInterpolant.fit(points, values, kernel=kernel, **rule)
    at = np.clip(np.vstack([queries, points]), *many.bounds)
    np.testing.assert_allclose(many(at), one(at), rtol=0, atol=FIELD_TWIN * np.abs(values).max())
    slopes = one.gradient(at)
    np.testing.assert_allclose(many.gradient(at), slopes, rtol=0, atol=10 * FIELD_TWIN * np.abs(slopes).max())


@pytest.mark.parametrize(("power", "d"), [(3, 1), (2, 2), (4, 2), (3, 3), (5, 3), (4, 4)])
def test_the_gradient_is_the_difference_quotient_at_centres_and_data_points_too(power, d):
    points, values, queries = wavy(d)
    field = PUInterpolant.fit(
        points,
        values,
        kernel=Polyharmonic(power, d),
        points_per_ball=BALLS,
        smoothing=0.1,
        bounds=[[-1.1] * d, [2.1] * d],
    )  # the larger bounds keep the data inside, where differences are two-sided
    at = everywhere(field, points if power > 2 else queries, queries)
    expected = reference.difference(field, at)
    np.testing.assert_allclose(field.gradient(at), expected, rtol=0, atol=FIELD_GRADIENT * np.abs(expected).max())


@pytest.mark.parametrize("kernel", ["linear", "thin_plate_spline", "cubic", "quintic"])
def test_the_gradient_is_finite_at_centres_and_data_points_for_any_kernel(kernel):
    points, values, queries = wavy(3)
    field = PUInterpolant.fit(points, values, kernel=kernel, points_per_ball=BALLS)
    assert np.isfinite(field.gradient(everywhere(field, points, queries))).all()


@settings(max_examples=12)
@given(
    seed=st.integers(0, 2**31),
    d=st.integers(1, 3),
    degree=st.integers(1, 2),
    shift=st.sampled_from([0.0, 1e6, -1e6]),
    scale=st.sampled_from([1e-3, 1.0]),
    rule=st.sampled_from([{}, {"smoothing": 1.0}]),
)
def test_polynomials_of_the_tail_s_degree_are_reproduced(seed, d, degree, shift, scale, rule):
    rng = np.random.default_rng(seed)
    points = shift + scale * rng.random((300, d))
    coefficients = rng.uniform(-1, 1, len(reference.powers(d, degree)))

    def shape(u):
        return reference.polynomials(u, degree) @ coefficients

    def polynomial(x):
        return shape((x - shift) / scale)

    field = PUInterpolant.fit(points, polynomial(points), degree=degree, points_per_ball=BALLS, **rule)
    queries = rng.uniform(*field.bounds, (200, d))
    np.testing.assert_allclose(field(queries), polynomial(queries), rtol=0, atol=POLYNOMIAL)
    slopes = reference.difference(shape, (queries - shift) / scale, 0.1)
    np.testing.assert_allclose(scale * field.gradient(queries), slopes, rtol=0, atol=POLYNOMIAL_SLOPE)


def test_a_large_rho_gives_each_ball_its_least_squares_polynomial():
    points, values, queries = wavy(2)
    field = PUInterpolant.fit(points, values, kernel="thin_plate_spline", rho=1e9, points_per_ball=BALLS)
    centres, radii = field.cover.centers, field.cover.radii

    def least_squares(rows, centre):
        solution = np.linalg.lstsq(reference.polynomials(points[rows] - centre, 1), values[rows])[0]
        return lambda x: reference.polynomials(x - centre, 1) @ solution

    local = [least_squares(reference.members(points, c, r, BALLS[0]), c) for c, r in zip(centres, radii, strict=True)]
    expected = reference.partition_of_unity(queries, centres, radii, local)
    np.testing.assert_allclose(field(queries), expected, rtol=0, atol=RHO_LIMIT)


def test_weights_divide_each_ball_s_diagonal():
    points, values, queries = wavy(3)
    weights = np.random.default_rng(1).uniform(0.5, 2, len(points))
    field = PUInterpolant.fit(points, values, smoothing=0.3, weights=weights, points_per_ball=BALLS)
    centres, radii = field.cover.centers, field.cover.radii
    rows = [reference.members(points, c, r, BALLS[0]) for c, r in zip(centres, radii, strict=True)]
    local = [reference.solve_spline(points[r], values[r], 3, 2, 0.3 / weights[r]) for r in rows]
    expected = reference.partition_of_unity(queries, centres, radii, local)
    np.testing.assert_allclose(field(queries), expected, rtol=0, atol=FIELD_TWIN * np.abs(values).max())


def test_it_is_a_field_with_bounds_and_unit_and_takes_a_flat_or_an_empty_query():
    points, values, _ = wavy(3)
    field = PUInterpolant.fit(points, values, points_per_ball=40, unit="mm", bounds=[[-2] * 3, [3] * 3])
    assert isinstance(field, Field)
    assert unit_scale(field.unit, "um") == pytest.approx(1000)
    np.testing.assert_array_equal(field.bounds, [[-2] * 3, [3] * 3])
    assert field.cover.counts.max() <= 40
    assert field(points[0]).shape == (1,)
    assert field(np.empty((0, 3))).shape == (0,)
    assert field.gradient(np.empty((0, 3))).shape == (0, 3)
    np.testing.assert_allclose(field(points), values, rtol=0, atol=FIELD_TWIN * np.abs(values).max())


@pytest.mark.parametrize("rule", [{}, {"rho": "gcv"}, {"rho": "gcv-per-ball"}], ids=str)
def test_progress_rises_to_its_total(rule):
    points, values, _ = wavy(3)
    seen = []
    with progress.listening(lambda *done: seen.append(done)):
        field = PUInterpolant.fit(points, values, points_per_ball=BALLS, **rule)
        assert seen[-1][0] == seen[-1][1]
    assert all(one < other for (one, _), (other, _) in pairwise(seen))
    assert len(seen) >= len(field.cover.radii)


def test_any_kind_of_whole_number_says_how_large_the_balls_are():
    points, values, queries = wavy(3)
    expected = PUInterpolant.fit(points, values, points_per_ball=(25, 50))(queries)
    for size in (50, np.int64(50), np.uint8(50), np.array(50), (np.int32(25), 50), np.array([25, 50]), [25, 50]):
        np.testing.assert_array_equal(PUInterpolant.fit(points, values, points_per_ball=size)(queries), expected)
    for size in (50.0, "50", (25, 50, 75), (25.0, 50), np.array([50.0])):
        with pytest.raises(InputError, match=r"points_per_ball: is .*; give a whole number"):
            PUInterpolant.fit(points, values, points_per_ball=size)


def test_a_local_fit_says_how_large_its_balls_are_unless_the_caller_does():
    points, values, queries = wavy(3)
    local = Splines(points_per_ball=50)
    for asked, size in ((None, 50), (80, 80)):
        expected = PUInterpolant.fit(points, values, points_per_ball=size)(queries)
        found = PUInterpolant.fit(points, values, local=local, points_per_ball=asked)(queries)
        np.testing.assert_array_equal(found, expected)


def test_what_is_printed_is_one_line_that_counts():
    points, values, _ = wavy(3, 1234)
    field = PUInterpolant.fit(points, values, points_per_ball=BALLS, unit="mm")
    assert repr(field) == f"PUInterpolant(3-D, 1,234 points in {len(field.cover.radii)} balls, unit mm)"
    assert repr(RBFInterpolant.fit(points[:50], values[:50])) == "RBFInterpolant(3-D, 50 points, r^3)"
    for part in (field.cover, field.index, field.local, field.diagnostics([0])):
        assert len(repr(part)) < 80


def test_bad_input_is_named():
    points, values, _ = wavy(3)
    field = PUInterpolant.fit(points, values)
    hole = points.copy()
    hole[3, 1] = np.nan
    for call in (field, field.gradient, lambda x: PUInterpolant.fit(x, values)):
        with pytest.raises(InputError, match="1 values are NaN or infinite, the first at index \\(3, 1\\)"):
            call(hole)
    with pytest.raises(InputError, match="at least 1"):
        PUInterpolant.fit(np.empty((0, 3)), np.empty(0))
    with pytest.raises(InputError, match="do not contain all the points"):
        PUInterpolant.fit(points, values, bounds=[[0, 0, 0], [1, 1, 1]])
    with pytest.raises(InputError, match="the lower, then the upper one"):
        PUInterpolant.fit(points, values, bounds=[[1, 1, 1], [0, 0, 0]])
    with pytest.raises(InputError, match="above zero"):
        PUInterpolant.fit(points, values, weights=np.zeros(len(points)))
    with pytest.raises(IllPosedError, match="needs at least 1"):
        PUInterpolant.fit(points, values, degree=0)
    with pytest.raises(UnitError, match="parsec"):
        PUInterpolant.fit(points, values, unit="parsec")


def test_inputs_are_left_alone():
    points, values, queries = wavy(3)
    bounds = np.array([[-2.0] * 3, [3.0] * 3])
    for array in (points, values, queries, bounds):
        array.setflags(write=False)
    field = PUInterpolant.fit(points, values, rho="gcv", bounds=bounds, points_per_ball=BALLS)
    field(queries)
    field.gradient(queries)


def test_the_order_of_the_data_matters_to_rounding_only():
    points, values, queries = wavy(3)
    order = np.random.default_rng(3).permutation(len(points))
    plain, mixed = (
        PUInterpolant.fit(points[o], values[o], points_per_ball=BALLS) for o in (np.arange(len(points)), order)
    )
    np.testing.assert_allclose(plain(queries), mixed(queries), rtol=0, atol=FIELD_TWIN * np.abs(values).max())
    assert plain.cover.radii == pytest.approx(mixed.cover.radii, rel=ROUNDING)


def test_open3d_tensors_are_arrays():
    """What a tensor cloud holds goes in as it is, to be fitted and asked for."""
    rng = np.random.default_rng(2)
    points, values = rng.random((300, 3)), rng.random(300)
    held = o3d.core.Tensor(points)
    field = PUInterpolant.fit(held, o3d.core.Tensor(values))
    assert np.array_equal(field(held), PUInterpolant.fit(points, values)(points))
