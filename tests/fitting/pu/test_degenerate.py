"""Balls whose points do not determine the tail: finite, sensible, never a singular matrix."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats.qmc import Halton

from o3dleaf import PUInterpolant
from tolerances import MEAN_OF_DUPLICATES, POLYNOMIAL, POLYNOMIAL_SLOPE, TURNED

BIG_BOX = np.array([[-9.0] * 3, [9.0] * 3])


def plane_of_voxels(side=12):
    axis = np.arange(float(side)) - (side - 1) / 2
    return np.stack(np.meshgrid(axis, axis, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)


def linear(x):
    return 2 + x @ np.array([1.0, 0.5, 0.0])


def turn(seed):
    return Rotation.random(rng=np.random.default_rng(seed)).as_matrix().T


def check_finite(field, count=500):
    """Nothing but finite values and slopes anywhere in and around the bounds, none of them wild."""
    low, high = field.bounds
    queries = np.random.default_rng(0).uniform(low - 1, high + 1, (count, 3))
    assert np.isfinite(field(queries)).all()
    assert np.isfinite(field.gradient(queries)).all()
    return np.abs(field(np.clip(queries, low, high))).max()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("seed", range(4))
def test_a_tilted_plane_of_voxels_reproduces_linear_data_with_no_slope_across(degree, seed):
    """The tail has rank 3 of 4 (6 of 10); what the plane does not tell is taken as constant."""
    points, R = plane_of_voxels(), turn(seed)
    field = PUInterpolant.fit(points @ R, linear(points), degree=degree, points_per_ball=(20, 60))
    assert set(field.local.ranks) == {3 if degree == 1 else 6}
    on = np.random.default_rng(1).uniform(-5, 5, (200, 3)) * [1, 1, 0]
    on = on[np.all((on @ R >= field.bounds[0]) & (on @ R <= field.bounds[1]), axis=1)]
    np.testing.assert_allclose(field(on @ R), linear(on), rtol=0, atol=POLYNOMIAL)
    np.testing.assert_allclose(field.gradient(on @ R) @ R.T, [[1, 0.5, 0]] * len(on), rtol=0, atol=POLYNOMIAL_SLOPE)
    assert check_finite(field) < 20


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_how_a_plane_of_voxels_is_turned_does_not_matter_on_it_or_off_it(degree):
    """One ball about the origin, so that the cover turns with the plane."""
    points = plane_of_voxels()
    values = np.sin(points[:, 0] / 3) + points[:, 1] ** 2 / 20
    queries = np.random.default_rng(2).uniform(-2, 2, (100, 3))
    found = []
    for R in (np.eye(3), turn(0), turn(1), turn(2)):
        field = PUInterpolant.fit(points @ R, values, degree=degree, points_per_ball=400, bounds=BIG_BOX)
        assert len(field.cover.radii) == 1
        found.append(field(queries @ R))
    np.testing.assert_allclose(found[1:], [found[0]] * 3, rtol=0, atol=TURNED)


def test_voxels_on_a_sphere_restrict_a_quadratic_tail():
    """x² + y² + z² is constant on them: rank 9 of 10."""
    directions = np.random.default_rng(0).standard_normal((60, 3))
    points = directions / np.linalg.norm(directions, axis=1)[:, None]
    field = PUInterpolant.fit(points, points[:, 0] ** 2 - points[:, 1], degree=2, points_per_ball=60)
    assert set(field.local.ranks) == {9}
    assert check_finite(field) < 10


@pytest.mark.parametrize("seed", range(3))
def test_collinear_points(seed):
    t = np.linspace(-1, 1, 80)
    points = t[:, None] * [3.0, 0, 0] @ turn(seed)
    field = PUInterpolant.fit(points, 1 + 2 * t, points_per_ball=(10, 20))
    middle = 0.37 * points
    np.testing.assert_allclose(field(middle), 1 + 2 * 0.37 * t, rtol=0, atol=POLYNOMIAL)
    assert check_finite(field) < 10


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9, 10, 11])
@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_fewer_points_than_terms_are_taken_exactly(count, d):
    points = Halton(d, rng=np.random.default_rng(0)).random(count)  # none of them nearly coincide
    values = np.random.default_rng(1).random(count)
    field = PUInterpolant.fit(points, values, degree=2)
    np.testing.assert_allclose(field(points), values, rtol=0, atol=POLYNOMIAL)
    assert np.isfinite(field.gradient(points)).all()
    assert np.isfinite(field(points + 1)).all()


@pytest.mark.parametrize("smoothing", [0.0, 1e-3])
def test_duplicated_points_with_equal_values_count_twice_where_smoothed_and_once_where_not(smoothing):
    rng = np.random.default_rng(0)
    points = rng.random((150, 3))
    values = np.sin(4 * points).sum(axis=1)
    twice = np.vstack([points, points[:30]]), np.concatenate([values, values[:30]])
    field = PUInterpolant.fit(*twice, points_per_ball=200, smoothing=smoothing)
    weights = 1.0 + (np.arange(len(points)) < 30)
    once = PUInterpolant.fit(points, values, points_per_ball=200, smoothing=smoothing, weights=weights)
    assert field.local.dropped.sum() == (30 if smoothing == 0 else 0)
    np.testing.assert_allclose(field(points), once(points), rtol=0, atol=MEAN_OF_DUPLICATES)


@pytest.mark.parametrize("kernel", ["linear", "thin_plate_spline", "cubic", "quintic"])
@pytest.mark.filterwarnings("ignore::o3dleaf.core.errors.DataWarning")
def test_duplicated_points_with_different_values_are_fitted_through_their_mean(kernel):
    """SciPy gives numbers of size 1e14 or a singular matrix; the limit of vanishing smoothing is the mean."""
    rng = np.random.default_rng(0)
    points = rng.random((200, 3))
    values = np.sin(4 * points).sum(axis=1)
    apart = np.concatenate([values, values[:30] + 1])
    mean = values + 0.5 * (np.arange(len(values)) < 30)
    field = PUInterpolant.fit(np.vstack([points, points[:30]]), apart, kernel=kernel, points_per_ball=(30, 80))
    np.testing.assert_allclose(field(points), mean, rtol=0, atol=MEAN_OF_DUPLICATES)
    assert check_finite(field) < 20


@pytest.mark.filterwarnings("ignore::o3dleaf.core.errors.DataWarning")
def test_all_points_in_one_place():
    field = PUInterpolant.fit(np.full((7, 3), 2.5), np.arange(7.0))
    np.testing.assert_allclose(field([[2.5, 2.5, 2.5], [2.5, 2.5, 3.5]]), [3, 3], rtol=0, atol=POLYNOMIAL)
    np.testing.assert_allclose(field.gradient([[2.5, 2.5, 2.5]]), 0, atol=POLYNOMIAL)


def test_a_slab_one_voxel_thick_beside_a_lattice_and_far_from_the_origin():
    """Some balls see a plane only, others see space: all of it at 1e6 from the origin."""
    axis = np.arange(8.0)
    cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    slab = plane_of_voxels(24) + [24.0, 3.5, 0.0]
    points = np.vstack([cube, slab])
    points = np.unique(points, axis=0) * 0.024
    values = linear(points)
    field = PUInterpolant.fit(points + 1e6, values, points_per_ball=(30, 60))
    assert field.local.ranks.min() < 10 == field.local.ranks.max()
    np.testing.assert_allclose(field(points + 1e6), values, rtol=0, atol=POLYNOMIAL)
    assert check_finite(field) < 10
