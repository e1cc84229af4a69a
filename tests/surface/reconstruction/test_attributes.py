"""What points carry comes to the vertices: linear colors as they are, noise smoothed, red red; normals of the field."""

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from o3dleaf import create_from_point_cloud_rbfpu, interpolate_attributes, samples
from o3dleaf.core.errors import InputError
from tolerances import CARRIED, RINGING, SINGLE_NORMALS

RED = np.array([1.0, 0.0, 0.0])


def legacy(points, normals, colors=None):
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    if colors is not None:
        cloud.colors = o3d.utility.Vector3dVector(colors)
    return cloud


def tensor(points, **attributes):
    cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(points))
    for name, values in attributes.items():
        cloud.point[name] = o3d.core.Tensor(values)
    return cloud


@pytest.fixture(scope="module")
def torus():
    return samples.Torus().sample(2_000, seed=1)


def ramp(x):
    """Colors that are linear in space, from 0.2 to 0.8 in the torus's box."""
    low, high = samples.Torus().bounds
    return 0.2 + 0.6 * ((x - low) / (high - low)) @ np.array([[1.0, 0, 0.3], [0, 1, 0.3], [0, 0, 0.4]])


@pytest.fixture(scope="module")
def colored(torus):
    points, normals = torus
    return create_from_point_cloud_rbfpu(legacy(points, normals, ramp(points)))


def test_linear_colors_come_back(colored):
    mesh, _ = colored
    np.testing.assert_allclose(np.asarray(mesh.vertex_colors), ramp(np.asarray(mesh.vertices)), rtol=0, atol=CARRIED)


def test_an_edge_between_colors_is_narrow_and_does_not_ring(torus):
    points, _ = torus
    left, spacing = points[:, 0] < 0, np.sqrt(samples.Torus().area / len(points))
    cloud = legacy(points, points, np.where(left[:, np.newaxis], [0.8, 0.1, 0.1], [0.1, 0.2, 0.9]))
    places = samples.Torus().sample(5_000, seed=2)[0]
    places = places[np.abs(places[:, 0]) > 1.5 * spacing]
    expected = np.where(places[:, :1] < 0, [0.8, 0.1, 0.1], [0.1, 0.2, 0.9])
    assert np.abs(interpolate_attributes(cloud, places)["colors"] - expected).max() < RINGING


def test_normals_are_the_field_s(colored):
    mesh, field = colored
    slope = field.gradient(np.asarray(mesh.vertices))
    expected = -slope / np.linalg.norm(slope, axis=1)[:, np.newaxis]
    np.testing.assert_allclose(np.asarray(mesh.vertex_normals), expected, rtol=0, atol=CARRIED)
    truth = -samples.Torus().gradient(np.asarray(mesh.vertices))
    assert np.einsum("ij,ij->i", np.asarray(mesh.vertex_normals), truth).min() > 0.9


def test_red_stays_red_and_bytes_labels_and_scalars_come_along(torus):
    points, normals = torus
    attributes = {
        "normals": normals,
        "colors": np.tile((255 * RED).astype(np.uint8), (len(points), 1)),
        "intensity": (7 + points @ [[3.0], [2.0], [1.0]]).astype(np.float32),
        "label": np.where(points[:, :1] > 0, 4, 2).astype(np.int32),
        "flow": np.column_stack([points[:, 0], np.full(len(points), 5.0)]),
    }
    attributes["intensity"][::50] = np.nan
    mesh, field = create_from_point_cloud_rbfpu(tensor(points, **attributes), measure="auto")
    found = {name: values.numpy() for name, values in mesh.vertex.items()}
    vertices = found["positions"]
    assert {"distance", "weight", "residual"} <= set(found)
    np.testing.assert_allclose(found["colors"], np.broadcast_to(RED, vertices.shape), rtol=0, atol=CARRIED)
    assert found["intensity"].dtype == np.float32
    inside = np.clip(7 + vertices @ [3.0, 2.0, 1.0], *np.nanquantile(attributes["intensity"], (0, 1)))
    np.testing.assert_allclose(found["intensity"][:, 0], inside, rtol=0, atol=20 * CARRIED)
    assert found["flow"].shape == (len(vertices), 2)
    np.testing.assert_allclose(found["flow"][:, 1], 5, rtol=0, atol=CARRIED)
    assert found["label"].dtype == np.int32
    np.testing.assert_array_equal(found["label"][:, 0], attributes["label"][cKDTree(points).query(vertices)[1], 0])
    slope = field.gradient(vertices)
    expected = -slope / np.linalg.norm(slope, axis=1)[:, np.newaxis]
    np.testing.assert_allclose(found["normals"], expected, rtol=0, atol=SINGLE_NORMALS)


def test_what_the_colors_show(torus):
    """The cloud's own unless a measure is named; without any, the distance; none where neither is wanted."""
    points, normals = (each[:600] for each in torus)
    red, bare = legacy(points, normals, np.tile(RED, (len(points), 1))), legacy(points, normals)

    def is_red(cloud, **options):
        mesh, _ = create_from_point_cloud_rbfpu(cloud, **options)
        colors = np.asarray(mesh.vertex_colors)
        return bool(np.abs(colors - RED).max() < CARRIED) if len(colors) else None

    assert is_red(red)
    assert is_red(red, measure=None)
    assert is_red(red, measure="weight") is False
    assert is_red(bare) is False
    assert is_red(bare, measure=None) is None
    assert is_red(red, measure=None, attributes=None) is None
    with pytest.raises(InputError, match="measure"):
        is_red(red, measure="color")


def test_noise_is_smoothed(torus):
    points, _ = torus
    rng = np.random.default_rng(3)
    noisy = ramp(points) + 0.1 * rng.standard_normal(points.shape)
    at = samples.Torus().sample(2_000, seed=9)[0]
    found = interpolate_attributes(legacy(points, points, noisy), at)["colors"]
    nearest = noisy[cKDTree(points).query(at)[1]]
    assert np.sqrt(np.mean((found - ramp(at)) ** 2)) < 0.5 * np.sqrt(np.mean((nearest - ramp(at)) ** 2))


def test_a_stray_point_or_one_without_a_place_changes_nothing(torus):
    points, _ = torus
    at = points[::7] + 0.001
    wavy = 0.5 + 0.4 * np.sin(9 * points)
    clean = interpolate_attributes(tensor(points, colors=wavy), at)["colors"]
    more = np.vstack([points, [[1e4, 0, 0]], [[np.nan] * 3]])
    colors = np.vstack([wavy, [[1.0, 1.0, 1.0]] * 2])
    np.testing.assert_array_equal(interpolate_attributes(tensor(more, colors=colors), at)["colors"], clean)


def test_few_points_give_that_of_the_nearest():
    points = np.random.default_rng(0).random((5, 3))
    values = np.arange(5.0)[:, np.newaxis]
    found = interpolate_attributes(tensor(points, height=values), points + 1e-6)
    np.testing.assert_array_equal(found["height"], values)
    assert interpolate_attributes(points, points) == {}


def test_rows_must_fit():
    points = np.random.default_rng(0).random((50, 3))
    with pytest.raises(InputError, match="40 height for 50 points"):
        interpolate_attributes(tensor(points, height=np.zeros((40, 1))), points)
