"""A tile set down everywhere is the surface of the whole tiled lattice: the same triangles, the same bits."""

import tracemalloc

import numpy as np
import pytest
from scipy import ndimage

from o3dleaf import get_num_threads, mesh_report, remesh, set_num_threads, simplify_mesh
from o3dleaf.core import parallel
from o3dleaf.core.errors import MemoryBudgetError, ReconstructionError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.resources import scratch
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.leaf.instancing import block, runs
from o3dleaf.leaf.instancing.assembly import Assembly
from o3dleaf.leaf.instancing.block import FlatBlock
from o3dleaf.leaf.instancing.components import LOWER, RIM, UPPER
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.reduced import reduce_tile
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.surface.isosurface.cell_loops import MIN_FRACTION
from o3dleaf.surface.isosurface.polygonize import METHODS, lattice_positions, march
from tile_fields import LATTICE, PERIOD, area, assemble, ball, layer, made_block, outline, solid_layer
from tolerances import HELD_BY_TILE, SHARPENED

both = pytest.mark.parametrize("method", range(len(METHODS)), ids=METHODS)


class Unkept:
    """A sink that keeps nothing."""

    def put_vertices(self, start, vertices):
        pass

    def put_triangles(self, start, triangles, labels):
        pass


def as_set(vertices, triangles):
    """Triangles as sorted rows of nine coordinates, each begun at its first corner: equal sets are equal arrays."""
    corners = vertices[triangles]
    first = np.lexsort(np.moveaxis(corners, 2, 0)[::-1], axis=1)[:, 0]
    turn = (first[:, np.newaxis] + np.arange(3)) % 3
    rows = np.take_along_axis(corners, turn[..., np.newaxis], axis=1).reshape(-1, 9)
    return rows[np.lexsort(rows.T[::-1])]


@both
@pytest.mark.parametrize("field", [layer, solid_layer])
def test_the_instances_are_the_brute_force_extraction_of_the_whole_tiled_lattice(method, field):
    """In lattice indices the same triangles, in position the same bits."""
    tile = extract_tile(field, LATTICE, method)
    region = np.array([[0.2, -1.0], [3.2, 0.9]])
    _, found = assemble(tile, outline(), region)
    nx, ny, nz = LATTICE.shape
    low = np.ceil((region[0] - LATTICE.origin[:2]) / LATTICE.spacing[:2] - 1e-9).astype(int)
    high = np.floor((region[1] - LATTICE.origin[:2]) / LATTICE.spacing[:2] + 1e-9).astype(int)
    i, j = (np.arange(a, b + 1) for a, b in zip(low, high, strict=True))
    columns = np.stack(np.meshgrid(i % nx, j % ny, np.arange(nz), indexing="ij"), axis=-1)
    values = field(LATTICE.positions(columns.reshape(-1, 3))).reshape(columns.shape[:3])
    inside = tile.runs.expand((columns[..., 0, 0] * ny + columns[..., 0, 1]).ravel()).reshape(values.shape) == INSIDE
    if field is solid_layer:
        assert np.array_equal(inside, values > 0)
    brute = march(np.where(inside, np.abs(values), -np.abs(values)), inside, method)
    positions = LATTICE.positions(brute.positions((int(low[0]), int(low[1]), 0)))
    assert np.array_equal(as_set(found.vertices, found.triangles), as_set(positions, brute.triangles))


def test_voids_are_filled_and_islands_removed_across_the_sides_of_the_period_too():
    tile = extract_tile(layer, LATTICE)
    assert (tile.runs.voids, tile.runs.islands) == (2, 1)
    plain = extract_tile(solid_layer, LATTICE)
    assert np.array_equal(tile.edges, plain.edges)
    assert np.array_equal(tile.nodes, plain.nodes)


