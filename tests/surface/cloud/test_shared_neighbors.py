"""Neighbors, spacings and noise are found once: what a cloud keeps is what everyone would have found."""

import numpy as np
from scipy.spatial import cKDTree

from cloud_shapes import torus
from o3dleaf import OrientedCloud, adaptive_down_sample, preprocess_point_cloud
from o3dleaf.core import progress
from o3dleaf.surface.cloud.neighbors import nearest_neighbors


def test_neighbors_are_the_trees_whatever_the_batches():
    points, _ = torus(3000)
    distance, row = cKDTree(points).query(points, 16)
    reported = []
    with progress.listening(lambda *done: reported.append(done)):
        near = nearest_neighbors(cKDTree(points), batch=701)
        assert reported[-1][0] == reported[-1][1]
    assert np.array_equal(near.distance, distance)
    assert np.array_equal(near.row, row)
    assert len(reported) == 5


def test_equal_points_are_found_by_value_not_by_bits():
    points, normals = torus(2000)
    points[:300, 2] = 0.0
    twins = points[:300] * [1, 1, -1]  # the other zero
    given = np.concatenate([normals, normals[:300]])
    # The flattened points are a wall inside the torus: three sheets meet where it ends.
    cloud = preprocess_point_cloud(np.concatenate([points, twins]), normals=given, branchings=None)
    assert cloud.removed.repeated == 300
    assert np.array_equal(cloud.points, points)


def test_what_a_cloud_keeps_is_that_of_its_points():
    points, normals = torus(4000)
    bad = np.concatenate([points[:50], [[np.nan] * 3], points, [[40.0, 0, 0]]])
    cloud = preprocess_point_cloud(bad, normals=np.concatenate([normals[:50], [[0, 0, 1]], normals, [[0, 0, 1]]]))
    averaged = preprocess_point_cloud(bad, normals=np.ones((len(bad), 3)), voxel_size=0.1, orient=None)
    for some in (cloud, averaged):
        alone = OrientedCloud.of(some.points, some.normals)
        assert np.array_equal(some.neighbors.row, alone.neighbors.row)
        assert np.array_equal(some.neighbors.distance, alone.neighbors.distance)
        assert np.array_equal(some.point_spacing, alone.point_spacing)
        assert some.spacing == alone.spacing
        assert some.noise == alone.noise
    assert cloud.removed == (1, 50, 1, 0, 0)


def test_a_cloud_that_dropped_its_neighbors_keeps_its_spacings():
    cloud = preprocess_point_cloud(torus(4000)[0])
    known = cloud.spacing, cloud.point_spacing.copy(), cloud.neighbors.row.copy()
    cloud.compact()
    assert not {"neighbors", "surfels"} & set(vars(cloud))
    assert (cloud.spacing, np.array_equal(cloud.point_spacing, known[1])) == (known[0], True)
    assert np.array_equal(cloud.neighbors.row, known[2])


def test_a_clean_cloud_is_not_averaged_and_comes_back_with_all_that_was_found_of_it():
    cloud = preprocess_point_cloud(torus(4000)[0])
    assert adaptive_down_sample(cloud) is cloud
