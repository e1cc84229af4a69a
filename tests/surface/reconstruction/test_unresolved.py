"""Handles, breaks and losses where data are too few are told; resolved ones, tips, rims and creases are not."""

import warnings

import numpy as np
import pytest

from mesh_fields import Analytic, joined
from o3dleaf import OrientedCloud, create_from_point_cloud_rbfpu, extract_isosurface, mesh_report
from o3dleaf.core.errors import CloudWarning
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.reconstruction.unresolved import angle_deficits, doubts, find_lost, find_unresolved

STEP = 0.02
TUNNEL = 0.05
"""Radius of the waist of a hole through a sheet, or of a bridge between two."""
SPARSE = 0.15
"""Spacing of points that do not resolve it."""


def dumbbell(x, y, z):
    """Return a function whose sign is that of two sheets joined by a bridge around the z axis, or of a sheet's hole."""
    return np.abs(z) - 0.03 + np.exp(-(x**2 + y**2) / (2 * TUNNEL**2)) * 0.045


def mesh_of(function, sign=1):
    return mesh_arrays(extract_isosurface(Analytic(lambda x, y, z: sign * function(x, y, z)), STEP))


def samples(mesh, spacing, keep=lambda points: np.ones(len(points), dtype=bool), seed=0):
    """Return an oriented cloud of random points of a mesh, those of them that are kept."""
    vertices, triangles = mesh
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    rng = np.random.default_rng(seed)
    row = rng.choice(len(area), round(area.sum() / 2 / spacing**2), p=area / area.sum())
    points = np.einsum("ij,ijk->ik", rng.dirichlet(np.ones(3), len(row)), corners[row])
    kept = keep(points)
    return OrientedCloud.of(points[kept], (normal[row] / area[row, np.newaxis])[kept])


def off_axis(points):
    """Return which points are on the sheets, none in what joins them."""
    return np.hypot(points[:, 0], points[:, 1]) > 2 * TUNNEL


def near_axis(points):
    return np.hypot(points[:, 0], points[:, 1]) < 0.5


@pytest.mark.few(handles=2)
@pytest.mark.parametrize("handles", [0, 1, 2])
def test_deficits_sum_to_gauss_and_bonnet(handles):
    rings = [Analytic(lambda x, y, z, c=c: 0.15 - np.hypot(np.hypot(x - c, y) - 0.35, z)) for c in (-0.4, 0.4)]
    bodies = [Analytic(lambda x, y, z: 0.6 - np.sqrt(x**2 + y**2 + z**2)), rings[0]]
    field = Analytic(lambda x, y, z: np.maximum(rings[0].function(x, y, z), rings[1].function(x, y, z)))
    mesh = mesh_arrays(extract_isosurface([*bodies, field][handles], STEP))
    assert mesh_report(mesh).genus == handles
    assert angle_deficits(*mesh).sum() == pytest.approx(4 * np.pi * (1 - handles), abs=1e-6)


def test_a_rim_has_no_curvature():
    x, y = (part.ravel() for part in np.meshgrid(np.arange(4.0), np.arange(5.0), indexing="ij"))
    number = np.arange(20).reshape(4, 5)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    vertices = np.column_stack([x, y, 0 * x])
    vertices = np.concatenate([vertices, [[9.0, 9.0, 9.0]]])  # of no triangle
    np.testing.assert_allclose(angle_deficits(vertices, triangles), 0, atol=1e-12)
    vertices[number[1, 1], 2] = 1.0
    rim = number.ravel()[(x == 0) | (x == 3) | (y == 0) | (y == 4)]
    deficit = angle_deficits(vertices, triangles)
    assert deficit[number[1, 1]] > 1
    assert not deficit[rim].any()


@pytest.mark.few(sign=1)
@pytest.mark.parametrize("sign", [1, -1])
def test_what_joins_two_sheets_without_data_is_found_and_with_data_is_not(sign):
    mesh = mesh_of(dumbbell, sign)
    for spacing, kept in ((SPARSE, off_axis), (0.03, near_axis)):
        data = samples(mesh, spacing, kept)
        found = find_unresolved(*mesh, data)
        assert (found < 0).any() == (spacing == SPARSE)
        assert not (found > 0).any()
        assert np.all(np.hypot(*data.points[found < 0, :2].T) < 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1])
