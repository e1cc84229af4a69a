"""The noise of voxels: found where it is correlated, and by it a smoothing of least error."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from o3dleaf import PUInterpolant
from o3dleaf.fitting.cover.voxel_noise import REACH, VoxelNoise
from o3dleaf.fitting.cover.voxel_values import VoxelValues
from o3dleaf.fitting.rbf.smoothing import Spectrum, choose_by_risk, trial_values

SIZE, RADIUS, STEP, WIDTH = 48, 15.0, 100.0, 0.7


def ball(noise, *, width=WIDTH, drift=0.0, seed=1):
    """A ball of 100 in 0, blurred, with noise after a Gaussian, and a drift along the last axis."""
    axis = np.arange(SIZE) - (SIZE - 1) / 2
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    drawn = np.random.default_rng(seed).standard_normal(x.shape)
    if width:
        drawn = gaussian_filter(drawn, width, mode="wrap")
        drawn /= drawn.std()
    return STEP / (1 + np.exp((np.sqrt(x**2 + y**2 + z**2) - RADIUS) / 0.4)) + noise * drawn + drift * z / SIZE


def noise_of(data):
    return VoxelNoise.of(VoxelValues.of_array(data, STEP / 2))


def test_covariances_are_those_of_the_filter():
    found = noise_of(ball(8.0)).covariances / 64
    delta = np.zeros((41,) * 3)
    delta[20, 20, 20] = 1.0
    kernel = gaussian_filter(delta, WIDTH)
    exact = np.real(np.fft.ifftn(np.abs(np.fft.fftn(kernel)) ** 2))
    exact /= exact[0, 0, 0]
    near = np.arange(-3, 4)
    middle = found[np.ix_(*[near + REACH] * 3)]
    assert np.abs(middle - exact[np.ix_(*[near] * 3)]).max() < 0.04


@pytest.mark.parametrize(
    "data",
    [ball(8.0, width=0.0), ball(8.0, width=0.0, drift=20.0), ball(2.0), ball(0.0), ball(8.0) + STEP, ball(8.0)[:12]],
    ids=["independent", "drift", "slight", "none", "one side", "few voxels"],
)
def test_noise_that_cross_validation_can_tell_is_left_to_it(data):
    assert noise_of(data) is None


def test_voxels_far_apart_have_no_covariance():
    between = noise_of(ball(8.0)).between(np.array([[0, 0, 0], [1, 0, 0], [0, 9, 0]]))
    assert np.array_equal(between, between.T)
    assert between[0, 2] == 0
    assert 0.4 < between[0, 1] / between[0, 0] < 0.7


def test_the_least_risk_has_the_least_error():
    """Of coefficients with noise of known variances, whatever these are."""
    rng = np.random.default_rng(3)
    eigenvalues = np.repeat(np.geomspace(1e-4, 1.0, 60), 200)
    signal = eigenvalues**0.5 * rng.standard_normal(len(eigenvalues))
    for variances in (np.full(len(signal), 0.01), 0.05 * eigenvalues):
        seen = signal + np.sqrt(variances) * rng.standard_normal(len(signal))
        value, _ = choose_by_risk(Spectrum(eigenvalues, seen, len(signal), variances))

        def error(value, seen=seen):
            return np.sum((seen / (1 + value / eigenvalues) - signal) ** 2)

        assert error(value) < 1.05 * min(map(error, trial_values(eigenvalues)))


@pytest.mark.slow
def test_a_surface_in_correlated_noise_is_nearer_than_by_cross_validation(monkeypatch):
    data, clean = ball(14.0), ball(0.0)
    near = np.argwhere(np.abs(clean - STEP / 2) < 0.45 * STEP)

    def off():
        fit = PUInterpolant.fit_lattice(data, spacing=1.0, isovalue=STEP / 2, band=True, smoothing="gcv")
        return np.sqrt(np.mean((fit(near) + STEP / 2 - clean[tuple(near.T)]) ** 2))

    known = off()
    monkeypatch.setattr(VoxelNoise, "of", lambda _: None)
    assert known < 0.9 * off()
