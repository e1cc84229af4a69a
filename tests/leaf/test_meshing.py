"""A whole leaf meshed: windows of one surface, closed solids, levels, blends; counted before it is made."""

import tracemalloc
from functools import cache
from types import SimpleNamespace

import numpy as np
import open3d as o3d
import pytest
import shapely
from scipy.spatial import cKDTree

from leaf_fields import HALF_WIDTH, MAIN_FRAME, leaf_of
from leaf_fields import texture as texture_of
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.io.labelled_mesh import ABAXIAL, ADAXIAL, RIM
from o3dleaf.io.triangle_mesh import write_mesh
from o3dleaf.leaf.blade.outline_area import sides_of
from o3dleaf.leaf.instancing import block
from o3dleaf.leaf.meshing import write_flat_tile
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.textured_blade import TexturedBlade
from o3dleaf.leaf.tile_lattice import LAYERS, extract_tiles, extract_tiles_ahead, leaf_lattice, tile_lattice
from o3dleaf.surface.mesh.mesh_report import mesh_report
from tolerances import CUT_VERTEX, ON_SURFACE

LENGTH, HALF = 16.0, 0.2037
"""Length of the blade and its mean half thickness; its ridges run across, the tile is 2 by 2 and 1 high."""


def ridged(phase=0.0, half=HALF):
    return lambda x, y, z: half + 0.05 * np.cos(np.pi * x + phase) + 0.03 * np.sin(np.pi * y) - np.abs(z)


@pytest.fixture(scope="module", params=MAIN_FRAME)
def leaf(request):
    """A strip of 16 by 6, bent about a circle of radius 15."""
    return leaf_of(texture_of(ridged()), bend=15.0, length=LENGTH, frame=request.param)[0]


@pytest.fixture(scope="module")
def paper_leaf():
    return leaf_of(texture_of(ridged()), bend=15.0, length=LENGTH, frame="paper")[0]


@pytest.fixture(scope="module")
def normal_leaf(paper_leaf):
    blade = paper_leaf.blade
    return MultiscaleLeaf(paper_leaf.texture, blade.frame, blade.height_map, blade.outline, offset="normal")


@pytest.fixture(scope="module")
def blend_leaf(leaf):
    """Two textures that pass into one another midway."""
    return MultiscaleLeaf(PatchBlend([leaf.texture, texture_of(ridged(1.0, 0.15))], [10.3], 0.5), blade=leaf.blade)


def arrays(mesh):
    mesh = mesh.mesh if hasattr(mesh, "mesh") else mesh
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def rows(points):
    return {row.tobytes() for row in np.ascontiguousarray(points)}


@pytest.fixture(scope="module")
def whole(leaf):
    """Return a function that gives the whole leaf's mesh at a step of 0.1, its report, and where it lies flat."""

    @cache
    def made(closed, method="cubes"):
        mesh = leaf.plan_mesh(0.1, closed=closed, method=method).extract().mesh
        vertices = arrays(mesh)[0]
        return SimpleNamespace(
            vertices=vertices, flat=leaf.blade.flatten(vertices)[:, :2], report=cache(lambda: mesh_report(mesh))
        )

    return made


@pytest.mark.few
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("method", ["cubes", pytest.param("tetrahedra", marks=pytest.mark.slow)])
@pytest.mark.parametrize("region", [[[5.03, -1.07], [8.9, 1.9]], [[7.0, -1.0], [9.0, 1.0]], [[4.5, -0.35], [4.9, 0.1]]])
def test_the_mesh_of_a_window_and_of_the_whole_leaf_coincide(leaf, whole, closed, method, region):
    """In the cells that both have, the vertices are the same bits; the second window is one tile, whole."""
    window = arrays(leaf.plan_mesh(0.1, region, closed=closed, method=method).extract())[0]
    region = np.array(region)
    step = 0.1 * 1.01

    def within(vertices, flat):
        return vertices[((flat > region[0] + step) & (flat < region[1] - step)).all(axis=1)]

    common = rows(within(window, leaf.blade.flatten(window)[:, :2]))
    assert len(common) > (4 if region[1, 0] - region[0, 0] < 1 else 400)
    of_all = whole(closed, method)
    assert common == rows(within(of_all.vertices, of_all.flat))


