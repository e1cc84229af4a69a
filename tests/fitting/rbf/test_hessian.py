"""Second derivatives of one spline: the formula written out, at its data sites too, and who has none."""

from dataclasses import replace

import numpy as np
import pytest

import reference
from o3dleaf import RBFInterpolant
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf import interpolant
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from tolerances import FIELD_TWIN, HESSIAN_DIFFERENCE, HESSIAN_KINK, SIMILARITY

POWERS, DIMENSIONS = (3, 4, 5, 7), (1, 2, 3, 4)
SMOOTH_KERNELS = [(power, d) for power in POWERS for d in DIMENSIONS]


def scattered(d, count=60):
    points, queries = np.random.default_rng(0).uniform(-2, 3, (2, count, d))
    return points, np.sin(points).sum(axis=1) + points[:, 0] ** 2, queries


def bends_by_difference(field, at, step):
    d = at.shape[1]
    return np.stack([reference.difference(lambda x: field.gradient(x)[:, a], at, step) for a in range(d)], axis=1)  # noqa: B023


def assert_close(found, expected, share):
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


@pytest.mark.few
@pytest.mark.parametrize("more", [0, 1], ids=["usual tail", "longer tail"])
@pytest.mark.parametrize("power", POWERS)
@pytest.mark.parametrize("d", DIMENSIONS[::-1])
def test_gradient_and_hessian_are_the_formula_written_out_at_data_sites_too(power, d, more):
    points, values, queries = scattered(d)
    kernel = Polyharmonic(power, d)
    degree = kernel.least_degree if more == 0 else kernel.least_degree + (d < 4)
    field = RBFInterpolant.fit(points, values, kernel=kernel, degree=degree, smoothing=0.1)
    slow = reference.solve_spline(points, values, power, degree, 0.1)
    at = np.vstack([queries[:10], points[:10]])
    jets = [reference.spline_jet(slow, x) for x in at]
    assert_close(field.gradient(at), np.array([gradient for _, gradient, _ in jets]), FIELD_TWIN)
    assert_close(field.hessian(at), np.array([hessian for _, _, hessian in jets]), FIELD_TWIN)


@pytest.mark.few
@pytest.mark.parametrize("tail", [True, False], ids=["tail", "no tail"])
@pytest.mark.parametrize(("power", "d"), SMOOTH_KERNELS)
def test_the_hessian_is_the_difference_of_the_gradient_and_symmetric(power, d, tail):
    points, values, queries = scattered(d)
    field = RBFInterpolant.fit(points, values, kernel=Polyharmonic(power, d), smoothing=0.1)
    if not tail:
        field = replace(field, tail=np.empty(0), exponents=np.empty((0, d), dtype=np.int64))
    found = field.hessian(queries)
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))
    outside = 3 * queries  # where it extrapolates, as the formula says
    for at in (queries, outside):
        assert_close(field.hessian(at), bends_by_difference(field, at, 1e-4), HESSIAN_DIFFERENCE)
    assert_close(field.hessian(points), bends_by_difference(field, points, 1e-6), HESSIAN_KINK)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_a_similarity_takes_its_square_off(d):
    points, values, queries = scattered(d)
    turn = np.linalg.qr(np.random.default_rng(d).normal(size=(d, d)))[0]
    plain = RBFInterpolant.fit(points, values, smoothing=0.1)
    moved = RBFInterpolant.fit(7 * points @ turn.T + 2, values, smoothing=0.1 * 7**3)
    expected = turn @ plain.hessian(queries) @ turn.T
    assert_close(49 * moved.hessian(7 * queries @ turn.T + 2), expected, SIMILARITY)


@pytest.mark.parametrize("kernel", ["linear", "thin_plate_spline"])
def test_a_kernel_without_second_derivatives_refuses_in_one_line(kernel):
    points, values, queries = scattered(2)
    with pytest.raises(InputError, match=r"no second derivatives.*use 'cubic' or a smoother") as error:
        RBFInterpolant.fit(points, values, kernel=kernel).hessian(queries)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_the_blocks_and_the_company_do_not_change_a_bit(block, monkeypatch):
    points, values, queries = scattered(3)
    for power in (3, 5):
        field = RBFInterpolant.fit(points, values, kernel=Polyharmonic(power, 3))
        calls = field, field.gradient, field.hessian
        before = [call(queries) for call in calls]
        monkeypatch.setattr(interpolant, "BLOCK", block)
        for call, expected in zip(calls, before, strict=True):
            np.testing.assert_array_equal(call(queries), expected)
            np.testing.assert_array_equal(call(queries[::-1]), expected[::-1])
            np.testing.assert_array_equal(call(queries[3]), expected[3:4])
        monkeypatch.undo()


def test_one_point_and_none():
    points, values, _ = scattered(3)
    field = RBFInterpolant.fit(points, values)
    assert field.hessian(points[0]).shape == (1, 3, 3)
    assert field.hessian(np.empty((0, 3))).shape == (0, 3, 3)
    with pytest.raises(InputError, match="NaN"):
        field.hessian([[0.0, np.nan, 0.0]])