def test_the_largest_piece_is_the_blade_by_its_samples_not_by_its_place_or_its_runs():
    """Specks below the blade come first in every column; a cloud of them has more runs than the blade."""

    def specked(points):
        waves = np.cos(8 * np.pi / PERIOD * (points[:, :2] - LATTICE.origin[:2]))
        below = waves.prod(axis=1)
        return np.maximum(solid_layer(points), np.where(np.abs(points[:, 2] + 0.3) < 0.02, below, -1.0))

    tile = extract_tile(specked, LATTICE)
    assert tile.runs.islands > 10
    assert np.array_equal(tile.edges, extract_tile(solid_layer, LATTICE).edges)


def test_what_is_inside_is_what_the_labelling_of_a_whole_period_says():
    """The twin: scipy's labels of 3 × 3 periods, of which the middle one is looked at."""
    rng = np.random.default_rng(3)
    noise = ndimage.gaussian_filter(rng.normal(size=(24, 20, 31)), 1.0, mode="wrap")
    height = np.linspace(-1, 1, 31)

    def field(points):
        at = np.round((points - LATTICE.origin) / LATTICE.spacing).astype(int)
        return 0.4 - np.abs(height[at[:, 2]]) + 1.6 * noise[at[:, 0] % 24, at[:, 1] % 20, at[:, 2]]

    tile = extract_tile(field, LATTICE)
    points = LATTICE.positions(np.stack(np.meshgrid(*map(np.arange, LATTICE.shape), indexing="ij"), -1).reshape(-1, 3))
    solid = np.tile((field(points) > 0).reshape(LATTICE.shape), (3, 3, 1))
    solid[..., [0, -1]] = False
    pieces, _ = ndimage.label(solid)
    main = pieces == np.argmax(np.bincount(pieces[pieces > 0]))
    air, _ = ndimage.label(~main)
    expected = ~np.isin(air, np.unique(air[..., [0, -1]]))[24:48, 20:40]
    found = tile.runs.expand(np.arange(24 * 20)).reshape(LATTICE.shape) == INSIDE
    assert min(tile.runs.voids, tile.runs.islands) > 3
    assert np.array_equal(found, expected)


@pytest.mark.parametrize("columns", [5 * 20, 20, 7, 1])
def test_a_tile_made_in_slabs_is_the_tile_made_at_once(columns):
    """Of some planes, of one, or of rows of one."""
    whole = extract_tile(layer, LATTICE, 1)
    slabs = extract_tile(layer, LATTICE, 1, slab_size=columns * 31)
    for name in ("edges", "fractions", "sides", "upward", "nodes", "cells", "beyond"):
        assert np.array_equal(getattr(whole, name), getattr(slabs, name)), name


@pytest.mark.slow
def test_what_a_tile_holds_at_once_does_not_grow_with_its_surface(monkeypatch):
    """Of arrays in memory, by NumPy's word; those of all columns, vertices and walls lie in files."""
    monkeypatch.setattr(scratch, "is_held", lambda *_: False)
    for module, name in ((scratch, "ROWS"), (runs, "ROWS"), (block, "ROWS"), (block, "BATCH_SIZE")):
        monkeypatch.setattr(module, name, 1 << 8)
    # Blocks that run side by side are held side by side.
    monkeypatch.setattr(parallel._pool, "threads", 1)
    held = []
    for finer in (2, 2, 6):
        steps, shape = np.array(LATTICE.spacing) / (finer, finer, 1), (24 * finer, 20 * finer, 31)
        lattice, peaks = TileLattice(LATTICE.origin, tuple(steps.tolist()), shape), []
        tracemalloc.start()
        tile = extract_tile(solid_layer, lattice, slab_size=40 * 31)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.reset_peak()
        FlatBlock(tile).emit(Unkept())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        held.append(np.array(peaks))
    assert np.all(held[2] < HELD_BY_TILE * held[1])


@both
def test_open_sheets_are_two_manifold_discs_that_look_apart(method):
    assembly, found = assemble(extract_tile(layer, LATTICE, method), outline())
    report = mesh_report((found.vertices, found.triangles))
    assert (report.components, report.boundary_loops, report.holes, report.genus) == (2, 2, 0, 0)
    assert report.manifold
    assert report.oriented
    assert len(np.unique(found.triangles)) == assembly.vertices
    assert set(np.unique(found.labels)) == {UPPER, LOWER}
    height = found.vertices[found.triangles].mean(axis=1)[:, 2]
    assert height[found.labels == UPPER].min() > height[found.labels == LOWER].max()