def test_a_window_has_its_place_and_no_more(leaf):
    region = np.array([[5.03, -1.07], [8.9, 1.9]])
    for closed in (False, True):
        vertices, _ = arrays(leaf.plan_mesh(0.1, region, closed=closed).extract())
        flat = leaf.blade.flatten(vertices)[:, :2]
        slack = 1e-9 if not closed else 0.02
        assert np.all(flat >= region[0] - slack)
        assert np.all(flat <= region[1] + slack)
        assert np.abs(np.array([flat.min(axis=0), flat.max(axis=0)]) - region).max() < 0.1


def test_a_window_beside_the_leaf_is_refused(leaf):
    for closed in (False, True):
        with pytest.raises(ReconstructionError, match="another region"):
            leaf.plan_mesh(0.2, [[40, 0], [44, 2]], closed=closed)


@pytest.mark.parametrize("method", ["cubes", "tetrahedra"])
def test_a_closed_leaf_is_watertight_outward_and_has_the_volume_of_its_blade(leaf, method):
    solid = leaf.plan_mesh(0.15, closed=True, method=method).extract()
    report = mesh_report(solid.mesh)
    assert (report.components, report.boundary_edges, report.genus) == (1, 0, 0)
    assert report.manifold
    assert report.oriented
    # The bent strip's middle surface is 16 by 6; offsets up and down of it cancel.
    assert report.volume == pytest.approx(leaf.blade.outline.rounded.area * 2 * HALF, rel=0.02)
    vertices, triangles = arrays(solid)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces = solid.labels != RIM
    outward = -leaf.gradient(corners[faces].mean(axis=1))
    assert np.all(np.einsum("ij,ij->i", outward, normals[faces]) > 0)


def test_labels_say_which_face_a_triangle_is_of(leaf):
    for closed in (False, True):
        mesh = leaf.plan_mesh(0.15, closed=closed).extract()
        vertices, triangles = arrays(mesh)
        height = leaf.blade.flatten(vertices)[:, 2][triangles].mean(axis=1)
        assert mesh.labels.shape == (len(mesh.mesh.triangles),)
        assert set(np.unique(mesh.labels)) == ({ADAXIAL, ABAXIAL, RIM} if closed else {ADAXIAL, ABAXIAL})
        assert height[mesh.labels == ADAXIAL].min() > 0 > height[mesh.labels == ABAXIAL].max()
        if closed:
            rim = np.unique(triangles[mesh.labels == RIM])
            plane = leaf.blade.flatten(vertices[rim])[:, :2]
            assert (np.minimum(plane[:, 0], LENGTH - plane[:, 0]).clip(0) < 0.4).sum() > 50
            edge = np.minimum(np.minimum(plane[:, 0], LENGTH - plane[:, 0]), 3 - np.abs(plane[:, 1]))
            assert edge.max() < 0.45


def is_of_second_order(leaf):
    """Vertices of a window's faces lie on the surface, and fields in triangles' middles are below their sizes' square.

    So it is where the field's second derivatives are of order one, and at the finest step alone nothing of first order
    is. The ratio of two steps says less: ridges meet each lattice in other places, and it changes by a third.
    """
    for spacing in (0.1, 0.08, 0.04):
        solid = leaf.plan_mesh(spacing, [[9.4, -0.5], [11.2, 0.5]], closed=True).extract()
        vertices, triangles = arrays(solid)
        on_rim = np.zeros(len(vertices), dtype=bool)
        on_rim[triangles[solid.labels == RIM]] = True
        face = triangles[~on_rim[triangles].any(axis=1)]
        inner = vertices[np.unique(face)]
        off = np.abs(leaf(inner)) / np.linalg.norm(leaf.gradient(inner), axis=1)
        assert off.max() < ON_SURFACE * spacing
        error, square = leaf(vertices[face].mean(axis=1)), triangle_areas(vertices, face)
        if np.mean(error**2) > np.mean(square**2):
            return False
    return True


