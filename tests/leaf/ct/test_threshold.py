"""The threshold lies between air and leaf, whatever noise, drift, padding and imbalance do to the histogram."""

import numpy as np
import pytest
from scipy.special import ndtr

from o3dleaf import Volume
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.mixture import _chances, fit_mixture
from o3dleaf.leaf.ct.threshold import histogram_threshold
from o3dleaf.samples import wheat_ct
from tolerances import MIXTURE_LEVEL, ROUND_LEVEL

METHODS = ["mixture", "valley", "otsu"]


@pytest.mark.few
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.025])
def test_between_the_peaks_of_a_noisy_drifting_leaf(method, noise):
    volume, truth = wheat_ct(seed=3, noise=noise, drift=0.15)
    clean = wheat_ct(seed=3, noise=0.0, drift=0.0)[0].data
    level = volume.threshold(method)
    # Between the peaks and in the valley: nearly no voxel deep in the leaf or far out in the air is on the wrong side.
    leaf, air = volume.data[clean > 1.99 * truth.level], volume.data[clean < 0.01 * truth.level]
    assert np.quantile(air, 0.95) < level < np.quantile(leaf, 0.05)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_two_peaks_of_any_share(method, share):
    rng = np.random.default_rng(5)
    leaf = rng.random(40_000) < share
    data = np.where(leaf, 200.0, 50.0) + rng.normal(0, 15, 40_000)
    level = histogram_threshold(data, method)
    assert 50 + 45 < level < 200 - 45


@pytest.mark.parametrize("method", METHODS)
def test_zero_padding_does_not_move_it(method):
    volume, _ = wheat_ct(seed=0)
    padded = np.pad(volume.data, 12)
    assert histogram_threshold(padded, method) == volume.threshold(method)


@pytest.mark.parametrize("method", METHODS)
def test_scales_and_shifts_with_the_intensities(method):
    volume, _ = wheat_ct(seed=0)
    data = volume.data.astype(float)
    bin_width = np.ptp(data) / 256
    moved = histogram_threshold(3000.0 * data + 500.0, method)
    assert abs((moved - 500.0) / 3000.0 - volume.threshold(method)) < bin_width


@pytest.mark.parametrize("method", METHODS)
def test_whole_number_intensities_will_do(method):
    volume, _ = wheat_ct(seed=0)
    gray = np.clip(np.rint(volume.data * 1000) + 40, 0, 255).astype(np.uint8)
    assert 60 < histogram_threshold(gray, method) < 200


def test_air_that_the_scanner_set_to_zero_counts_as_air():
    data = np.zeros(10_000)
    data[:4000] = np.random.default_rng(0).normal(200, 10, 4000)
    assert 0 < histogram_threshold(data) < 170


@pytest.mark.few
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["normal", "uniform", "exponential"])
def test_one_peak_is_refused(method, name):
    data = getattr(np.random.default_rng(2), name)(size=(40, 40, 40))
    with pytest.raises(InputError, match="two classes"):
        histogram_threshold(data, method)


@pytest.mark.parametrize("value", [0, 7])
def test_one_value_is_refused(value):
    volume = Volume(np.full((4, 4, 4), value), 1.0)
    for method in (*METHODS, 3.0):
        with pytest.raises(InputError, match=r"one value|range"):
            volume.threshold(method)


def test_an_unknown_method_is_refused():
    with pytest.raises(InputError, match="valley"):
        histogram_threshold(np.arange(10.0), "magic")


@pytest.mark.few(noise=2)
@pytest.mark.parametrize("noise", [0.0, 0.003, 0.01, 0.06])
def test_the_mixture_s_level_is_the_surface_s_at_every_noise(noise):
    volume, truth = wheat_ct(seed=1, noise=noise, drift=0.0)
    assert abs(volume.threshold() - truth.level) < MIXTURE_LEVEL * 2 * truth.level


@pytest.mark.few(sign=2)
@pytest.mark.parametrize(("sign", "noise"), [(1, 0.0), (1, 0.05), (-1, 0.0), (-1, 0.05)])
def test_the_level_is_the_surface_s_where_it_is_round(sign, noise):
    # A ball of four voxels, or its hole: parallel surfaces grow outward, and one class is a hundredth of the volume.
    place = np.linalg.norm(np.stack(np.meshgrid(*[np.arange(-12.0, 13)] * 3)), axis=0)
    data = 300 + 800 * (ndtr(sign * (4 - place)) + noise * np.random.default_rng(3).normal(size=place.shape))
    assert abs(histogram_threshold(data) - 700) < ROUND_LEVEL * 800


def test_the_slopes_of_the_mixture_are_its_own():
    edges, at, step = np.linspace(-0.1, 1.1, 60), np.array([0.2, -0.4, -2.5, -2.2, 0.3, -0.4, 0.2]), 1e-6
    slopes = _chances(at, edges, 0.01)[1]
    for k, move in enumerate(step * np.eye(7)):
        quotient = (_chances(at + move, edges, 0.01)[0] - _chances(at - move, edges, 0.01)[0]) / (2 * step)
        assert abs(slopes[k] - quotient).max() < 1e-8


def test_a_mixture_is_found_from_its_histogram():
    rng = np.random.default_rng(4)
    means, deviations, weights = np.array([40.0, 160.0]), np.array([12.0, 20.0]), np.array([0.5, 0.2, 0.3])
    kinds = rng.choice(3, 200_000, p=weights)
    share = np.where(kinds == 2, ndtr(rng.uniform(-3, 3, kinds.size)), kinds)
    spread = np.sqrt(deviations[0] ** 2 + share * (deviations[1] ** 2 - deviations[0] ** 2))
    data = means[0] + share * (means[1] - means[0]) + spread * rng.normal(size=kinds.size)
    found = fit_mixture(*np.histogram(data, bins=256))
    assert np.abs(found.means - means).max() < 0.01 * 120
    assert np.abs(found.deviations / deviations - 1).max() < 0.05
    assert np.abs(found.weights - weights).max() < 0.03


@pytest.mark.few
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", [np.uint8, np.int16, np.float32, ">u2"])
def test_the_level_does_not_depend_on_the_type_that_holds_the_intensities(kind, method):
    """To the last bit: where bins begin is not rounded as the intensities are. They stay in their order."""
    rng = np.random.default_rng(3)
    leaf = rng.random(30_000) < 0.4
    data = np.clip(np.where(leaf, 180.0, 60.0) + 12.0 * rng.standard_normal(leaf.shape), 1, 255).astype(kind)
    before = data.copy()
    assert histogram_threshold(data, method) == histogram_threshold(data.astype(np.float64), method)
    assert np.array_equal(data, before)
