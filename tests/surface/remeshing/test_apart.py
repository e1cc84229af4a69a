"""What came to cross stays as it was: a body thinner than the edges asked for does not cross itself when remeshed."""

import numpy as np
import pytest

from o3dleaf import mesh_report
from o3dleaf.core.mesh_arrays import drop_unused_vertices
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.remeshing import apart
from o3dleaf.surface.remeshing.apart import remesh_apart
from o3dleaf.surface.remeshing.blocks import Charted
from o3dleaf.surface.remeshing.limits import Limits
from o3dleaf.surface.remeshing.projection_target import MeshTarget
from o3dleaf.surface.remeshing.remesh import _improve
from remesh_fields import sheet

EDGE, COUNT = 0.1, 24


def pillow(thick):
    """Two undulating sheets over a square that meet along its sides, up to twice as far apart."""
    corners, triangles = sheet(COUNT)
    x, y = corners[:, :2].T * COUNT / (COUNT - 1)
    inner, names = (np.minimum(x * (1 - x), y * (1 - y)) > 1e-9), np.arange(len(x))
    names[inner] = len(x) + np.arange(inner.sum())
    middle, half = 0.1 * np.sin(6 * x) * np.cos(5 * y), 16 * thick * x * (1 - x) * y * (1 - y)
    top, bottom = (np.column_stack([x, y, middle + sign * half]) for sign in (1, -1))
    # A triangle with all corners on the sides would be in both.
    kept = triangles[inner[triangles].any(axis=1)]
    both = np.concatenate([kept, names[kept][:, ::-1]])
    places, both = drop_unused_vertices(np.vstack([top, bottom[inner]]), both)
    return Charted.of(places, places, both, np.repeat([0, 1], len(kept)).astype(np.uint8))


@pytest.fixture(scope="module")
def mesh():
    return pillow(0.01)


@pytest.fixture(scope="module")
def again(mesh):
    """Remesh a part of it."""
    limits = Limits(0.7 * EDGE, 1.33 * EDGE, 0.1 * EDGE)
    return lambda part: _improve(part, MeshTarget(mesh.places, mesh.triangles), limits)


def crossings(mesh):
    return int(find_crossings(mesh.places, mesh.triangles).sum())


def facets(mesh):
    """The triangles by the bits of their corners, from any first corner on, with their labels."""
    corners = [[tuple(place) for place in triangle] for triangle in mesh.places[mesh.triangles].tolist()]
    first = [min(range(3), key=triangle.__getitem__) for triangle in corners]
    turned = [tuple(triangle[k:] + triangle[:k]) for k, triangle in zip(first, corners, strict=True)]
    return set(zip(turned, mesh.labels.tolist(), strict=True))


def test_what_crosses_stays_as_it_was_and_all_else_is_remeshed(mesh, again):
    assert crossings(mesh) == 0
    remeshed = again(mesh)
    assert crossings(remeshed) > 0
    found = remesh_apart(mesh, remeshed, again)
    report = mesh_report((found.places, found.triangles))
    assert report.watertight
    assert report.oriented
    assert (report.components, report.genus, report.self_intersections) == (1, 0, 0)
    stayed = facets(found) & facets(mesh)
    assert 0 < len(stayed) < 0.6 * len(mesh.triangles)
    assert len(found.triangles) - len(stayed) < 0.3 * len(mesh.triangles)
    assert np.unique(found.triangles).tolist() == list(range(len(found.places)))


def test_parts_are_joined_along_their_border(mesh, again):
    """If nothing is done to the rest all of it is the mesh as it was."""
    found = remesh_apart(mesh, again(mesh), lambda part: part)
    assert facets(found) == facets(mesh)
    assert len(found.places) == len(mesh.places)


def test_what_does_not_cross_is_not_looked_at_again(mesh):
    assert remesh_apart(mesh, mesh, None) is mesh


def test_what_crossed_as_it_came_does_not_count(mesh):
    through = np.array([[0.4, 0.5, -1], [0.4, 0.5, 1], [0.5, 0.6, 0]])
    corners, triangles = np.vstack([mesh.places, through]), np.vstack([mesh.triangles, len(mesh.places) + np.arange(3)])
    crossed = Charted.of(corners, corners, triangles, np.append(mesh.labels, 0).astype(np.uint8))
    assert crossings(crossed) > 1
    assert remesh_apart(crossed, crossed, None) is crossed


@pytest.mark.slow
def test_where_triangles_cross_whatever_stays_those_are_returned_that_cross_least(mesh, again, monkeypatch):
    """A remesher that makes a thing of its own of every part, which crosses."""
    bad, parts = again(pillow(0.004)), []

    def worse(part):
        parts.append(part)
        return bad

    monkeypatch.setattr(apart, "MAX_ROUNDS", 3)
    remeshed = again(mesh)
    assert crossings(remeshed) < crossings(bad)
    assert remesh_apart(mesh, remeshed, worse) is remeshed
    sizes = [len(part.triangles) for part in parts]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > sizes[-1] > 0
