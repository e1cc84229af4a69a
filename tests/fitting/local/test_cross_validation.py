import numpy as np
import pytest

from o3dleaf import PUInterpolant, RBFInterpolant, polyharmonic
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local.cross_validation import held_out_errors
from o3dleaf.fitting.local.fit_loops import ball_residuals
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.rbf.kernels import as_kernel
from o3dleaf.fitting.rbf.smoothing import Smoothing, SplineModel
from tolerances import HELD_OUT


@pytest.fixture(scope="module")
def noisy():
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 4, (220, 2))
    values = np.sin(points[:, 0]) * np.cos(points[:, 1]) + 0.1 * rng.normal(size=220)
    return points, values, rng.uniform(0.2, 1.0, 220)


@pytest.mark.parametrize("kernel", [polyharmonic(2, 2), "cubic"])
@pytest.mark.parametrize("width", [None, 1.0])
def test_held_out_errors_equal_explicit_refits(noisy, kernel, width):
    """One ball around everything: leaving a group out by the block formula is refitting without it."""
    points, values, weights = noisy
    groups = np.arange(220) if width is None else np.floor(points[:, 0] / width).astype(np.int64)
    bounds = np.array([points.min(axis=0), points.max(axis=0)])
    cover = Cover.fit(points, bounds, (220, 220), 1.1)
    assert len(cover.radii) == 1
    phi = RBFInterpolant.fit(points, values, kernel=kernel, smoothing=0.05).kernel
    data = ScatteredData(points, values, weights, groups)
    found = held_out_errors(cover, data, SplineModel(phi, 1, Smoothing(0.05)))
    chosen = np.unique(groups)[:: max(len(np.unique(groups)) // 12, 1)]
    for group in chosen:
        out = groups == group
        refit = RBFInterpolant.fit(
            points[~out], values[~out], kernel=kernel, degree=1, smoothing=0.05, weights=weights[~out]
        )
        assert found[out] == pytest.approx(values[out] - refit(points[out]), abs=HELD_OUT)


def test_errors_of_columns_are_those_of_each(noisy):
    points, values, weights = noisy
    columns = np.column_stack([values, points[:, 0] ** 2, np.roll(values, 1)])
    groups = np.floor(points[:, 1]).astype(np.int64)
    cover = Cover.fit(points, np.array([points.min(axis=0), points.max(axis=0)]), (40, 80), 1.1)
    model = SplineModel(polyharmonic(3, 2), 1, Smoothing(0.1))
    together = held_out_errors(cover, ScatteredData(points, columns, weights, groups), model)
    for found, one in zip(together.T, columns.T, strict=True):
        alone = held_out_errors(cover, ScatteredData(points, one.copy(), weights, groups), model)
        assert found == pytest.approx(alone, abs=HELD_OUT, nan_ok=True)


def test_a_group_that_leaves_too_few_points_has_no_error(noisy):
    points, values, _ = noisy
    cover = Cover.fit(points, np.array([points.min(axis=0), points.max(axis=0)]), (220, 220), 1.1)
    data = ScatteredData(points, values, groups=np.zeros(220, dtype=np.int64))
    errors = held_out_errors(cover, data, SplineModel(polyharmonic(2, 2), 1, Smoothing(0.1)))
    assert np.isnan(errors).all()


def test_errors_of_many_balls_are_close_to_those_of_one(noisy):
    points, values, _ = noisy
    bounds = np.array([points.min(axis=0), points.max(axis=0)])
    data, model = ScatteredData(points, values), SplineModel(polyharmonic(2, 2), 1, Smoothing(0.3))
    one = held_out_errors(Cover.fit(points, bounds, (220, 220), 1.1), data, model)
    many = held_out_errors(Cover.fit(points, bounds, (40, 80), 1.1), data, model)
    assert np.sqrt(np.mean((one - many) ** 2)) < 0.2 * np.sqrt(np.mean(one**2))


def test_a_point_of_tiny_weight_is_ignored(noisy):
    points, values, _ = noisy
    spoilt, weights = values.copy(), np.ones(220)
    spoilt[17], weights[17] = 1e3, 1e-12
    options = {"kernel": "cubic", "degree": 1, "smoothing": 0.05, "points_per_ball": (60, 120)}
    ignoring = PUInterpolant.fit(points, spoilt, weights=weights, **options)
    elsewhere = PUInterpolant.fit(np.delete(points, 17, axis=0), np.delete(values, 17), **options)
    assert np.abs(ignoring(points) - elsewhere(points)).max() < 0.05
    assert np.abs(PUInterpolant.fit(points, spoilt, **options)(points) - elsewhere(points)).max() > 10


@pytest.mark.filterwarnings("ignore:values. points coincide")
@pytest.mark.parametrize("smoothing", [0.0, 0.05])
def test_residuals_of_a_ball_are_those_of_its_fit_where_points_coincide_too(noisy, smoothing):
    """Without smoothing points at one place have the mean of their values, of which the solution says nothing."""
    points, values, weights = noisy
    points = np.concatenate([points, points[:9]])
    values, weights = np.concatenate([values, values[:9] + 1.0]), np.concatenate([weights, weights[:9]])
    bounds = np.array([points.min(axis=0), points.max(axis=0)])
    cover, model = (
        Cover.fit(points, bounds, (229, 229), 1.1),
        SplineModel(as_kernel("cubic", 2), 1, Smoothing(smoothing)),
    )
    data, power = ScatteredData(points, values, weights), model.kernel.power
    left = ball_residuals(
        0, data.weighted, cover.balls, model.exponents, power, model.smoothing.diagonals(cover.counts)
    )
    fit = PUInterpolant.fit(points, values, kernel=model.kernel, degree=1, smoothing=smoothing, weights=weights)
    assert np.abs(left).max() > 0.3
    assert left == pytest.approx((values - fit(points))[cover.members], abs=HELD_OUT)
