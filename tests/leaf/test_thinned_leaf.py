"""A leaf whose hairs a map thins out: each is whole or gone, tiles are polygonized twice, and no seam is left."""

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

import o3dleaf as o3l
from hair_fields import AREA, FACE, HALF, RADIUS, STEP, TILE, TIP, hairs_of, hairy, hollow_leaf, on_strip, thinned
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
from tolerances import AT_VERTICES, FADE_TWIN, ON_SURFACE, SHARPENED

OFF_THE_LATTICE = [[0.03, -2.96], [7.96, 2.96]]
"""The strip but its ends, which columns of the lattice lie on: what is inside of them is a matter of rounding."""


def off_the_ends(places):
    """Those places that no end of the strip is near."""
    return places[((places[:, :2] > OFF_THE_LATTICE[0]) & (places[:, :2] < OFF_THE_LATTICE[1])).all(axis=1)]


@pytest.fixture(scope="module")
def patch():
    return texture(hairy, tile=TILE, n=31)


@pytest.fixture(scope="module")
def wang(patch):
    return WangField(patch.field, seed=2)


@pytest.fixture(scope="module", params=["periodic", pytest.param("wang", marks=pytest.mark.slow)])
def tiles(request):
    return request.getfixturevalue("patch" if request.param == "periodic" else "wang")


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


@pytest.mark.slow
def test_wang_tiles_fit_where_hairs_are_removed(wang):
    leaf = on_strip(thinned(wang, HALF))
    made = leaf.plan_mesh(STEP, [[1.0, -2.0], [5.0, 2.0]], closed=True).extract()
    report = mesh_report(made.mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)
    assert 0 < leaf.texture.hairs.counts[0] < leaf.texture.hairs.counts[1]


def test_every_hair_is_whole_or_gone(tiles, leaf, solid):
    meshes = on_strip(tiles).plan_mesh(STEP, closed=True).extract().mesh, solid.mesh
    full, left = (off_the_ends(hairs_of(leaf, mesh.vertices)) for mesh in meshes)
    assert cKDTree(full).query(left)[0].max() < 1e-9
    # What is left of a hair is all of it: beside each of its vertices lie those that were there.
    near = cKDTree(full).query_ball_point(left, 1.5 * STEP)
    kept = cKDTree(left).query(full[np.unique(np.concatenate(near).astype(int))])[0]
    assert kept.max() < 1e-9
    assert 0.2 < len(left) / len(full) < 0.8


@pytest.mark.slow
def test_a_map_of_ones_changes_nothing(tiles, half):
    plain = on_strip(tiles).plan_mesh(STEP, OFF_THE_LATTICE, closed=True).extract().mesh
    ones = on_strip(thinned(tiles, [[1.0]], zones=half.zones))
    same = ones.plan_mesh(STEP, OFF_THE_LATTICE, closed=True).extract().mesh
    # Small tiles are not set down together here, so that vertices come in another order.
    assert len(same.triangles) == len(plain.triangles)
    assert cKDTree(np.asarray(plain.vertices)).query(np.asarray(same.vertices))[0].max() < SHARPENED * STEP


def test_a_map_of_zeros_leaves_no_hair(tiles, half):
    zeros = on_strip(thinned(tiles, [[0.0]], zones=half.zones))
    bare = zeros.plan_mesh(STEP, closed=True).extract().mesh
    assert len(hairs_of(zeros, bare.vertices)) == 0
    heights = zeros.blade.flatten(np.asarray(bare.vertices))[:, 2]
    assert heights.max() < FACE + 0.01 + tiles.data_distance


@pytest.fixture(scope="module")
def both_ways(leaf):
    """Mixed tiles, and the plane polygonized at once."""
    lattice = tile_lattice(leaf.texture.texture, leaf.scale, STEP)
    return extract_tiles(leaf, STEP, 0, together=False), extract_plane(leaf, lattice, 0)


@pytest.mark.parametrize("closed", [False, True])
def test_mixed_tiles_are_what_the_whole_plane_is_polygonized_at_once(leaf, both_ways, closed):
    """As open sheets, and as the solid that an outline cuts, whose rim sees the inside of its columns."""
    (tile, tiles, *_), (whole, alone, *_) = both_ways
    assert tile.lattice.spacing == whole.lattice.spacing
    box = np.array([removed_hair(leaf, [[1.5, -1.8], [3.0, 0.5]]), [6.5, 2.0]])
    (mixed, count), (direct, number) = (placed(each, leaf, box, closed=closed) for each in (tiles, alone))
    assert count == number
    assert cKDTree(direct).query(mixed)[0].max() < SHARPENED * STEP


def test_a_plane_set_down_place_by_place_is_what_it_is_at_once(leaf):
    lattice = tile_lattice(leaf.texture.texture, leaf.scale, 2.5 * STEP)
    (whole, alone, *_), (_, parts, *_) = (extract_plane(leaf, lattice, 0, together=each) for each in (True, False))
    assert len(parts.tiles) > len(alone.tiles) == 1
    for closed in (False, True):
        one, other = (placed(each, leaf, [[1.0, -2.0], [6.5, 2.0]], closed=closed) for each in (alone, parts))
        assert len(one[0]) == len(other[0])
        assert one[1] == other[1]
        assert cKDTree(one[0]).query(other[0])[0].max() < FADE_TWIN * max(whole.lattice.period)


