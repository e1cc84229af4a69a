"""Solids: exact distances to a surface that is known, and samples of it that are uniform by area."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from o3dleaf import Field
from o3dleaf.core.errors import InputError
from o3dleaf.samples import Block, Figure, Sphere, Torus, WavySheet, Wires
from o3dleaf.samples.figure import DEFAULT_PARTS
from o3dleaf.samples.meshed import draw_on_triangles
from o3dleaf.surface.mesh.topology import EdgeTable, label_triangles
from tolerances import DIVERGENCE_SIGMAS, SAMPLE_DIFFERENCE, SHEET_AREA, SOLID_ASTRAY, SOLID_FOOT, SOLID_TIE

KINDS = [Sphere, Torus, Block, Wires, WavySheet, Figure]


@pytest.fixture(scope="module")
def solids():
    """One of each; the figure has no tail, whose radius is the least and the step of all of its mesh."""
    return {kind: kind(DEFAULT_PARTS[:-1]) if kind is Figure else kind() for kind in KINDS}


@pytest.fixture(params=KINDS)
def solid(request, solids):
    return solids[request.param]


def shell(solid, count, reach, seed=5):
    """Return points on either side of a surface, within about `reach` of it."""
    points, _ = solid.sample(count, seed)
    return points + np.random.default_rng(99).normal(scale=reach, size=points.shape)


def mesh_volume(vertices, triangles):
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    return (np.cross(a, b) * c).sum() / 6


def test_it_is_a_field_with_room_around_it(solid):
    assert isinstance(solid, Field)
    points, _ = solid.sample(1000)
    low, high = solid.bounds
    assert np.all((points > low) & (points < high))


def test_the_distance_is_that_to_the_nearest_of_many_samples(solid):
    points = shell(solid, 1500, 0.02)
    count = 20_000
    dense = solid.sample(count, 1)[0]
    brute = KDTree(dense).query(points)[0]
    distance = np.abs(solid.signed_distance(points))
    assert np.max(distance - brute) < SOLID_TIE
    # A disc around the foot, of three spacings and a bit, is never without a sample.
    gap = 3.5 * np.sqrt(solid.area / count)
    assert np.all(brute < np.hypot(distance, gap))


def test_the_distance_is_negative_inside(solid):
    points, normals = solid.sample(2000, 3)
    assert np.all(solid.signed_distance(points + 1e-3 * normals) > 0)
    assert np.all(solid.signed_distance(points - 1e-3 * normals) < 0)
    assert np.all(solid(points - 1e-3 * normals) > 0)


def test_feet_are_on_the_surface_as_far_away_as_the_distance_says(solid):
    points = shell(solid, 2000, 0.05)
    feet = solid.closest(points)
    assert np.abs(solid.signed_distance(feet.points)).max() < SOLID_FOOT
    assert np.abs(np.linalg.norm(points - feet.points, axis=1) - np.abs(feet.distance)).max() < SOLID_FOOT
    assert np.abs(np.linalg.norm(feet.normals, axis=1) - 1).max() < SOLID_FOOT
    if not isinstance(solid, Block):  # whose normals on an edge are those of a face
        aside = np.linalg.norm(np.cross(points - feet.points, feet.normals), axis=1)
        assert np.mean(aside > SOLID_FOOT) < SOLID_ASTRAY


def test_who_goes_out_along_the_normal_finds_back(solid):
    points, normals = solid.sample(2000, 4)
    feet = solid.closest(points + 5e-3 * normals)
    assert np.abs(feet.points - points).max() < SOLID_FOOT
    assert np.abs(feet.distance - 5e-3).max() < SOLID_FOOT


def test_the_gradient_is_the_difference_quotient_and_has_length_one(solid):
    points, normals = solid.sample(500, 6)
    off, h = points + 5e-3 * normals, 1e-6
    gradient = solid.gradient(off)
    quotient = np.stack([(solid(off + h * e) - solid(off - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    assert np.abs(np.linalg.norm(gradient, axis=1) - 1).max() < SOLID_FOOT / 5e-3
    assert np.abs(gradient - quotient).max() < SAMPLE_DIFFERENCE
    assert np.abs(gradient + normals).max() < SOLID_FOOT / 5e-3
    assert np.abs(solid.gradient(points) + normals).max() < SOLID_FOOT


def test_samples_are_uniform_by_area(solid):
    """Gauss: the integral of x nᵀ over a closed surface is its volume times the unit matrix, and that of n is 0."""
    known = {Sphere: np.pi / 6, Torus: 2 * np.pi**2 * 0.4 * 0.15**2, Block: 0.28, Wires: np.pi * 0.034}
    volume = known.get(type(solid)) or mesh_volume(*solid.mesh)
    points, normals = solid.sample(20_000, 7)
    about = points - points.mean(axis=0)
    terms = solid.area * np.concatenate(
        [normals[:, :, np.newaxis], about[:, :, np.newaxis] * normals[:, np.newaxis]], 2
    )
    expected = np.column_stack([np.zeros(3), volume * np.eye(3)])
    sigma = terms.std(axis=0) / np.sqrt(len(points))
    assert np.all(np.abs(terms.mean(axis=0) - expected) < DIVERGENCE_SIGMAS * sigma)


@pytest.mark.parametrize("places", [(), ((0.0, 0.0), (0.0, 0.2))])
def test_no_wires_and_wires_that_touch_are_refused(places):
    with pytest.raises(InputError, match="farther apart than two radii"):
        Wires(places)


def test_points_on_triangles_are_uniform():
    vertices = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [4, 0, 0], [5, 0, 0], [4, 1, 0]])
    triangles, count = np.arange(6).reshape(2, 3), 40_000
    points, chosen = draw_on_triangles(vertices, triangles, count, np.random.default_rng(0))
    assert abs(np.mean(chosen == 0) - 0.9) < DIVERGENCE_SIGMAS * np.sqrt(0.9 * 0.1 / count)
    large = points[chosen == 0]
    sigma = large.std(axis=0) / np.sqrt(len(large))
    assert np.all(np.abs(large.mean(axis=0) - vertices[:3].mean(axis=0)) <= DIVERGENCE_SIGMAS * sigma)
    # The covariance of a uniform triangle is that of its corners over four.
    expected = np.cov(vertices[:3].T, bias=True) / 4
    assert np.abs(np.cov(large.T) - expected).max() < DIVERGENCE_SIGMAS * np.sqrt(2 / len(large)) * expected.max()


def test_the_seed_decides(solid):
    first, again, other = (solid.sample(100, seed)[0] for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.any(np.all(first == other, axis=1))
    assert len(np.unique(np.concatenate([first, other]), axis=0)) == 200


def test_the_sheet_is_three_spacings_thick_all_over(solids):
    sheet = solids[WavySheet]
    assert abs(sheet.thickness / (3 * np.sqrt(sheet.area / 5000)) - 1) < SHEET_AREA
    points, normals = sheet.sample(2000, 8)
    assert (
        np.abs(sheet.signed_distance(points - sheet.thickness / 2 * normals) + sheet.thickness / 2).max() < SOLID_FOOT
    )


def test_the_sheet_and_the_figure_are_of_one_piece_without_a_handle(solids):
    for kind in (WavySheet, Figure):
        vertices, triangles = solids[kind].mesh
        edges = EdgeTable.of(triangles)
        assert np.all(edges.count == 2)
        assert label_triangles(triangles, edges).max() == 0
        assert len(vertices) - len(edges.ends) + len(triangles) == 2


def test_what_cannot_be_meant_is_refused(solid):
    with pytest.raises(InputError, match="count"):
        solid.sample(0)
    with pytest.raises(InputError, match="points"):
        solid.closest([[0.0, np.nan, 0.0]])
