"""Tiles of a set: parted and laid again they are what they were, and their borders are sealed wherever they lie."""

from functools import partial

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
from o3dleaf.leaf.instancing.sets.tile_set import MatchingBorders, TileSet, split_torus
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.leaf.texture.corners import KINDS, SIDE, TORUS, kinds_of, seeded, torus_color
from tile_fields import PERIOD, WIDE, layer, outline, solid_layer
from tolerances import FADE_TWIN, ON_SURFACE

SHAPE = (24, 20, 31)
LATTICE = TileLattice((0.0, 0.0, -0.4), (PERIOD / 24, PERIOD / 20, 0.8 / 30), SHAPE)
WHOLE = TileLattice(LATTICE.origin, LATTICE.spacing, (SIDE * 24, SIDE * 20, 31))
BORDERS = MatchingBorders(SHAPE[:2], SHAPE[2], TORUS)

both_ends = pytest.mark.parametrize(("closed", "cut"), [(False, False), (False, True), (True, True)])


def laid(color, points):
    """A layer whose thickness and waves follow from the colors of corners, on borders from those of their ends."""
    share = points[:, :2] / PERIOD
    place = np.floor(share).astype(np.int64)
    u, v = (share - place).T
    tone = np.zeros(len(points))
    for a, b in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = (1 - abs(u - a)) ** 2 * (1 + 2 * abs(u - a)) * (1 - abs(v - b)) ** 2 * (1 + 2 * abs(v - b))
        tone += weight * color(place[:, 0] + a, place[:, 1] + b)
    middle = np.sin(np.pi * u) ** 2 * np.sin(np.pi * v) ** 2
    kind = kinds_of(color, *place.T)
    half = 0.1037 + 0.05 * tone + 0.03 * np.sin(2 * np.pi * u) * tone + 0.04 * middle * np.cos(kind + 5 * u + 3 * v)
    blade = half - np.abs(points[:, 2] - 0.02 * tone)
    # A pocket on each border along, of tiles on both sides of it.
    pocket = 0.06 - np.sqrt((PERIOD * (u - 0.5)) ** 2 + (PERIOD * np.minimum(v, 1 - v)) ** 2 + points[:, 2] ** 2)
    return np.minimum(blade, -pocket)


def torus_of(method=0, *, alike=BORDERS):
    return extract_tile(partial(laid, torus_color), WHOLE, method, sharpen=WHOLE.shape[:2], alike=alike)


def kind_of(color, place):
    return int(kinds_of(color, *(np.array(number) for number in place)))


def set_of(torus, color):
    """The tiles of a torus, laid by the colors of the plane's corners."""
    parts = {kind_of(torus_color, place): part for place, part in split_torus(torus, SHAPE[:2]).items()}
    return TileSet(tuple(parts[kind] for kind in range(KINDS)), partial(kind_of, color))


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


def facets(found, *, rim=True):
    """The triangles by the bits of their corners, each from its first corner in order."""
    chosen = found.triangles if rim else found.triangles[found.labels != RIM]
    corners = found.vertices[chosen].view(np.int64)
    first = np.lexsort(corners.transpose(2, 0, 1), axis=1)[:, 0]
    turned = np.take_along_axis(corners, (first[:, np.newaxis, np.newaxis] + np.arange(3)[:, np.newaxis]) % 3, axis=1)
    return {row.tobytes() for row in turned.reshape(-1, 9)}


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


@both_ends
def test_a_torus_that_is_parted_and_laid_as_it_was_is_the_same_surface(torus, closed, cut):
    whole, parted = (assemble(each, closed=closed, cut=cut)[1] for each in (torus, set_of(torus, torus_color)))
    assert_same(whole, parted)
    # What the margin cuts is placed from the corner of its tile.
    assert cut or facets(whole) == facets(parted)


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
