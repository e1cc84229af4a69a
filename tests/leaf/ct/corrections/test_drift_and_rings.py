"""Drift and rings that were put into a volume are taken out of it; of what has none hardly anything is taken."""

from functools import cache

import numpy as np
import pytest

from o3dleaf import Volume, remove_drift, remove_rings
from o3dleaf.errors import InputError
from o3dleaf.leaf.ct.corrections.drift import find_drift
from o3dleaf.leaf.ct.corrections.rings import find_rings, middle, middle_slices
from o3dleaf.samples import wheat_ct
from tests.tolerances import DRIFT_LEFT, RINGS_LEFT, UNTOUCHED

STEP = 0.19
"""From air to leaf, in the samples."""


@cache
def patch(noise, seed=0):
    return wheat_ct(seed=seed, noise=noise, spacing=12)[0]


def with_data(volume, data):
    return Volume(data, volume.spacing, volume.origin, volume.unit)


def drifting(volume, offset=0.05, gain=0.2):
    z = np.linspace(0, 1, volume.shape[2])
    return with_data(volume, volume.data * (1 + gain * z**2) + offset * np.sin(3 * z))


def rings_of(volume, axis, height=0.03, seed=3):
    """Rings of a volume that are linear between multiples of a voxel, other ones in every slice."""
    x, y = (volume.origin[k] + volume.spacing[k] * np.arange(volume.shape[k]) - axis[k] for k in range(2))
    radii = np.hypot(x[:, None], y) / volume.spacing[0]
    knots = np.arange(int(radii.min()), int(radii.max()) + 2)
    heights = height * np.random.default_rng(seed).standard_normal((volume.shape[2], len(knots)))
    return np.stack([np.interp(radii, knots, row) for row in heights], axis=2)


def off(volume, other):
    return float(np.sqrt(np.mean((volume.data - other.data) ** 2)))


def off_but_for_scale(volume, other):
    """Of two volumes, one of which may have another unit of intensity and another zero."""
    x, y = (each.data.ravel().astype(np.float64) for each in (volume, other))
    return float(np.std(np.polyval(np.polyfit(x, y, 1), x) - y))


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.05])
def test_drift_is_taken_out(noise):
    clean = patch(noise)
    given = drifting(clean)
    left = off_but_for_scale(remove_drift(given), clean)
    assert left < DRIFT_LEFT * off_but_for_scale(given, clean) + 0.1 * noise


@pytest.mark.few(noise=3)
@pytest.mark.parametrize(
    ("noise", "place"),
    [(0.0, (0.5, 0.5)), (0.05, (0.5, 0.5)), (0.02, (0.4, 0.55)), (0.05, (-0.3, 0.2)), (0.02, (12.0, 30.0))],
)
def test_rings_are_taken_out_around_any_axis(noise, place):
    clean = patch(noise)
    axis = clean.bounds[0, :2] + np.array(place) * 1680
    given = with_data(clean, clean.data + rings_of(clean, axis))
    assert off(remove_rings(given, axis), clean) < RINGS_LEFT * off(given, clean)


@pytest.mark.few(noise=1, seed=1)
@pytest.mark.parametrize("noise", [0.05, 0.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_what_has_none_stays_nearly_as_it_is(noise, seed):
    volume = patch(noise, seed)
    assert off(remove_drift(volume), volume) < UNTOUCHED * max(noise, 0.02)
    assert off(remove_rings(volume), volume) < UNTOUCHED * max(noise, 0.02)
    assert find_drift(volume).largest < UNTOUCHED * max(noise, 0.02) / STEP


def test_rings_of_one_place_of_a_circle_are_none():
    """A blot in one sector is not spread over the circle: two halves of it do not agree."""
    volume = patch(0.02)
    data = volume.data.copy()
    data[10:20, 10:20] += 0.03
    blot = with_data(volume, data)
    change = np.abs(remove_rings(blot).data - blot.data)
    assert change.mean() < 0.1 * 0.03


@pytest.mark.few(scale=1)
@pytest.mark.parametrize(("scale", "zero"), [(2.0**10, 2.0**7), (2.0**-20, 0.0)])
def test_both_go_with_the_intensities_and_with_the_unit(scale, zero):
    volume = drifting(patch(0.02))
    other = Volume(volume.data * scale + zero, volume.spacing * 1e-3, volume.origin * 1e-3, "mm")
    for correct in (remove_drift, remove_rings):
        np.testing.assert_allclose((correct(other).data - zero) / scale, correct(volume).data, atol=1e-5 * STEP, rtol=0)


@pytest.mark.slow
def test_parts_are_those_of_the_whole(monkeypatch):
    volume = drifting(patch(0.02))
    whole = [correct(volume).data for correct in (remove_drift, remove_rings)]
    monkeypatch.setattr("o3dleaf.leaf.ct.corrections.pure.SLAB", 3 * 140 * 140)
    parts = [correct(volume).data for correct in (remove_drift, remove_rings)]
    np.testing.assert_allclose(whole, parts, atol=1e-6 * STEP, rtol=0)  # sums in another order


def test_slices_about_the_middle_keep_their_place(monkeypatch):
    volume = patch(0.02)
    monkeypatch.setattr("o3dleaf.leaf.ct.corrections.rings.MAX_VOXELS", 6 * 140 * 140)
    part = middle_slices(volume)
    np.testing.assert_array_equal(part.data, volume.crop(part.bounds).data)
    assert part.shape == (140, 140, 6)
    np.testing.assert_allclose(middle(part), middle(volume))


def test_without_air_and_leaf_there_is_nothing_to_compare():
    flat = Volume(np.random.default_rng(0).normal(size=(20, 20, 20)), 1.0)
    for correct in (remove_drift, remove_rings, find_rings):
        with pytest.raises(InputError, match="two classes"):
            correct(flat)


def test_the_axis_is_two_numbers():
    with pytest.raises(InputError, match="axis"):
        remove_rings(patch(0.02), (1.0, 2.0, 3.0))


def test_an_axis_that_is_nowhere_near_is_refused():
    """A number in another unit, as a rule."""
    with pytest.raises(InputError, match=r"lies 1.*e\+06 voxels away"):
        remove_rings(patch(0.02), (14e6, 0.0))
