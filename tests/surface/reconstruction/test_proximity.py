"""What is known of most places without a search is what a search says, and none of it moves a surface."""

import numpy as np
import pytest
from matplotlib import colormaps
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mesh_fields import CENTRE, joined, sphere
from o3dleaf import (
    OrientedCloud,
    PUInterpolant,
    create_from_point_cloud_rbfpu,
    distance_mask,
    extract_isosurface,
    mesh_report,
    point_spacing,
    trim_to_data,
    vertex_support,
)
from o3dleaf.core import progress
from o3dleaf.core.field import values_and_gradients
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.reconstruction import proximity
from o3dleaf.surface.reconstruction.proximity import conservative_mask, data_around, nearest_data, nearest_points
from o3dleaf.surface.reconstruction.vertex_support import VertexSupport, support_colors
from tolerances import CLASS_WIDTH, ONE_PASS


def uneven(count=3000, seed=4):
    """Return points on a sphere, far denser on one side, beyond the origin of the grid on all axes."""
    rng = np.random.default_rng(seed)
    towards = rng.normal(size=(count, 3)) + [0, 0, 1.5]
    return CENTRE + towards / np.linalg.norm(towards, axis=1)[:, np.newaxis] - 3.0


def places_around(cloud, count=20_000):
    rng = np.random.default_rng(9)
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    on = cloud[rng.integers(len(cloud), size=count)] + 0.05 * rng.normal(size=(count, 3))
    return np.concatenate([on, rng.uniform(2 * low - high, 2 * high - low, size=(count, 3)), cloud])


def least_ratios(cloud, steps, places):
    """Return of each place how far it is from the points, each in its own spacings, by all pairs."""
    return np.concatenate([(cdist(part, cloud) / steps).min(axis=1) for part in np.array_split(places, 20)])


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_the_distance_mask_is_what_some_point_says(factor):
    cloud = uneven(1000)
    places, steps = places_around(cloud, 2_000), point_spacing(cloud)
    least, (far, nearest) = least_ratios(cloud, steps, places), cKDTree(cloud).query(places)
    found = distance_mask(cloud, factor=factor)(places)
    assert not np.any(found & (least > factor))
    assert not np.any((far <= factor * steps[nearest]) & ~found)
    assert not np.any((np.maximum(least, 1) * CLASS_WIDTH <= factor) & ~found)
    assert 0 < found.sum() < len(found)


def test_a_gap_is_no_wider_for_what_is_dense_on_its_other_side():
    cloud = uneven(1000)
    places, data = places_around(cloud, 2_000), OrientedCloud.of(cloud)
    distance, row = data_around(data, places)
    np.testing.assert_allclose(distance, np.linalg.norm(places - cloud[row], axis=1), rtol=1e-12)
    ratio, least = distance / data.point_spacing[row], least_ratios(cloud, data.point_spacing, places)
    assert np.all(ratio <= np.maximum(1, CLASS_WIDTH * least))
    assert np.any(row != cKDTree(cloud).query(places)[1])


@pytest.mark.few(solid=1)
@pytest.mark.parametrize(("solid", "step"), [("sphere", 10), ("sphere", 30), ("torus", 10)])
def test_where_density_steps_down_the_surface_goes_on(solid, step):
    rng = np.random.default_rng(2)
    if solid == "sphere":
        normals = rng.normal(size=(6_000, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
        points = normals
    else:
        u, v = rng.uniform(0, 2 * np.pi, (2, 9_000))
        normals = np.column_stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)])
        points = np.column_stack([np.cos(u), np.sin(u), 0 * u]) + 0.4 * normals
    kept = (points[:, 0] > 0) | (rng.uniform(size=len(points)) < 1 / step)
    mesh, _ = create_from_point_cloud_rbfpu(OrientedCloud.of(points[kept], normals[kept]), closed=False, measure=None)
    report = mesh_report(mesh)
    assert (report.components, report.boundary_edges, report.genus) == (1, 0, int(solid == "torus"))


@pytest.mark.parametrize("reach", [1e-7, 0.03, 0.5, 20.0])
def test_what_is_surely_near_is(reach):
    cloud = uneven()
    places, surely = places_around(cloud), conservative_mask(cloud, reach)
    assert (cKDTree(cloud).query(places[surely(places)])[0] <= reach).all()
    assert surely(cloud).all() or reach < 1e-6  # so fine a grid has no numbers


def test_most_cells_of_a_surface_are_known_without_a_search():
    cloud = extract_isosurface(sphere(), 0.05)
    vertices, _ = mesh_arrays(cloud)
    shifted = vertices + 0.02
    assert conservative_mask(vertices, 0.2)(shifted).mean() > 0.8


