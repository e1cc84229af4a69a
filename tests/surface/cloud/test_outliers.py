"""Outliers of a cloud and of a scan: few, counted, and the same however the cloud is held."""

import weakref
from functools import partial

import numpy as np
import open3d as o3d
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cloud_shapes import sphere, torus
from o3dleaf import OrientedCloud, detect_outliers, read_point_cloud
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.pipeline import is_far
from o3dleaf.surface.cloud import oriented_cloud, outliers
from o3dleaf.surface.cloud.neighbors import nearest_neighbors
from o3dleaf.surface.cloud.usable_points import remove_faults, usable_rows
from tolerances import SCATTERED, UNEVEN


def cloud_of(points):
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(points, dtype=np.float64)))


def test_points_beside_a_surface_are_outliers_from_four_spacings_on():
    """No point of a random cloud is, and of one 32 times as dense on one half only few of the other."""
    points, normals = torus(20_000)
    spacing = OrientedCloud.of(points).spacing
    rng = np.random.default_rng(12)
    beside = rng.choice(20_000, 40, replace=False)
    lifted = points[beside] + rng.uniform(4.5, 9, size=(40, 1)) * spacing * normals[beside]
    assert not detect_outliers(points).any()
    assert np.array_equal(np.flatnonzero(detect_outliers(np.vstack([points, lifted]))), np.arange(20_000, 20_040))
    xy = rng.uniform(size=(33_000, 2))
    uneven = np.column_stack([xy[:, 0] * np.repeat([1, -1], [32_000, 1_000]), xy[:, 1], np.zeros(33_000)])
    assert detect_outliers(uneven).sum() < 33


@pytest.mark.few(count=2)
@pytest.mark.parametrize("count", [300, 3_000, 12_000])
def test_points_scattered_through_space_are_outliers(count):
    """Nine of ten of them, and none of a clean or a noisy surface beside them; a twelfth of its density is no cause."""
    points, normals = torus(10_000)
    rng = np.random.default_rng(4)
    scattered = rng.uniform(-2, 2, (count, 3))
    spacing = OrientedCloud.of(points).spacing
    away = cKDTree(points).query(scattered)[0] > 6 * spacing
    for noise in (0.0, 0.5):
        noisy = points + noise * spacing * rng.normal(size=(10_000, 1)) * normals
        found = detect_outliers(np.vstack([noisy, scattered]), max_gap=np.inf, max_ratio=np.inf)
        assert not found[:10_000].any()
        assert found[10_000:][away].mean() > SCATTERED
        assert not detect_outliers(
            np.vstack([noisy, scattered]), max_gap=np.inf, max_ratio=np.inf, max_clutter=np.inf
        ).any()
    sheet = np.column_stack([rng.uniform(3, 4, (800, 2)), 0.1 * rng.normal(size=800) * spacing])
    wire = np.column_stack([np.linspace(-3, 3, 200), np.full(200, 3.0), 1e-3 * rng.normal(size=200)])
    assert not detect_outliers(np.vstack([points, 3 * sheet, wire]), max_gap=np.inf, max_ratio=np.inf).any()


def test_neighbors_of_rounds_before_are_not_kept(monkeypatch):
    """A cloud that thins out loses clutter round by round: its own neighbors stay, and those of the last round."""
    known = []

    def recorded(*arguments):
        assert sum(each() is not None for each in known[1:]) == 0
        near = nearest_neighbors(*arguments)
        known.append(weakref.ref(near.distance))
        return near

    monkeypatch.setattr(oriented_cloud, "nearest_neighbors", recorded)
    rng = np.random.default_rng(0)
    cloud = OrientedCloud.of(rng.normal(size=(2_000, 3)) * np.exp(rng.normal(size=(2_000, 1))))
    detect_outliers(cloud, max_clutter=1.2)
    assert len(known) > 3


def test_a_surface_of_few_points_beside_a_dense_one_is_no_outlier():
    """Ground around a ball of 600 times its density, also where both are one; what is beside the ground goes."""
    rng = np.random.default_rng(5)
    ball = rng.normal(size=(20_000, 3))
    ball *= 0.2 / np.linalg.norm(ball, axis=1)[:, np.newaxis]
    ground = np.column_stack([rng.uniform(-3, 3, (2_000, 2)), np.zeros(2_000)])
    above = ground[::200] + [0.0, 0.0, 1.5]
    patch = np.column_stack([rng.uniform(-0.2, 0.2, (20_000, 2)), np.zeros(20_000)])
    for dense in (ball + [0.0, 0.0, 1.0], patch):
        found = detect_outliers(np.vstack([dense, ground, above]))
        assert not found[:20_000].any()
        assert found[20_000:-10].mean() < UNEVEN
        assert found[-10:].all()