def is_one_leaf(mesh, *, closed):
    report = mesh_report(mesh.mesh)
    assert report.manifold
    assert report.oriented
    assert (report.components, report.genus) == ((1, 0) if closed else (2, 0))
    return report.boundary_loops == (0 if closed else 2)


def test_vertices_lie_on_the_surface_and_triangles_to_second_order(leaf):
    assert is_of_second_order(leaf)


@pytest.mark.slow
def test_so_they_do_where_patches_are_blended(blend_leaf):
    assert is_of_second_order(blend_leaf)


@pytest.mark.slow
def test_so_they_do_along_the_normal_of_the_paper_s_blade(normal_leaf):
    assert is_of_second_order(normal_leaf)


@pytest.mark.few(closed=1)
@pytest.mark.parametrize("closed", [True, False])
def test_blends_are_manifold_too(blend_leaf, closed):
    assert is_one_leaf(blend_leaf.plan_mesh(0.15, closed=closed).extract(), closed=closed)


@pytest.mark.few(closed=1)
@pytest.mark.parametrize("closed", [True, False])
def test_other_offsets_are_manifold_too(normal_leaf, closed):
    assert is_one_leaf(normal_leaf.plan_mesh(0.15, closed=closed).extract(), closed=closed)


@pytest.mark.slow
def test_a_blend_is_each_of_its_patches_away_from_the_break(leaf, whole, blend_leaf):
    """Tiles are not alike there: one row of tiles is made for all of the blade."""
    blend = arrays(blend_leaf.extract_mesh(0.1))[0]
    along = blend_leaf.blade.flatten(blend)[:, 0]
    assert np.abs(leaf(blend[along < 9.7])).max() < 0.1**2
    assert (along < 9.7).sum() == pytest.approx((whole(False).flat[:, 0] < 9.7).sum(), rel=0.02)
    assert np.abs(blend_leaf(blend)).max() < 0.1**2
    assert np.abs(leaf(blend[along > 11])).max() > 0.05


@pytest.mark.few
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("how", [{"simplify": 0.5}, {"simplify": 0.8}, {"remesh_tile": 0.2}])
def test_a_reduced_leaf_keeps_its_shape_with_fewer_triangles(leaf, whole, closed, how):
    reduced = leaf.plan_mesh(0.1, closed=closed, **how)
    made = reduced.extract()
    assert (len(made.mesh.vertices), len(made.mesh.triangles)) == (reduced.vertices, reduced.triangles)
    report, plain = mesh_report(made.mesh), whole(closed).report()
    assert report.manifold
    assert report.oriented
    assert (report.components, report.boundary_loops, report.genus) == (
        plain.components, plain.boundary_loops, plain.genus)  # fmt: skip
    assert report.area == pytest.approx(plain.area, rel=0.01)
    share = report.triangles / plain.triangles
    if "simplify" in how:
        # The tiles at the rim, two of three, stay.
        assert how["simplify"] < share < 1 - 0.25 * (1 - how["simplify"])
        assert len(reduced.assembly.reduced[0].nodes) == pytest.approx(
            how["simplify"] * len(reduced.tile.nodes), rel=0.01
        )
    else:
        assert 0.5 < share < 0.95
        vertices, triangles = arrays(made)
        corners = vertices[triangles[np.abs(vertices[triangles][:, :, 1]).max(axis=1) < 0.8]]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        # Edges of 0.1 along the tile's border stay.
        assert 0.12 < np.median(edges) < 0.18


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"simplify": 0.5, "remesh_tile": 0.2}, "give one"),
        ({"simplify": 1.0}, "between 0 and 1"),
        ({"simplify": 0.0}, "between 0 and 1"),
        ({"method": "squares"}, "cubes, tetrahedra"),
        ({"region": [[1, 1], [0, 0]]}, "region"),
    ],
)
def test_what_cannot_be_meant_is_refused(leaf, how, words):
    with pytest.raises(InputError, match=words):
        leaf.plan_mesh(0.2, **how)


