"""Second derivatives of the blend: Leibniz's rule written out, differences of gradients, symmetry, and who has none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats.qmc import Halton

import reference
from o3dleaf import PUInterpolant, RBFInterpolant, TiledField
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.local.fields import LocalFields
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from tolerances import HESSIAN_DIFFERENCE, HESSIAN_KINK, HESSIAN_SEAM, HESSIAN_TWIN, ROUNDING

BALLS = (40, 80)
POWERS, DIMENSIONS = (3, 4, 5, 7), (1, 2, 3, 4)
SMOOTH_KERNELS = [(power, d) for power in POWERS for d in DIMENSIONS]


def wavy(d, count=220):
    rng = np.random.default_rng(0)
    points = 3 * Halton(d, rng=rng).random(count) - 1
    return points, np.sin(2 * points).sum(axis=1) + points[:, 0] ** 2, rng.uniform(-0.9, 1.9, (20, d))


def fitted(power, d, **options):
    points, values, queries = wavy(d)
    rule = {"smoothing": 0.1, "points_per_ball": BALLS, "bounds": [[-1.1] * d, [2.1] * d]} | options
    field = PUInterpolant.fit(points, values, kernel=Polyharmonic(power, d), **rule)
    centres = field.cover.centers
    return field, queries, np.vstack([points[:8], centres[np.all(np.abs(centres - 0.5) < 1.6, axis=1)][:8]])


def bends_by_difference(gradient, at, step):
    """The (n, d, d) central differences of a gradient, a row a component."""
    d = at.shape[1]
    return np.stack([reference.difference(lambda x: gradient(x)[:, a], at, step) for a in range(d)], axis=1)  # noqa: B023


def assert_close(found, expected, share):
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


@pytest.mark.few
@pytest.mark.parametrize("power", POWERS)
@pytest.mark.parametrize("d", DIMENSIONS[::-1])
def test_values_gradients_and_hessians_are_leibniz_s_rule_written_out(power, d):
    """At data sites and balls' centres too, where differences see the kink of the third derivatives."""
    points, values, _ = wavy(d)
    field, queries, special = fitted(power, d)
    centres, radii = field.cover.centers, field.cover.radii
    assert len(radii) > 3
    rows = np.split(field.cover.members, field.cover.offsets[1:-1])
    degree = field.local.kernel.degree
    local = [reference.solve_spline(points[r], values[r], power, degree, 0.1) for r in rows]
    at = np.vstack([queries[:6], special])
    for found, expected in zip(
        (field(at), field.gradient(at), field.hessian(at)),
        reference.blended_jets(at, centres, radii, local),
        strict=True,
    ):
        assert_close(found, expected, HESSIAN_TWIN)


@pytest.mark.few
@pytest.mark.parametrize("tail", [True, False], ids=["tail", "no tail"])
@pytest.mark.parametrize(("power", "d"), SMOOTH_KERNELS)
def test_the_hessian_is_the_difference_of_the_gradient(power, d, tail):
    field, queries, special = fitted(power, d)
    if not tail:
        local = field.local
        nothing = replace(local, tails=np.empty((len(local.tails), 0)), exponents=np.empty((0, d), dtype=np.int64))
        field = replace(field, local=nothing)
    assert_close(field.hessian(queries), bends_by_difference(field.gradient, queries, 1e-4), HESSIAN_DIFFERENCE)
    assert_close(field.hessian(special), bends_by_difference(field.gradient, special, 1e-6), HESSIAN_KINK)


def tiled(power=3):
    points, values, _ = wavy(3, 400)
    field = PUInterpolant.fit(points, values, kernel=Polyharmonic(power, 3), points_per_ball=BALLS, smoothing=0.1)
    return TiledField(field, 0.8 * (field.bounds[1] - field.bounds[0])[:2])


@pytest.mark.parametrize("power", [3, 4])
def test_the_hessian_of_a_tiled_field_is_the_difference_of_its_gradient_and_repeats(power):
    field = tiled(power)
    queries = np.random.default_rng(1).uniform(-6, 6, (40, 3)) * [1, 1, 0.5]
    found = field.hessian(queries)
    assert np.any(queries[:, 2] > field.bounds[1, 2])
    assert np.any(np.abs(queries[:, 2]) < 1)
    assert_close(found, bends_by_difference(field.gradient, queries, 1e-4), HESSIAN_DIFFERENCE)
    moved = queries + np.append(3 * field.period, 0) * [1, -1, 0]
    assert_close(field.hessian(moved), found, HESSIAN_SEAM)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_it_is_symmetric_bit_for_bit_inside_and_outside(d):
    field, queries, special = fitted(3, d)
    at = np.vstack([queries, special, 4 * queries])
    found = field.hessian(at)
    assert found.shape == (len(at), d, d)
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_outside_the_bounds_it_is_the_difference_of_the_gradient(d):
    """Beyond faces, edges and corners: weights bend on axes that stayed, the fits on all."""
    field, _, _ = fitted(3, d)
    queries = np.random.default_rng(2).uniform(-4, 5, (60, d))
    moved = np.sum((queries < field.bounds[0]) | (queries > field.bounds[1]), axis=1)
    assert set(range(1, d + 1)) <= set(moved)
    outside = queries[moved > 0]
    # On a line a natural spline goes on straight.
    found, expected = field.hessian(outside), bends_by_difference(field.gradient, outside, 1e-4)
    np.testing.assert_allclose(found, expected, rtol=0, atol=HESSIAN_DIFFERENCE * max(np.abs(expected).max(), 1.0))