@pytest.mark.few(scale=2)
@pytest.mark.parametrize("shape", [sphere, torus])
@pytest.mark.parametrize("scale", [7e-7, 1.0, 3e6])
def test_a_solid_of_two_densities_loses_no_point_and_groups_beside_it_go(shape, scale):
    """One half has a twentieth of the other's points; up to four points are some six spacings above either."""
    points, normals = shape(24_000)
    rng = np.random.default_rng(8)
    kept = (points[:, 0] < 0) | (rng.random(24_000) < 1 / 20)
    points, normals = points[kept], normals[kept]
    assert not detect_outliers(scale * points).any()
    spacing = OrientedCloud.of(points).point_spacing
    for side in (points[:, 0] < -0.2, points[:, 0] > 0.2):
        chosen = rng.choice(np.flatnonzero(side), 5, replace=False)
        above = points[chosen] + 6 * spacing[chosen, np.newaxis] * normals[chosen]
        groups = np.repeat(above, [1, 1, 2, 3, 4], axis=0)
        groups += 0.2 * np.repeat(spacing[chosen], [1, 1, 2, 3, 4])[:, np.newaxis] * rng.normal(size=groups.shape)
        found = detect_outliers(scale * np.vstack([points, groups]))
        assert not found[: len(points)].any()
        assert found[len(points) :].all()


@pytest.mark.few(max_ratio=1)
@pytest.mark.parametrize("max_ratio", [outliers.MAX_RATIO, np.inf])
def test_forty_points_scattered_around_a_solid_are_outliers_though_they_are_near_one_another_by_their_own_density(
    max_ratio,
):
    points, _ = torus(10_000)
    for seed in range(5):
        scattered = np.random.default_rng(seed).uniform(-2, 2, (40, 3))
        away = scattered[cKDTree(points).query(scattered)[0] > 10 * OrientedCloud.of(points).spacing]
        found = detect_outliers(np.vstack([points, away]), max_ratio=max_ratio)
        assert np.array_equal(np.flatnonzero(found), 10_000 + np.arange(len(away)))


def test_points_scattered_above_a_plane_or_far_beside_it_are_no_sparse_sheet(monkeypatch):
    """Forty above it, of which many are linked to one another: no more stay than where no sparse sheet is asked for."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        plane = np.column_stack([rng.uniform(0, 100, (10_000, 2)), np.zeros(10_000)])
        above = np.column_stack([rng.uniform(35, 65, (40, 2)), rng.uniform(6, 24, 40)])
        group = [140.0, 50.0, 0.0] + rng.normal(size=(20, 3)) * [2.0, 2.0, 0.0]
        points = np.vstack([plane, above, group])
        found = detect_outliers(points)
        assert found[-20:].all()
        with monkeypatch.context() as without:
            without.setattr(outliers, "SHEET", (16, 0.0))
            assert np.array_equal(found, detect_outliers(points))


def lines_of_a_tip(shortest):
    """Points a quarter apart on lines four apart, from forty on a line to the shortest."""
    lines = [
        np.column_stack([0.25 * np.arange(count) - count / 8, np.full(count, 4.0 * line), np.zeros(count)])
        for line, count in enumerate(range(40, shortest - 1, -2))
    ]
    return np.concatenate(lines)


@pytest.mark.parametrize(("find", "shortest"), [(detect_outliers, 2), (is_far, 8)])
def test_scan_lines_of_a_tip_are_no_outliers_however_short(find, shortest):
    """Of a line of six points each one's eight nearest are on others: by their distance these are far from all."""
    assert not find(lines_of_a_tip(shortest)).any()


def test_clusters_are_those_of_all_points_within_the_reach(monkeypatch):
    """The twin links all pairs; lines, groups and single points lie at random."""
    monkeypatch.setattr(outliers, "SHEET", (16, 0.0))
    sizes = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        tip = lines_of_a_tip(2)
        groups = np.repeat(rng.uniform([-30, 0, 0], [30, 80, 40], (12, 3)), rng.integers(1, 30, 12), axis=0)
        points = np.vstack([tip, groups + rng.normal(size=groups.shape)])
        reach = outliers.MAX_GAP * np.median(cKDTree(points).query(points, 9)[0][:, -1])
        distance = np.linalg.norm(points[:, np.newaxis] - points, axis=2)
        cluster = connected_components(csr_array(distance <= reach))[1]
        small = np.bincount(cluster)[cluster] < outliers.MIN_CLUSTER
        found = detect_outliers(points, max_ratio=np.inf, max_clutter=np.inf)
        assert np.array_equal(found, small)
        sizes += np.unique(np.bincount(cluster)[cluster[small]]).tolist()
    assert min(sizes) == 1
    assert max(sizes) > 8  # more than the neighbors that are looked at first


@pytest.mark.parametrize("ratio", [1.0, 2.0, 10.0])
def test_the_statistical_criterion_is_open3ds(ratio):
    rng = np.random.default_rng(3)
    points = rng.normal(size=(3000, 3)) * rng.uniform(0.1, 3, size=(3000, 1))
    _, kept = cloud_of(points).remove_statistical_outlier(nb_neighbors=8, std_ratio=ratio)
    found = detect_outliers(points, max_gap=np.inf, max_ratio=np.inf, max_clutter=np.inf, std_ratio=ratio)
    assert np.array_equal(np.flatnonzero(~found), np.sort(kept))
    assert found.any() or ratio == 10


