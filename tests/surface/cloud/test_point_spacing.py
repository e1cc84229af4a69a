import numpy as np
import pytest

import o3dleaf as o3l
from cloud_shapes import sphere, torus
from o3dleaf import OrientedCloud, point_spacing
from o3dleaf.surface.cloud.neighbors import SPACED
from tolerances import SPACING, SPARSE_SPACING


def test_the_spacing_is_that_of_the_area():
    points, _ = sphere(20000)
    assert OrientedCloud.of(points).spacing == pytest.approx(np.sqrt(4 * np.pi / len(points)), rel=SPACING)


@pytest.mark.few(spacings=1)
@pytest.mark.parametrize("spacings", [1, 4])
def test_noise_thicker_than_the_spacing_does_not_change_it(spacings):
    points, _ = torus(60000)
    true = np.sqrt(4 * np.pi**2 * 0.35 / len(points))
    points += spacings * true * np.random.default_rng(1).normal(size=points.shape)
    assert OrientedCloud.of(points).spacing == pytest.approx(true, rel=SPACING)


def test_each_point_has_the_spacing_around_it():
    rng = np.random.default_rng(2)
    dense, sparse = rng.uniform(0, 1, (16000, 2)), rng.uniform(0, 1, (1000, 2)) + [2, 0]
    points = np.column_stack([np.concatenate([dense, sparse]), np.zeros(17000)])
    for spacing in (point_spacing(points), OrientedCloud.of(points).surfels.spacing):
        assert np.median(spacing[:16000]) == pytest.approx(1 / np.sqrt(16000), rel=SPACING)
        assert np.median(spacing[16000:]) == pytest.approx(1 / np.sqrt(1000), rel=SPACING)


@pytest.mark.parametrize("ratio", [20, 80, 400])
def test_sparse_points_beside_dense_ones_have_the_spacing_of_their_own_region(ratio):
    """Half a spacing and more from the dense region, whose points are nearest; dense ones keep theirs."""
    rng, own = np.random.default_rng(4), 1 / np.sqrt(40)
    dense, sparse = rng.uniform([0, -1], [5, 0], (200 * ratio, 2)), rng.uniform([0, 0], [5, 3], (600, 2))
    points = np.column_stack([np.concatenate([dense, sparse]), np.zeros(len(dense) + len(sparse))])
    spacing = point_spacing(points)
    beside = (points[:, 1] > 0.5 * own) & (points[:, 1] < 2 * own)
    assert np.count_nonzero(beside) > 30
    assert np.median(spacing[beside]) > SPARSE_SPACING * own
    assert np.quantile(spacing[: len(dense)], 0.999) < 2 * own / np.sqrt(ratio)


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_spacings_of_an_even_cloud_are_means_of_medians(noise):
    """No point of it is taken for one beside a step of density, and two strays close together are none."""
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(0, 100, (10_000, 2)), noise * rng.normal(size=10_000)])
    points = np.vstack([points, [[50.0, 50.0, 9.0], [50.0, 50.5, 9.0]]])
    near = OrientedCloud.of(points).neighbors
    row, first = near.row[:, : SPACED + 1], near.distance[:, SPACED] * np.sqrt(np.pi / SPACED)
    np.testing.assert_array_equal(point_spacing(points), np.median(first[row], axis=1)[row].mean(axis=1))


def test_a_lattice_and_a_random_cloud_of_one_density_agree():
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    assert OrientedCloud.of(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])).spacing == pytest.approx(
        1, rel=SPACING
    )


def test_many_points_in_one_place_are_refused_among_others():
    points = np.concatenate(
        [np.column_stack([np.random.default_rng(3).random((200, 2)), np.zeros(200)]), np.zeros((40, 3))]
    )
    with pytest.raises(o3l.errors.InputError, match="13 points lie in one place"):
        point_spacing(points)


def test_points_on_a_line_have_none():
    with pytest.raises(o3l.errors.InputError, match="on a line"):
        _ = OrientedCloud.of(np.outer(np.arange(50.0), [1, 2, 3])).spacing
