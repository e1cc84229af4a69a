"""Vertices on creases leave their cells where a field turns within one; triangles cross others there alone."""

import numpy as np
import pytest

from o3dleaf import extract_isosurface
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.isosurface.crease_edges import near_strayed
from o3dleaf.surface.mesh.crossings import find_crossings

STEP = 0.07


class Blades:
    """Solids between pairs of planes that meet at a few degrees, thinner than a cell along their edges."""

    bounds = np.array([[-1.0] * 3, [1.0] * 3])
    unit = None

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        one, lean = rng.normal(size=(2, 4, 3))
        other = -one + 0.3 * lean
        self.normals = np.stack([each / np.linalg.norm(each, axis=1, keepdims=True) for each in (one, other)])
        self.offsets = rng.uniform(0.02, 0.3, (2, 4))

    def values(self, points):
        return self.offsets[..., None] - self.normals @ np.asarray(points).T

    def __call__(self, points):
        return self.values(points).min(axis=0).max(axis=0)

    def gradient(self, points):
        values = self.values(points)
        blade = values.min(axis=0).argmax(axis=0)
        rows = np.arange(len(blade))
        return -self.normals[values[:, blade, rows].argmin(axis=0), blade]


def surface(seed, *, features):
    field = Blades(seed)
    seeds = np.random.default_rng(0).uniform(-1, 1, (4_000, 3))
    seeds = seeds[np.abs(field(seeds)) < STEP]
    return mesh_arrays(extract_isosurface(field, STEP, seeds=seeds, sharpen=False, features=features))


@pytest.mark.parametrize("seed", range(4))
def test_all_that_cross_are_near_a_vertex_that_left_its_cell(seed):
    vertices, triangles = surface(seed, features=True)
    crossing = find_crossings(vertices, triangles)
    assert crossing.any()
    near = near_strayed(vertices, triangles, STEP)
    assert near[crossing].all()
    assert near.mean() < 0.9
    alone = np.zeros(len(triangles), dtype=bool)
    alone[near] = find_crossings(vertices, triangles[near])
    assert np.array_equal(alone, crossing)


@pytest.mark.parametrize("seed", range(4))
def test_without_vertices_on_creases_none_cross_and_none_is_looked_at(seed):
    vertices, triangles = surface(seed, features=False)
    assert not find_crossings(vertices, triangles).any()
    assert not near_strayed(vertices, triangles, STEP).any()
