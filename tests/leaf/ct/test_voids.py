"""Voids and loose pieces are what is enclosed and what lies apart, with the volume that they have."""

import numpy as np
import pytest

from o3dleaf import Volume
from o3dleaf.leaf.ct.voids import levels_around, pieces_at_levels

STEP = 2.0


def block():
    """A block of leaf with two voids, one pocket that is open, two specks beside it; paler where it is thin."""
    data = np.zeros((20, 18, 16))
    data[3:15, 3:15, 3:13] = 1.0
    data[5:7, 5:8, 5:9] = 0.0
    data[10, 10, 10] = 0.0
    data[12:15, 8, 8] = 0.0
    data[17, 3:6, 4] = 1.0
    data[18, 16, 14] = 0.4
    return Volume(data, (STEP, STEP, 3 * STEP), unit="um")


def test_what_is_enclosed_and_what_lies_apart():
    low, high = pieces_at_levels(block(), np.array([0.2, 0.7]))
    voxel = 3 * STEP**3
    assert (low.voids, low.void_volume) == (high.voids, high.void_volume) == (2, 25 * voxel)
    assert (low.pieces, low.piece_volume) == (2, 4 * voxel)
    assert (high.pieces, high.piece_volume) == (1, 3 * voxel)
    assert low.share == pytest.approx(np.mean(block().data > 0.2))


def test_air_and_leaf_do_not_both_pass_a_corner():
    data = np.zeros((8, 8, 8))
    data[2:6, 2:6, 2:6] = 1.0
    data[3:5, 3:5, 3:5] = 0.0
    data[2, 2, 3:5] = 0.0  # touches the hollow along an edge only
    (row,) = pieces_at_levels(Volume(data, 1.0), np.array([0.5]))
    assert (row.voids, row.pieces) == (1, 0)


def test_turned_or_mirrored_it_is_the_same_volume():
    volume = block()
    (first,) = pieces_at_levels(volume, np.array([0.5]))
    for turned in (volume.data[::-1], volume.data.transpose(2, 0, 1), volume.data[:, ::-1, ::-1]):
        (row,) = pieces_at_levels(Volume(turned, 1.0), np.array([0.5]))
        assert (row.voids, row.pieces, row.share) == (first.voids, first.pieces, first.share)


def test_levels_lie_between_air_and_leaf_with_the_middle_among_them():
    levels = levels_around(100.0, 300.0)
    assert (np.diff(levels) > 0).all()
    assert levels[0] > 100
    assert levels[-1] < 300
    assert 200.0 in levels
