from functools import partial

import numpy as np
import pytest
from scipy.spatial import cKDTree

import o3dleaf as o3l
from cloud_shapes import block, ellipsoid, slab, sphere, torus
from o3dleaf import OrientedCloud, offset_constraints
from o3dleaf.core.mesh_arrays import mesh_arrays
from tolerances import NEAREST, TIPS_HELD


def constraints(points, normals, distance, **options):
    """Return those of all points."""
    return offset_constraints(OrientedCloud.of(points, normals), distance, every=1, **options)


SHAPES = {"sphere": sphere, "torus": torus, "block": block, "slab": slab}


@pytest.mark.parametrize("shape", SHAPES)
def test_no_point_is_nearer_to_a_site_than_the_one_it_stands_off_from(shape):
    cloud = OrientedCloud.of(*SHAPES[shape](4000))
    sites, values, base = offset_constraints(cloud, 0.05, every=1)
    assert cKDTree(cloud.points).query(sites)[0] == pytest.approx(np.abs(values), rel=NEAREST)
    assert np.array_equal(sites, cloud.points[base] - values[:, np.newaxis] * cloud.normals[base])


def test_sites_keep_to_a_third_of_what_is_between_two_sheets():
    points, normals = slab(8000)
    thickness = np.ptp(points[:, 2])
    faces = np.flatnonzero(np.abs(normals[:, 2]) > 0.5)
    _, values, base = constraints(points, normals, 10 * thickness, floor=0.01)
    inside = np.isin(base, faces) & (values > 0)
    assert np.median(values[inside]) == pytest.approx(thickness / 3, rel=0.2)
    assert values[inside].max() < thickness / 2


def test_sites_of_sparse_points_stand_off_by_their_own_spacing():
    """Up to twice the median counts as it: a tenth of the points, twenty times as far apart, have ten times as much."""
    rng = np.random.default_rng(8)
    near, far = rng.uniform(0, 1, (9_000, 2)), rng.uniform(5, 5 + np.sqrt(1_000 / 9_000) * 20, (1_000, 2))
    cloud = OrientedCloud.of(np.pad(np.vstack([near, far]), ((0, 0), (0, 1))), np.tile([0.0, 0, 1], (10_000, 1)))
    _, values, base = offset_constraints(cloud)
    least, most = (np.median(np.abs(values[rows])) for rows in (base < 9_000, base >= 9_000))
    assert most / least == pytest.approx(10, rel=0.1)
    even = OrientedCloud.of(cloud.points[:9_000], cloud.normals[:9_000])
    assert len(np.unique(np.abs(offset_constraints(even).values))) == 1


def test_sites_stand_off_the_farther_the_noisier_a_cloud_is():
    points, normals = sphere(2000)
    noise = np.random.default_rng(1).normal(size=len(points))
    distance = []
    for share, weights in ((0.0, None), (0.3, None), (0.3, np.full(len(points), 2.0))):
        spacing = OrientedCloud.of(points, normals).spacing
        moved = points + (share * spacing * noise)[:, np.newaxis] * normals
        cloud = OrientedCloud.of(moved, normals, weights=weights, spacing=np.full(len(points), spacing))
        distance.append(np.abs(offset_constraints(cloud).values).max() / cloud.spacing)
    assert distance[0] < 0.8 * distance[1]
    assert distance[1] < 0.8 * distance[2]


def test_tips_of_few_clean_points_are_held_by_sites_near_them():
    """Of a thin ellipsoid, whose tips bend within a spacing: sites as far off as noise asks for let it bulge there."""
    semiaxes, largest = np.array([1.0, 0.25, 0.12]), np.zeros(2)
    for seed in range(4):
        cloud = OrientedCloud.of(*ellipsoid(600, semiaxes, seed))
        for k, distance in enumerate((None, 0.7 * cloud.spacing)):
            chosen = partial(offset_constraints, distance=distance)
            mesh, _ = o3l.create_from_point_cloud_rbfpu(cloud, constraints=chosen, measure=None)
            vertices = mesh_arrays(mesh)[0]
            slopes = vertices / semiaxes**2
            off = np.abs((vertices * slopes).sum(axis=1) - 1) / (2 * np.linalg.norm(slopes, axis=1))
            largest[k] += off.max()
    assert largest[0] < TIPS_HELD * largest[1]


def test_larger_is_inside_and_each_side_can_be_had_alone():
    points, normals = sphere(500)
    both = constraints(points, normals, 0.02)
    outer, inner = (constraints(points, normals, 0.02, sides=side) for side in ("outside", "inside"))
    assert (np.linalg.norm(outer.sites, axis=1) > 1).all()
    assert (outer.values < 0).all()
    assert (np.linalg.norm(inner.sites, axis=1) < 1).all()
    assert (inner.values > 0).all()
    for part, name in enumerate(both._fields):
        assert np.array_equal(both[part], np.concatenate([getattr(outer, name), getattr(inner, name)]))


def test_noise_thicker_than_the_spacing_takes_no_room():
    points, normals = sphere(20000)
    noise = 3 * np.sqrt(4 * np.pi / len(points))
    points += np.random.default_rng(1).normal(size=points.shape) * noise
    _, values, _ = constraints(points, normals, noise)
    assert np.abs(values) == pytest.approx(np.full(2 * len(points), noise))


def test_a_site_without_room_is_left_out():
    points = np.array([[0.0, 0, 0], [0, 0, 0.1]])
    normals = np.array([[0.0, 0, -1], [0, 0, 1]])
    kept = constraints(points, normals, 1.0, floor=0.1)
    assert (kept.values < 0).all()
    assert np.array_equal(kept.base, [0, 1])


@pytest.mark.parametrize("distance", [0.0, -1.0, np.nan])
def test_a_distance_that_is_none_is_refused(distance):
    with pytest.raises(o3l.errors.InputError, match="distance"):
        constraints(*sphere(20), distance)


def test_constraints_are_shown_in_a_line():
    points, normals = sphere(500)
    assert repr(constraints(points, normals, 0.05)) == "OffsetConstraints(1,000 sites)"