@pytest.mark.few
@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
@pytest.mark.parametrize("closed", [False, True])
def test_what_was_counted_is_what_is_made(leaf, tmp_path, suffix, closed):
    plan = leaf.plan_mesh(0.25, closed=closed)
    path, calls = tmp_path / f"leaf{suffix}", []
    said = plan.bytes(path)
    assert not list(tmp_path.iterdir())
    with progress.listening(lambda done, total: calls.append((done, total))):
        plan.write(path)
        assert calls[-1][0] == calls[-1][1]
    made = plan.extract()
    assert (len(made.mesh.vertices), len(made.mesh.triangles)) == (plan.vertices, plan.triangles)
    assert len(calls) > 1
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)
    size = path.stat().st_size
    assert 0.6 * said < size <= said if suffix == ".obj" else size == said
    write_mesh(made, tmp_path / f"again{suffix}", plan._comments)
    assert (tmp_path / f"again{suffix}").read_bytes() == path.read_bytes()
    assert plan.seconds > 0
    assert (plan.voids, plan.islands, plan.fragments.pieces) == (0, 0, 0)
    assert len(o3d.io.read_triangle_mesh(path).triangles) == len(made.mesh.triangles)


@pytest.mark.parametrize("spacing", [0.0501, 0.13, 0.7, 5.0])
def test_the_lattice_divides_the_period_and_holds_the_patch(leaf, spacing):
    lattice = tile_lattice(leaf.texture, 1.0, spacing)
    assert np.allclose(lattice.period, leaf.texture.period, rtol=1e-14)
    expected = leaf.texture.period / np.maximum(np.round(leaf.texture.period / spacing), 1)
    assert np.allclose(lattice.spacing[:2], expected)
    layer = lattice.spacing[2]
    assert layer <= spacing * (1 + 1e-12)
    assert spacing / layer == pytest.approx(round(spacing / layer))
    low, high = leaf.texture.cell[:, 2]
    assert (high - low) / layer >= LAYERS - 1e-9
    first, last = lattice.positions([[0, 0, 1], [0, 0, lattice.shape[2] - 2]])[:, 2]
    assert first <= low + 1e-9
    assert last >= high - 1e-9
    assert first > low - 1.001 * layer
    assert last < high + 1.001 * layer


def test_one_flat_period_is_a_closed_block(leaf):
    tile = leaf.extract_tile(0.1)
    report = mesh_report(tile.mesh)
    assert report.watertight
    assert report.genus == 0
    assert report.volume == pytest.approx(2 * HALF * 4.0, rel=0.01)
    vertices, triangles = arrays(tile)
    assert np.allclose(np.ptp(vertices[:, :2], axis=0), leaf.texture.period, rtol=1e-12)
    assert np.abs(leaf.texture(vertices[np.unique(triangles[tile.labels != RIM])])).max() < 0.1**2
    assert set(np.unique(tile.labels)) == {ADAXIAL, ABAXIAL, RIM}


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_a_flat_period_is_streamed_to_the_bytes_that_it_is_written_with(leaf, tmp_path, suffix, monkeypatch):
    """In blocks so small that there are many, on all threads."""
    monkeypatch.setattr(block, "BATCH_SIZE", 100)
    whole, streamed = tmp_path / f"whole{suffix}", tmp_path / f"streamed{suffix}"
    write_mesh(leaf.extract_tile(0.1), whole)
    write_flat_tile(leaf.texture, leaf.scale, 0.1, streamed, leaf.unit)
    assert streamed.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("closed", [False, True])
