"""Triangles cut along a margin: open sheets and the closed solid end on the same curve, wherever it runs."""

import numpy as np
import pytest
import shapely

from o3dleaf import mesh_report
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.leaf.blade.outline_area import sides_of
from o3dleaf.leaf.instancing.assembly import BATCH_SIZE, Assembly
from o3dleaf.leaf.instancing.components import RIM
from o3dleaf.leaf.instancing.cut.ear_loops import cut_ears
from o3dleaf.leaf.instancing.cut.flip_loops import flip_diagonals
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.levels import Level, extract_levels
from o3dleaf.leaf.instancing.reduced import reduce_tile
from o3dleaf.leaf.instancing.sets.tile_set import TileSet
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.surface.isosurface.polygonize import METHODS
from tile_fields import LATTICE, PERIOD, WIDE, area, layer, outline, ring, solid_layer
from tolerances import CHORD_AREA

both = pytest.mark.parametrize(
    "method", [pytest.param(k, id=name, marks=[pytest.mark.slow] * (k > 0)) for k, name in enumerate(METHODS)]
)


def eaten(**reach):
    """The outline with a hole in it."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    return np.concatenate([outline(**reach), ring(np.column_stack([2.3 + np.cos(angle), 0.2 + 0.9 * np.sin(angle)]))])


def plane_of(lattice, sides):
    return footprint(sides, np.array(lattice.origin[:2]), np.array(lattice.spacing[:2]), None)


def cut(tile, sides, *, closed, batch_size=BATCH_SIZE, **given):
    assembly = Assembly(tile, plane_of(tile.lattice, sides), closed=closed, cut=True, **given)
    arrays = Arrays(assembly)
    assembly.emit(arrays, lambda flat: flat, batch_size)
    return assembly, arrays


def facets(found, keep=None):
    """The triangles by the bits of their corners, each from its first corner in order."""
    corners = found.vertices[found.triangles if keep is None else found.triangles[keep]].view(np.int64)
    _, names = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    turned = (names.reshape(-1, 3).argmin(axis=1)[:, np.newaxis] + np.arange(3)) % 3
    rows = np.take_along_axis(corners, turned[:, :, np.newaxis], axis=1).reshape(-1, 9)
    return rows[np.lexsort(rows.T)]


@pytest.mark.few
@both
@pytest.mark.parametrize("sides", [outline() / 2, eaten()], ids=["whole", "eaten"])
@pytest.mark.parametrize("field", [layer, solid_layer])
def test_the_solid_is_closed_and_without_its_wall_it_is_the_two_sheets(method, sides, field):
    tile, holes = extract_tile(field, LATTICE, method), len(sides) > 90
    (_, solid), (_, sheets) = (cut(tile, sides, closed=closed) for closed in (True, False))
    assert np.array_equal(facets(solid, solid.labels != RIM), facets(sheets))
    report = mesh_report((solid.vertices, solid.triangles))
    assert (report.components, report.boundary_edges, report.genus) == (1, 0, int(holes))
    assert report.watertight
    assert report.oriented
    thickness = 2 * 0.1037
    expected = thickness * (area(sides[:90]) - area(sides[90:]))
    assert report.volume == pytest.approx(expected, rel=0.02)
    report = mesh_report((sheets.vertices, sheets.triangles))
    assert report.manifold
    assert report.oriented
    assert (report.components, report.boundary_loops, report.self_intersections) == (2, 4 if holes else 2, 0)


def chord_area(plane):
    """The area inside the chords that join where the margin crosses the sides of cells, cell by cell."""
    low, high = plane.box
    distance = plane.distances(low, high + 1)
    total = 0.0
    for i, j in np.ndindex(distance.shape[0] - 1, distance.shape[1] - 1):
        corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        kept = []
        for n, here in enumerate(corners):
            there = corners[(n + 1) % 4]
            if distance[here] > 0:
                kept.append(here)
            if (distance[here] > 0) != (distance[there] > 0):
                share = distance[here] / (distance[here] - distance[there])
                kept.append(tuple(np.array(here) + share * (np.array(there) - here)))
        if kept:
            total += area(ring(kept))
    return total * plane.spacing.prod()


@both
def test_the_sheets_cover_what_the_chords_of_the_margin_enclose(method):
    """Unless a vertex on a diagonal lies between its cell's chord and where distances cut the diagonal: not so here."""

    def flat(points):
        return 0.1037 - np.abs(points[:, 2])

    tile, sides = extract_tile(flat, LATTICE, method), eaten(reach=WIDE)
    _, found = cut(tile, sides, closed=False)
    expected = chord_area(plane_of(LATTICE, sides))
    report = mesh_report((found.vertices, found.triangles))
    assert report.area == pytest.approx(2 * expected, rel=CHORD_AREA)
    assert expected == pytest.approx(area(sides[:90]) - area(sides[90:]), rel=2e-3)


