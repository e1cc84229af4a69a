"""A cloud thinned to a number of points stands for the same cloud."""

import numpy as np
import pytest

from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.downsample import thin
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from tolerances import SAME_MOMENTS


@pytest.fixture(scope="module")
def sheet():
    rng = np.random.default_rng(7)
    x, y = rng.uniform(-1, 1, (2, 30_000))
    return np.column_stack([3 * x, y, 0.2 * np.sin(3 * x)])


@pytest.mark.parametrize("most", [1, 50, 2_000, 29_999])
def test_means_stand_for_all_points(sheet, most):
    cloud = thin(sheet, most)
    assert most / 3 <= len(cloud) <= most
    assert cloud.weights.sum() == len(sheet)
    assert cloud.removed.averaged == len(sheet) - len(cloud)
    assert np.average(cloud.points, axis=0, weights=cloud.weights) == pytest.approx(
        sheet.mean(axis=0), abs=SAME_MOMENTS
    )


def test_means_lie_in_the_voxels_of_their_points(sheet):
    """Each point is as near to a mean as the diagonal of a voxel: a few hundred of them cover a sheet of 6 by 2."""
    means = thin(sheet, 1_000).points
    gap = np.linalg.norm(sheet[np.newaxis, ::10] - means[:, np.newaxis], axis=2).min(axis=0)
    assert gap.max() < np.sqrt(3 * 12 / (1_000 / 3))


def test_a_cloud_of_few_points_is_itself(sheet):
    cloud = OrientedCloud.of(sheet)
    assert thin(cloud, len(sheet)) is cloud
    assert np.array_equal(thin(sheet, len(sheet)).points, sheet)


def test_nothing_is_no_number_of_points(sheet):
    with pytest.raises(InputError, match="most"):
        thin(sheet, 0)


def test_weights_add_up_in_turn(sheet):
    """A mean of means is the mean of all their points."""
    again = thin(thin(sheet, 5_000), 1)
    assert again.weights.tolist() == [len(sheet)]
    assert again.points[0] == pytest.approx(sheet.mean(axis=0), abs=SAME_MOMENTS)
