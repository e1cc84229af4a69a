import numpy as np
import open3d as o3d
import pytest

from cloud_shapes import sphere, torus
from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.oriented_cloud import prepare_cloud
from o3dleaf.surface.cloud.point_spacing import cloud_spacing
from o3dleaf.surface.cloud.stray import find_stray_points


def test_what_does_no_good_goes_and_is_counted_and_the_rest_keeps_its_order():
    points, normals = torus(3000)
    far = [5.0, 0, 0] + 0.01 * np.random.default_rng(0).normal(size=(8, 3))
    bad = np.array([[np.nan, 0, 0], [0, np.inf, 0]])
    order = np.random.default_rng(1).permutation(3000 + 8 + 2)
    dirty = np.concatenate([points, far, bad])[order]
    directions = np.concatenate([normals, np.ones((10, 3))])[order]
    cloud = prepare_cloud(np.concatenate([dirty, dirty[:5]]), normals=np.concatenate([directions, directions[:5]]))
    good = order < 3000
    assert (cloud.non_finite, cloud.repeated, cloud.stray, cloud.merged) == (2, 5, 8, 0)
    assert np.array_equal(cloud.points, dirty[good])
    assert cloud.normals == pytest.approx(directions[good])


def test_legacy_clouds_tensor_clouds_and_arrays_are_taken_alike():
    points, normals = sphere(500)
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    legacy.normals = o3d.utility.Vector3dVector(normals)
    tensor = o3d.t.geometry.PointCloud(o3d.core.Tensor(points))
    tensor.point.normals = o3d.core.Tensor(normals)
    plain = prepare_cloud(points, normals=normals)
    for held in (legacy, tensor):
        assert np.array_equal(prepare_cloud(held).points, plain.points)
        assert np.array_equal(prepare_cloud(held).normals, plain.normals)


def test_normals_that_are_missing_or_flipped_are_mended():
    points, normals = sphere(3000)
    rng = np.random.default_rng(2)
    given = 3 * normals
    given[rng.choice(3000, 30)] *= -1
    given[5], given[6] = 0, np.nan
    cloud = prepare_cloud(points, normals=given)
    assert (np.einsum("ij,ij->i", cloud.normals, normals) > 0.9).all()
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(np.ones(3000))
    assert len(cloud.notes) == 2


@pytest.mark.parametrize(("points", "message"), [(np.full((20, 3), np.nan), "0 of 20"), (np.ones((20, 2)), "shape")])
def test_a_cloud_without_points_is_refused(points, message):
    with pytest.raises(InputError, match=message):
        prepare_cloud(points, normals=np.ones((20, 3)))


def test_points_beside_a_surface_are_stray_from_four_spacings_on():
    """No point of a random cloud is, and of one 32 times as dense on one half only few of the other."""
    points, normals = torus(20_000)
    spacing = cloud_spacing(points).median
    rng = np.random.default_rng(12)
    beside = rng.choice(20_000, 40, replace=False)
    lifted = points[beside] + rng.uniform(4.5, 9, size=(40, 1)) * spacing * normals[beside]
    assert not find_stray_points(points).any()
    assert np.array_equal(np.flatnonzero(find_stray_points(np.vstack([points, lifted]))), np.arange(20_000, 20_040))
    xy = rng.uniform(size=(33_000, 2))
    uneven = np.column_stack([xy[:, 0] * np.repeat([1, -1], [32_000, 1_000]), xy[:, 1], np.zeros(33_000)])
    assert find_stray_points(uneven).sum() < 33
