import re
from functools import partial

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from cloud_shapes import block, sphere, torus
from o3dleaf import OrientedCloud, detect_outliers, estimate_normals, orient_normals, preprocess_point_cloud, samples


def test_what_does_no_good_goes_and_is_counted_and_the_rest_keeps_its_order():
    points, normals = torus(3000)
    far = [5.0, 0, 0] + 0.01 * np.random.default_rng(0).normal(size=(8, 3))
    bad = np.array([[np.nan, 0, 0], [0, np.inf, 0]])
    order = np.random.default_rng(1).permutation(3000 + 8 + 2)
    dirty = np.concatenate([points, far, bad])[order]
    directions = np.concatenate([normals, np.ones((10, 3))])[order]
    cloud = preprocess_point_cloud(
        np.concatenate([dirty, dirty[:5]]), normals=np.concatenate([directions, directions[:5]])
    )
    good = order < 3000
    assert cloud.removed == (2, 5, 8, 0, 0)
    assert np.array_equal(cloud.points, dirty[good])
    assert cloud.normals == pytest.approx(directions[good])


def test_legacy_clouds_tensor_clouds_and_arrays_are_taken_alike():
    points, normals = sphere(500)
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    legacy.normals = o3d.utility.Vector3dVector(normals)
    tensor = o3d.t.geometry.PointCloud(o3d.core.Tensor(points))
    tensor.point.normals = o3d.core.Tensor(normals)
    plain = preprocess_point_cloud(points, normals=normals)
    for held in (legacy, tensor):
        assert np.array_equal(preprocess_point_cloud(held).points, plain.points)
        assert np.array_equal(preprocess_point_cloud(held).normals, plain.normals)


@pytest.mark.parametrize("empty", [0.0, np.nan])
def test_normals_that_were_never_filled_are_none(empty):
    points = np.random.default_rng(0).standard_normal((800, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    with_none = o3l.preprocess_point_cloud(points)
    with_empty = o3l.preprocess_point_cloud(points, normals=np.full_like(points, empty))
    assert np.array_equal(with_empty.normals, with_none.normals)
    assert with_empty.notes == with_none.notes


def test_normals_that_are_missing_or_flipped_are_mended():
    points, normals = sphere(3000)
    rng = np.random.default_rng(2)
    given = 3 * normals
    given[rng.choice(3000, 30)] *= -1
    given[5], given[6] = 0, np.nan
    cloud = preprocess_point_cloud(points, normals=given)
    assert (np.einsum("ij,ij->i", cloud.normals, normals) > 0.9).all()
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(np.ones(3000))
    assert len(cloud.notes) == 2


@pytest.mark.few
@pytest.mark.parametrize("kind", ["one direction", "chance"])
@pytest.mark.parametrize("viewpoint", [None, [9.0, 9.0, 9.0]])
def test_normals_that_lie_across_the_surface_are_not_used(kind, viewpoint):
    """As where a writer puts 0 0 1 for what it does not know; right ones of solids with edges are, every one."""
    points, normals = torus(4_000)
    wrong = np.broadcast_to([0.0, 0, 1], points.shape)
    if kind == "chance":
        wrong = np.random.default_rng(6).normal(size=points.shape)
    cloud = preprocess_point_cloud(points, normals=wrong, viewpoint=viewpoint)
    assert np.abs(np.einsum("ij,ij->i", cloud.normals, normals)).min() > 0.9
    assert "of the given normals lie across the planes of their neighbors" in cloud.notes[0]
    if viewpoint is None:
        assert (np.einsum("ij,ij->i", cloud.normals, normals) > 0.9).all()
    for points, normals in (block(4_000), torus(4_000)):
        kept = preprocess_point_cloud(points, normals=normals)
        assert not kept.notes
        assert kept.normals == pytest.approx(normals)


@pytest.mark.parametrize(("points", "message"), [(np.full((20, 3), np.nan), "0 of 20"), (np.ones((20, 2)), "shape")])
def test_a_cloud_without_points_is_refused(points, message):
    with pytest.raises(o3l.errors.InputError, match=message):
        preprocess_point_cloud(points, normals=np.ones((20, 3)))


def test_steps_that_are_wrapped_do_what_the_bare_ones_do():
    """On a noisy cloud, whose sides are found on groups of points: the very normals, whoever calls the steps."""
    points = torus(3000)[0]
    points += 0.028 * np.random.default_rng(3).normal(size=points.shape)
    bare = preprocess_point_cloud(points)
    wrapped = preprocess_point_cloud(points, outliers=partial(detect_outliers), orient=partial(orient_normals))
    assert np.array_equal(bare.points, wrapped.points)
    assert np.array_equal(bare.normals, wrapped.normals)
    assert bare.spacing == wrapped.spacing
    estimated = [
        preprocess_point_cloud(points, estimate=step) for step in (estimate_normals, partial(estimate_normals))
    ]
    assert np.array_equal(estimated[0].normals, estimated[1].normals)


def test_a_cloud_that_was_preprocessed_stays_as_it_is():
    points, normals = torus(3000)
    once = preprocess_point_cloud(points, normals=normals)
    again = preprocess_point_cloud(once)
    assert np.array_equal(again.points, once.points)
    assert again.normals == pytest.approx(once.normals)
    weighted = preprocess_point_cloud(OrientedCloud.of(points, normals, weights=np.arange(1.0, 3001)))
    assert np.array_equal(weighted.weights, np.arange(1.0, 3001))


def test_a_cloud_says_what_it_is_in_a_line():
    cloud = preprocess_point_cloud(torus(3000)[0])
    assert re.fullmatch(r"OrientedCloud\(3,000 points with normals, spacing 0\.0\d+, noise \d\S+\)", repr(cloud))
    assert repr(OrientedCloud.of(torus(50)[0])) == "OrientedCloud(50 points)"
    assert repr(orient_normals(cloud)) == "Orientation(3,000 normals, notes ())"


@pytest.mark.few(wrong=1)
@pytest.mark.parametrize(("wrong", "together"), [(0.1, True), (0.0, True), (0.1, False)])
def test_right_normals_that_contradict_one_another_are_kept_and_wrong_ones_are_not(wrong, together):
    """Planes through thirty points of a thin noisy plate stand anywhere, but on the right sides they enclose it."""
    solid = samples.fins(0.0566)
    points, _ = solid.sample(5_000)
    points = points + 0.007 * np.linalg.norm(np.ptp(points, axis=0)) * np.random.default_rng(3).normal(
        size=points.shape
    )
    truth = solid.closest(points).normals
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    given = np.asarray(cloud.normals)
    given = np.where((given * truth).sum(axis=1)[:, np.newaxis] < 0, -given, given)
    place = np.linalg.norm(points - points[0], axis=1) if together else np.random.default_rng(5).random(len(points))
    given[np.argsort(place)[: int(wrong * len(points))]] *= -1
    found = preprocess_point_cloud(points, normals=given).normals
    assert np.mean((found * truth).sum(axis=1) > 0) > (0.99 if wrong == 0 else 0.93)
