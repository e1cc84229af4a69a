"""Hairs that the sides of a volume cut are found; where none is cut, none is; the crop that is proposed cuts none."""

import numpy as np
import pytest

from o3dleaf import Volume
from o3dleaf.leaf.ct.hairs import find_cut_hairs
from o3dleaf.samples import wheat_ct

LEVEL = 0.095


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_none_is_cut_in_a_whole_patch(noise):
    for seed in range(3):
        assert find_cut_hairs(wheat_ct(seed=seed, noise=noise)[0], LEVEL).count == 0


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 1, 0)])
def test_a_hair_that_is_cut_is_found_and_avoided(order):
    volume, truth = wheat_ct(seed=2)
    hair = truth.hairs[truth.hairs[:, 5] > truth.hairs[:, 2]][0]
    box = volume.bounds.copy()
    # Through its foot: what is left stands out.
    box[0, 0] = hair[0] + 10
    turned = lambda v: Volume(v.data.transpose(order), v.spacing, v.origin[list(order)], v.unit)  # noqa: E731
    cut = turned(volume.crop(box))
    found = find_cut_hairs(cut, LEVEL)
    assert found.count > 0
    assert (found.crop >= cut.bounds[0] - 1e-6).all()
    assert (found.crop <= cut.bounds[1] + 1e-6).all()
    left = cut.crop(found.crop)
    assert find_cut_hairs(left, LEVEL).count == 0
    assert np.prod(left.shape) >= 0.5 * np.prod(cut.shape)


def test_nothing_is_found_in_nothing():
    assert find_cut_hairs(Volume(np.zeros((9, 9, 9)), 1.0), 0.5).count == 0
