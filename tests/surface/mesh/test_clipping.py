"""Discarding triangles, manifold rims, and the pieces that are kept, counted and dropped."""

import numpy as np
import pytest

from mesh_fields import sphere, wavy_sheets
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from o3dleaf.surface.mesh.clip import discard_triangles, trim_to_manifold
from o3dleaf.surface.mesh.components import connected_components, largest_component
from o3dleaf.surface.mesh.mesh_report import mesh_report


def grid_sheet(columns, rows):
    """Return a flat sheet of unit squares, two triangles each."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corner = (np.arange(rows)[:, np.newaxis] * (columns + 1) + np.arange(columns)).ravel()
    lower = np.stack([corner, corner + 1, corner + columns + 2], axis=1)
    upper = np.stack([corner, corner + columns + 2, corner + columns + 1], axis=1)
    return vertices, np.concatenate([lower, upper])


def test_a_triangle_goes_if_one_of_its_vertices_is_out():
    vertices, triangles = mesh_arrays(extract_isosurface(sphere(), 0.1))
    keep = vertices[:, 2] > 0.1
    left, rest = discard_triangles(vertices, triangles, keep)
    literal = [triangle for triangle in triangles if all(keep[corner] for corner in triangle)]
    assert np.array_equal(left[rest], vertices[np.array(literal)])
    assert len(np.unique(rest)) == len(left)


@pytest.mark.parametrize("seed", range(5))
def test_the_rim_is_manifold_after_trimming_and_no_vertex_has_moved(seed):
    vertices, triangles = mesh_arrays(extract_isosurface(wavy_sheets(), 0.08, [[-1] * 3, [1] * 3]))
    keep = np.random.default_rng(seed).random(len(vertices)) > 0.12
    ragged = discard_triangles(vertices, triangles, keep)
    assert not build_mesh(*ragged).is_vertex_manifold()
    left, rest = trim_to_manifold(*ragged)
    mesh = build_mesh(left, rest)
    assert mesh.is_vertex_manifold()
    assert mesh.is_edge_manifold(allow_boundary_edges=True)
    assert {tuple(v) for v in left} <= {tuple(v) for v in vertices}
    assert len(rest) > 0.9 * len(ragged[1])
    again = trim_to_manifold(left, rest)
    assert np.array_equal(again[0], left)
    assert np.array_equal(again[1], rest)


def test_of_a_bow_tie_the_largest_fan_stays():
    vertices, triangles = grid_sheet(4, 4)
    middle = vertices[triangles].mean(axis=1)
    first, second = (middle < 2).all(axis=1)[:, np.newaxis], (middle > 2)[:, :2].all(axis=1)[:, np.newaxis]
    two = triangles[(middle[:, :2] < 2).all(axis=1) | second[:, 0]]
    assert first.any()
    assert mesh_report((vertices, two)).nonmanifold_vertices == 1
    # One triangle less on the far side makes the near fan the larger one.
    hub = int(np.flatnonzero((vertices[:, :2] == 2).all(axis=1))[0])
    far = [row for row in range(len(two)) if hub in two[row] and (vertices[two[row], :2] >= 2).all()]
    left, rest = trim_to_manifold(vertices, np.delete(two, far[0], axis=0))
    kept = left[rest].mean(axis=1)
    assert ((kept[:, :2] < 2).all(axis=1)).sum() == 8
    assert mesh_report((left, rest)).manifold


def test_of_three_triangles_on_an_edge_two_stay():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]])
    left, rest = trim_to_manifold(vertices, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert len(rest) == 2
    assert mesh_report((left, rest)).manifold


def test_a_mesh_can_be_trimmed_away_and_an_empty_one_stays_empty():
    vertices, triangles = trim_to_manifold(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    assert (vertices.shape, triangles.shape) == ((0, 3), (0, 3))


def test_components_are_counted_and_ordered_by_area():
    parts = [mesh_arrays(extract_isosurface(sphere(radius), 0.1)) for radius in (0.4, 0.9, 0.2)]
    vertices = np.concatenate([part[0] + (3 * n, 0, 0) for n, part in enumerate(parts)])
    start = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    triangles = np.concatenate([part[1] + first for part, first in zip(parts, start, strict=True)])
    labels, areas = connected_components((vertices, triangles))
    assert np.all(np.diff(areas) < 0)
    assert np.bincount(labels).tolist() == [len(parts[n][1]) for n in (1, 0, 2)]
    oracle, sizes, _ = build_mesh(vertices, triangles).cluster_connected_triangles()
    assert len(sizes) == 3
    assert len({(a, b) for a, b in zip(labels, oracle, strict=True)}) == 3
    kept, of_all = largest_component((vertices, triangles))
    assert np.array_equal(np.asarray(kept.vertices), parts[1][0] + (3, 0, 0))
    assert np.array_equal(of_all, areas)


def test_what_cannot_be_meant_is_refused():
    with pytest.raises(InputError, match="keep_vertex"):
        discard_triangles(*grid_sheet(2, 2), np.ones(3, dtype=bool))
    with pytest.raises(InputError, match="outside 0 to 2"):
        connected_components((np.zeros((3, 3)), [[0, 1, 3]]))
    with pytest.raises(InputError, match="give an Open3D"):
        connected_components("leaf.ply")
