"""Coordinates that were rounded to steps wider than points are apart: found in any direction, averaged, and told."""

import numpy as np
import pytest

from o3dleaf import create_from_point_cloud_rbfpu, mesh_report, preprocess_point_cloud, samples
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.rounding import MAX_STEP, average_levels, find_levels
from tolerances import ALMOST_ALL, STEP_OF_SINGLE, STEPS_OFF

COUNT = 4000
AXES = [[0.0, 0.0, 1.0], [2 / 7, 3 / 7, 6 / 7]]


def rounded(solid, step, direction, count=COUNT):
    """Return a solid's points whose coordinates along a direction are whole steps, the step in spacings, and both."""
    points, normals = solid.sample(count, seed=3)
    length, heights = step * np.sqrt(solid.area / count), points @ direction
    return points + np.outer(np.round(heights / length) * length - heights, direction), normals, length


def levels_of(points):
    """Return the levels of points."""
    return find_levels(points, OrientedCloud.of(points).neighbors.row)


@pytest.mark.parametrize("direction", AXES)
@pytest.mark.parametrize("dtype", ["f4", "f8"])
@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_levels_are_found_in_any_direction_precision_and_unit(direction, dtype, scale):
    points, _, step = rounded(samples.Torus(), 2.0, direction)
    found = levels_of((scale * points).astype(dtype).astype(float))
    np.testing.assert_allclose([*found.direction, found.step / scale / step], [*direction, 1], atol=STEP_OF_SINGLE)


def lattice():
    """Return the lattice's points on the faces of a cube."""
    ticks = np.arange(-8.0, 9.0)
    points = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    return points[np.abs(points).max(axis=1) == 8]


def contours():
    """Return points on contours of a ball, four times farther apart than the points along each."""
    turn = np.linspace(0, 2 * np.pi, 150, endpoint=False)
    heights = np.linspace(-0.8, 0.8, 11)
    return np.concatenate(
        [
            np.column_stack([np.sqrt(1 - z * z) * part for part in (np.cos(turn), np.sin(turn))] + [np.full(150, z)])
            for z in heights
        ]
    )


@pytest.mark.parametrize(
    "make",
    [
        lambda: samples.Block().sample(COUNT)[0],
        pytest.param(lambda: samples.bumps().sample(COUNT)[0], marks=pytest.mark.slow),
        lattice,
        contours,
    ],
)
def test_planes_lattices_and_contours_are_left_as_they_are(make):
    cloud = OrientedCloud.of(make())
    assert average_levels(cloud)[0] is cloud


@pytest.mark.few
@pytest.mark.parametrize("direction", AXES)
@pytest.mark.parametrize("given", [False, True])
def test_points_on_levels_are_averaged_to_the_surface_between_them(direction, given):
    """The points themselves are 0.58 spacings off, a quarter of a step, but where the surface is steep."""
    solid = samples.Torus()
    points, normals, step = rounded(solid, 2.5, direction, 8000)
    points = points.astype("f4").astype(float)
    cloud = preprocess_point_cloud(points, normals=normals if given else None)
    assert any("is rounded to steps" in note for note in cloud.notes)
    assert cloud.weights.sum() == len(cloud) + cloud.removed.averaged
    levels = cloud.points @ np.array(direction) / step
    np.testing.assert_allclose(levels, np.round(levels), atol=STEP_OF_SINGLE)  # each is of points of one level
    assert np.mean(np.einsum("ij,ij->i", cloud.normals, solid.closest(cloud.points).normals) > 0) >= ALMOST_ALL
    mesh, _ = create_from_point_cloud_rbfpu(cloud, prepare=OrientedCloud.of, measure=None)
    report = mesh_report(mesh)
    assert (report.components, report.genus, report.boundary_edges) == (1, 1, 0)
    assert np.abs(solid.closest(np.asarray(mesh.vertices)).distance).mean() < STEPS_OFF * step


@pytest.mark.few(direction=1)
@pytest.mark.parametrize("direction", AXES)
def test_given_normals_tell_the_sides_of_parts_as_thin_as_a_step_apart(direction):
    """Without them the means of such plates are no surface, and the points' own planes are those of the levels."""
    solid = samples.fins(0.08)
    points, normals, step = rounded(solid, 2.5, direction, 8000)
    cloud = preprocess_point_cloud(points, normals=normals)
    mesh, _ = create_from_point_cloud_rbfpu(cloud, prepare=OrientedCloud.of, measure=None)
    report = mesh_report(mesh)
    assert (report.components, report.genus, report.boundary_edges) == (1, 0, 0)
    assert np.abs(solid.closest(np.asarray(mesh.vertices)).distance).mean() < STEPS_OFF * step


def test_means_of_two_sides_that_coincide_are_one_point():
    """Each point has two others of the other side around it, all in its voxel but for a few; sums of binary fractions
    are exact."""
    points, normals, step = rounded(samples.Torus(), 1.5, AXES[0])
    points = np.round(points / step * 2**20) / 2**20
    aside = np.array([2.0**-8, 0.0, 0.0])
    cloud = preprocess_point_cloud(
        np.concatenate([points, points + aside, points - aside]), normals=np.concatenate([normals, -normals, -normals])
    )
    assert cloud.removed.repeated > len(cloud) / 2
    assert len(np.unique(cloud.points, axis=0)) == len(cloud)


def test_levels_too_far_apart_are_sheets_of_their_own_and_thin_parts_are_kept():
    places = np.random.default_rng(0).uniform(0, 8, (3000, 2))
    stairs = np.column_stack([places, np.floor(places[:, 0])])
    plates, _, _ = rounded(samples.fins(), 2.0, AXES[1], 6000)
    assert MAX_STEP * OrientedCloud.of(stairs).spacing < 1
    for points in (stairs, plates):
        cloud, first = average_levels(OrientedCloud.of(points))
        assert len(cloud) == len(first) == len(points)
        assert "has terraces or comes apart" in cloud.notes[0]