@pytest.mark.few
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("across", [0.16, 0.6])
@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4])
def test_a_strip_far_away_has_its_area(closed, across, turn):
    """Some hundred tiles to the left of the first one."""
    middle = np.array([-120.37, -77.11])
    corners = np.array([[-2.0, -across / 2], [2.0, -across / 2], [2.0, across / 2], [-2.0, across / 2]])
    sides = ring(corners @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]] + middle)
    tile = extract_tile(solid_layer, LATTICE)
    _, found = cut(tile, sides, closed=closed)
    report = mesh_report((found.vertices, found.triangles))
    assert report.manifold
    assert report.oriented
    assert report.components == (1 if closed else 2)
    if closed:
        assert report.watertight
        assert report.genus == 0
    else:
        assert report.area / 2 == pytest.approx(4.0 * across, rel=0.05)


@pytest.mark.few(shape=2)
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (6, 1), (2, 1)])
def test_one_cell_to_a_period_is_enough(closed, shape):
    nx, ny = shape
    lattice = TileLattice((0.1, -0.2, -0.4), (PERIOD / nx, PERIOD / ny, 0.8 / 30), (nx, ny, 31))
    _, found = cut(extract_tile(solid_layer, lattice), 3 * outline(), closed=closed)
    report = mesh_report((found.vertices, found.triangles))
    assert report.manifold
    assert (report.components, report.boundary_loops, report.genus) == ((1, 0, 0) if closed else (2, 2, 0))


@pytest.mark.few(off=1)
@pytest.mark.parametrize("off", [0.0, 1e-7, 1e-5])
def test_corners_on_columns_of_the_lattice_make_no_triangles_cross(off):
    """Corners of polygons on its columns, or so many steps from them: slivers there are as thin as rounding makes."""
    tile, rng = extract_tile(solid_layer, LATTICE), np.random.default_rng(7)
    origin, step = np.array(LATTICE.origin[:2]), np.array(LATTICE.spacing[:2])
    found = 0
    while found < 8:
        angle, radius = np.sort(rng.uniform(0, 2 * np.pi, 9)), rng.uniform(5, 25, 9)
        corners = np.round(radius * [np.cos(angle), np.sin(angle)]).T + rng.uniform(-off, off, (9, 2))
        polygon = shapely.Polygon(corners)
        if not polygon.is_valid or polygon.area < 60:
            continue
        _, solid = cut(tile, ring(origin + step * corners), closed=True)
        report = mesh_report((solid.vertices, solid.triangles))
        assert report.watertight
        assert (report.components, report.self_intersections) == (1, 0)
        found += 1


def hairy(points):
    """The layer with hairs that lean over its outline, thinner than a step across and farther apart than the air."""
    x, y, z = points.T
    hairs = [
        0.05 - np.hypot((x - a - 0.9 * z) % PERIOD - 0.6, (y - b + 0.5 * z) % PERIOD - 0.6)
        for a, b in ((0, 0), (0.31, 0.5), (0.7, 0.23))
    ]
    return np.maximum(solid_layer(points), np.minimum(np.maximum.reduce(hairs), 0.35 - z))


@both
def test_hairs_that_the_margin_cuts_end_on_it(method):
    tile = extract_tile(hairy, LATTICE, method)
    everything = {"keep_fragments": True}
    (_, solid), (_, sheets) = (cut(tile, eaten(), closed=closed, **everything) for closed in (True, False))
    assert np.array_equal(facets(solid, solid.labels != RIM), facets(sheets))
    report = mesh_report((solid.vertices, solid.triangles))
    assert (report.boundary_edges, report.manifold, report.oriented) == (0, True, True)
    assert report.self_intersections == 0
    assert mesh_report((sheets.vertices, sheets.triangles)).manifold


@pytest.mark.few(closed=1)
@pytest.mark.parametrize("closed", [True, False])
def test_batches_threads_and_reduced_tiles_change_nothing_at_the_margin(closed):
    tile, threads = extract_tile(layer, LATTICE), get_num_threads()
    whole = cut(tile, eaten(), closed=closed)[1]
    try:
        set_num_threads(3)
        again = cut(tile, eaten(), closed=closed, batch_size=100)[1]
    finally:
        set_num_threads(threads)
    for name in ("vertices", "triangles", "labels"):
        assert np.array_equal(getattr(whole, name), getattr(again, name))
    _, reduced = cut(tile, eaten(), closed=closed, reduced=reduce_tile(tile, lambda *mesh: mesh))
    assert len(reduced.triangles) == len(whole.triangles)
    report = mesh_report((reduced.vertices, reduced.triangles))
    assert report.manifold
    assert report.boundary_loops == (0 if closed else 4)


