"""Neighbours are found once: what is handed on says what everyone would have found."""

import numpy as np
from scipy.spatial import cKDTree

from cloud_shapes import torus
from o3dleaf.surface.cloud import neighbors
from o3dleaf.surface.cloud.neighbors import nearest_neighbours
from o3dleaf.surface.cloud.noise import estimate_noise
from o3dleaf.surface.cloud.oriented_cloud import prepare_cloud
from o3dleaf.surface.cloud.point_spacing import cloud_spacing


def test_neighbours_are_the_trees_whatever_the_batches(monkeypatch):
    points, _ = torus(3000)
    distance, row = cKDTree(points).query(points, 16)
    monkeypatch.setattr(neighbors, "BATCH", 701)
    told = []
    found = nearest_neighbours(points, progress=lambda *at: told.append(at))
    assert np.array_equal(found.distance, distance)
    assert np.array_equal(found.row, row)
    assert told[-1] == (3000, 3000)
    assert len(told) == 5


def test_equal_points_are_found_by_value_not_by_bits():
    points, normals = torus(2000)
    points[:300, 2] = 0.0
    twins = points[:300] * [1, 1, -1]  # the other zero
    cloud = prepare_cloud(np.concatenate([points, twins]), normals=np.concatenate([normals, normals[:300]]))
    assert cloud.repeated == 300
    assert np.array_equal(cloud.points, points)


def test_neighbourhoods_handed_on_are_those_of_the_points():
    points, normals = torus(4000)
    bad = np.concatenate([points[:50], [[np.nan] * 3], points, [[40.0, 0, 0]]])
    cloud = prepare_cloud(bad, normals=np.concatenate([normals[:50], [[0, 0, 1]], normals, [[0, 0, 1]]]))
    merged = prepare_cloud(bad, normals=np.ones((len(bad), 3)), voxel_size=0.1, orient=None)
    for some in (cloud, merged):
        alone = nearest_neighbours(some.points)
        assert np.array_equal(some.near.row, alone.row)
        assert np.array_equal(some.near.distance, alone.distance)
        for one, other in zip(cloud_spacing(some.points, alone), cloud_spacing(some.points), strict=True):
            assert np.array_equal(one, other)
        assert some.spacing == cloud_spacing(some.points).median
        assert estimate_noise(some.points, some.near.tree) == estimate_noise(some.points)
    assert (cloud.repeated, cloud.non_finite, cloud.stray) == (50, 1, 1)
