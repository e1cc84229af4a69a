"""Points that have moved go back to the surface, the nearest way; those of creases stay."""

import numpy as np
import pytest

from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.remeshing.limits import Limits
from o3dleaf.surface.remeshing.projection_target import FieldTarget, MeshTarget
from o3dleaf.surface.remeshing.remesh import _untangle
from remesh_fields import charted, turned
from tolerances import ON_FIELD, SINGLE_PRECISION_DISTANCE


def points(count=200):
    rng = np.random.default_rng(0)
    places = rng.normal(size=(count, 3))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    shifts = 0.05 * rng.normal(size=(count, 3))
    shifts[::4] = 0.0
    return places, shifts, np.arange(count) % 3 == 0


def jet_of(field):
    return lambda x: (field(x), field.gradient(x))


def test_on_a_field_points_go_along_its_gradient_and_creases_stay():
    field = turned("sphere")
    places, shifts, creased = points()
    charts, found, reached = FieldTarget(jet_of(field), 0.1).project(places, shifts, np.ones(200), creased)
    moved = places + shifts
    expected = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    assert found[~creased] == pytest.approx(expected[~creased], abs=ON_FIELD)
    assert np.array_equal(found[creased], places[creased])
    assert np.array_equal(charts, found)
    assert reached.tolist() == (~creased | (shifts == 0).all(axis=1)).tolist()


def test_where_newton_does_not_arrive_points_have_not_reached_it():
    target = FieldTarget(lambda x: (1 + np.sum(x**2, axis=1), 2 * x), 0.1)
    places, shifts, _ = points()
    assert not target.project(1.037 * places, shifts, np.ones(200), np.zeros(200, dtype=bool))[2].any()


@pytest.mark.parametrize("far", [0.0, 1e5])
def test_on_a_mesh_points_go_to_the_nearest_and_what_does_not_move_keeps_its_bits(far):
    mesh = charted("sphere", 4)
    places, shifts, creased = points()
    places = places + far
    charts, found, reached = MeshTarget(mesh.places + far, mesh.triangles).project(
        places, shifts, np.ones(200), creased
    )
    stays = creased | (shifts == 0).all(axis=1)
    assert np.array_equal(found[stays], places[stays])
    assert np.array_equal(charts, found)
    assert reached.tolist() == (~creased | (shifts == 0).all(axis=1)).tolist()
    out = (found[~stays] - far) / np.linalg.norm(found[~stays] - far, axis=1, keepdims=True)
    moved = (places + shifts - far)[~stays]
    # Triangles of 0.07 lie up to 6e-4 under the sphere, their planes turned by 0.04.
    assert np.linalg.norm(out - moved / np.linalg.norm(moved, axis=1, keepdims=True), axis=1).max() < 0.01
    assert np.abs(np.linalg.norm(found[~stays] - far, axis=1) - 1).max() < 2e-3
    again = MeshTarget(mesh.places + far, mesh.triangles).project(
        found, 0 * shifts + 1e-9, np.ones(200), ~stays & stays
    )
    assert np.linalg.norm(again[1] - found, axis=1)[~stays].max() < 10 * SINGLE_PRECISION_DISTANCE


def test_crossing_triangles_are_untangled():
    mesh, field = charted("sphere", 4, 0.35), turned("sphere")
    assert find_crossings(mesh.places, mesh.triangles).sum() > 100
    found, crossing = _untangle(mesh, FieldTarget(jet_of(field), 0.05), Limits(0.05, 0.1, 0.01))
    assert not crossing.any()
    assert not find_crossings(found.places, found.triangles).any()
