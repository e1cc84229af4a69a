import numpy as np
import pytest

from o3dleaf import PUInterpolant, TiledField
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.local.weight_loops import wendland
from tolerances import ANALYTIC_VS_DIFFERENCE, TWIN, UNIT_SCALE


@pytest.fixture(scope="module")
def patch():
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, -1], [4, 3, 1], (3000, 3))
    values = np.sin(2 * points[:, 0]) + np.cos(3 * points[:, 1]) - points[:, 2]
    return PUInterpolant.fit(points, values, points_per_ball=(40, 80), unit="mm", bounds=[[0, 0, -1], [4, 3, 1]])


def literal_tiling(field, period, points, reach=3):
    """The equation of G in the paper's section 2.6, with explicit copies: Σ w F_i(z − s) / Σ w."""
    index = field.index
    centers, radii = field.cover.centers, field.cover.radii
    total, weights = np.zeros(len(points)), np.zeros(len(points))
    for p in range(-reach, reach + 1):
        for q in range(-reach, reach + 1):
            shift = np.array([p * period[0], q * period[1], 0.0])
            for ball in range(len(radii)):
                z = points - shift
                tau = np.linalg.norm(z - centers[ball], axis=1) / radii[ball]
                for row in np.flatnonzero(tau < 1):
                    w = wendland(tau[row])
                    total[row] += w * local_value(field, ball, z[row])
                    weights[row] += w
    del index
    return total / weights


def local_value(field, ball, z):
    """F_i alone, from its points, λ and tail."""
    local = field.local
    first, last = local.offsets[ball], local.offsets[ball + 1]
    sites = local.sites[3 * first : 3 * last].reshape(3, -1).T
    unit = (z - field.cover.centers[ball]) / field.cover.radii[ball]
    r = np.linalg.norm(unit - sites, axis=1)
    return r**3 @ local.weights[first:last] + np.prod(unit**local.exponents, axis=1) @ local.tails[ball]


@pytest.mark.parametrize("period", [(4.0, 3.0), (3.3, 2.2)])
def test_the_tiled_field_is_the_sum_over_explicit_copies(patch, period):
    tiled = TiledField(patch, period)
    points = np.random.default_rng(1).uniform([-5, -4, -1], [8, 6, 1], (60, 3))
    expected = literal_tiling(patch, period, points)
    assert np.abs(tiled(points) - expected).max() <= TWIN * np.abs(expected).max()


def test_the_tiled_field_repeats(patch):
    tiled = TiledField(patch)
    points = np.random.default_rng(2).uniform([0, 0, -1], [4, 3, 1], (500, 3))
    for shift in ([4, 0, 0], [0, 3, 0], [-400, 27, 0]):
        assert np.abs(tiled(points + shift) - tiled(points)).max() <= 1e-9


def test_the_tiled_field_is_continuous_and_smooth_across_a_seam(patch):
    tiled = TiledField(patch)
    seam = np.column_stack([np.full(200, 4.0), np.random.default_rng(3).uniform([0, -1], [3, 1], (200, 2))])
    step = np.array([1e-7, 0, 0])
    assert np.abs(tiled(seam + step) - tiled(seam - step)).max() <= 1e-4
    assert np.abs(tiled.gradient(seam + step) - tiled.gradient(seam - step)).max() <= 1e-3


def test_far_from_the_seam_the_tile_is_the_patch(patch):
    """A query that no shifted ball reaches sees the patch alone."""
    tiled = TiledField(patch)
    reach = patch.cover.radii.max()
    points = np.random.default_rng(4).uniform([reach, reach, -1], [4 - reach, 3 - reach, 1], (300, 3))
    assert np.array_equal(tiled(points), patch(points))


def test_gradient_equals_central_differences(patch):
    tiled = TiledField(patch, (3.7, 2.9))
    points = np.random.default_rng(5).uniform([-5, -4, -0.9], [8, 6, 0.9], (200, 3))
    step = 1e-5
    numeric = np.stack([(tiled(points + step * e) - tiled(points - step * e)) / (2 * step) for e in np.eye(3)], axis=1)
    assert np.abs(numeric - tiled.gradient(points)).max() <= ANALYTIC_VS_DIFFERENCE * 10


def test_above_and_below_the_patch_the_field_falls_with_the_distance(patch):
    tiled = TiledField(patch)
    rim = np.array([[9.0, 7.0, 1.0]])
    assert tiled(rim + [[0, 0, 2.5]]) == pytest.approx(tiled(rim) - 2.5 * tiled.fall)
    assert tiled.gradient(rim + [[0, 0, 2.5]])[0, 2] == -tiled.fall


@pytest.mark.parametrize(("value", "length"), [(255.0, 1.0), (1e-6, 1e6), (1e6, 1e-6)])
def test_how_it_falls_scales_with_the_values_and_the_lengths(value, length):
    points = np.random.default_rng(7).random((300, 3))
    values = np.sin(5 * points).sum(axis=1)
    one = TiledField(PUInterpolant.fit(points, values, points_per_ball=(40, 80)))
    other = TiledField(PUInterpolant.fit(length * points, value * values, points_per_ball=(40, 80)))
    queries = np.random.default_rng(8).uniform(-2, 3, (50, 3))
    np.testing.assert_allclose(other(length * queries) / value, one(queries), rtol=0, atol=UNIT_SCALE * one.fall)


def test_a_layer_is_air_half_a_spacing_of_its_data_beyond_it():
    """Whatever it is made of: of solid where it is cut, nothing is left there."""
    points = np.random.default_rng(7).random((1000, 3))
    tiled = TiledField(PUInterpolant.fit(points, np.sin(7 * points).sum(axis=1)))
    plane = np.random.default_rng(8).random((2000, 2))
    top = np.column_stack([plane, np.full(2000, tiled.cell[1, 2])])
    assert tiled(top).max() > 0
    assert tiled(top + [0, 0, 0.05]).max() < 0


def test_a_period_beyond_the_patch_is_refused(patch):
    with pytest.raises(InputError, match="larger than the patch"):
        TiledField(patch, (4.5, 3.0))
    with pytest.raises(InputError, match="above zero"):
        TiledField(patch, (0.0, 3.0))
