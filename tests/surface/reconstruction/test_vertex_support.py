"""Support of vertices by data: sums over them, and attributes that a file keeps."""

import numpy as np
import open3d as o3d
import pytest

from mesh_fields import CENTRE, Analytic, sphere
from o3dleaf import OrientedCloud, color_by_support, extract_isosurface, vertex_support
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.io.triangle_mesh import read_triangle_mesh, write_mesh
from tolerances import FIRST_ORDER, FULL_WEIGHT, RESIDUAL_OF_NOISE, SUPPORT_TWIN


def noisy_sphere(count, sigma):
    rng = np.random.default_rng(8)
    cloud = rng.normal(size=(count, 3))
    cloud /= np.linalg.norm(cloud, axis=1)[:, None]
    return CENTRE + cloud * (1 + sigma * rng.normal(size=(count, 1)))


def test_support_is_what_literal_sums_say():
    vertices, _ = mesh_arrays(extract_isosurface(sphere(), 0.3))
    vertices = np.concatenate([vertices, [[5.0, 0, 0], [1.3, 0, 0]]])
    cloud, spacing = noisy_sphere(2_000, 0.02), 0.08
    found = vertex_support(vertices, OrientedCloud.of(cloud, spacing=spacing), sphere())
    towards = cloud - CENTRE
    off = np.linalg.norm(towards, axis=1)
    feet = CENTRE + towards / off[:, None]
    r = np.linalg.norm(vertices[:, None] - feet, axis=2)
    share = np.minimum(r / (3 * spacing), 1)
    fade = (1 - share) ** 4 * (4 * share + 1)
    total = fade.sum(axis=1)
    nearest = np.linalg.norm(vertices[:, None] - cloud, axis=2).min(axis=1)
    np.testing.assert_allclose(found.distance, nearest, rtol=SUPPORT_TWIN)
    np.testing.assert_allclose(found.weight, total / (9 * np.pi / 7), atol=SUPPORT_TWIN)
    expected = np.sqrt((fade @ (off - 1) ** 2)[total > 0] / total[total > 0])
    np.testing.assert_allclose(found.residual[total > 0], expected, atol=SUPPORT_TWIN)
    assert np.isnan(found.residual[total == 0]).all()
    assert (total == 0).any()


def test_weight_is_one_where_points_lie_at_one_per_spacing_squared():
    flat = Analytic(lambda x, y, z: 0.01 - z, np.array([[-9.0] * 3, [9.0] * 3]))
    ticks = np.arange(40) * 0.1
    x, y = np.meshgrid(ticks, ticks)
    cloud = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    inside = np.random.default_rng(0).uniform([1, 1, 0], [3, 3, 0], size=(50, 3)) + [0, 0, 0.01]
    found = vertex_support(inside, OrientedCloud.of(cloud, spacing=0.1), flat)
    assert found.weight == pytest.approx(1, abs=FULL_WEIGHT)


def test_residual_is_the_noise_of_the_data():
    ball, sigma = extract_isosurface(sphere(), 0.05), 0.01
    for field in (None, sphere()):
        found = vertex_support(ball, noisy_sphere(40_000, sigma), field)
        assert np.sqrt(np.mean(found.residual**2)) == pytest.approx(sigma, rel=RESIDUAL_OF_NOISE)
    assert found.spacing == pytest.approx(np.sqrt(4 * np.pi / 40_000), rel=0.1)


def test_a_file_keeps_support_and_every_digit(tmp_path):
    ball = extract_isosurface(sphere(), 0.2)
    found = vertex_support(ball, noisy_sphere(1_000, 0.01))
    mesh = color_by_support(ball, found, measure="residual")
    vertices, triangles = mesh_arrays(ball)
    write_mesh(mesh, tmp_path / "ball.ply")
    read = mesh_arrays(read_triangle_mesh(tmp_path / "ball.ply"))
    assert np.array_equal(read[0], vertices)
    assert np.array_equal(read[1], triangles)
    rows = o3d.t.io.read_point_cloud(str(tmp_path / "ball.ply")).point
    for name in ("distance", "weight", "residual"):
        assert np.array_equal(rows[name].numpy()[:, 0], getattr(found, name))
        assert np.array_equal(mesh.vertex[name].numpy(), rows[name].numpy())
    colours = mesh.vertex.colors.numpy()
    assert np.abs(rows["colors"].numpy() / 255.0 - colours).max() <= 0.5 / 255 + FIRST_ORDER / 255
    brightness = colours @ [0.2126, 0.7152, 0.0722]
    order = np.argsort(found.residual)
    assert np.all(np.diff(brightness[order]) >= -FIRST_ORDER)


def test_support_that_cannot_be_says_why():
    ball = extract_isosurface(sphere(), 0.5)
    found = vertex_support(ball, noisy_sphere(100, 0.0))
    with pytest.raises(InputError, match="give the field too"):
        vertex_support(np.zeros((4, 3)), noisy_sphere(100, 0.0))
    with pytest.raises(InputError, match="support: is of"):
        color_by_support(extract_isosurface(sphere(), 0.4), found)
    with pytest.raises(InputError, match="measure: unknown"):
        color_by_support(ball, found, measure="colour")
