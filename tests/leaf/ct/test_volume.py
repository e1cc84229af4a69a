"""A volume knows where its voxels are, and samples them without moving or losing any."""

import numpy as np
import pytest

from o3dleaf import Volume
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.leaf.ct.volume import apply_transform


@pytest.fixture
def volume():
    """Three different sizes, spacings and origins, so that no axis can stand for another."""
    data = np.random.default_rng(1).normal(size=(4, 5, 7))
    data.flags.writeable = False
    return Volume(data, (1.0, 2.0, 4.0), (10.0, 20.0, 30.0), "um")


def test_voxel_centers_and_faces(volume):
    assert np.array_equal(volume.voxel_bounds, [[10, 20, 30], [13, 28, 54]])
    assert np.array_equal(volume.bounds, [[9.5, 19, 28], [13.5, 29, 56]])


def test_samples_are_centers_and_intensity_less_level(volume):
    points, values = volume.to_samples(0.1)
    for n in (0, 17, 101, len(points) - 1):
        index = np.rint((points[n] - volume.origin) / volume.spacing).astype(int)
        assert np.array_equal(volume.origin + volume.spacing * index, points[n])
        assert values[n] == volume.data[tuple(index)] - 0.1
    assert len(points) == len(np.unique(points, axis=0)) == volume.data.size


def test_a_mask_a_motion_and_bounds_select_and_move_points_only(volume):
    mask = volume.data > 0
    turn = np.array([[0.0, -1, 0, 5], [1, 0, 0, -3], [0, 0, 1, 2], [0, 0, 0, 1]])
    plain, kept = volume.to_samples(0.0, mask=mask)
    moved, values = volume.to_samples(0.0, mask=mask, transform=turn)
    assert (kept > 0).all()
    assert len(kept) == mask.sum()
    assert np.array_equal(values, kept)
    assert np.array_equal(moved, plain[:, [1, 0, 2]] * [-1, 1, 1] + [5, -3, 2])
    box = np.quantile(moved, [0.2, 0.8], axis=0)
    inside = ((moved >= box[0]) & (moved <= box[1])).all(axis=1)
    points, values = volume.to_samples(0.0, mask=mask, transform=turn, bounds=box)
    assert 0 < len(points) < len(moved)
    assert np.array_equal(points, moved[inside])
    assert np.array_equal(values, kept[inside])


def test_crop_keeps_every_voxel_at_its_place(volume):
    part = volume.crop([[10.5, 20, 33], [13, 26.5, 47]])
    assert part.shape == (3, 4, 4)
    points, values = part.to_samples(0.0)
    everything = {tuple(p): v for p, v in zip(*volume.to_samples(0.0), strict=True)}
    assert all(everything[tuple(p)] == v for p, v in zip(points, values, strict=True))
    assert np.array_equal(volume.crop(volume.bounds).data, volume.data)


@pytest.mark.parametrize(
    ("data", "spacing", "says"),
    [
        (np.zeros((3, 3)), 1.0, "shape"),
        (np.zeros((3, 1, 3)), 1.0, "at least 2"),
        (np.zeros((3, 3, 3, 3)), 1.0, "shape"),
        (np.full((3, 3, 3), np.nan), 1.0, "NaN"),
        (np.zeros((3, 3, 3), dtype=complex), 1.0, "real"),
        (np.zeros((3, 3, 3)), 0.0, "above zero"),
        (np.zeros((3, 3, 3)), (1.0, -1.0, 1.0), "above zero"),
        (np.zeros((3, 3, 3)), (1.0, 1.0), "three"),
    ],
)
def test_what_is_no_volume_is_refused_with_its_cause(data, spacing, says):
    with pytest.raises(InputError, match=says):
        Volume(data, spacing)


def test_an_unknown_unit_is_refused():
    with pytest.raises(UnitError, match="parsec"):
        Volume(np.zeros((2, 2, 2)), 1.0, unit="parsec")


def test_a_level_without_a_surface_is_refused(volume):
    with pytest.raises(InputError, match="range"):
        volume.to_samples(100.0)
    with pytest.raises(InputError, match="no voxel"):
        volume.to_samples(0.0, bounds=[[0, 0, 0], [1, 1, 1]])


def test_a_foreign_byte_order_becomes_this_machines():
    data = np.arange(8.0).reshape(2, 2, 2)
    volume = Volume(data.astype(">f4"), 1.0)
    assert volume.data.dtype.isnative
    assert np.array_equal(volume.data, data)


def test_a_motion_must_be_four_by_four():
    with pytest.raises(InputError, match="transform"):
        apply_transform(np.eye(3), np.zeros((1, 3)))