def test_neighbors_that_are_known_tell_the_same_spacings():
    cloud = uneven()
    known = OrientedCloud.of(cloud)
    assert known.neighbors.row.shape == (len(cloud), 16)
    assert np.array_equal(known.point_spacing, point_spacing(cloud))
    distance, row = cKDTree(cloud).query(cloud, 13)
    first = distance[:, 12] * np.sqrt(np.pi / 12)
    np.testing.assert_array_equal(known.point_spacing, np.median(first[row], axis=1)[row].mean(axis=1))


@pytest.mark.parametrize("part", [1.0, 0.2])
def test_a_cloud_that_knows_its_tree_trims_and_supports_alike(part):
    ball = extract_isosurface(sphere(), 0.05)
    towards = np.random.default_rng(2).normal(size=(4000, 3))
    cloud = CENTRE + towards / np.linalg.norm(towards, axis=1)[:, np.newaxis]
    cloud, reported = cloud[cloud[:, 2] < part], []
    known = OrientedCloud.of(cloud, spacing=0.06)
    assert known.tree.n == len(cloud)
    one = trim_to_data(ball, OrientedCloud.of(cloud, spacing=0.06))
    with progress.listening(lambda *done: reported.append(done)):
        other = trim_to_data(ball, known)
        assert reported[-1][0] == reported[-1][1]
    for a, b in zip(mesh_arrays(one), mesh_arrays(other), strict=True):
        assert np.array_equal(a, b)
    assert (len(one.triangles) == len(ball.triangles)) == (part == 1.0)
    reported.clear()
    with progress.listening(lambda *done: reported.append(done)):
        support = vertex_support(ball, known, sphere())
        assert reported[-1][0] == reported[-1][1]
    alone = vertex_support(ball, OrientedCloud.of(cloud, spacing=0.06), sphere())
    assert np.array_equal(support.distance, alone.distance)


def test_nearest_data_that_are_remembered_are_those_of_a_search():
    cloud = OrientedCloud.of(uneven(500))
    places = places_around(cloud.points, 2_000)
    parts = places, places[::3], places[3::-1], places[1::3], places + 1e-9, np.concatenate([places[5:], -places])
    for part in parts:
        distance, nearest = nearest_data(cloud, part)
        expected = cKDTree(cloud.points).query(part)
        np.testing.assert_array_equal(distance, expected[0])
        np.testing.assert_array_equal(nearest, expected[1])


def test_nearest_data_of_vertices_that_stay_are_not_searched_again(monkeypatch):
    cloud, asked = OrientedCloud.of(uneven(500)), []
    places = places_around(cloud.points, 2_000)

    def counted(tree, some):
        asked.append(len(some))
        return nearest_points(tree, some)

    monkeypatch.setattr(proximity, "nearest_points", counted)
    for part in (places, places, places[::2], np.concatenate([places[::2], places[:7] + 1])):
        nearest_data(cloud, part)
    assert asked == [len(places), 0, 7]


def test_pieces_that_share_no_vertex_are_still_judged_one_by_one():
    ball = mesh_arrays(extract_isosurface(sphere(), 0.1))
    lone = ball[0] * 0.3, ball[1]
    towards = np.random.default_rng(2).normal(size=(4000, 3))
    cloud = CENTRE + towards / np.linalg.norm(towards, axis=1)[:, np.newaxis]
    both = trim_to_data(joined(ball, lone), OrientedCloud.of(cloud, spacing=1.0))
    assert len(both.triangles) == len(ball[1])


def test_seeds_beside_the_surface_lead_to_the_very_mesh():
    towards = np.random.default_rng(2).normal(size=(500, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, np.newaxis]
    on, beside = (mesh_arrays(extract_isosurface(sphere(), 0.08, seeds=CENTRE + r * towards)) for r in (1.0, 1.1))
    for a, b in zip(on, beside, strict=True):
        assert np.array_equal(a, b)


def test_one_pass_finds_what_two_do():
    points = np.random.default_rng(0).uniform(-1, 1, size=(600, 3))
    field = PUInterpolant.fit(points, np.sin(points).sum(axis=1), points_per_ball=100)
    value, slope = values_and_gradients(field, points)
    np.testing.assert_allclose(value, field(points), atol=ONE_PASS)
    np.testing.assert_allclose(slope, field.gradient(points), atol=ONE_PASS)


@pytest.mark.parametrize("name", ["viridis", "coolwarm", "tab10"])
def test_colors_are_the_color_maps(name):
    values = np.concatenate([np.linspace(0, 2, 1001), [np.nan, 3.0]])
    found = support_colors(VertexSupport(values, values, values, 1.0), color_map=name, limits=(0.0, 2.0))
    share = np.clip(np.where(np.isnan(values), 2.0, values) / 2.0, 0, 1)
    assert np.array_equal(found, colormaps[name](share)[:, :3].astype(np.float32))
