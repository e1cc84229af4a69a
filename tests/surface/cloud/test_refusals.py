"""What is no cloud of a surface is refused in one line that says what it is, and what to give instead."""

from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import InputError, O3DLeafError

BALL = o3d.geometry.TriangleMesh.create_sphere()
MESHES = [
    BALL,
    o3d.t.geometry.TriangleMesh.from_legacy(BALL),
    (np.asarray(BALL.vertices), np.asarray(BALL.triangles)),
    o3l.LabelledMesh(BALL),
]
CALLS = [
    o3l.create_from_point_cloud_rbfpu,
    o3l.preprocess_point_cloud,
    o3l.fit_surface,
    o3l.estimate_noise,
    o3l.point_spacing,
    o3l.estimate_normals,
    o3l.create_blade,
    lambda cloud: o3l.trim_to_data(BALL, cloud),
    lambda cloud: o3l.interpolate_attributes(cloud, np.zeros((1, 3))),
    lambda cloud: o3l.mesh_report(BALL, cloud=cloud),
]


@pytest.mark.parametrize("call", CALLS)
def test_a_path_a_mesh_or_nothing_is_no_cloud(call):
    for path in ("cloud.ply", Path("cloud.ply")):
        with pytest.raises(InputError, match=r"is a path; read it first, by read_point_cloud\('cloud.ply'\)"):
            call(path)
    for mesh in MESHES:
        with pytest.raises(InputError, match="is a mesh; give a point cloud"):
            call(mesh)


def test_nothing_is_no_cloud():
    with pytest.raises(InputError, match="is None"):
        o3l.create_from_point_cloud_rbfpu(None)


@pytest.mark.parametrize("normals", [False, True])
@pytest.mark.parametrize("jitter", [0.0, 1e-12, 1e-6, 1e-3])
@pytest.mark.parametrize("count", [20, 200])
def test_points_on_a_line_are_no_surface(count, jitter, normals):
    rng = np.random.default_rng(0)
    for along in ([1.0, 0, 0], [3.0, -1, 2]):
        points = 5 + np.sort(rng.random(count))[:, np.newaxis] * along + jitter * rng.standard_normal((count, 3))
        across = np.cross(along, [0, 0, 1.0])
        cloud = o3l.OrientedCloud.of(points, np.tile(across, (count, 1))) if normals else points
        with pytest.raises(InputError, match=r"lie on one line, .* wide and .* long; give the points of a surface"):
            o3l.create_from_point_cloud_rbfpu(cloud)
        with pytest.raises(InputError, match="points lie on one line"):
            o3l.create_from_point_cloud_rbfpu(cloud, prepare=lambda held: held)


@pytest.mark.parametrize("far", [1e4, 1e9])
def test_a_stray_point_far_off_makes_no_line_of_a_surface(far):
    """A surface of a thousand points is a line to the eye of one a million widths away."""
    rng = np.random.default_rng(0)
    points = rng.standard_normal((1000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    cloud = o3l.preprocess_point_cloud(np.vstack([points, [[far, 0, 0]]]))
    assert (len(cloud), cloud.removed.outliers) == (1000, 1)


def test_a_surface_far_from_the_origin_in_single_precision_is_told_as_such():
    """At 5,000 km single precision has steps of half a meter, in which a leaf of 80 mm is one place or two."""
    points = np.random.default_rng(0).random((500, 3)) * [0.08, 0.08, 0.001] + [583_412.0, 5_123_877.9, 412.7]
    with pytest.raises(InputError, match=r"single precision, .* steps of 0\.5 so far"):
        o3l.create_from_point_cloud_rbfpu(points.astype(np.float32).astype(np.float64))
    line = np.linspace(0, 1, 500)[:, np.newaxis] * [1.0, 0.0, 0.0]
    with pytest.raises(InputError, match="give the points of a surface"):
        o3l.create_from_point_cloud_rbfpu(line.astype(np.float32).astype(np.float64))
    with pytest.raises(InputError, match="give the points of a surface"):
        _ = o3l.OrientedCloud.of(np.ones((100, 3))).spacing


@pytest.mark.parametrize("count", [0, 1, 3, 9, 12])
def test_too_few_points_are_no_surface(count):
    points = np.random.default_rng(0).standard_normal((count, 3))
    with pytest.raises(O3DLeafError, match=r"at least|show no surface"):
        o3l.create_from_point_cloud_rbfpu(points / np.linalg.norm(points, axis=1, keepdims=True))


def test_a_narrow_strip_of_three_rows_is_one():
    """Three rows of a thousand points: a hundred times as long as wide, and no line."""
    x, y = np.meshgrid(np.arange(1000.0), np.arange(3.0))
    strip = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    assert len(o3l.preprocess_point_cloud(strip)) == len(strip)


@pytest.mark.parametrize("cloud", [o3d.geometry.PointCloud(), o3d.t.geometry.PointCloud(), np.empty((0, 3))])
def test_an_empty_cloud_is_said_to_be_empty(cloud):
    """Also where it has no positions at all, as an empty tensor cloud."""
    for call in (o3l.create_from_point_cloud_rbfpu, o3l.preprocess_point_cloud):
        with pytest.raises(InputError, match="cloud: is empty"):
            call(cloud)