def test_levels_are_one_mesh_fine_in_their_windows(leaf, closed):
    windows = [([[6.2, -0.7], [9.1, 0.7]], 0.1), ([[7.1, -0.35], [8.2, 0.3]], 0.05)]
    found = leaf.extract_levels(0.25, windows, closed=closed)
    report = mesh_report(found.mesh)
    assert report.manifold
    assert report.oriented
    assert (report.components, report.genus, report.holes) == ((1, 0, 0) if closed else (2, 0, 0))
    assert report.boundary_loops == (0 if closed else 2)
    vertices, triangles = arrays(found)
    flat = leaf.blade.flatten(vertices)
    corners = flat[triangles]
    middle = corners.mean(axis=1)
    size = np.linalg.norm(corners[:, 1, :2] - corners[:, 0, :2], axis=1)
    for (box, spacing), inner in zip(windows, (np.array(windows[1][0]), None), strict=True):
        region = np.array(box)
        within = ((middle[:, :2] > region[0]) & (middle[:, :2] < region[1])).all(axis=1)
        if inner is not None:
            within &= ((middle[:, :2] < inner[0] - 0.3) | (middle[:, :2] > inner[1] + 0.3)).any(axis=1)
        within &= found.labels != RIM
        assert 0.9 * spacing < np.median(size[within]) <= 1.6 * spacing
    assert np.all((middle[:, 2] > 0)[found.labels != RIM] == (found.labels == ADAXIAL)[found.labels != RIM])
    coarse, _ = arrays(leaf.plan_mesh(0.25, closed=closed).extract())
    plane = leaf.blade.flatten(coarse)[:, :2]
    # No column of the lattice lies there, on either side of which rounding would put its vertices.
    found, expected = vertices[flat[:, 0] > 10.1], coarse[plane[:, 0] > 10.1]
    if not leaf.cuts_edges:
        assert rows(expected) == rows(found)
        return
    # Where cells are cut along the outline, vertices are those of the whole leaf but for rounding.
    assert found.shape == expected.shape
    assert cKDTree(found).query(expected)[0].max() <= CUT_VERTEX
    inner = [vertices[inner_cells(flat[:, :2])], coarse[inner_cells(plane)]]
    assert rows(inner[0]) == rows(inner[1])
    assert len(inner[0]) > 1000


def inner_cells(plane):
    """Vertices of the strip beyond its middle, and farther than a coarse cell from its outline."""
    return (plane[:, 0] > 10.1) & (plane[:, 0] < LENGTH - 0.3) & (np.abs(plane[:, 1]) < HALF_WIDTH - 0.3)


def test_a_window_of_one_coarse_cell_has_room_for_a_finer_one(leaf):
    report = mesh_report(leaf.extract_levels(0.25, [([[7.1, 0.1], [7.12, 0.12]], 0.125)]).mesh)
    assert report.manifold
    assert (report.components, report.boundary_loops, report.holes) == (2, 2, 0)


def test_a_window_that_ends_with_a_tile_is_whole(leaf):
    report = mesh_report(leaf.extract_levels(0.25, [([[7.0, -1.0], [9.0, 1.0]], 0.125)]).mesh)
    assert report.manifold
    assert (report.components, report.boundary_loops, report.holes) == (2, 2, 0)


def test_windows_that_cross_or_reach_the_rim_are_refused(leaf):
    one = ([[6.0, -1.0], [8.0, 1.0]], 0.125)
    with pytest.raises(InputError, match="two windows cross"):
        leaf.extract_levels(0.25, [one, ([[7.5, 0.0], [9.0, 1.5]], 0.125)])
    with pytest.raises(InputError, match="reaches the rim"):
        leaf.extract_levels(0.25, [([[6.0, 1.0], [8.0, 3.5]], 0.125)])
    with pytest.raises(InputError, match="two windows cross"):
        leaf.extract_levels(0.25, [one, ([[6.0, -0.5], [7.0, 0.5]], 0.0625)])


def peak(work):
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "frame"), [(".ply", "surface"), (".ply", "paper"), (".stl", "surface")])
def test_the_memory_of_writing_does_not_grow_with_the_leaf(tmp_path, suffix, frame):
    """Twice as long, the same memory: counting and writing hold three rows of tiles."""
    threads, needed, made = get_num_threads(), [], []
    field = texture_of(ridged())
    set_num_threads(2)
    try:
        for length in (20.0, 40.0):
            leaf, _ = leaf_of(field, length=length, frame=frame)

            def work(leaf=leaf):
                plan = leaf.plan_mesh(0.06, closed=True)
                made.append(plan.triangles)
                plan.write(tmp_path / f"leaf{suffix}")

            leaf.plan_mesh(0.5, closed=True).write(tmp_path / f"leaf{suffix}")  # compiled, outline made
            needed.append(peak(work))
    finally:
        set_num_threads(threads)
    assert made[1] > 1.9 * made[0]
    size = (tmp_path / f"leaf{suffix}").stat().st_size
    assert needed[1] < 1.05 * needed[0]
    assert needed[1] - needed[0] < 0.02 * size


