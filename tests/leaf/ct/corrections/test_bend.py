"""A bend that a blade was given is found, and taken out: what is left is the blade as it was."""

from functools import cache

import numpy as np
import pytest

from o3dleaf import TextureOptions, Volume, create_texture, remove_bend
from o3dleaf.commands.patch import PatchJob
from o3dleaf.core.errors import DataWarning
from o3dleaf.leaf.ct.corrections import bend as of_bend
from o3dleaf.leaf.ct.corrections.bend import find_bend
from o3dleaf.samples import wheat_ct
from tests.tolerances import BEND_LEFT, BEND_OFF

STEP = 24.0


@cache
def sample(seed=0):
    return wheat_ct(seed=seed, spacing=STEP, noise=0.0, drift=0.0)


def raised(volume, terms):
    """The heights of a quadric over a volume of 24 micrometers, about their middle."""
    x, y = np.meshgrid(*(STEP * (np.arange(volume.shape[k]) - (volume.shape[k] - 1) / 2) for k in range(2)))
    heights = terms[0] * x.T**2 + terms[1] * (x * y).T + terms[2] * y.T**2
    return heights - (heights.max() + heights.min()) / 2


@cache
def bent(terms, seed=0, noise=0.0):
    """The sample as a scanner sees it where its blade bends, and the heights; nothing is resampled."""
    volume, truth = sample(seed)
    heights, more = raised(volume, terms), 8
    x, y, z = (volume.origin[k] + STEP * np.arange(volume.shape[k]) for k in range(2 + 1))
    z = np.concatenate([z[0] - STEP * np.arange(more, 0, -1), z, z[-1] + STEP * np.arange(1, more + 1)])
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    points[..., 2] -= heights[:, :, np.newaxis]
    low, high = truth.bounds
    data = truth(np.clip(points, low, high).reshape(-1, 3)).reshape(points.shape[:3])
    data += np.random.default_rng(seed).normal(0, noise, data.shape) if noise else 0.0
    return Volume(data, STEP, [x[0], y[0], z[0]], volume.unit), heights


BENDS = [(2e-4, 0.0, 0.0), (0.0, 0.0, -2e-4), (1e-4, 1e-4, -1e-4), (1e-4, -2e-4, 1e-4)]


@pytest.mark.few(terms=2)
@pytest.mark.parametrize("terms", BENDS)
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_bend_is_found(terms, noise):
    volume, heights = bent(terms, noise=noise)
    found = find_bend(volume)
    u, v = (volume.origin[k] + STEP * np.arange(volume.shape[k]) for k in range(2))
    off = found.heights(u, v) - heights
    assert np.std(off) < BEND_OFF * STEP
    assert found.prevails
    assert found.range == pytest.approx(np.ptp(heights), abs=0.5 * STEP)


@pytest.mark.few(terms=1)
@pytest.mark.parametrize("terms", BENDS)
def test_without_its_bend_the_blade_is_as_it_was(terms):
    volume, _ = bent(terms)
    clean, _ = bent((0.0, 0.0, 0.0))
    straight = remove_bend(volume)
    assert find_bend(straight).range < 0.5 * STEP
    assert straight.shape[2] > volume.shape[2]
    # By whole voxels: both stand on one lattice, and the middles of blades may differ by part of a voxel.
    inner = straight.crop(clean.voxel_bounds)
    assert off(inner, clean) < BEND_LEFT * off(volume, clean)


def off(volume, other):
    return float(np.sqrt(np.mean((volume.data - other.data) ** 2)))


@pytest.mark.few(order=1)
@pytest.mark.parametrize("order", [(1, 2, 0), (2, 0, 1), (1, 0, 2)])
def test_it_is_the_same_along_any_axis(order):
    volume, _ = bent(BENDS[2])
    turned = Volume(volume.data.transpose(order), STEP, volume.origin[list(order)], volume.unit)
    straight, expected = remove_bend(turned), remove_bend(volume)
    np.testing.assert_allclose(straight.data.transpose(np.argsort(order)), expected.data, rtol=0, atol=1e-6)
    np.testing.assert_allclose(straight.origin[np.argsort(order)], expected.origin, rtol=0, atol=1e-9)


def test_what_does_not_bend_is_not_touched():
    for seed in range(2):
        volume = wheat_ct(seed=seed)[0]
        assert remove_bend(volume) is volume
        assert not find_bend(volume).prevails


def test_a_plate_neither_bends_nor_has_relief():
    data = np.zeros((30, 40, 20))
    data[:, :, 8:13] = 0.2
    found = find_bend(Volume(data, 1.0), 0.1)
    assert (found.range < 1e-9, found.prevails) == (True, False)


def test_beside_a_sample_air_is_moved_no_farther_than_the_blade():
    volume, heights = bent(BENDS[0])
    padded = Volume(np.pad(volume.data, ((40, 40), (0, 0), (0, 0))), STEP, volume.origin - [40 * STEP, 0, 0], "um")
    found = find_bend(padded)
    assert found.range == pytest.approx(np.ptp(heights), abs=0.5 * STEP)
    assert remove_bend(padded).shape[2] - padded.shape[2] == 2 * np.ceil(found.range / 2 / STEP)


def test_slabs_are_those_of_the_whole(monkeypatch):
    volume, _ = bent(BENDS[3])
    whole = remove_bend(volume).data
    monkeypatch.setattr(of_bend, "SLAB", 9 * whole.shape[1] * whole.shape[2])
    np.testing.assert_allclose(remove_bend(volume).data, whole, rtol=0, atol=1e-6)


def test_a_bend_that_tiles_would_repeat_is_said_and_none_that_was_removed():
    volume, _ = bent(BENDS[0])
    with pytest.warns(DataWarning, match="every tile repeats it"):
        create_texture(volume, options=TextureOptions(rho=0.0))
    assert not find_bend(remove_bend(volume)).prevails


def test_the_command_straightens(tmp_path):
    from o3dleaf import write_volume

    volume, _ = bent(BENDS[0])
    write_volume(volume, tmp_path / "bent.tif")
    job = PatchJob(tmp_path / "bent.tif", tmp_path / "a.o3l", remove_bend=True)
    np.testing.assert_allclose(job.read_volume(job.volume).data, remove_bend(volume).data, rtol=0, atol=1e-6)
