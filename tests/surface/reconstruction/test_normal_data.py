"""Normals that a fit takes for data: exact ones as they are, others only where no first fit's slopes predict better."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.fitter_selection import left_out_values
from o3dleaf.surface.cloud.constraints import offset_constraints
from o3dleaf.surface.reconstruction.fit import normal_data, surface_data
from tolerances import REFINED_NORMALS, SLOPES_DATA, SLOPES_ERROR

TORUS = o3l.samples.Torus()
POTENTIALS = ["hermite", "curl-free"]


def by_planes(points, normals):
    """Normals of planes through 30 points, on the side of others."""
    patches = points[cKDTree(points).query(points, k=30)[1]]
    patches -= patches.mean(axis=1, keepdims=True)
    found = np.linalg.eigh(np.einsum("nki,nkj->nij", patches, patches))[1][:, :, 0]
    return found * np.sign(np.sum(found * normals, axis=1, keepdims=True))


def error(field):
    places = TORUS.sample(2_000, 5)[0]
    return np.mean(np.abs(field(places)) / np.linalg.norm(field.gradient(places), axis=1))


@pytest.fixture(scope="module")
def points():
    return TORUS.sample(1_500)


@pytest.mark.few(local=1)
@pytest.mark.parametrize("local", POTENTIALS)
def test_exact_normals_are_used_as_they_are(points, local):
    cloud = o3l.OrientedCloud.of(*points)
    np.testing.assert_array_equal(normal_data(cloud, offset_constraints, local), cloud.normals)


@pytest.mark.few(local=1)
@pytest.mark.parametrize("local", POTENTIALS)
def test_with_normals_of_planes_the_surface_is_about_as_near_as_that_of_values(points, local):
    cloud = o3l.OrientedCloud.of(points[0], by_planes(*points))
    own = error(o3l.fit_surface(cloud, local=local))
    assert own < SLOPES_ERROR * error(o3l.fit_surface(cloud))
    planes = o3l.PUInterpolant.fit_oriented(cloud.points, cloud.normals, local=local)
    assert own < REFINED_NORMALS * error(planes)


def test_what_corrects_a_field_has_the_normals_that_it_was_fitted_to(points):
    cloud = o3l.OrientedCloud.of(points[0], by_planes(*points))
    field = o3l.fit_surface(cloud, local="hermite")
    fitted = surface_data(cloud, local="hermite").normals
    assert normal_data(cloud, offset_constraints, "hermite") is normal_data(cloud, offset_constraints, "hermite")
    assert np.abs(field.gradient(cloud.points) + fitted).max() < SLOPES_DATA


def test_dense_and_sparse_parts_of_a_cloud_are_judged_apart():
    """Normals are off where points are dense, and exact where they are a fifth as dense: there they stay."""
    rng = np.random.default_rng(0)
    plane = np.vstack([rng.uniform(0, 1, (1_500, 2)), rng.uniform(0.4, 0.6, (2_500, 2))])
    slopes = np.column_stack([2 * np.cos(4 * plane[:, 0]), -np.sin(2 * plane[:, 1])])
    points = np.column_stack([plane, 0.5 * np.sin(4 * plane[:, 0]) + 0.5 * np.cos(2 * plane[:, 1])])
    normals = np.column_stack([-slopes, np.ones(len(plane))])
    dense = (np.abs(plane - 0.5) < 0.1).all(axis=1)
    normals[dense] += 0.05 * rng.normal(size=(dense.sum(), 3))
    cloud = o3l.OrientedCloud.of(points, normals)
    taken = normal_data(cloud, offset_constraints, "hermite")
    kept = (taken == cloud.normals).all(axis=1)
    far = (np.abs(plane - 0.5) > 0.2).any(axis=1)
    assert kept[far].all()
    assert not kept[(np.abs(plane - 0.5) < 0.08).all(axis=1)].any()


def test_values_at_points_left_out_know_nothing_of_them(points):
    """Other normals there, and other points that are left out beside them, change no bit."""
    data, rows = ScatteredData.on_surface(*points), np.arange(0, 1_500, 50)
    values = left_out_values(data, o3l.Hermite(), rows)
    turned = data.normals.copy()
    turned[rows] = turned[rows][:, ::-1]
    np.testing.assert_array_equal(left_out_values(replace(data, normals=turned), o3l.Hermite(), rows), values)
    moved = data.points[rows] + 0.01 * data.normals[rows]
    away = np.concatenate([data.points, moved])
    more = ScatteredData.on_surface(away, np.concatenate([data.normals, turned[rows]]))
    both = np.concatenate([rows, np.arange(1_500, len(away))])
    assert np.abs(left_out_values(more, o3l.Hermite(), both)[len(rows) :] + 0.01).max() < REFINED_NORMALS * 0.01
