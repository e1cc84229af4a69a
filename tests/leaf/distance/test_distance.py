"""Signed distance: exact on slabs, flat and bent; a distance anywhere; the sign of G; bounded memory."""

import tracemalloc

import numpy as np
import open3d as o3d
import pytest

from leaf_fields import MAIN_FRAME, leaf_of, texture
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.leaf.distance import distance
from o3dleaf.leaf.texture.patches import PatchBlend
from tolerances import CLOSED_MESH, DISTANCE_MESH, EIKONAL, FILLED, LIPSCHITZ, PROJECTED, SLAB_DISTANCE

HALF, LENGTH, WIDTH = 0.31, 20.0, 3.0


@pytest.fixture(scope="module")
def slab():
    """A box, 20 by 6 by 0.62."""
    return leaf_of(texture(lambda x, y, z: HALF**2 - z**2))[0]


@pytest.fixture(scope="module", params=MAIN_FRAME)
def bent(request):
    return leaf_of(texture(lambda x, y, z: HALF**2 - z**2), bend=10.0, frame=request.param, step=0.5)


@pytest.fixture(scope="module", params=MAIN_FRAME)
def rough(request):
    """Ridges and bumps on a bent blade."""

    def function(x, y, z):
        top = 0.2 + 0.08 * np.cos(2 * np.pi * y) + 0.05 * np.cos(np.pi * x) ** 2
        return (top - z) * (z + 0.2)

    return leaf_of(texture(function, n=21), bend=10.0, frame=request.param)


def box_distance(x):
    q = np.abs(x - [LENGTH / 2, 0, 0]) - [LENGTH / 2, WIDTH, HALF]
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def about(leaf, rng, count, margin):
    low, high = leaf.bounds
    return rng.uniform(low - margin, high + margin, (count, 3))


@pytest.mark.parametrize("margin", [0.3, 30.0])
def test_the_distance_to_a_flat_slab_is_that_to_a_box(slab, margin):
    x = about(slab, np.random.default_rng(0), 3000, margin)
    found = slab.signed_distance(x)
    assert np.abs(found - box_distance(x)).max() <= SLAB_DISTANCE


def test_the_distance_to_a_bent_slab_is_that_to_cylinders(bent):
    leaf, lift = bent
    rng = np.random.default_rng(1)
    height = rng.uniform(-1.5, 1.5, 2000)
    x = lift(rng.uniform(4, 16, 2000), rng.uniform(-1.2, 1.2, 2000), height)
    error = np.abs(leaf.signed_distance(x) - (np.abs(height) - HALF))
    # Midway between the faces a sample of the farther one may be nearer than one of the nearer face.
    assert error[np.abs(height) > 0.02].max() <= SLAB_DISTANCE


def test_the_foot_of_the_slab_lies_on_it_at_that_distance(slab):
    x = about(slab, np.random.default_rng(2), 1000, 3.0)
    feet = slab.closest_points(x)
    assert np.abs(box_distance(feet)).max() <= SLAB_DISTANCE
    assert np.abs(np.linalg.norm(feet - x, axis=1) - np.abs(slab.signed_distance(x))).max() <= SLAB_DISTANCE


def test_the_sign_is_that_of_g_in_the_outline(rough):
    leaf, lift = rough
    rng = np.random.default_rng(3)
    x = lift(rng.uniform(-0.5, 20.5, 4000), rng.uniform(-3.3, 3.3, 4000), rng.uniform(-0.5, 0.5, 4000))
    inside = (leaf(x) > 0) & leaf.blade.outline.contains(leaf.blade.flatten(x)[:, :2])
    assert np.array_equal(leaf.signed_distance(x) < 0, inside)
    assert 0.1 < inside.mean() < 0.9


def test_it_is_1_lipschitz(rough):
    leaf, _ = rough
    rng = np.random.default_rng(4)
    x = about(leaf, rng, 4000, 1.0)
    y = x + rng.normal(size=x.shape) * 10.0 ** rng.uniform(-3, 0.5, (len(x), 1))
    change, way = np.abs(leaf.signed_distance(x) - leaf.signed_distance(y)), np.linalg.norm(x - y, axis=1)
    assert np.all(change <= way + LIPSCHITZ)


def test_its_slope_is_one(rough):
    leaf, lift = rough
    rng = np.random.default_rng(5)
    x = lift(rng.uniform(1, 19, 2000), rng.uniform(-2, 2, 2000), rng.uniform(-0.5, 3, 2000))
    h = 1e-3
    parts = [(leaf.signed_distance(x + h * e) - leaf.signed_distance(x - h * e)) / (2 * h) for e in np.eye(3)]
    slope = np.linalg.norm(parts, axis=0)
    # Across the medial axis, where two points are nearest, it has a kink.
    assert np.mean(np.abs(slope - 1) > EIKONAL) < 0.02


def test_it_is_the_distance_to_the_mesh(rough):
    leaf, lift = rough
    mesh = leaf.extract_mesh(0.04, [[5.4, -2.6], [14.6, 2.6]])
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    rng = np.random.default_rng(6)
    x = lift(rng.uniform(7, 13, 3000), rng.uniform(-1, 1, 3000), rng.uniform(-1.2, 1.5, 3000))
    expected = scene.compute_distance(o3d.core.Tensor(x.astype(np.float32))).numpy()
    error = np.abs(np.abs(leaf.signed_distance(x)) - expected)
    assert np.quantile(error, 0.99) <= DISTANCE_MESH[0]
    assert error.max() <= DISTANCE_MESH[1]


