"""Finer windows in a surface of many tiles: one mesh, each level the surface of its own spacing, to the bit."""

from functools import cache

import numpy as np
import pytest

from o3dleaf import mesh_report
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.leaf.instancing.assembly import Assembly
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.levels import Level, extract_levels
from o3dleaf.leaf.instancing.sets.tile_set import TileSet
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.leaf.texture.wang.corners import seeded, torus_color
from tile_fields import layer, outline
from tile_sets import LATTICE, SHAPE, facets, finer_torus, laid, set_of, torus_of
from tolerances import FADE_TWIN

REACH = 3.6, 3.1
"""Of the outline: a solid that is marched leaves the tiles around a window whole."""
WINDOWS = [[[17, -11], [55, 14]], [[30, -5], [62, 17]]]
"""Columns of the coarse lattice: both reach over tiles along and across, and over one another."""

ends = pytest.mark.parametrize(("closed", "cut"), [(False, False), (True, True), (False, True), (True, False)])


@cache
def torus(ratio):
    return torus_of() if ratio == 1 else finer_torus(ratio)


@cache
def tiles_of(ratio, seed):
    return set_of(torus(ratio), torus_color if seed is None else seeded(seed))


def plane_of(lattice):
    return footprint(outline(reach=REACH), np.array(lattice.origin[:2]), np.array(lattice.spacing[:2]), None)


def leveled(coarse, fine, *, closed, cut, window=WINDOWS[0], inner=None):
    """A surface with a window of half the step, and one of another set of tiles in it."""
    plane = plane_of(coarse.lattice)
    level = Level(fine, plane, 2 * np.array(window), ratio=2)
    if inner is not None:
        level.children.append(Level(inner, plane, 2 * (2 * np.array(window) + [[9, 7], [-31, -20]]), ratio=2))
    root = Level(coarse, plane, plane.box, closed, 1, [level], cut=cut)
    found = Arrays.__new__(Arrays)
    found.vertices, found.triangles, found.labels = extract_levels(root)
    return found


def whole(tiles, *, closed, cut):
    assembly = Assembly(tiles, plane_of(tiles.lattice), closed=closed, cut=cut)
    arrays = Arrays(assembly)
    assembly.emit(arrays, lambda flat: flat)
    return arrays


class Chosen:
    """The triangles of a mesh all of whose corners lie where they are to."""

    def __init__(self, found, inside):
        chosen = inside(found.vertices[:, :2])[found.triangles].all(axis=1)
        self.vertices, self.triangles, self.labels = found.vertices, found.triangles[chosen], found.labels[chosen]


def box_of(window):
    return np.array(LATTICE.origin[:2]) + np.array(window) * LATTICE.spacing[:2]


@pytest.mark.few(closed=2)
@ends
@pytest.mark.parametrize("seed", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_a_surface_of_many_tiles_with_a_window_has_no_crack(closed, cut, seed):
    found = leveled(tiles_of(1, seed), tiles_of(2, seed), closed=closed, cut=cut)
    report = mesh_report((found.vertices, found.triangles))
    assert report.manifold
    assert report.oriented
    assert report.self_intersections == 0
    assert (report.components, report.boundary_loops) == ((1, 0) if closed else (2, 2))
    assert (report.holes, report.genus) == (0, 0)
    assert report.watertight == closed


@pytest.mark.few(closed=1)
@ends
@pytest.mark.parametrize("window", [WINDOWS[0], pytest.param(WINDOWS[1], marks=pytest.mark.slow)])
def test_inside_of_a_window_the_mesh_is_the_whole_fine_one_and_outside_the_whole_coarse_one(closed, cut, window):
    """To the bit, but for the cells beside the curtain."""
    coarse, fine = tiles_of(1, 3), tiles_of(2, 3)
    found = leveled(coarse, fine, closed=closed, cut=cut, window=window)
    (low, high), step = box_of(window), np.array(LATTICE.spacing[:2])

    def inside(plane):
        return ((plane > low + 0.75 * step) & (plane < high - 0.75 * step)).all(axis=1)

    def outside(plane):
        return ((plane < low - 0.25 * step) | (plane > high + 0.25 * step)).any(axis=1)

    for tiles, where in ((fine, inside), (coarse, outside)):
        expected, there = (facets(Chosen(each, where)) for each in (whole(tiles, closed=closed, cut=cut), found))
        assert len(expected) > 1000
        assert there == expected


@pytest.mark.few(closed=2)
@ends
def test_a_tile_beside_itself_under_two_names_has_the_windows_of_the_periodic_surface_to_the_bit(closed, cut):
    shape = tuple(np.array(SHAPE) * [2, 2, 2] - [0, 0, 1])
    fine = TileLattice(LATTICE.origin, tuple(np.array(LATTICE.spacing) / 2), shape)
    meshes = []
    for kinds in (1, 2):
        tiles = [
            TileSet((tile,) * kinds, lambda place, kinds=kinds: (place[0] + 2 * place[1]) % 3 % kinds)
            for tile in (extract_tile(layer, LATTICE), extract_tile(layer, fine))
        ]
        meshes.append(leveled(*tiles, closed=closed, cut=cut))
    one, other = meshes
    assert np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.triangles, other.triangles)
    assert np.array_equal(one.labels, other.labels)


