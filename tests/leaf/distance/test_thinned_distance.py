"""Distances where a map thins out hairs: to those that stand there, and to what is left of the others."""

import numpy as np
import open3d as o3d
import pytest

from hair_fields import FACE, HALF, STEP, TILE, TIP, hairy, hollow_leaf, on_strip, thinned
from leaf_fields import texture
from o3dleaf import WangField
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.leaf.distance import cells, distance
from o3dleaf.leaf.distance.distance import SurfaceIndex
from tolerances import AT_EDGE, AT_VERTICES, FILLED, OFF_SURFACE, ON_SURFACE, THINNED_MESH

ENDS = np.array([[0.0, -3.0], [8.0, 3.0]])
"""Of the strip, along and across."""


@pytest.fixture(scope="module")
def patch():
    return texture(hairy, tile=TILE, n=31)


@pytest.fixture(scope="module", params=["periodic", pytest.param("wang", marks=pytest.mark.slow)])
def tiles(request, patch):
    return patch if request.param == "periodic" else WangField(patch.field, seed=4)


@pytest.fixture(scope="module")
def half(tiles):
    return thinned(tiles, HALF)


@pytest.fixture(scope="module")
def leaf(half):
    return on_strip(half)


@pytest.fixture(scope="module")
def mesh(leaf, tiles):
    """The closed one, in triangles of half a step; of a quarter where seams of Wang tiles leave slivers of hairs."""
    step = STEP / 4 if isinstance(tiles, WangField) else STEP / 2
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(leaf.extract_mesh(step, closed=True)))
    return scene


@pytest.fixture(scope="module")
def places(tiles, half):
    """Places of the plane: in hairs that are kept, in those that are not, on borders of tiles, at the rim."""
    rng = np.random.default_rng(0)
    plane = rng.uniform(*ENDS, (20_000, 2))
    above = np.column_stack([plane, np.full(len(plane), (FACE + TIP) / 2)])
    hair, kept = tiles(above) > 0, half(above) > 0
    some, axis = plane[:600], np.arange(600) % 2
    row, corner = np.arange(600), tiles.cell[0, :2]
    border, rim = some.copy(), some.copy()
    border[row, axis] = (corner + np.round((some - corner) / tiles.period) * tiles.period)[row, axis]
    rim[row, axis] = ENDS[rng.integers(0, 2, 600), axis]
    return {"kept": plane[kept], "removed": plane[hair & ~kept], "border": border, "rim": rim}


def around(leaf, plane, seed, count=800, reach=0.15):
    """World points over and under places of the plane, and in the leaf there."""
    rng = np.random.default_rng(seed)
    plane = plane[rng.integers(0, len(plane), count)] + rng.uniform(-reach, reach, (count, 2))
    return leaf.blade.lift(np.column_stack([plane, rng.uniform(-0.5, 0.7, count)]))


@pytest.mark.parametrize("closed", [pytest.param(False, marks=pytest.mark.slow), True])
@pytest.mark.parametrize("place", ["kept", "removed", "border", "rim"])
def test_it_is_the_distance_to_the_mesh(leaf, mesh, places, place, closed):
    x = around(leaf, places[place], seed=1)
    assert len(places[place]) > 100
    expected = mesh.compute_signed_distance(o3d.core.Tensor(x.astype(np.float32))).numpy()
    off = np.abs(leaf.signed_distance(x, closed=closed) - expected)
    assert np.quantile(off, 0.9) < THINNED_MESH[0]
    assert off.max() < THINNED_MESH[1]


@pytest.mark.slow
def test_its_sign_is_that_of_g_and_its_feet_lie_at_it(leaf, places):
    plane = np.concatenate([places["kept"], places["removed"]])
    x = around(leaf, plane, seed=2, count=3000)
    found = leaf.signed_distance(x)
    inside = (leaf(x) > 0) & leaf.blade.outline.contains(leaf.blade.flatten(x)[:, :2])
    assert np.array_equal(found < 0, inside)
    assert 0.1 < inside.mean() < 0.9
    feet = leaf.closest_points(x)
    assert np.allclose(np.linalg.norm(feet - x, axis=1), np.abs(found))


@pytest.mark.slow
def test_with_a_map_of_ones_it_is_that_of_all_hairs_to_the_bit(tiles, half, leaf, places):
    x = around(leaf, np.concatenate(list(places.values())), seed=4)
    ones, full = on_strip(thinned(tiles, [[1.0]], zones=half.zones)), on_strip(tiles)
    assert np.array_equal(ones.signed_distance(x), full.signed_distance(x))


@pytest.mark.slow
def test_it_depends_on_neither_company_nor_threads(leaf, places, monkeypatch):
    x = around(leaf, np.concatenate(list(places.values())), seed=5)
    expected = leaf.signed_distance(x)
    order = np.random.default_rng(6).permutation(len(x))
    monkeypatch.setattr(distance, "BLOCK", 77)
    monkeypatch.setattr(cells, "VIEW_BLOCK", 3)
    before = get_num_threads()
    try:
        set_num_threads(3)
        assert np.array_equal(SurfaceIndex.build(leaf).signed_distance(x[order]), expected[order])
    finally:
        set_num_threads(before)


def test_at_vertices_of_a_mesh_it_is_zero(leaf):
    """Over stubs too, where the field bends at the lid."""
    window = np.array([[1.5, -2.0], [4.5, 1.0]])
    vertices = np.asarray(leaf.plan_mesh(STEP, window).extract().mesh.vertices)
    off = np.abs(leaf(vertices)) / np.linalg.norm(leaf.gradient(vertices), axis=1)
    # Where the window's edge cuts triangles, its vertices lie in their planes.
    to_edge = np.abs(leaf.blade.flatten(vertices)[:, np.newaxis, :2] - window).min(axis=(1, 2))
    assert np.mean(off[to_edge > AT_EDGE] > ON_SURFACE * STEP) < OFF_SURFACE
    assert np.abs(leaf.signed_distance(vertices[off <= ON_SURFACE * STEP])).max() < AT_VERTICES


@pytest.mark.slow
def test_a_void_in_a_hair_is_filled_where_the_hair_stands_and_air_where_it_is_gone():
    leaf, tiles, kept = hollow_leaf()
    assert 0 < kept.sum() < len(kept)
    for height, offset, filled in ((0.5, 0.0, kept), (0.0, 0.8, np.ones(len(kept), dtype=bool))):
        middle = leaf.blade.lift(np.column_stack([tiles + [offset, 0], np.full(len(tiles), height)]))
        opened, closed = (leaf.signed_distance(middle, closed=each) for each in (False, True))
        assert opened[filled] == pytest.approx(0.12, abs=FILLED)
        assert np.array_equal(closed < 0, filled)
