"""Smoothing that the data choose: pooled over balls, a ball for itself, and how near the best it comes."""

import numpy as np
import pytest

from o3dleaf import PUInterpolant, RBFInterpolant, get_num_threads, polyharmonic, set_num_threads
from o3dleaf.fitting.local.smoothing_selection import GCV_BALLS
from o3dleaf.fitting.rbf.smoothing import Spectrum, choose_by_gcv, gcv_score
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import tail_exponents
from o3dleaf.samples.ct import wheat_ct
from tolerances import CT_FALL, GCV_CHOICE, GCV_EFFICIENCY, ROUNDING

LEVELS = (0.01, *(pytest.param(level, marks=pytest.mark.slow) for level in (0.03, 0.1)), 0.3)
SEEDS = (0, 1, 2, 3)


def growing_noise(count=400):
    rng = np.random.default_rng(5)
    points = rng.random((count, 2))
    values = np.sin(5 * points).sum(axis=1) + points[:, 0] ** 2 * rng.standard_normal(count)
    return points, values, rng.uniform(0.2, 2, count)


@pytest.mark.parametrize("weighted", [False, True])
def test_the_pooled_choice_is_that_of_the_sum_over_the_balls(weighted):
    """Noise that grows along x: no single ball would choose what all of them do."""
    points, values, weights = growing_noise()
    weights = weights if weighted else np.ones(len(points))
    kernel, exponents = polyharmonic(2, 2), tail_exponents(2, 1)
    field = PUInterpolant.fit(points, values, kernel=kernel, rho="gcv", points_per_ball=(30, 60), weights=weights)
    assert 4 < len(field.cover.radii) <= GCV_BALLS
    parts = []
    for rows in np.split(field.cover.members, field.cover.offsets[1:-1]):
        local, data = points[rows].T.copy(), values[rows][np.newaxis]
        found, coefficients = spectra(local, data, np.sqrt(weights[rows]), exponents, kernel.power)
        parts.append(Spectrum(found * kernel.theta / len(rows), coefficients[0], len(rows)))
    pooled, rule = Spectrum.pooled(parts), field.local.smoothing
    assert rule.value == pytest.approx(choose_by_gcv(pooled), rel=GCV_CHOICE)
    assert rule.score == pytest.approx(gcv_score(rule.value, pooled), rel=GCV_CHOICE)
    assert all(rule.value != pytest.approx(choose_by_gcv(part), rel=0.05) for part in parts)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("name", ["rho", "smoothing"])
def test_a_ball_that_chooses_for_itself_chooses_as_if_it_were_alone(name, weighted):
    points, values, weights = growing_noise()
    weights = weights if weighted else None
    options = {"kernel": "thin_plate_spline", "points_per_ball": (40, 80)}
    field = PUInterpolant.fit(points, values, weights=weights, **options, **{name: "gcv-per-ball"})
    rows = np.split(field.cover.members, field.cover.offsets[1:-1])
    assert len(field.local.smoothing_per_ball) == len(rows) > 5
    assert field.local.smoothing_per_ball.max() > 100 * field.local.smoothing_per_ball.min()
    for own, diagonal, r in zip(field.local.smoothing_per_ball, field.local.diagonals, rows, strict=True):
        of_ball = None if weights is None else weights[r]
        alone = RBFInterpolant.fit(points[r], values[r], weights=of_ball, kernel="thin_plate_spline", **{name: "gcv"})
        assert own == pytest.approx(alone.smoothing.value, rel=GCV_CHOICE)
        assert diagonal == pytest.approx(alone.smoothing.diagonal(len(r)), rel=GCV_CHOICE)