@pytest.mark.parametrize("step", [is_far, detect_outliers])
def test_repeated_and_stray_points_go_and_are_counted(step):
    rng = np.random.default_rng(1)
    leaf = np.column_stack([rng.uniform(0, 100, 3000), rng.uniform(-5, 5, 3000), np.zeros(3000)])
    far = np.array([[50.0, 0, 400], [-300, 0, 0]])
    cloud = remove_faults(np.concatenate([leaf, leaf[:7], far]), step)
    assert (cloud.removed.repeated, cloud.removed.outliers) == (7, 2)
    assert np.array_equal(cloud.points, leaf)


def test_the_largest_group_of_outliers_is_told_with_its_number_its_length_and_its_place():
    points, _ = torus(5_000)
    places = np.repeat([[3.0, 0.0, 0.0], [0.0, -4.0, 0.0], [0.0, 0.0, 5.0]], [1, 5, 3], axis=0)
    places[1:6, 0] += np.linspace(-0.04, 0.04, 5)
    told = [remove_faults(np.vstack([points, some])).decisions[-1] for some in (places, places[[0, 1, 8]], places[:1])]
    assert told[0] == "the largest group of outliers has 5 points, is 0.08 long, and at 0.000 -4.000 0.000"
    assert told[1].startswith("the outliers are apart from one another, one of them at ")
    assert told[2] == "the outlier is at 3.000 0.000 0.000"


@pytest.mark.few
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("copies", [1, 3])
def test_points_that_were_rounded_repeat_those_that_were_not(scale, copies):
    rng = np.random.default_rng(6)
    leaf = scale * np.column_stack([rng.uniform(0, 100, (3000, 2)), np.zeros(3000)])
    rounded = [each.astype(dtype).astype(float) for each, dtype in zip([leaf] * 3, ["f4", "f4", "f8"], strict=True)]
    rounded[1] *= 1 + 2e-7
    some = rng.random(3000) < 0.3
    for chosen in (some, np.ones(3000, dtype=bool)):
        cloud = remove_faults(np.concatenate([leaf, *(each[chosen] for each in rounded[:copies])]), None)
        assert cloud.removed.repeated == copies * chosen.sum()
        assert np.array_equal(cloud.points, leaf)


def test_points_of_a_place_a_million_times_as_dense_repeat_no_others():
    rng = np.random.default_rng(7)
    dense = rng.normal(0, 1e-3, (200, 3)) * [1, 1, 0]
    around = rng.uniform(-100, 100, (3000, 3)) * [1, 1, 0]
    assert remove_faults(np.concatenate([dense, around]), None).removed.repeated == 0


def test_the_real_leaf_keeps_its_thin_parts(real_scan):
    cloud = remove_faults(read_point_cloud(real_scan("wheat/wheat_leaf.ply")), is_far)
    assert cloud.removed.repeated == 0
    assert cloud.removed.outliers <= 3


def test_tensor_clouds_and_arrays_are_taken_alike():
    points = np.random.default_rng(2).uniform(0, 1, (200, 3))
    tensor = o3d.t.geometry.PointCloud(o3d.core.Tensor(points))
    for held in (points, cloud_of(points), tensor, OrientedCloud.of(points)):
        assert np.array_equal(remove_faults(held, is_far).points, remove_faults(points, is_far).points)


@pytest.mark.parametrize("step", [is_far, detect_outliers])
@pytest.mark.parametrize("points", [np.ones((200, 3)), np.random.default_rng(4).uniform(0, 1e300, (200, 3))])
def test_a_scan_of_one_place_or_beyond_all_sizes_is_refused(points, step):
    with pytest.raises(InputError, match=r"is it damaged|1e-30 to 1e[+]30"):
        remove_faults(points, step)


def test_a_wrapped_step_finds_what_the_bare_one_finds():
    points = np.vstack([torus(2000)[0], [[9.0, 9, 9]]])
    bare, wrapped = (remove_faults(points, step) for step in (detect_outliers, partial(detect_outliers)))
    assert np.array_equal(bare.points, wrapped.points)
    assert np.array_equal(bare.points, points[:-1])
    assert np.array_equal(usable_rows(points), np.arange(len(points) - 1))


@pytest.mark.parametrize("count", [3, 9])
def test_few_points_are_called_few_and_many_that_are_one_damaged(count):
    with pytest.raises(InputError, match=f"has {count} points, too few to show a surface; give at least 10$"):
        remove_faults(np.random.default_rng(1).random((count, 3)))
    with pytest.raises(InputError, match=r"1 of 30 points .* is it damaged"):
        remove_faults(np.ones((30, 3)))


def test_of_points_that_are_mostly_repeated_none_is_divided_by_nothing():
    """Nine of ten points lie at two places: their spacing is 0, and that of the others is their own."""
    points = sphere(400, np.random.default_rng(0))[0]
    points[40:] = points[np.random.default_rng(1).integers(0, 2, 360)]
    with np.errstate(all="raise", under="ignore"):
        assert len(detect_outliers(points)) == 400