@pytest.mark.parametrize("step", [1e-100, 1e-170, 1e-300, 5e-324])
def test_a_layer_falls_at_distances_whose_square_is_zero_or_beyond_all_numbers(step):
    points = np.random.default_rng(0).random((200, 3))
    layer = TiledField(PUInterpolant.fit(points, points.sum(axis=1), points_per_ball=60, bounds=[[0] * 3, [1] * 3]))
    beside, far = np.array([[0.5, 0.5, -step]]), np.array([[0.5, 0.5, 1 / max(step, 1e-300)]])
    assert layer.gradient(beside)[0, 2] == layer.fall
    assert layer(far)[0] == -layer.fall * far[0, 2]
    assert layer.gradient(far)[0, 2] == -layer.fall
    for each in (beside, far):
        np.testing.assert_array_equal(layer.hessian(each)[0, 2, 2], 0.0)


@pytest.mark.parametrize(("power", "d"), [(3, 1), (3, 2), (5, 3), (3, 3), (3, 4)])
def test_a_similarity_takes_its_square_off(power, d):
    """x′ = s R x + t: F′(x′) = F(x), and Hess F′ = R Hess F Rᵀ/s²; R exchanges and mirrors axes: boxes stay boxes."""
    points, values, queries = wavy(d)
    R = np.eye(d)[::-1] * (-1.0) ** np.arange(d)
    scale, shift = 8.0, 3.0
    plain = PUInterpolant.fit(points, values, kernel=Polyharmonic(power, d), points_per_ball=len(points), smoothing=0.1)
    moved = PUInterpolant.fit(
        scale * points @ R.T + shift,
        values,
        kernel=Polyharmonic(power, d),
        points_per_ball=len(points),
        smoothing=0.1 * scale**power,
    )
    assert len(plain.cover.radii) == 1
    found = moved.hessian(scale * queries @ R.T + shift)
    assert_close(scale**2 * found, R @ plain.hessian(queries) @ R.T, HESSIAN_TWIN)


@pytest.mark.parametrize("kernel", ["linear", "thin_plate_spline"])
def test_a_kernel_without_second_derivatives_refuses_in_one_line(kernel):
    points, values, queries = wavy(3)
    field = PUInterpolant.fit(points, values, kernel=kernel, points_per_ball=BALLS)
    for each in (field, TiledField(field)):
        with pytest.raises(InputError, match=r"no second derivatives.*use 'cubic' or a smoother") as error:
            each.hessian(queries)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_splines_put_in_as_fields_equal_the_compiled_path(d):
    points, values, queries = wavy(d)
    compiled = PUInterpolant.fit(points, values, smoothing=0.1, points_per_ball=BALLS)
    plain = PUInterpolant.fit(
        points, values, local=lambda p, f: RBFInterpolant.fit(p, f, smoothing=0.1), points_per_ball=BALLS
    )
    assert isinstance(plain.local, LocalFields)
    at = np.vstack([queries, points[:20], compiled.cover.centers, 4 * queries])
    assert_close(compiled.hessian(at), plain.hessian(at), HESSIAN_TWIN)


def test_local_fits_without_a_hessian_are_named():
    class Level:
        bounds, unit = np.array([[-1.0] * 3, [2.0] * 3]), None

        def __call__(self, points):
            return np.ones(len(points))

        def gradient(self, points):
            return np.zeros(points.shape)

    points, values, queries = wavy(3)
    field = PUInterpolant.fit(points, values, local=lambda p, f: Level(), points_per_ball=BALLS)
    np.testing.assert_allclose(field(queries), 1.0, rtol=ROUNDING)
    with pytest.raises(InputError, match="local fits, of type Level, have none; add the method"):
        field.hessian(queries)


def test_one_point_none_and_no_point():
    field, queries, _ = fitted(3, 3)
    assert field.hessian(queries[0]).shape == (1, 3, 3)
    assert field.hessian(np.empty((0, 3))).shape == (0, 3, 3)
    for bad in (np.nan, np.inf):
        with pytest.raises(InputError, match="NaN or infinite"):
            field.hessian([[0.5, bad, 0.5]])


def test_jets_are_what_values_gradients_and_hessians_are():
    field, queries, _ = fitted(3, 3)
    values, gradients, hessians = field.jets(4 * queries, 2)
    for found, expected in zip(
        (values, gradients, hessians),
        (field(4 * queries), field.gradient(4 * queries), field.hessian(4 * queries)),
        strict=True,
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    assert len(field.jets(queries, 0)) == 1
