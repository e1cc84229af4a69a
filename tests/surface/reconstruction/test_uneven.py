"""Clouds whose density differs much: each part of the surface in steps of its own spacing, closed or open as it is."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cloud_shapes import scanned_ground
from o3dleaf import create_from_point_cloud_rbfpu, mesh_report, samples
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes
from o3dleaf.surface.reconstruction.extract import PER_POINT, finest_spacing, is_uneven, mesh_step
from tolerances import UNEVEN_SURFACE


def ball(hole=0.0):
    """Return a cloud of a ball, 30 times as dense on a fifth of it, without what is higher than 1 − `hole` of it."""
    points, normals = samples.Sphere().sample(20_000, seed=7)
    along = (points[:, 0] - points[:, 0].min()) / np.ptp(points[:, 0])
    kept = np.random.default_rng(8).uniform(size=len(points)) < np.where(along < 0.2, 1, 1 / 30)
    kept &= (points[:, 2] - points[:, 2].min()) / np.ptp(points[:, 2]) <= 1 - hole
    return OrientedCloud.of(points[kept], normals[kept])


def terrain(patch):
    """Return a cloud of waves of 1,000 points, with a patch of many more in their middle."""
    rng = np.random.default_rng(1)
    places = np.vstack([rng.uniform(-1, 1, (1_000, 2)), rng.uniform(-0.15, 0.15, (patch, 2))])
    heights = waves(*places.T)
    slopes = np.column_stack([-0.3 * np.cos(3 * places[:, 0]), np.zeros(len(places)), np.ones(len(places))])
    return OrientedCloud.of(np.column_stack([places, heights]), slopes / np.linalg.norm(slopes, axis=1)[:, np.newaxis])


def waves(x, _):
    """Return heights of waves along x."""
    return 0.1 * np.sin(3 * x)


def test_each_part_of_a_ball_is_as_near_as_its_own_points_are_dense():
    cloud = ball()
    mesh, _ = create_from_point_cloud_rbfpu(cloud, prepare=OrientedCloud.of)
    vertices, triangles = mesh_arrays(mesh)
    report, middles = mesh_report(mesh), vertices[triangles].mean(axis=1)
    assert is_uneven(cloud.point_spacing)
    assert report.watertight
    assert (report.components, report.genus) == (1, 0)
    assert len(triangles) < 2 * PER_POINT * len(cloud) / mesh_step(1.0, len(cloud)) ** 2
    spacing = cloud.point_spacing[cKDTree(cloud.points).query(middles)[1]]
    off = np.abs(samples.Sphere().closest(middles).distance) / spacing
    for part in (spacing < np.median(cloud.point_spacing), spacing > 3 * np.median(cloud.point_spacing)):
        assert np.count_nonzero(part) > 1_000
        assert off[part].mean() < UNEVEN_SURFACE


def test_single_precision_is_as_fine_as_the_densest_part_asks_for():
    cloud, middle = ball(), float(np.median(ball().point_spacing))
    assert finest_spacing(cloud, None) == cloud.point_spacing.min() < 0.9 * middle
    assert [finest_spacing(cloud, spacing) for spacing in (0.5 * middle, 2 * middle)] == [0.5 * middle, middle]


@pytest.mark.slow
def test_a_gap_in_an_uneven_cloud_is_closed_where_that_is_asked_for():
    """The field is corrected, and followed again on its leaves."""
    cloud = ball(hole=0.15)
    closed, opened = (
        mesh_report(create_from_point_cloud_rbfpu(cloud, prepare=OrientedCloud.of, closed=asked, measure=None)[0])
        for asked in (True, False)
    )
    assert closed.watertight
    assert closed.genus == 0
    assert opened.boundary_edges > 0
    assert opened.manifold


@pytest.mark.slow
def test_a_closed_solid_stays_closed_where_density_steps_by_twenty():
    """Its sparse points beside dense ones, taken to be as close as those, left 248 edges of rims."""
    points, normals = samples.gap().sample(40_000)
    ball = np.linalg.norm(points - points[1], axis=1) < 0.25 * np.ptp(points[:, 0])
    kept = ball | (np.random.default_rng([1, 7]).random(len(points)) < 1 / 20)
    cloud = OrientedCloud.of(points[kept], normals[kept])
    mesh, _ = create_from_point_cloud_rbfpu(cloud, prepare=OrientedCloud.of, measure=None)
    report = mesh_report(mesh)
    assert (report.components, report.genus, report.boundary_edges) == (1, 0, 0)


@pytest.mark.parametrize("ratio", [1, 20])
def test_a_hole_of_six_spacings_across_a_step_of_density_stays_open(ratio):
    """Its rim is where the data end, to the spacing of each side."""
    rng = np.random.default_rng(9)
    flat = rng.uniform(-1, 1, (600 * ratio, 2))
    flat = flat[(flat[:, 0] < 0) | (rng.random(len(flat)) < 1 / ratio)]
    own = 2 / np.sqrt(600)
    flat = flat[np.linalg.norm(flat, axis=1) > 6 * own]
    normals = np.broadcast_to([0.0, 0.0, 1.0], (len(flat), 3))
    cloud = OrientedCloud.of(np.column_stack([flat, np.zeros(len(flat))]), normals)
    mesh, _ = create_from_point_cloud_rbfpu(cloud, prepare=OrientedCloud.of, measure=None)
    vertices, triangles = mesh_arrays(mesh)
    edges = EdgeTable.of(triangles)
    rim = np.linalg.norm(vertices[np.unique(edges.ends[edges.count == 1])], axis=1)
    hole = rim[rim < 0.9]
    assert len(find_holes(vertices, triangles).perimeter) == 2
    assert np.all(np.abs(hole / own - 6) < 2)


@pytest.mark.slow
def test_terrain_with_a_dense_patch_has_one_rim_and_faces_up():
    cloud = terrain(4_000)
    mesh, _ = create_from_point_cloud_rbfpu(cloud, prepare=OrientedCloud.of, measure=None)
    vertices, triangles = mesh_arrays(mesh)
    assert is_uneven(cloud.point_spacing)
    assert mesh_report(mesh).manifold
    assert len(find_holes(vertices, triangles).perimeter) == 1
    assert np.linalg.norm(vertices[triangles[:, 0], :2], axis=1).max() > 1
    corners = vertices[triangles]
    assert np.all(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0)
    length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    inside = np.abs(corners[:, 0, :2]).max(axis=1) < 0.1
    outside = np.abs(corners[:, 0, :2]).max(axis=1) > 0.5
    assert length[outside].mean() > 4 * length[inside].mean()


@pytest.mark.slow
def test_ground_scanned_from_one_place_has_no_handle_and_no_patch_that_faces_down():
    """Far waves are seen at a few degrees; normals that each point turned by itself made two handles, and 600 triangles
    that faced down."""
    points, _, eye = scanned_ground()
    mesh, _ = create_from_point_cloud_rbfpu(points, viewpoint=eye, measure=None)
    vertices, triangles = mesh_arrays(mesh)
    report, corners = mesh_report(mesh), vertices[triangles]
    assert is_uneven(OrientedCloud.of(points).point_spacing)
    assert (report.components, report.genus) == (1, 0)
    assert np.all(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0)
