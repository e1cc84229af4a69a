"""A leaf whose hairs a map thins out: each is whole or gone, tiles are polygonized twice, and no seam is left."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import o3dleaf as o3l
from hair_fields import AREA, FACE, HALF, RADIUS, STEP, TILE, hairs_of, hairy, hollow_leaf, on_strip, thinned
from leaf_fields import off_the_field, texture
from o3dleaf import ThinnedField, WangField
from o3dleaf.core.errors import InputError
from o3dleaf.io.labelled_mesh import RIM
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.io.triangle_mesh import read_mesh
from o3dleaf.leaf.blade.outline_area import sides_of
from o3dleaf.leaf.instancing.assembly import Assembly
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.remeshing import LeafTarget
from o3dleaf.leaf.tile_lattice import extract_plane, extract_tiles, tile_lattice
from o3dleaf.surface.mesh.mesh_report import mesh_report
from tolerances import AT_VERTICES, ON_SURFACE, SHARPENED


@pytest.fixture(scope="module")
def patch():
    return texture(hairy, tile=TILE, n=31)


@pytest.fixture(scope="module", params=["periodic", pytest.param("wang", marks=pytest.mark.slow)])
def tiles(request, patch):
    return patch if request.param == "periodic" else WangField(patch.field, seed=2)


@pytest.fixture(scope="module")
def half(tiles):
    return thinned(tiles, HALF)


@pytest.fixture(scope="module")
def leaf(half):
    return on_strip(half)


@pytest.fixture(scope="module")
def solid(leaf):
    return leaf.plan_mesh(STEP, closed=True).extract()


def test_the_solid_is_closed_and_its_faces_lie_on_the_field(leaf, solid):
    report = mesh_report(solid.mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)
    off = off_the_field(leaf, solid)
    assert np.quantile(off, 0.97) < ON_SURFACE
    assert off.max() < STEP


def test_wang_tiles_fit_where_hairs_are_removed(patch):
    leaf = on_strip(thinned(WangField(patch.field, seed=2), HALF))
    made = leaf.plan_mesh(STEP, [[1.0, -2.0], [5.0, 2.0]], closed=True).extract()
    report = mesh_report(made.mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)
    assert 0 < leaf.texture.hairs.counts[0] < leaf.texture.hairs.counts[1]


def test_every_hair_is_whole_or_gone(tiles, leaf, solid):
    full = hairs_of(leaf, on_strip(tiles).plan_mesh(STEP, closed=True).extract().mesh.vertices)
    left = hairs_of(leaf, solid.mesh.vertices)
    assert cKDTree(full).query(left)[0].max() < 1e-9
    # What is left of a hair is all of it: beside each of its vertices lie those that were there.
    near = cKDTree(full).query_ball_point(left, 1.5 * STEP)
    kept = cKDTree(left).query(full[np.unique(np.concatenate(near).astype(int))])[0]
    assert kept.max() < 1e-9
    assert 0.2 < len(left) / len(full) < 0.8


def test_a_map_of_ones_changes_nothing_and_one_of_zeros_leaves_no_hair(tiles, half):
    plain = on_strip(tiles).plan_mesh(STEP, closed=True).extract().mesh
    ones, zeros = (on_strip(thinned(tiles, [[share]], zones=half.zones)) for share in (1.0, 0.0))
    same = ones.plan_mesh(STEP, closed=True).extract().mesh
    # Small tiles are not set down together here, so that vertices come in another order.
    assert len(same.triangles) == len(plain.triangles)
    assert cKDTree(np.asarray(plain.vertices)).query(np.asarray(same.vertices))[0].max() < SHARPENED * STEP
    bare = zeros.plan_mesh(STEP, closed=True).extract().mesh
    assert len(hairs_of(zeros, bare.vertices)) == 0
    heights = zeros.blade.flatten(np.asarray(bare.vertices))[:, 2]
    assert heights.max() < FACE + 0.01 + tiles.data_distance


def test_mixed_tiles_are_what_the_whole_plane_is_polygonized_at_once(leaf):
    tile, tiles, *_ = extract_tiles(leaf, STEP / 2, 0, together=False)
    lattice = tile_lattice(leaf.texture.texture, leaf.scale, STEP / 2)
    whole, alone, *_ = extract_plane(leaf, lattice, 0)
    assert tile.lattice.spacing == whole.lattice.spacing

    def faces(tiles):
        lattice = tiles.lattice
        plane = np.array(lattice.origin[:2]), np.array(lattice.spacing[:2])
        area = footprint(sides_of(leaf.edge_curve(closed=True)), *plane, np.array([[2.0, -2.0], [6.5, 2.0]]))
        assembly = Assembly(tiles, area, closed=False)
        arrays = Arrays(assembly)
        assembly.emit(arrays, lambda flat: flat)
        return arrays.vertices, len(arrays.triangles)

    (mixed, count), (direct, number) = faces(tiles), faces(alone)
    assert count == number
    assert cKDTree(direct).query(mixed)[0].max() < SHARPENED * STEP


def test_a_mesh_coarser_than_the_data_is_closed_and_has_no_hair_that_is_gone(tiles, leaf, solid):
    step = 2.5 * STEP
    assert step > leaf.texture.finest
    made = leaf.plan_mesh(step, closed=True).extract()
    report = mesh_report(made.mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)
    coarse = hairs_of(leaf, made.mesh.vertices)
    assert len(coarse) > 0
    assert cKDTree(hairs_of(leaf, solid.mesh.vertices)).query(coarse)[0].max() < step
    # With all hairs there are some that are farther off.
    full = hairs_of(leaf, on_strip(tiles).plan_mesh(step, closed=True).extract().mesh.vertices)
    assert cKDTree(hairs_of(leaf, solid.mesh.vertices)).query(full)[0].max() > 2 * RADIUS + step


def test_a_window_is_part_of_the_whole_and_a_file_has_what_is_extracted(leaf, solid, tmp_path):
    whole, window = (leaf.extract_mesh(STEP, region) for region in (None, [[3.0, -1.0], [6.0, 1.0]]))
    places = {row.tobytes() for row in np.asarray(whole.vertices)}
    inside = np.abs(leaf.blade.flatten(np.asarray(window.vertices))[:, :2] - [4.5, 0]) < [1.5 - STEP, 1 - STEP]
    assert all(row.tobytes() in places for row in np.asarray(window.vertices)[inside.all(axis=1)])
    leaf.plan_mesh(STEP, closed=True).write(tmp_path / "leaf.ply")
    assert np.array_equal(np.asarray(read_mesh(tmp_path / "leaf.ply").mesh.triangles), np.asarray(solid.mesh.triangles))


def test_a_leaf_that_was_saved_has_the_same_mesh(leaf, solid, tmp_path):
    leaf.save(tmp_path / "leaf.o3l")
    again = o3l.load(tmp_path / "leaf.o3l").plan_mesh(STEP, closed=True).extract()
    assert np.array_equal(np.asarray(again.mesh.vertices), np.asarray(solid.mesh.vertices))


def test_of_two_maps_the_denser_one_has_all_hairs_of_the_other(tiles, half):
    few, many = (thinned(tiles, [[share]], zones=half.zones).hairs for share in (0.3, 0.7))
    assert (few.removed >= many.removed).all()
    assert few.counts[0] < many.counts[0] < many.counts[1]


@pytest.mark.parametrize(("shares", "mean"), [([[0.2]], 0.2), ([[0.0], [1.0]], 0.5), ([[0.1, 0.9]], 0.5)])
def test_as_many_hairs_are_kept_as_the_map_says(tiles, half, shares, mean):
    kept, hairs = ThinnedField(tiles, shares, [[0.0, 0.0], [300.0, 300.0]], zones=half.zones).hairs.counts
    assert hairs > 10_000
    # Of independent hairs, to four deviations.
    assert abs(kept / hairs - mean) < 4 * 0.5 / np.sqrt(hairs)


def test_hairs_are_where_the_map_wants_them(tiles, half):
    one = ThinnedField(tiles, [[0.0], [0.0], [0.0], [1.0], [1.0], [1.0]], AREA, zones=half.zones, longest=0.5)
    leaf = on_strip(one)
    left = hairs_of(leaf, leaf.plan_mesh(STEP).extract().mesh.vertices)
    full = hairs_of(leaf, on_strip(tiles).plan_mesh(STEP).extract().mesh.vertices)
    for low, high, share in ((0.5, 2.0, 0.0), (6.0, 7.5, 1.0)):
        there, all_there = (np.sum((each[:, 0] > low) & (each[:, 0] < high)) for each in (left, full))
        assert there == share * all_there
        assert all_there > 0


@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_under_lids_are_limits_of_difference_quotients(half, order):
    rng, eps = np.random.default_rng(0), 1e-5
    points = np.column_stack([rng.uniform(*AREA, (4000, 2)), rng.uniform(0.1, 0.45, 4000)])
    rows, lids = half.hairs.lids(points[:, :2], 0)
    # Not at the lid itself, where it bends.
    rows = rows[np.abs(points[rows, 2] - lids[1, 0]) > 1e-3][:300]
    assert len(rows) > 100
    points = points[rows]
    values = half.__call__ if order == 1 else half.gradient
    exact = half.gradient(points) if order == 1 else half.hessian(points)
    for axis in range(3):
        shift = eps * np.eye(3)[axis]
        quotient = (values(points + shift) - values(points - shift)) / (2 * eps)
        assert np.abs(quotient - exact[:, axis]).max() < 1e-4 * np.abs(exact).max()


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda leaf: leaf.extract_levels(0.1, [([[3, -1], [5, 1]], 0.05)]), "levels: .*hairs"),
        (lambda leaf: leaf.plan_mesh(0.1, remesh_tile=0.1), "remesh_tile: .*hairs"),
    ],
)
def test_what_needs_one_tile_is_refused_by_name(leaf, call, match):
    with pytest.raises(InputError, match=match):
        call(leaf)


def test_a_patch_without_hairs_has_none():
    bare = texture(lambda x, y, z: FACE + 0.01 * np.cos(2 * np.pi * y / TILE) - np.abs(z), tile=TILE, n=21)
    field = thinned(bare, HALF)
    assert field.hairs.counts == (0, 0)
    points = np.random.default_rng(0).uniform([0, -3, -0.4], [8, 3, 0.4], (500, 3))
    assert np.array_equal(field(points), bare(points))


def test_a_table_of_other_numbers_is_refused(patch):
    for table in ([[1.5]], [[-0.1]], [0.5], [[np.nan]]):
        with pytest.raises(InputError, match="hair_density"):
            thinned(patch, table)
    with pytest.raises(InputError, match="zones"):
        thinned(WangField(patch.field, seed=2), HALF, zones=thinned(patch, HALF).zones)


def test_tiles_are_simplified_each_by_itself(leaf, solid):
    plan = leaf.plan_mesh(STEP / 2, closed=True, simplify=0.5)
    report = mesh_report(plan.extract().mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)


@pytest.fixture(scope="module", params=[STEP, pytest.param(2.5 * STEP, marks=pytest.mark.slow)], ids=["tiles", "plane"])
def remeshed(request, leaf):
    """A window of tiles that are mixed, or, coarser than hairs are apart, of the plane polygonized at once."""
    plan = leaf.plan_mesh(request.param, [[1.0, -1.5], [4.0, 1.5]], closed=True)
    return plan, plan.extract(remesh=request.param)


def test_a_remeshed_leaf_is_a_solid_whose_faces_lie_on_the_field(leaf, remeshed):
    made = remeshed[1]
    report = mesh_report(made.mesh)
    assert report.watertight
    assert (report.components, report.genus, report.self_intersections) == (1, 0, 0)
    assert report.share_below_10deg < 0.02
    off = off_the_field(leaf, made)
    assert np.quantile(off, 0.99) < ON_SURFACE * STEP
    triangles = np.asarray(made.mesh.triangles)
    faces = np.setdiff1d(triangles[made.labels != RIM], triangles[made.labels == RIM])
    assert np.abs(leaf.signed_distance(np.asarray(made.mesh.vertices)[faces], closed=True)).max() < AT_VERTICES


def test_a_remeshed_leaf_has_the_hairs_that_are_kept(leaf, solid, remeshed):
    made = hairs_of(leaf, remeshed[1].mesh.vertices)
    assert len(made) > 10
    assert cKDTree(hairs_of(leaf, solid.mesh.vertices)).query(made)[0].max() < remeshed[0].spacing[0]


def test_walls_of_voids_are_no_place_to_go_to_with_hairs_or_without():
    leaf, tiles, kept = hollow_leaf()
    plan = leaf.plan_mesh(0.08, closed=True)
    target = LeafTarget(leaf, plan.outline, *plan.wholes)

    def reached(offset, height):
        flat = np.column_stack([tiles + [offset, 0], np.full(len(tiles), height)])
        return target.project(flat, np.zeros_like(flat), np.ones(len(flat), dtype=np.uint8), kept)[2]

    assert not reached(0.8, 0.1).any()
    assert not reached(0.0, 0.4)[kept].any()
    assert reached(0.36, 0.5)[kept].all()
    assert reached(0.0, 0.22)[~kept].all()
    assert reached(0.5, 0.21).all()