@both
def test_a_closed_solid_is_watertight_and_has_the_volume_of_its_layer(method):
    sides = outline()
    _, found = assemble(extract_tile(layer, LATTICE, method), sides, closed=True)
    report = mesh_report((found.vertices, found.triangles))
    assert (report.components, report.boundary_edges, report.genus) == (1, 0, 0)
    assert report.manifold
    assert report.oriented
    assert report.volume == pytest.approx(2 * 0.1037 * area(sides), rel=0.01)
    assert set(np.unique(found.labels)) == {UPPER, LOWER, RIM}
    if method == 0:
        # MeshLab takes triangles that touch in one plane for crossing; tetrahedra draw many in an upright wall.
        assert report.self_intersections == 0


def test_the_rim_stands_on_the_outline():
    sides = outline()
    _, found = assemble(extract_tile(solid_layer, LATTICE), sides, closed=True)
    rim = np.unique(found.triangles[found.labels == RIM])
    faces = np.unique(found.triangles[found.labels != RIM])
    own = np.setdiff1d(rim, faces)
    low, high = sides[:, :2], sides[:, 2:]
    along = high - low
    share = np.einsum("ijk,jk->ij", found.vertices[own, None, :2] - low, along) / np.sum(along**2, axis=1)
    gap = found.vertices[own, None, :2] - low - np.clip(share, 0, 1)[..., None] * along
    distance = np.linalg.norm(gap, axis=2).min(axis=1)
    assert distance.max() < 0.1 * LATTICE.spacing[1]


@pytest.mark.parametrize("closed", [False, True])
def test_the_mesh_does_not_depend_on_the_number_of_threads(closed):
    before, meshes = get_num_threads(), []
    try:
        for threads in (1, 3):
            set_num_threads(threads)
            meshes.append(assemble(extract_tile(layer, LATTICE), outline(), closed=closed)[1])
    finally:
        set_num_threads(before)
    for name in ("vertices", "triangles", "labels"):
        assert np.array_equal(getattr(meshes[0], name), getattr(meshes[1], name))


def test_a_hair_that_the_outline_cuts_from_its_root_is_left_out():
    """A hair leans over the edge: its root is outside, its tip inside, in the air above the blade."""

    def hairy(points):
        x, y, z = points.T
        x = (x - 0.1) % PERIOD
        hair = 0.05 - np.hypot((y - 0.45 + 0.6) % PERIOD - 0.6, z - 0.05 - 0.6 * (x - 0.3))
        hair = np.where((x > 0.2) & (x < 0.75), hair, -0.1)
        return np.maximum(0.08 - np.abs(z + 0.1), hair)

    tile = extract_tile(hairy, LATTICE)
    box = np.array([[0.62, -3.0], [0.62, 3.0], [6.0, 3.0], [6.0, -3.0]])
    sides = np.hstack([box, np.roll(box, -1, axis=0)])
    for closed in (False, True):
        assembly, found = assemble(tile, sides, closed=closed)
        report = mesh_report((found.vertices, found.triangles))
        assert assembly.fragments.pieces > 0
        assert report.components == (1 if closed else 2)
        assert report.manifold


def test_a_tile_whose_parts_lie_on_disk_is_the_one_in_memory(monkeypatch):
    """Bit for bit, sharpened or not; what grows with the surface is mapped."""
    tiles = []
    for held in (True, False):
        monkeypatch.setattr(scratch, "is_held", lambda *_, held=held: held)
        tiles.append(extract_tile(layer, LATTICE, sharpen=LATTICE.shape[:2], slab_size=2000))
    for name in ("edges", "fractions", "sides", "upward", "nodes", "cells", "beyond"):
        np.testing.assert_array_equal(*(getattr(tile, name) for tile in tiles))
    for name in ("edges", "fractions", "sides", "upward", "nodes"):
        bases = [getattr(tile, name).base for tile in tiles]
        assert [isinstance(base, np.memmap) for base in bases] == [False, True]


