import numpy as np
import pytest

from o3dleaf import PUInterpolant
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.splines import fit_splines
from o3dleaf.fitting.rbf.kernels import as_kernel, polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing, SplineModel
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.noise import MAD, height_noise, plane_noise
from o3dleaf.leaf.macro.robust import TOLERANCE, RobustHeight, huber_loss
from tolerances import ANALYTIC_VS_DIFFERENCE, NOISE_OF_HEIGHTS, TWIN

LENGTH = 36.0


def truth(plane):
    return 1.2 * np.cos(plane[:, 0] / 8) + 0.06 * plane[:, 1] ** 2


def scan(rng, count=1500, noise=0.1, second=0.0, shift=1.0):
    """A strip 36 by 10, a share `second` of its points from a pass that lies `shift` higher."""
    plane = np.column_stack([rng.uniform(0, LENGTH, count), rng.uniform(-5, 5, count)])
    heights = truth(plane) + noise * rng.normal(size=count)
    in_second = (rng.uniform(size=count) < second) & (np.abs(plane[:, 0] - LENGTH / 2) < LENGTH / 4)
    heights[in_second] += shift
    return np.column_stack([plane, heights])


def rms_to_truth(height):
    plane = np.random.default_rng(99).uniform([1, -4.5], [LENGTH - 1, 4.5], (4000, 2))
    return np.sqrt(np.mean((height(plane) - truth(plane)) ** 2))


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.03, 0.1, 0.3])
def test_the_error_of_a_smoothed_scan_is_well_below_its_noise(noise):
    points = scan(np.random.default_rng(0), noise=noise)
    assert rms_to_truth(HeightMap.fit(points)) < 0.45 * noise


@pytest.mark.parametrize("apart", [0.0, 2.0])
def test_the_noise_of_heights_is_that_about_a_tilted_plane_however_far_two_layers_are_apart(apart):
    rng = np.random.default_rng(7)
    plane, layer = rng.uniform(-20, 20, (4000, 2)), rng.choice([-0.5, 0.5], 4000)
    points = np.column_stack([plane, plane @ [0.3, -0.5] + apart * layer + 0.1 * rng.normal(size=4000)])
    # Points of two layers are half their distance off the middle; a point is a thirteenth of the plane it is held to.
    found = MAD * apart / 2 if apart else 0.1
    assert height_noise(points) == pytest.approx(12 / 13 * found, rel=NOISE_OF_HEIGHTS)


def test_a_minority_pass_is_not_followed():
    points = scan(np.random.default_rng(1), second=0.3)
    robust, plain = HeightMap.fit(points), HeightMap.fit(points, smoothing="gcv")
    assert rms_to_truth(robust) < 0.1
    assert rms_to_truth(plain) > 2 * rms_to_truth(robust)


def test_weights_reproduce_themselves_in_all_balls():
    """They are Huber's for the blend of a fit with them: balls are fitted again wherever a weight has moved."""
    points = scan(np.random.default_rng(1), second=0.3)
    plane, heights = points[:, :2].copy(), points[:, 2].copy()
    cover = Cover.fit(plane, np.array([plane.min(axis=0), plane.max(axis=0)]), (80, 160), 1.1)
    assert len(cover.radii) > 10
    problem = RobustHeight(cover, plane, heights, as_kernel("cubic", 2), 0.15)
    weights = problem.reweight(0.1, np.ones(len(plane)))
    fit = fit_splines(cover, ScatteredData(plane, heights, weights), SplineModel(problem.kernel, 1, Smoothing(0.1)))
    index = BallIndex.build(cover.centers, cover.radii, cover.bounds)
    left = np.abs(heights - PUInterpolant(cover, index, fit, None)(plane))
    assert np.mean(weights < 0.5) > 0.1
    assert np.abs(np.minimum(1, 0.15 / left) - weights).max() < 2 * TOLERANCE