@pytest.mark.few(closed=1)
@pytest.mark.parametrize(("closed", "cut"), [(True, True), (False, False)])
def test_a_torus_that_is_parted_has_the_windows_of_the_whole_one(closed, cut):
    parted = leveled(tiles_of(1, None), tiles_of(2, None), closed=closed, cut=cut)
    at_once = leveled(TileSet.of(torus(1)), TileSet.of(torus(2)), closed=closed, cut=cut)
    assert len(parted.vertices) == len(at_once.vertices)
    assert np.array_equal(np.bincount(parted.labels), np.bincount(at_once.labels))
    # What the margin cuts is placed from the corner of its tile.
    assert cut or facets(parted) == facets(at_once)


@pytest.mark.few(closed=1)
@pytest.mark.parametrize(("closed", "cut"), [(True, True), (False, False)])
def test_threads_change_no_window(closed, cut):
    before, meshes = get_num_threads(), []
    try:
        for count in (1, 3):
            set_num_threads(count)
            meshes.append(leveled(tiles_of(1, 3), tiles_of(2, 3), closed=closed, cut=cut))
    finally:
        set_num_threads(before)
    assert np.array_equal(meshes[0].vertices, meshes[1].vertices)
    assert np.array_equal(meshes[0].triangles, meshes[1].triangles)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [False, True])
def test_a_window_in_a_window_has_no_crack(closed):
    found = leveled(tiles_of(1, 3), tiles_of(2, 3), closed=closed, cut=True, inner=tiles_of(4, 3))
    report = mesh_report((found.vertices, found.triangles))
    assert (report.manifold, report.oriented, report.holes, report.genus) == (True, True, 0, 0)
    assert (report.components, report.boundary_loops) == ((1, 0) if closed else (2, 2))
    assert report.self_intersections == 0


def test_the_columns_of_the_plane_are_sampled_as_the_field_is_there():
    """With pockets filled: they lie on borders, so that the columns of two tiles have them."""
    tiles, color = tiles_of(1, 3), seeded(3)
    columns = np.random.default_rng(1).integers(-60, 60, (400, 2))
    columns[::2, 1] = SHAPE[1] * (columns[::2, 1] // SHAPE[1])
    found = tiles.samples(columns)
    points = np.column_stack([np.repeat(columns, SHAPE[2], axis=0), np.tile(np.arange(SHAPE[2]), len(columns))])
    values = laid(color, tiles.lattice.positions(points)).reshape(found.shape)
    assert np.abs(np.abs(found) - np.abs(values)).max() < FADE_TWIN
    solid = (
        np.logical_or.accumulate(values > 0, axis=1) & np.logical_or.accumulate(values[:, ::-1] > 0, axis=1)[:, ::-1]
    )
    assert np.array_equal(found > 0, solid)
    assert (solid & (values < 0)).sum() > 10
