"""Given normals that contradict one another along a line are told, and those of surfaces with two sides are not."""

import re

import numpy as np
import pytest

from cloud_shapes import block, moebius, slab, sphere, torus
from o3dleaf import OrientedCloud, preprocess_point_cloud, samples
from o3dleaf.surface.cloud.orientation.contradictions import find_contradicted


def told(points, normals):
    return [note for note in preprocess_point_cloud(points, normals=normals).notes if "contradict those" in note]


@pytest.mark.parametrize("start", [0.0, 2.0])
@pytest.mark.parametrize("scale", [1e-5, 1.0])
def test_normals_of_a_strip_with_one_side_are_told_with_the_place_where_they_change(start, scale):
    points, normals = moebius(6_000, 0.3, start)
    (note,) = told(scale * points, normals)
    place = [float(x) / scale for x in re.search(r"around (\S+) (\S+) (\S+):", note).groups()]
    spacing = OrientedCloud.of(points).spacing
    assert np.abs(np.angle(np.exp(1j * (np.arctan2(place[1], place[0]) - start)))) < 3 * spacing


@pytest.mark.parametrize("thick", [0.3, 0.6, 1.0])
def test_surfaces_with_two_sides_are_not_however_thin(thick):
    for points, normals in (sphere(2_000), torus(2_000), block(2_000), slab(4_000, thick)):
        assert not told(points, normals)


@pytest.mark.few(solid=1)
@pytest.mark.parametrize("solid", [samples.fold, samples.fins, samples.gap])
def test_thin_parts_under_noise_are_not(solid):
    points, normals = solid().sample(5_000)
    noise = 0.005 * np.linalg.norm(np.ptp(points, axis=0))
    assert not told(points + noise * np.random.default_rng(1).normal(size=points.shape), normals)


def test_one_wrong_normal_contradicts_the_others_and_they_not_one_another():
    xy = np.random.default_rng(2).uniform(size=(2_000, 2))
    normals = np.tile([0.0, 0.0, 1.0], (2_000, 1))
    normals[7] *= -1
    cloud = OrientedCloud.of(np.column_stack([xy, np.zeros(2_000)]))
    assert np.flatnonzero(find_contradicted(cloud, normals)).tolist() == [7]