@pytest.mark.slow
def test_the_kernel_hardly_matters():
    points = scan(np.random.default_rng(2), count=900)
    plane = np.random.default_rng(3).uniform([2, -4], [LENGTH - 2, 4], (2000, 2))
    cubic, spline = HeightMap.fit(points), HeightMap.fit(points, kernel="thin_plate_spline")
    assert np.sqrt(np.mean((cubic(plane) - spline(plane)) ** 2)) < 0.05


@pytest.mark.slow
def test_the_choice_scales_with_the_unit():
    points = scan(np.random.default_rng(4), count=900)
    small, large = HeightMap.fit(points), HeightMap.fit(1000 * points)
    assert large.choice.bandwidth == pytest.approx(1000 * small.choice.bandwidth, rel=1e-6)
    assert large.choice.noise == pytest.approx(1000 * small.choice.noise, rel=1e-9)
    plane = points[:200, :2]
    assert large(1000 * plane) / 1000 == pytest.approx(small(plane), abs=1e-6)


def test_the_paper_rho_is_that_of_the_thin_plate_spline():
    points = scan(np.random.default_rng(5), count=900)
    by_rho = HeightMap.fit(points, kernel=polyharmonic(2, 2), rho=1e-3, points_per_ball=(900, 900))
    by_number = HeightMap.fit(
        points, kernel=polyharmonic(2, 2), smoothing=1e-3 * 900 * 8 * np.pi, points_per_ball=(900, 900)
    )
    plane = points[:100, :2]
    assert by_rho(plane) == pytest.approx(by_number(plane), abs=1e-9)


def test_slopes_equal_central_differences_and_vanish_outside():
    height = HeightMap.fit(scan(np.random.default_rng(6), count=900), smoothing=1.0)
    plane, step = np.random.default_rng(7).uniform([2, -4], [LENGTH - 2, 4], (200, 2)), 1e-5
    numeric = np.stack([(height(plane + step * e) - height(plane - step * e)) / (2 * step) for e in np.eye(2)], axis=1)
    assert np.abs(numeric - height.gradient(plane)).max() <= ANALYTIC_VS_DIFFERENCE
    beyond = np.array([[-10.0, 0.0]])
    assert height(beyond) == pytest.approx(height(np.array([[height.bounds[0, 0], 0.0]])))
    assert height.gradient(beyond)[0, 0] == 0


def test_the_jet_is_height_slopes_and_their_slopes():
    height = HeightMap.fit(scan(np.random.default_rng(9), count=900), smoothing=1.0)
    plane, step = np.random.default_rng(10).uniform([-2, -6], [LENGTH + 2, 6], (300, 2)), 1e-5
    jet = height.jet(plane)
    assert jet[:, 0] == pytest.approx(height(plane), abs=TWIN)
    assert np.abs(jet[:, 1:3] - height.gradient(plane)).max() <= TWIN
    assert np.array_equal(height.jet(plane, 1), jet[:, :3])
    edge = np.abs(plane[:, None] - height.bounds).min(axis=(1, 2)) > step
    slopes = [(height.gradient(plane + step * e) - height.gradient(plane - step * e)) / (2 * step) for e in np.eye(2)]
    expected = np.column_stack([slopes[0][:, 0], slopes[0][:, 1], slopes[1][:, 1]])
    assert np.abs(jet[:, 3:] - expected)[edge].max() <= ANALYTIC_VS_DIFFERENCE


def test_noise_is_measured_about_the_surface_however_it_lies():
    rng = np.random.default_rng(8)
    points = scan(rng, count=4000, noise=0.05)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert plane_noise(points @ turn.T) == pytest.approx(plane_noise(points), rel=1e-6)
    # A plane through thirteen points takes three of their degrees of freedom.
    assert plane_noise(points) == pytest.approx(0.05 * np.sqrt(10 / 13), rel=0.05)


def test_huber_loss_is_square_then_straight():
    e = np.array([0.0, 0.5, 1.0, 3.0])
    assert huber_loss(e, 1.0) == pytest.approx([0, 0.125, 0.5, 2.5])


def test_bad_points_are_refused():
    with pytest.raises(InputError, match="NaN"):
        HeightMap.fit([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]])
    with pytest.raises(InputError, match="at least 3"):
        HeightMap.fit([[0, 0, 0]])