def test_a_flat_period_is_a_closed_block_whose_opposite_walls_match():
    tile = extract_tile(layer, LATTICE)
    vertices, triangles, labels = made_block(tile)
    report = mesh_report((vertices, triangles))
    assert report.watertight
    assert (report.components, report.genus) == (1, 0)
    assert report.volume == pytest.approx(2 * 0.1037 * PERIOD**2, rel=0.01)
    origin = np.array(LATTICE.origin)
    for axis in range(2):
        walls = []
        for end in (origin[axis], LATTICE.positions([[24, 20, 0]])[0, axis]):
            on = np.isclose(vertices[:, axis], end, atol=1e-12)
            wall = triangles[(labels == RIM) & on[triangles].all(axis=1)]
            walls.append(np.delete(vertices[wall], axis, axis=2))
        near, far = walls
        assert len(near) == len(far) > 100
        assert np.array_equal(near[:, ::-1], far)


def test_a_blade_with_a_hole_through_it_and_a_flooded_one_are_refused():
    with pytest.raises(ReconstructionError, match="one sheet"):
        extract_tile(lambda at: np.minimum(solid_layer(at), -ball(at * [1, 1, 0], [0.5, 0.6, 0], 0.2)), LATTICE)
    for flooded in (lambda at: np.ones(len(at)), lambda at: 0.1 - at[:, 2], lambda at: 0.1 + at[:, 2]):
        with pytest.raises(ReconstructionError, match="no air"):
            extract_tile(flooded, LATTICE)
    with pytest.raises(ReconstructionError, match="no solid"):
        extract_tile(lambda at: -np.ones(len(at)), LATTICE)


def test_an_outline_of_two_parts_and_one_without_a_cell_are_refused():
    tile = extract_tile(solid_layer, LATTICE)
    sides = outline()
    far = sides + [20, 0, 20, 0]
    with pytest.raises(ReconstructionError, match="4 sheets"):
        assemble(tile, np.concatenate([sides, far]))
    with pytest.raises(ReconstructionError, match="2 pieces"):
        assemble(tile, np.concatenate([sides, far]), closed=True)
    with pytest.raises(ReconstructionError, match="no cell"):
        assemble(tile, 0.001 * sides)