def test_the_row_of_tiles_under_a_blend_reaches_over_all_of_the_blade(blend_leaf):
    """Also where the blade begins before the midrib does."""
    for bounds in ([[-7.3, -3.0], [5.0, 3.0]], [[0.0, -3.0], [20.0, 3.0]], [[4.1, -3.0], [12.0, 3.0]]):
        blade = SimpleNamespace(unit=blend_leaf.unit, outline=SimpleNamespace(bounds=np.array(bounds)))
        leaf = TexturedBlade(blend_leaf.texture, blade)
        lattice = leaf_lattice(leaf, 0.1)
        period = blend_leaf.texture.period[0]
        start, stop = lattice.origin[0], lattice.origin[0] + lattice.period[0]
        if not leaf.is_one_tile:
            assert bounds[0][0] - period <= start <= bounds[0][0]
            assert bounds[1][0] <= stop <= bounds[1][0] + 2 * period
        assert (start - blend_leaf.texture.cell[0, 0]) / period == pytest.approx(round(start / period))


def test_the_sides_of_an_area_are_those_of_all_its_rings():
    ring = shapely.box(0, 0, 4, 4) - shapely.box(1, 1, 2, 3)
    assert len(sides_of(ring)) == 8
    assert len(sides_of(shapely.union(ring, shapely.box(6, 6, 7, 7)))) == 12
    assert len(sides_of(shapely.GeometryCollection([ring, shapely.LineString([(5, 5), (6, 6)])]))) == 8
    steps = sides_of(ring)[:, 2:] - sides_of(ring)[:, :2]
    assert np.abs(steps.sum(axis=0)).max() == 0


def test_two_windows_with_one_cell_between_are_both_set_in(leaf):
    windows = [([[6.0, -0.5], [7.0, 0.5]], 0.125), ([[7.25, -0.25], [8.0, 0.25]], 0.0625)]
    report = mesh_report(leaf.extract_levels(0.25, windows).mesh)
    assert report.manifold
    assert report.oriented
    assert (report.components, report.boundary_loops, report.holes, report.genus) == (2, 2, 0, 0)
    with pytest.raises(InputError, match="make it smaller or move it"):
        leaf.extract_levels(0.25, [windows[0], ([[7.0, -0.25], [8.0, 0.25]], 0.125)])


def test_a_window_in_a_tile_that_the_rim_of_a_solid_cuts_is_refused(paper_leaf):
    """The rounded corners of the α-shape cut the tiles at the margin; a rectangle of whole tiles cuts none."""
    with pytest.raises(InputError, match="the rim cuts"):
        paper_leaf.extract_levels(0.25, [([[6.2, -1.6], [9.1, -1.1]], 0.125)], closed=True)


def test_a_window_that_is_no_finer_than_what_is_around_it_is_refused(leaf):
    with pytest.raises(InputError, match="no finer"):
        leaf.extract_levels(0.1, [([[8, -1], [10, 1]], 0.09)])


@pytest.mark.few
@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("method", [0, 1])
def test_tiles_made_before_the_blade_are_those_that_are_made_after(together, method):
    """Same bits, each taken once; what is refused is left to whoever asks for it on the blade."""
    leaf = leaf_of(texture_of(ridged()), bend=15.0, length=LENGTH)[0]
    wanted = (0.1, method, together)
    ahead = extract_tiles_ahead(leaf.texture, leaf.unit, [wanted, (1e-9, method, together)])
    assert list(ahead) == [wanted]
    later = extract_tiles(leaf, 0.1, method, together=together)
    leaf.tiles.update(ahead)
    assert extract_tiles(leaf, 0.1, method, together=together) is ahead[wanted]
    assert not leaf.tiles
    assert later.copies == ahead[wanted].copies
    for name in ("edges", "fractions", "sides", "upward", "nodes", "cells", "beyond", "beyond_fractions"):
        assert getattr(later.whole, name).tobytes() == getattr(ahead[wanted].whole, name).tobytes()


def test_patches_along_the_blade_have_no_tiles_before_it(blend_leaf):
    assert not extract_tiles_ahead(blend_leaf.texture, blend_leaf.unit, [(0.1, 0, True)])
