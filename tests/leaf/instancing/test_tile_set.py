"""Tiles of a set: parted and laid again they are what they were, and their borders are sealed wherever they lie."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from o3dleaf import mesh_report
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.leaf.instancing.assembly import Assembly
from o3dleaf.leaf.instancing.components import RIM
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.reduced import reduce_tile
from o3dleaf.leaf.instancing.sets.tile_set import TileSet, split_torus
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.leaf.texture.wang.corners import SIDE, seeded, torus_color
from tile_fields import WIDE, layer, outline, solid_layer
from tile_sets import BORDERS, LATTICE, SHAPE, WHOLE, facets, laid, set_of, torus_of
from tolerances import FADE_TWIN, ON_SURFACE

both_ends = pytest.mark.parametrize(("closed", "cut"), [(False, False), (True, True), (False, True), (True, False)])


@pytest.fixture(scope="module")
def torus():
    return torus_of()


def assemble(tile, *, closed, cut, **given):
    lattice = TileSet.of(tile).lattice
    plane = footprint(outline(reach=WIDE), np.array(lattice.origin[:2]), np.array(lattice.spacing[:2]), None)
    assembly = Assembly(tile, plane, closed=closed, cut=cut, **given)
    arrays = Arrays(assembly)
    assembly.emit(arrays, lambda flat: flat)
    return assembly, arrays


@pytest.mark.few(closed=2)
@both_ends
def test_a_tile_beside_itself_under_two_names_is_the_periodic_surface_to_the_bit(closed, cut):
    tile = extract_tile(layer, LATTICE)
    twins = TileSet((tile, tile), lambda place: (place[0] + 2 * place[1]) % 3 % 2)
    one, other = (assemble(each, closed=closed, cut=cut)[1] for each in (tile, twins))
    assert np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.triangles, other.triangles)
    assert np.array_equal(one.labels, other.labels)


def assert_same(one, other):
    """The same vertices but for rounding, and as many triangles of each label."""
    assert len(one.vertices) == len(other.vertices)
    assert cKDTree(one.vertices).query(other.vertices)[0].max() < FADE_TWIN
    assert np.array_equal(np.bincount(one.labels), np.bincount(other.labels))


@pytest.mark.few(closed=2)
@both_ends
def test_a_torus_that_is_parted_and_laid_as_it_was_is_the_same_surface(torus, closed, cut):
    whole, parted = (assemble(each, closed=closed, cut=cut)[1] for each in (torus, set_of(torus, torus_color)))
    assert_same(whole, parted)
    # What the margin cuts is placed from the corner of its tile.
    assert cut or facets(whole) == facets(parted)


@pytest.mark.few(closed=1)
@pytest.mark.parametrize("method", [0, pytest.param(1, marks=pytest.mark.slow)])
@both_ends
def test_tiles_in_any_order_are_one_surface(torus, closed, cut, method):
    tiles = set_of(torus if method == 0 else torus_of(method), seeded(5))
    assembly, found = assemble(tiles, closed=closed, cut=cut)
    report = mesh_report((found.vertices, found.triangles))
    assert report.manifold
    assert report.self_intersections == 0
    assert report.components == (1 if closed else 2)
    assert report.watertight == closed
    assert len(found.vertices) == assembly.vertices
    inner = np.unique(found.triangles[found.labels != RIM])
    inner = np.setdiff1d(inner, found.triangles[found.labels == RIM])
    places = found.vertices[inner]
    if not cut:
        assert np.abs(laid(seeded(5), places)).max() < ON_SURFACE


@pytest.mark.few(closed=1)
@both_ends
def test_threads_change_nothing(torus, closed, cut):
    before, meshes = get_num_threads(), []
    try:
        for count in (1, 3):
            set_num_threads(count)
            meshes.append(assemble(set_of(torus, seeded(2)), closed=closed, cut=cut)[1])
    finally:
        set_num_threads(before)
    assert np.array_equal(meshes[0].vertices, meshes[1].vertices)
    assert np.array_equal(meshes[0].triangles, meshes[1].triangles)


def test_borders_of_one_kind_are_inside_together_and_crossed_at_the_same_places(torus):
    nx, ny, nz = SHAPE
    parts = split_torus(torus, SHAPE[:2])
    colors = {
        place: [int(torus_color(*(np.array(place) + end))) for end in ((0, 0), (1, 0), (0, 1))] for place in parts
    }
    labels = torus.runs.expand(np.arange(SIDE * nx * SIDE * ny)).reshape(SIDE, nx, SIDE, ny, nz) == INSIDE
    seen = {}
    for place, part in parts.items():
        column, direction = part.edges // (8 * nz), part.edges & 7
        for axis in range(2):
            on = (column // ny if axis == 0 else column % ny) == 0
            on &= direction & (1 << axis) == 0
            inside = labels[place[0], 0, place[1]] if axis == 0 else labels[place[0], :, place[1], 0]
            found = (part.edges[on].tobytes(), part.fractions[on].tobytes(), inside.tobytes())
            pair = (axis, colors[place][0], colors[place][2 if axis == 0 else 1])
            assert seen.setdefault(pair, found) == found
    assert len(seen) == 8


def test_a_pocket_on_a_border_is_filled_in_all_tiles_or_in_none(torus):
    """There are four kinds of borders along, each with a pocket; none is left, whatever lies beside what."""
    assert torus.runs.voids == 4
    tiles = set_of(torus, seeded(9))
    _, found = assemble(tiles, closed=True, cut=True)
    assert mesh_report((found.vertices, found.triangles)).components == 1


def test_whole_tiles_of_a_set_are_reduced_each_by_itself(torus):
    tiles = set_of(torus, seeded(4))
    same = [reduce_tile(tile, lambda *mesh: mesh) for tile in tiles.tiles]
    plain, reduced = (assemble(tiles, closed=True, cut=True, reduced=each)[1] for each in (None, same))
    assert_same(plain, reduced)


def test_what_is_alike_is_the_first_of_its_kind():
    columns = np.arange(np.prod(WHOLE.shape[:2]))
    first = BORDERS.columns(columns)
    assert np.all(first <= columns)
    assert np.array_equal(BORDERS.columns(first), first)
    i, j = columns // WHOLE.shape[1], columns % WHOLE.shape[1]
    inside = (i % SHAPE[0] > 0) & (j % SHAPE[1] > 0)
    assert np.array_equal(first[inside], columns[inside])
    # Two corners, and four edges along and across.
    assert len(np.unique(first[~inside])) == 2 + 4 * (SHAPE[0] - 1) + 4 * (SHAPE[1] - 1)


def test_a_set_of_one_is_the_tile():
    tile = extract_tile(solid_layer, LATTICE)
    assert TileSet.of(tile).tiles == (tile,)
    assert TileSet.of(TileSet.of(tile)).lattice == LATTICE