@pytest.mark.parametrize("size", [1e6, 1e30, 1e300, 1.5e308])
def test_far_away_it_is_the_distance_to_a_point(rough, size):
    leaf, _ = rough
    way = np.array([[1.0, 0.2, 0.1], [0, 0, -1], [-0.3, 1, 0.5]]) * size
    assert leaf.signed_distance(way) == pytest.approx(np.hypot(np.hypot(*way.T[:2]), way.T[2]), rel=1e-4)


def test_it_depends_on_neither_company_nor_threads(rough, monkeypatch):
    leaf, _ = rough
    x = about(leaf, np.random.default_rng(7), 3000, 0.5)
    expected = leaf.signed_distance(x)
    order = np.random.default_rng(8).permutation(len(x))
    monkeypatch.setattr(distance, "BLOCK", 77)
    monkeypatch.setattr(distance, "BATCH_SIZE", 500)
    before = get_num_threads()
    try:
        set_num_threads(3)
        assert np.array_equal(leaf.signed_distance(x[order]), expected[order])
    finally:
        set_num_threads(before)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_points(rough, monkeypatch):
    leaf, _ = rough
    monkeypatch.setattr(distance, "BLOCK", distance.BLOCK // 4)
    monkeypatch.setattr(distance, "BATCH_SIZE", distance.BATCH_SIZE // 4)
    x = about(leaf, np.random.default_rng(9), 8 * distance.BATCH_SIZE, 40.0)
    leaf.signed_distance(x)  # what is loaded by a first call is no matter of the points

    def needed(count):
        tracemalloc.start()
        try:
            return -leaf.signed_distance(x[:count]).nbytes + tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    threads = get_num_threads()
    assert needed(len(x)) <= threads * 1100 * distance.BLOCK + 120 * distance.BATCH_SIZE


def test_project_falls_back_to_the_nearest_point_where_there_is_no_way_down(rough):
    leaf, _ = rough
    x = np.array([[1e6, 0, 0], [0, 0, 300.0], [5.0, 1.0, -40.0]])
    found = leaf.project(x)
    assert np.all(np.isfinite(found))
    assert np.abs(leaf.signed_distance(found)).max() <= LIPSCHITZ


def test_several_patches_have_fields_and_masks_but_no_distance(tmp_path):
    parts = [texture(lambda x, y, z, half=half: half**2 - z**2) for half in (0.31, 0.25)]
    leaf, lift = leaf_of(PatchBlend(parts, breaks=[10.0]))
    for what in ("field", "mask"):
        leaf.write_grid(tmp_path / f"{what}.nrrd", 0.5, what=what)
    on = leaf.project(lift(np.array([3.0, 17.0]), np.zeros(2), np.full(2, 0.3)))
    assert np.abs(leaf(on)).max() <= PROJECTED
    far = [[0.0, 0.0, 300.0]]
    for call in (
        lambda: leaf.signed_distance(far),
        lambda: leaf.closest_points(far),
        lambda: leaf.project(far),
        lambda: leaf.write_grid(tmp_path / "distance.nrrd", 0.5, what="distance"),
    ):
        with pytest.raises(InputError, match="several patches along the leaf have no single tile"):
            call()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["field.nrrd", "mask.nrrd"]


@pytest.fixture(scope="module")
def pocked():
    """A slab with a pocket in the middle of every tile and a speck above it."""

    def function(x, y, z):
        pocket, speck = np.sqrt(x**2 + y**2 + z**2), np.sqrt(x**2 + y**2 + (z - 0.6) ** 2)
        return np.maximum(np.minimum(HALF - np.abs(z), pocket - 0.16), 0.1 - speck)

    return leaf_of(texture(function, half=0.8, n=31))[0]


def test_the_closed_solid_has_its_pockets_filled_and_no_specks(pocked):
    rng = np.random.default_rng(10)
    x = about(pocked, rng, 4000, 0.1)
    x = x[np.all(np.abs(x[:, :2] - [LENGTH / 2, 0]) < [LENGTH / 2 - 1, WIDTH - 1], axis=1)]
    found, face = pocked.signed_distance(x, closed=True), np.abs(x[:, 2]) - HALF
    assert np.abs(found - face).max() <= FILLED
    assert np.array_equal(found < 0, face < 0)
    middles = np.array([[8.0, 0, 0], [8.0, 0, 0.6]])  # a pocket's, filled, and a speck's, dropped
    assert pocked.signed_distance(middles) == pytest.approx([0.16, -0.1], abs=FILLED)
    assert pocked.signed_distance(middles, closed=True) == pytest.approx([-HALF, 0.6 - HALF], abs=FILLED)


@pytest.mark.slow
def test_the_closed_distance_is_that_to_the_closed_mesh(rough):
    leaf, _ = rough
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(leaf.extract_mesh(0.04, closed=True)))
    x = about(leaf, np.random.default_rng(11), 4000, 1.0)  # its rim and its rounded corners too
    expected = scene.compute_signed_distance(o3d.core.Tensor(x.astype(np.float32))).numpy()
    error = np.abs(leaf.signed_distance(x, closed=True) - expected)
    assert np.quantile(error, 0.99) <= CLOSED_MESH[0]
    assert error.max() <= CLOSED_MESH[1]


def test_air_that_reaches_through_the_blade_cannot_be_filled():
    leaf = leaf_of(texture(lambda x, y, z: np.minimum(HALF - np.abs(z), np.hypot(x, y) - 0.3), n=21))[0]
    assert leaf.signed_distance([[8.0, 0.0, 0.0]]) == pytest.approx(0.3, abs=FILLED)
    with pytest.raises(ReconstructionError, match="air reaches through the layer"):
        leaf.signed_distance([[8.0, 0.0, 0.0]], closed=True)
