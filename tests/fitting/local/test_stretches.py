"""Distances that are longer where the normals of a ball's points differ."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import o3dleaf as o3l
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.splines import Splines, fit_splines
from o3dleaf.fitting.local.stretches import StretchedCover, stretched
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.reconstruction.fit import surface_data
from tolerances import FOLD_BY_NORMALS, ROUNDING, STRETCHED_COORDINATES

BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
TURN = Rotation.from_euler("xyz", [20.0, 50.0, 80.0], degrees=True).as_matrix()
ALONG_Z = np.array([0.0, 0.0, 1.0])


def one_ball(count):
    """A ball of radius 2 about a point, with all points."""
    return Cover(np.full((1, 3), 0.1), np.full(1, 2.0), BOX, np.array([0, count]), np.arange(count))


def stretch_of(normals, weights=None):
    """The stretch of a ball whose points have some normals."""
    points = np.random.default_rng(0).uniform(-1, 1, (len(normals), 3))
    groups = np.arange(len(normals))
    data = ScatteredData(points, np.zeros(len(normals)), weights, groups, np.asarray(normals, dtype=float), 0.5)
    return stretched(one_ball(len(normals)), data).stretches[0]


@pytest.mark.parametrize(
    ("normals", "lengths"),
    [
        pytest.param([ALONG_Z] * 6, [1, 1, 1], id="one flat sheet"),
        pytest.param([ALONG_Z, -ALONG_Z] * 3, [1, 1, 2], id="two that face one another"),
        pytest.param([*np.eye(3), *-np.eye(3)], [2**0.5] * 3, id="all sides"),
        pytest.param([ALONG_Z, -ALONG_Z, 0 * ALONG_Z, 0 * ALONG_Z], [1, 1, 2], id="unknown ones do not count"),
        pytest.param([0 * ALONG_Z] * 3, [1, 1, 1], id="none is known"),
    ],
)
def test_distances_are_as_much_longer_as_normals_differ(normals, lengths):
    """I + d C of their covariance C, squared lengths."""
    np.testing.assert_allclose(stretch_of(normals @ TURN.T), TURN @ np.diag(lengths) @ TURN.T, atol=ROUNDING)


def test_a_mean_of_points_counts_as_often_as_they_do():
    """Three normals up and one down, or one of weight 3."""
    expected = stretch_of([ALONG_Z, ALONG_Z, ALONG_Z, -ALONG_Z])
    np.testing.assert_allclose(stretch_of([ALONG_Z, -ALONG_Z], np.array([3.0, 1.0])), expected, atol=ROUNDING)
    assert expected[2, 2] == pytest.approx((1 + 3 * (1 - 0.5**2)) ** 0.5)


def test_without_normals_or_errors_that_are_shared_distances_are_euclids():
    points = np.random.default_rng(0).uniform(-1, 1, (9, 3))
    data = ScatteredData(points, np.zeros(9), None, np.arange(9), np.tile(ALONG_Z, (9, 1)), 0.5)
    cover = one_ball(9)
    assert isinstance(stretched(cover, data), StretchedCover)
    assert stretched(cover, replace(data, normals=None)) is cover
    assert stretched(cover, replace(data, share=0.0)) is cover


def turned_and_stretched():
    """A fit with a stretch, the same fit of stretched points, the stretch, and the index of the one ball of both."""
    rng = np.random.default_rng(3)
    points, groups = rng.uniform(-1, 1, (90, 3)), np.repeat(np.arange(0, 90, 3), 3)
    values, matrix = rng.standard_normal(90), TURN @ np.diag([1.0, 1.3, 2.0]) @ TURN.T
    data = ScatteredData(points, values, rng.uniform(1, 3, 90), groups, share=0.5)
    cover, model = one_ball(90), Splines(smoothing=0.01).model(3)
    ours = fit_splines(StretchedCover.of(cover, matrix[np.newaxis]), data, model)
    far = Cover(cover.centers @ matrix, cover.radii, BOX, cover.offsets, cover.members)
    theirs = fit_splines(far, replace(data, points=points @ matrix), model)
    return ours, theirs, matrix, cover, far


def test_a_stretched_fit_is_that_of_stretched_points():
    """With its values, its gradients by the chain rule, and its second derivatives."""
    ours, theirs, matrix, cover, far = turned_and_stretched()
    places = np.random.default_rng(4).uniform(-0.3, 0.3, (20, 3))
    jets = (
        local.blend(BallIndex.build(over.centers, over.radii, box), at, level=2, dtype=np.dtype(np.float64))
        for local, over, box, at in ((ours, cover, BOX, places), (theirs, far, 2 * BOX, places @ matrix))
    )
    (value, *first), (expected, *slopes) = (np.split(each, [1, 4]) for each in jets)
    np.testing.assert_allclose(value, expected, atol=STRETCHED_COORDINATES * np.abs(value).max())
    np.testing.assert_allclose(first[0], matrix @ slopes[0], atol=STRETCHED_COORDINATES * np.abs(first[0]).max())
    a, b = np.triu_indices(3)
    second = np.empty((3, 3, len(places)))
    second[a, b] = second[b, a] = slopes[1]
    bent = np.einsum("ai,ijn,jb->abn", matrix, second, matrix)[a, b]
    np.testing.assert_allclose(first[1], bent, atol=STRETCHED_COORDINATES * np.abs(bent).max())


def test_single_precision_is_off_by_no_more_than_it_says():
    ours, _, _, cover, _ = turned_and_stretched()
    index, places = BallIndex.build(cover.centers, cover.radii, BOX), np.random.default_rng(4).uniform(-1, 1, (500, 3))
    single, double = (ours.blend(index, places, level=0, dtype=np.dtype(kind)) for kind in (np.float32, np.float64))
    assert 0 < np.abs(single - double).max() <= ours.single_error


def test_thin_noisy_sheets_are_nearer_to_the_truth_than_by_euclids_distances():
    """A fold two spacings thick, under noise of three tenths: smoothing along the sheets spares what is between."""
    truth = o3l.samples.fold()
    points, normals = truth.sample(2000, seed=1)
    spacing = (truth.area / 2000) ** 0.5
    noisy = points + 0.3 * spacing * np.random.default_rng(2).normal(size=points.shape)
    data = surface_data(OrientedCloud.of(noisy).with_normals(normals))
    options = {"groups": data.groups, "share": data.share, "weights": data.weights, "rho": "gcv-per-ball"}
    places, errors = truth.sample(1500, seed=7)[0], []
    for known in (data.normals, None):
        field = o3l.PUInterpolant.fit(data.points, data.values, normals=known, **options)
        errors.append(np.mean(np.abs(field(places)) / np.linalg.norm(field.gradient(places), axis=1)))
    assert errors[0] < FOLD_BY_NORMALS * errors[1]


def noisy_plate():
    """Points about both sides of a plate, and a site off every second: points, values, groups and normals."""
    rng, side = np.random.default_rng(5), np.repeat([1.0, -1.0], 300)
    points = np.column_stack([rng.uniform(0, 16, (600, 2)), side + 0.3 * rng.normal(size=600)])
    groups, normals = np.append(np.arange(600), np.arange(0, 600, 2)), np.outer(side, ALONG_Z)
    values = np.repeat([0.0, -0.7], [600, 300])
    return np.concatenate([points, points[::2] + 0.7 * normals[::2]]), values, groups, normals[groups]


def test_balls_that_are_put_together_fitted_again_or_saved_keep_their_stretches(tmp_path):
    points, values, groups, normals = noisy_plate()
    field = o3l.PUInterpolant.fit(points, values, groups=groups, share=0.5, rho="gcv-per-ball", normals=normals)
    local, rows = field.local, np.array([2, 0])
    np.testing.assert_array_equal(local.composed(local, rows).stretches, local.stretches[rows])
    data = ScatteredData(points, values, None, groups, normals, 0.5)
    again = local.with_points(field.cover, data, rows)
    np.testing.assert_array_equal(again.stretches, local.stretches)
    for ball in rows:
        np.testing.assert_allclose(again.ball(ball)[0], local.ball(ball)[0], atol=ROUNDING)
    field.save(tmp_path / "plate.o3l")
    np.testing.assert_array_equal(o3l.load(tmp_path / "plate.o3l")(points[:99]), field(points[:99]))