def test_the_choice_of_each_ball_is_what_it_is_fitted_with():
    """Ball by ball, a fit with the value given has the same λ."""
    points, values, _ = growing_noise()
    options = {"kernel": "thin_plate_spline", "points_per_ball": (40, 80)}
    field = PUInterpolant.fit(points, values, rho="gcv-per-ball", **options)
    for ball in (0, len(field.local.smoothing_per_ball) // 2, len(field.local.smoothing_per_ball) - 1):
        again = PUInterpolant.fit(points, values, rho=float(field.local.smoothing_per_ball[ball]), **options)
        np.testing.assert_allclose(field.local.ball(ball)[1], again.local.ball(ball)[1], rtol=ROUNDING, atol=0)


def test_one_amount_for_all_balls_is_the_same_fit_as_that_amount_given():
    points, values, _ = growing_noise()
    field = PUInterpolant.fit(points, values, rho="gcv", kernel="thin_plate_spline", points_per_ball=(30, 60))
    value = field.local.smoothing.value
    again = PUInterpolant.fit(points, values, rho=value, kernel="thin_plate_spline", points_per_ball=(30, 60))
    np.testing.assert_array_equal(field(points), again(points))


def test_the_number_of_threads_does_not_change_a_bit_of_what_balls_choose():
    points, values, _ = growing_noise(1500)
    before, found = get_num_threads(), []
    try:
        for threads in (1, 2, 4):
            set_num_threads(threads)
            field = PUInterpolant.fit(points, values, smoothing="gcv-per-ball", points_per_ball=60)
            judged, own = field.diagnostics(), field.local.smoothing_per_ball
            found.append(b"".join(part.tobytes() for part in (own, judged.score, judged.leave_one_out)))
    finally:
        set_num_threads(before)
    assert found[0] == found[1] == found[2]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("count", [1, 4, 10, 11])
def test_a_ball_without_freedom_has_nothing_to_smooth(count):
    """Up to ten points in space, the tail of degree 2 takes them all."""
    points = np.random.default_rng(0).random((count, 3))
    field = PUInterpolant.fit(points, points[:, 0] ** 3, rho="gcv-per-ball")
    assert (field.local.smoothing_per_ball > 0) == (count > 10)
    if count <= 10:
        np.testing.assert_allclose(field(points), points[:, 0] ** 3, atol=1e-9)


def waves(d, level, seed, count):
    rng = np.random.default_rng(seed)
    points = rng.random((count, d))
    truth = np.sin(5 * points + np.arange(d)).sum(axis=1)
    return points, truth, truth + level * rng.standard_normal(count)


def efficiency(d, level, seed, count, size):
    """Error at the points of the smoothing that was chosen, over that of the best on a grid of four decades."""
    points, truth, values = waves(d, level, seed, count)
    options = {"kernel": "thin_plate_spline" if d == 2 else "cubic", "points_per_ball": size}

    def error(rho):
        return np.sqrt(np.mean((PUInterpolant.fit(points, values, rho=rho, **options)(points) - truth) ** 2))

    chosen = PUInterpolant.fit(points, values, rho="gcv", **options).local.smoothing.value
    return error(chosen) / min(error(chosen * x) for x in np.geomspace(0.01, 100, 13))


@pytest.mark.few(d=1, level=1)
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("d", [2, 3])
def test_over_several_balls_the_error_is_within_a_tenth_of_the_best(d, level):
    assert max(efficiency(d, level, seed, 1500, (75, 150)) for seed in SEEDS) < GCV_EFFICIENCY


@pytest.mark.few(d=2, level=1)
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("d", [2, 3])
def test_in_one_ball_of_300_points_the_error_is_within_a_tenth_of_the_best_on_average(d, level):
    assert np.mean([efficiency(d, level, seed, 300, 300) for seed in range(8)]) < GCV_EFFICIENCY


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "fall"), [pytest.param(*each, marks=[pytest.mark.slow] * (each[0] < 0.01)) for each in CT_FALL.items()]
)
def test_on_the_24_um_sample_the_error_falls(noise, fall):
    """At the voxels an interpolant's error is the noise itself; the choice takes away what its truth allows."""
    volume, field = wheat_ct(size=(840, 840, 480), noise=noise, drift=0)
    points = volume.origin + np.indices(volume.shape).reshape(3, -1).T * volume.spacing
    values, truth = volume.data.ravel().astype(float), field(points)
    error = {
        rule: np.sqrt(np.mean((PUInterpolant.fit(points, values, rho=rule)(points) - truth) ** 2))
        for rule in (0.0, "gcv", "gcv-per-ball")
    }
    assert error[0.0] == pytest.approx(noise, rel=0.02)
    assert error["gcv"] < (1 - fall[0]) * error[0.0]
    assert error["gcv-per-ball"] < (1 - fall[1]) * error[0.0]