@pytest.mark.few(closed=1)
@pytest.mark.parametrize("closed", [True, False])
def test_a_window_beside_the_margin_leaves_it_as_it_is(closed):
    """In a tile that the margin cuts, too."""
    tile = extract_tile(layer, LATTICE)
    finer = TileLattice(LATTICE.origin, tuple(np.array(LATTICE.spacing) / 2), (48, 40, 61))
    plane = plane_of(LATTICE, eaten())
    window = Level(TileSet.of(extract_tile(layer, finer)), plane, 2 * np.array([[-16, -6], [-6, 6]]), ratio=2)
    vertices, triangles, labels = extract_levels(
        Level(TileSet.of(tile), plane, plane.box, closed, 1, [window], cut=True)
    )
    report = mesh_report((vertices, triangles))
    assert report.manifold
    assert report.oriented
    assert (report.components, report.boundary_loops) == ((1, 0) if closed else (2, 4))
    plain = cut(tile, eaten(), closed=closed)[1]
    edge = {row.tobytes() for row in plain.vertices}
    assert all(row.tobytes() in edge for row in vertices[vertices[:, 0] > 0])
    assert set(np.unique(labels)) == ({0, 1, 2} if closed else {0, 1})


def stars():
    """Polygons, star-shaped about the origin, counter-clockwise."""
    rng = np.random.default_rng(0)
    for count in (3, 4, 7, 30):
        angle = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.5, count)) / count
        yield rng.uniform(0.5, 2, (count, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])


def doubled(a, b, c):
    """Twice the areas of triangles, > 0 where they run counter-clockwise."""
    return (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]


@pytest.mark.parametrize("flipped", [False, True])
def test_ears_of_a_polygon_cover_it(flipped):
    for corners in stars():
        names, sides = np.arange(len(corners)), np.full(len(corners), -1)
        triangles = cut_ears(corners, names, sides)
        if flipped:
            flip_diagonals(corners, names, sides, triangles)
        assert len(triangles) == len(corners) - 2
        twice = doubled(*corners[triangles].transpose(1, 0, 2))
        assert np.all(twice > 0)
        assert twice.sum() == pytest.approx(doubled(np.zeros((1, 2)), corners, np.roll(corners, -1, axis=0)).sum())


def test_no_corner_beyond_a_flipped_diagonal_lies_in_the_circle_of_its_triangle():
    for corners in stars():
        names, sides = np.arange(len(corners)), np.full(len(corners), -1)
        triangles = cut_ears(corners, names, sides)
        flip_diagonals(corners, names, sides, triangles)
        beyond = {(t[k], t[k - 2]): t[k - 1] for t in triangles for k in range(3)}
        for a, b, c in triangles:
            lift = corners - corners[a]
            lift = np.column_stack([lift, (lift**2).sum(axis=1)])
            others = [beyond[edge] for edge in ((b, a), (c, b), (a, c)) if edge in beyond]
            assert all(np.linalg.det(lift[[b, c, d]]) >= -1e-5 for d in others)


def test_no_sliver_is_left_along_a_border_that_is_almost_straight():
    """The corner 2 is a hair's breadth off the side from 1 to 3: the best ear, at 0, leaves a sliver there."""
    corners = np.array([[0.0, 1 - np.sqrt(3.0)], [1.0, 1.0], [0.0, 1.0 + 1e-6], [-1.0, 1.0]])
    triangles = cut_ears(corners, np.arange(4), np.full(4, -1))
    assert doubled(*corners[triangles].transpose(1, 0, 2)).min() <= 1e-5
    flip_diagonals(corners, np.arange(4), np.full(4, -1), triangles)
    assert doubled(*corners[triangles].transpose(1, 0, 2)).min() >= 0.9
    # Corners of one side of a cell are not joined, nor the two ends of a bridge.
    for names, sides in (([0, 1, 0, 3], [-1, -1, -1, -1]), ([0, 1, 2, 3], [2, -1, 2, -1])):
        triangles = np.array([[0, 1, 3], [1, 2, 3]])
        flip_diagonals(corners, np.array(names), np.array(sides), triangles)
        assert triangles.tolist() == [[0, 1, 3], [1, 2, 3]]


def test_a_slit_that_ends_in_a_cell_makes_no_triangle_cross():
    """Its two flanks run through one cell, and the sheets above and below have their diagonals there as they come."""
    tile = extract_tile(solid_layer, LATTICE)
    step, rng = max(LATTICE.spacing[:2]), np.random.default_rng(0)
    disc = shapely.Point(2.0, 0.3).buffer(1.5)
    for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        wide = rng.uniform(0.3, 1.5) * step * across
        tip = rng.uniform(0.5, 1.0) * along
        disc -= shapely.Polygon([tip + [2, 0.3], 2 * along - wide + [2, 0.3], 2 * along + wide + [2, 0.3]])
    (_, solid) = cut(tile, sides_of(disc), closed=True)
    report = mesh_report((solid.vertices, solid.triangles))
    assert (report.components, report.boundary_edges, report.self_intersections) == (1, 0, 0)
