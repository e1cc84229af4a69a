"""Noise is measured whatever its size beside the spacing, and averaging points loses none of them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from o3dleaf import OrientedCloud, estimate_noise, samples, voxel_down_sample
from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.downsample import remove_tails
from o3dleaf.surface.cloud.noise import Patches, is_shape
from o3dleaf.surface.cloud.normals import plane_normals
from o3dleaf.surface.cloud.parity_loops import measure_patches
from tolerances import MEANS, NOISE_SHARE, PATCH_QUADRIC, SPACING


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0, 2.0])
def test_noise_is_found_in_spacings(ratio):
    """σ from a tenth of the spacing to twice it, on a curved surface, comes back."""
    rng = np.random.default_rng(1)
    points, _ = samples.Sphere().sample(20_000, seed=2)
    sigma = ratio * OrientedCloud.of(points).spacing
    noisy = points + rng.normal(size=points.shape) * sigma
    assert estimate_noise(noisy) == pytest.approx(sigma, rel=NOISE_SHARE)


def test_noise_of_many_spacings_is_found():
    """A dense scan of a poor scanner: a patch as wide as its noise holds thousands of points, and is still a patch."""
    rng = np.random.default_rng(11)
    points = np.column_stack([rng.uniform(size=(40_000, 2)), np.zeros(40_000)])
    assert estimate_noise(points + rng.normal(size=points.shape) * [0, 0, 0.04]) == pytest.approx(0.04, rel=NOISE_SHARE)


def test_clean_data_have_little_noise():
    """What a quadric cannot follow on a clean sphere is far below the spacing; creases and rims do not count."""
    for solid in (samples.Sphere(), samples.Block()):
        points, _ = solid.sample(5_000, seed=3)
        assert estimate_noise(points) < 0.01 * OrientedCloud.of(points).spacing


def test_noise_scales_with_the_cloud():
    """Twice as large is twice as noisy: the noise is a length."""
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(size=(3_000, 2)), rng.normal(size=3_000) * 0.01])
    assert estimate_noise(1024.0 * points) == pytest.approx(1024.0 * estimate_noise(points), rel=1e-12)


def two_sheets(apart, sigma, tilt=0.0):
    """Return points and outward normals of two noisy squares that face away from one another, and of one alone.

    The normals are tilted at random, each within its own half of space, as those of neighbors on both sheets are.
    """
    rng = np.random.default_rng(12)
    side = np.repeat([-1.0, 1.0], 5_000)
    points = np.column_stack([rng.uniform(size=(10_000, 2)), side * apart / 2]) + sigma * rng.normal(size=(10_000, 3))
    normals = np.column_stack([tilt * rng.normal(size=(10_000, 2)), side])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return OrientedCloud.of(points, normals), OrientedCloud.of(points[side > 0], normals[side > 0])


@pytest.mark.parametrize("tilt", [0.0, 1.0])
@pytest.mark.parametrize("apart", [0.005, 0.03, 0.2])
def test_another_sheet_says_nothing_of_this_one(apart, tilt):
    """However near the other side of a thin part is, noise and spacing are those of one side alone."""
    both, alone = two_sheets(apart, 0.006, tilt)
    assert both.noise == pytest.approx(alone.noise, rel=NOISE_SHARE)
    assert both.spacing == pytest.approx(alone.spacing, rel=SPACING)
    assert both.noise == pytest.approx(0.006, rel=NOISE_SHARE)
    assert both.spacing == pytest.approx(1 / np.sqrt(5_000), rel=SPACING)


def test_what_is_known_by_side_is_known_anew_of_other_normals():
    """Without normals two near sheets are one thick one; with them noise and spacing are those of either."""
    both, _ = two_sheets(0.03, 0.006)
    without = OrientedCloud.of(both.points)
    thick, close = without.noise, without.spacing
    turned = without.with_normals(both.normals)
    assert turned.noise < 0.8 * thick
    assert turned.spacing != close
    shuffled = turned.reordered(np.arange(len(both))[::-1].copy())
    assert (shuffled.noise, shuffled.spacing) == (turned.noise, turned.spacing)


def test_normals_across_both_sides_are_found_by_side():
    """Normals tilted anywhere in their half of space come nearer to those of their sheet, all of them on its side."""
    both, _ = two_sheets(0.03, 0.006, tilt=1.0)
    truth = np.sign(both.normals[:, 2])
    found = plane_normals(both.points, both.normals, both.neighbors.row, both.noise)
    given, now = truth * both.normals[:, 2], truth * found[:, 2]
    assert (1 - now).mean() < (1 - given).mean() / 2
    assert (now < 0).mean() < 0.01


def test_right_normals_are_kept_under_noise():
    """Of a sphere, whose normals agree all over, none is another after the planes were asked."""
    points, normals = samples.Sphere().sample(3_000, seed=13)
    cloud = OrientedCloud.of(points + 0.02 * np.random.default_rng(13).normal(size=points.shape), normals)
    np.testing.assert_array_equal(
        plane_normals(cloud.points, cloud.normals, cloud.neighbors.row, cloud.noise), cloud.normals
    )


def rippled(sigma):
    """Return a square of waves six spacings long and 0.6 high, more than a quadric follows, with noise."""
    rng = np.random.default_rng(17)
    plane = rng.uniform(size=(10_000, 2))
    height = 0.006 * np.sin(plane @ [[100.0, 30.0], [-30.0, 100.0]]).sum(axis=1)
    return np.column_stack([plane, height]) + sigma * rng.normal(size=(10_000, 3))


def test_detail_is_not_taken_for_noise():
    """What smaller patches leave less of is shape: waves are clean, noise of the height that they seem to have is not.

    Nor are waves with noise.
    """
    clean = OrientedCloud.of(rippled(0.0))
    assert clean.noise > 0.1 * clean.spacing
    assert clean.is_clean
    flat = OrientedCloud.of(rippled(0.0) * [1, 1, 0] + clean.noise * np.random.default_rng(18).normal(size=(10_000, 3)))
    assert not flat.is_clean
    assert not OrientedCloud.of(rippled(clean.noise)).is_clean


@pytest.mark.parametrize("thickness", [0.5, 3.0, 100.0])
def test_noise_of_any_thickness_is_no_detail(thickness):
    """Where noise fills neighborhoods, patches of more points are wider, but no less full of it."""
    rng = np.random.default_rng(19)
    points = np.column_stack([rng.uniform(size=(10_000, 2)), np.zeros(10_000)])
    points += [0, 0, 0.01 * thickness] * rng.normal(size=points.shape)
    assert not is_shape(Patches(points, cKDTree(points)))


def test_deviations_of_patches_are_those_of_least_squares():
    """NumPy fits the quadric of a patch over its own axes, among the points on the side of its middle."""
    cloud, _ = two_sheets(0.005, 0.006, tilt=0.3)
    places = np.arange(0, 10_000, 400)
    rows = cloud.tree.query(cloud.points[places], k=40)[1]
    noise, area, counts = np.empty(25), np.empty(25), np.empty(25, dtype=np.int64)
    measure_patches(cloud.points, cloud.normals, places, rows, 12, 0, 25, noise, area, counts)
    for i, near in enumerate(rows):
        middle = cloud.normals[places[i]]
        for _ in range(3):
            middle = np.maximum(cloud.normals[near] @ middle, 0) @ cloud.normals[near]
        local = cloud.points[near[cloud.normals[near] @ middle > 0]]
        local = local - local.mean(axis=0)
        variance, axes = np.linalg.eigh(local.T @ local / len(local))
        z, u, v = (local @ axes).T
        terms = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
        rest = z - terms @ np.linalg.lstsq(terms, z)[0]
        assert counts[i] == len(local)
        assert noise[i] == pytest.approx(np.sqrt(rest @ rest / (len(local) - 6)), rel=PATCH_QUADRIC)
        assert area[i] == pytest.approx(4 * np.pi * np.sqrt(variance[1] * variance[2]), rel=PATCH_QUADRIC)


def test_a_volume_is_no_surface():
    """Points that fill a ball have no noise across a surface, and the message says so."""
    rng = np.random.default_rng(5)
    points = rng.normal(size=(4_000, 3))
    points *= (rng.random(4_000) ** (1 / 3) / np.linalg.norm(points, axis=1))[:, np.newaxis]
    with pytest.raises(InputError, match="is this a volume"):
        estimate_noise(points)


def test_merging_keeps_every_point():
    """Weights count the points, and weighted means are those of the cloud: nothing is lost or counted twice."""
    points, normals = samples.Torus().sample(4_000, seed=6)
    points.setflags(write=False)
    merged = voxel_down_sample(OrientedCloud.of(points, normals), 0.1)
    assert merged.weights.sum() == len(points)
    assert len(merged.points) < len(points) / 2
    np.testing.assert_allclose(merged.weights @ merged.points, points.sum(axis=0), rtol=0, atol=MEANS)
    np.testing.assert_allclose(np.linalg.norm(merged.normals, axis=1), 1.0, rtol=0, atol=MEANS)


def test_merging_is_a_mean_by_voxel_and_facing():
    """A dictionary of voxels, filled point by point, says the same, in the order of the first points."""
    points, normals = samples.Torus().sample(500, seed=7)
    found = voxel_down_sample(OrientedCloud.of(points, normals), 0.2)
    groups: dict[tuple[int, ...], list[int]] = {}
    first: dict[tuple[int, ...], int] = {}
    low = points.min(axis=0)
    for i, x in enumerate(points):
        voxel = tuple(np.floor((x - low) / 0.2).astype(int))
        away = normals[first.setdefault(voxel, i)] @ normals[i] < 0
        groups.setdefault((*voxel, int(away)), []).append(i)
    expected = np.array([points[rows].mean(axis=0) for rows in groups.values()])
    np.testing.assert_allclose(found.points, expected, rtol=0, atol=MEANS)


def test_the_sides_of_a_thin_sheet_are_not_averaged():
    """A sheet far thinner than a voxel keeps both its sides, each with its own normals."""
    rng = np.random.default_rng(8)
    side = np.repeat([-1.0, 1.0], 500)
    points = np.column_stack([rng.uniform(size=(1_000, 2)), 0.001 * side])
    normals = np.column_stack([np.zeros((1_000, 2)), side])
    merged = voxel_down_sample(OrientedCloud.of(points, normals), 0.25)
    np.testing.assert_allclose(merged.points[:, 2], 0.001 * merged.normals[:, 2], rtol=0, atol=MEANS)


@pytest.mark.parametrize(("size", "why"), [(0.0, "above zero"), (np.nan, "above zero")])
def test_voxels_that_cannot_be_meant(size, why):
    """The message names the size and what is wrong with it."""
    points, normals = samples.Sphere().sample(100, seed=9)
    with pytest.raises(InputError, match=why):
        voxel_down_sample(OrientedCloud.of(1e6 * points, normals), size)


def test_tails_go_and_thin_parts_stay():
    """Single points beside means of twenty are left out; as single, among their like, they stay."""
    rng = np.random.default_rng(10)
    dense, thin = rng.uniform(size=(400, 3)) * [1, 1, 0], rng.uniform(size=(400, 3)) * [1, 1, 0] + [5, 0, 0]
    astray = dense[:20] + [0, 0, 0.02]
    points = np.vstack([dense, astray, thin])
    weights = np.concatenate([np.full(400, 20.0), np.ones(20), np.ones(400)])
    kept = remove_tails(OrientedCloud.of(points, np.tile([0.0, 0, 1], (820, 1)), weights=weights))
    np.testing.assert_array_equal(kept.points, np.vstack([dense, thin]))


def test_normals_are_kept_where_points_are_off_the_planes_by_side():
    """Of waves that sixteen points do not resolve, planes know less than the normals that are there."""
    rng, count = np.random.default_rng(8), 2_000
    x, y = rng.uniform(0, np.sqrt(count), (2, count))
    points = np.column_stack([x, y, 1.5 * np.sin(x)])
    normals = np.column_stack([-1.5 * np.cos(x), np.zeros(count), np.ones(count)])
    cloud = OrientedCloud.of(points, normals)
    assert plane_normals(points, cloud.normals, cloud.neighbors.row, 0.12) is cloud.normals


def test_patches_are_the_nearest_points_whoever_asked_before():
    """Of the largest every eighth point of the cloud counts."""
    points = np.random.default_rng(3).uniform(size=(6_000, 3))
    patches = Patches(points, cKDTree(points))
    for some in (slice(0, 40), slice(20, 90, 3), slice(None)):
        places = np.arange(len(patches.rows))[some]
        for count, every in ((16, 1), (256, 1), (2048, 8)):
            expected = cKDTree(points[::every]).query(points[patches.rows[places]], k=count // every)
            distance, row = patches.nearest(count, places)
            np.testing.assert_array_equal(distance, expected[0])
            np.testing.assert_array_equal(row, every * expected[1])