@pytest.mark.few
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("kind", ["simplified", "remeshed"])
def test_a_reduced_tile_fits_its_copies_and_the_tiles_that_are_cut(kind, closed):
    tile = extract_tile(layer, LATTICE)

    def reduce(vertices, triangles):
        if kind == "simplified":
            return mesh_arrays(simplify_mesh((vertices, triangles), target_triangles=len(triangles) // 3))
        return mesh_arrays(remesh((vertices, triangles), 0.07))

    sides = outline()
    plane = footprint(sides, np.array(LATTICE.origin[:2]), np.array(LATTICE.spacing[:2]), None)
    assembly = Assembly(tile, plane, closed=closed, reduced=reduce_tile(tile, reduce))
    found = Arrays(assembly)
    assembly.emit(found, lambda flat: flat)
    report, full = (mesh_report((m.vertices, m.triangles)) for m in (found, assemble(tile, sides, closed=closed)[1]))
    assert report.manifold
    assert report.oriented
    assert (report.components, report.boundary_edges) == (full.components, full.boundary_edges)
    assert report.triangles < 0.9 * full.triangles
    assert report.area == pytest.approx(full.area, rel=0.01)
    height = found.vertices[found.triangles].mean(axis=1)[:, 2]
    assert height[found.labels == UPPER].min() > height[found.labels == LOWER].max()


def test_a_reduced_tile_whose_border_moved_is_refused():
    with pytest.raises(ReconstructionError, match="border"):
        reduce_tile(extract_tile(layer, LATTICE), lambda vertices, triangles: (vertices + 1e-12, triangles))


def test_more_vertices_than_a_file_can_number_are_refused():
    with pytest.raises(MemoryBudgetError, match="more than a mesh can number"):
        assemble(extract_tile(layer, LATTICE), outline(), max_vertices=10_000)


def on_edges(tile):
    """Return the ends of the edges that vertices lie on, and the vertices themselves."""
    shape = tile.lattice.shape
    return [tile.lattice.positions(lattice_positions(tile.edges, share, shape)) for share in _shares(tile)]


def _shares(tile):
    return np.zeros(len(tile.edges)), np.ones(len(tile.edges)), tile.fractions


@both
def test_sharpened_vertices_lie_where_the_field_is_zero_on_the_same_edges(method):
    plain, sharp = (
        extract_tile(solid_layer, LATTICE, method, sharpen=sharpen) for sharpen in (None, LATTICE.shape[:2])
    )
    for name in ("edges", "sides", "upward", "nodes", "cells", "beyond"):
        assert np.array_equal(getattr(plain, name), getattr(sharp, name))
    low, high, at = on_edges(sharp)
    inner = (sharp.fractions > MIN_FRACTION) & (sharp.fractions < 1 - MIN_FRACTION)
    assert inner.mean() > 0.95
    slope = np.abs(solid_layer(high) - solid_layer(low))
    far = [np.abs(solid_layer(x)) / slope for x in (on_edges(plain)[2], at)]
    assert np.abs(far[1][inner]).max() < SHARPENED < 0.02 * far[0].max()


@both
def test_sharpened_vertices_beside_a_filled_void_stay_as_they_were(method):
    """Along an axis a void has no outer air beside it; along a diagonal of tetrahedra it may."""
    wave = 2 * np.pi / PERIOD

    def rough(points):
        x, y, z = points.T
        return solid_layer(points) + 0.09 * np.sin(11 * wave * x + 1) * np.sin(9 * wave * y + 2) * np.sin(50 * z + 0.3)

    for field in (layer, rough):
        plain, sharp = (extract_tile(field, LATTICE, method, sharpen=each) for each in (None, LATTICE.shape[:2]))
        low, high, _ = on_edges(sharp)
        ends = np.where(sharp.upward[:, np.newaxis], low, high), np.where(sharp.upward[:, np.newaxis], high, low)
        agrees = (field(ends[0]) > 0) & (field(ends[1]) <= 0)
        assert np.array_equal(sharp.fractions[~agrees], plain.fractions[~agrees])
        off = [np.mean(np.abs(field(on_edges(tile)[2][agrees]))) for tile in (sharp, plain)]
        assert off[0] < 0.1 * off[1]
        assert ((~agrees).sum() > 100) == (field is rough and method == 1)


def test_a_field_that_is_steep_at_one_end_is_sharpened_too():
    """Plain regula falsi would keep one end and creep."""

    def steep(points):
        return np.expm1(60 * solid_layer(points))

    sharp = extract_tile(steep, LATTICE, sharpen=LATTICE.shape[:2])
    exact = extract_tile(solid_layer, LATTICE, sharpen=LATTICE.shape[:2])
    assert np.array_equal(sharp.edges, exact.edges)
    assert np.abs(sharp.fractions - exact.fractions).max() < SHARPENED


def test_copies_of_a_vertex_are_sharpened_to_the_same_bits():
    nx, ny, nz = LATTICE.shape
    twice = TileLattice(LATTICE.origin, LATTICE.spacing, (2 * nx, 2 * ny, nz))
    large, small = (extract_tile(solid_layer, each, sharpen=(nx, ny)) for each in (twice, LATTICE))
    found = {edge: set() for edge in small.edges.tolist()}
    for edge, fraction in zip(large.edges.tolist(), large.fractions.tolist(), strict=True):
        column, rest = divmod(edge, 8 * nz)
        i, j = divmod(column, 2 * ny)
        found[(i % nx * ny + j % ny) * 8 * nz + rest].add(fraction)
    assert [len(each) for each in found.values()] == [1] * len(small.edges)
    assert [each.pop() for each in found.values()] == small.fractions.tolist()