def test_a_bridge_longer_than_neighborhoods_is_found_by_its_ends(sign):
    """Each has −2π, half of what a handle has, and what is between them has none."""
    reach = 0.3

    def off(points):
        return np.hypot(np.maximum(np.abs(points[:, 0]) - reach, 0), points[:, 1])

    mesh = mesh_of(lambda x, y, z: dumbbell(np.maximum(np.abs(x) - reach, 0), y, z), sign)
    data = samples(mesh, 0.1, lambda points: off(points) > 2 * TUNNEL)
    found = find_unresolved(*mesh, data)
    told = data.points[found < 0]
    assert (told[:, 0] > 0).any()
    assert (told[:, 0] < 0).any()
    assert off(told).max() < 0.5
    assert not (found > 0).any()
    assert not find_unresolved(*mesh, samples(mesh, 0.02, lambda points: off(points) < 0.3)).any()


def test_two_tips_that_face_each_other_are_a_break_and_one_is_not():
    def rod(x, y, z, gap):
        reach = np.clip(np.abs(x), gap / 2 + 0.1, None) - np.abs(x)
        return 0.1 - np.sqrt(reach**2 + y**2 + z**2)

    broken = mesh_of(lambda x, y, z: np.minimum(rod(x, y, z, 0.06), 1 - np.abs(x)))
    data = samples(broken, 0.1)
    found = find_unresolved(*broken, data)
    assert (found > 0).any()
    assert np.abs(data.points[found > 0, 0]).max() < 0.5
    single = mesh_of(lambda x, y, z: np.minimum(rod(np.maximum(x, 0), y, z, 0.06), 1 - x))
    assert not find_unresolved(*single, samples(single, 0.1)).any()


def test_points_without_surface_are_found_where_those_around_have_none_either():
    ball = [mesh_of(lambda x, y, z, r=r: r - np.sqrt(x**2 + y**2 + z**2)) for r in (1.0, 0.5)]
    data = samples(joined(*ball), 0.06)
    inner = np.linalg.norm(data.points, axis=1) < 0.75
    assert not find_lost(*joined(*ball), data).any()
    assert np.array_equal(find_lost(*ball[0], data), inner)
    stray = data.points.copy()
    stray[np.flatnonzero(~inner)[:5]] *= 0.8
    assert not find_lost(*joined(*ball), OrientedCloud.of(stray, data.normals)).any()
    assert doubts(*ball[0], data)[0].startswith(f"{inner.sum():,} points in all have no surface")


def test_points_on_triangles_larger_than_their_spacing_have_a_surface():
    """The vertices of a coarse mesh are far from most points, its triangles are not."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    lattice = np.stack(np.meshgrid(*2 * [np.linspace(0, 1, 30)]), axis=-1).reshape(-1, 2)
    data = OrientedCloud.of(np.column_stack([lattice, np.zeros(len(lattice))]), np.tile([0.0, 0, 1], (900, 1)))
    assert not find_lost(*square, data).any()
    above = data.points + 2 * data.spacing * data.normals
    assert find_lost(*square, OrientedCloud.of(above, data.normals)).all()


@pytest.mark.slow
def test_the_job_tells_of_sheets_that_few_points_hold_apart():
    """A hollow ball, dense but for a side where its wall is thinner than the points are apart."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(40_000, 3))
    points /= np.linalg.norm(points, axis=1)[:, np.newaxis]
    points = points[rng.random(len(points)) < np.where(points[:, 0] > 0.3, 0.015, 0.15)]
    inner = rng.random(len(points)) < 0.45
    radius, facing = (np.where(inner, *pair)[:, np.newaxis] for pair in ((0.9, 1.0), (-1.0, 1.0)))
    cloud = OrientedCloud.of(radius * points, facing * points)
    with pytest.warns(CloudWarning, match=r"the surface has a hole, a bridge or a break that too few points"):
        create_from_point_cloud_rbfpu(cloud)
    even = rng.normal(size=(3_000, 3))
    even /= np.linalg.norm(even, axis=1)[:, np.newaxis]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        create_from_point_cloud_rbfpu(OrientedCloud.of(even, even))