def removed_hair(leaf, box):
    """The place (along, across) in the middle of a hair that is not there."""
    plane = np.stack(np.meshgrid(*(np.arange(*ends, 0.02) for ends in zip(*box, strict=True))), axis=-1).reshape(-1, 2)
    points = np.column_stack([plane, np.full(len(plane), (FACE + TIP) / 2)])
    with_all = np.where(leaf.texture(points) < 0, leaf.texture.texture(points), -1)
    assert with_all.max() > 0
    return plane[np.argmax(with_all)]


def placed(tiles, leaf, box, *, closed):
    """The places of the vertices over a box of the plane, as sheets or as a solid, and the number of triangles."""
    plane = np.array(tiles.lattice.origin[:2]), np.array(tiles.lattice.spacing[:2])
    outline, region = (shapely.box(*np.ravel(box)), None) if closed else (leaf.edge_curve(closed=True), np.array(box))
    assembly = Assembly(tiles, footprint(sides_of(outline), *plane, region), closed=closed)
    arrays = Arrays(assembly)
    assembly.emit(arrays, lambda flat: flat)
    return arrays.vertices, len(arrays.triangles)


@pytest.mark.few(step=1)
@pytest.mark.parametrize("step", [STEP, 2.5 * STEP])
@pytest.mark.parametrize("closed", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_finer_window_has_no_crack_and_the_hairs_of_the_finer_mesh(leaf, solid, step, closed):
    """Its curtain hangs where one was; where the mesh around it is so coarse that a cell may see two hairs, too."""
    region = np.array([removed_hair(leaf, [[1.5, -1.5], [3.0, 0.2]]), [5.1, 0.7]])
    made = leaf.extract_levels(step, [(region, step / 2)], closed=closed)
    report = mesh_report(made.mesh)
    assert (report.manifold, report.oriented, report.genus, report.holes) == (True, True, 0, 0)
    assert (report.components, report.boundary_loops) == ((1, 0) if closed else (2, 2))
    window = hairs_of(leaf, made.mesh.vertices), hairs_of(leaf, solid.mesh.vertices)
    one, other = (each[((each > [*region[0], 0]) & (each < [*region[1], 1])).all(axis=1)] for each in window)
    assert len(one) > 0
    assert cKDTree(window[1]).query(one)[0].max() < step
    assert cKDTree(window[0]).query(other)[0].max() < step


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


@pytest.mark.slow
def test_a_window_is_part_of_the_whole_and_a_file_has_what_is_extracted(leaf, solid, tmp_path):
    whole, window = (leaf.extract_mesh(STEP, region) for region in (None, [[3.0, -1.0], [6.0, 1.0]]))
    places = {row.tobytes() for row in np.asarray(whole.vertices)}
    inside = np.abs(leaf.blade.flatten(np.asarray(window.vertices))[:, :2] - [4.5, 0]) < [1.5 - STEP, 1 - STEP]
    assert all(row.tobytes() in places for row in np.asarray(window.vertices)[inside.all(axis=1)])
    leaf.plan_mesh(STEP, closed=True).write(tmp_path / "leaf.ply")
    assert np.array_equal(np.asarray(read_mesh(tmp_path / "leaf.ply").mesh.triangles), np.asarray(solid.mesh.triangles))


@pytest.mark.slow
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
    # A vertex in a column of the lattice may lie on either side of it by rounding: none is counted between two.
    there, all_there = (each[(each[:, 0] > 6.0) & (each[:, 0] < 7.5)] for each in (left, full))
    assert len(all_there) > 0
    assert cKDTree(left).query(all_there)[0].max() < SHARPENED * STEP
    assert cKDTree(full).query(there)[0].max() < SHARPENED * STEP
    assert np.any((full[:, 0] > 0.5) & (full[:, 0] < 2.0))
    assert not np.any((left[:, 0] > 0.5) & (left[:, 0] < 2.0))


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


def test_tiles_that_are_remeshed_each_by_itself_are_refused(leaf):
    with pytest.raises(InputError, match=r"remesh_tile: .*hairs"):
        leaf.plan_mesh(0.1, remesh_tile=0.1)


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


@pytest.mark.slow
def test_zones_of_other_tiles_are_refused(patch, wang):
    with pytest.raises(InputError, match="zones"):
        thinned(wang, HALF, zones=thinned(patch, HALF).zones)


@pytest.mark.slow
def test_tiles_are_simplified_each_by_itself(leaf, solid):
    plan = leaf.plan_mesh(STEP / 2, closed=True, simplify=0.5)
    report = mesh_report(plan.extract().mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)


@pytest.fixture(scope="module", params=[STEP, pytest.param(2.5 * STEP, marks=pytest.mark.slow)], ids=["tiles", "plane"])
def remeshed(request, leaf):
    """A window of tiles that are mixed, or, coarser than hairs are apart, of the plane polygonized at once."""
    plan = leaf.plan_mesh(request.param, [[1.0, -1.5], [4.0, 1.5]], closed=True)
    return plan, plan.extract(remesh=request.param)


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_remeshed_leaf_has_the_hairs_that_are_kept(leaf, solid, remeshed):
    made = hairs_of(leaf, remeshed[1].mesh.vertices)
    assert len(made) > 10
    assert cKDTree(hairs_of(leaf, solid.mesh.vertices)).query(made)[0].max() < remeshed[0].spacing[0]


@pytest.mark.slow
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
