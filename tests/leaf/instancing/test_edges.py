"""Small, thin and odd places: one cell to a period, outlines with holes, regions of a few cells, negative tiles."""

import numpy as np
import pytest

from o3dleaf import mesh_report
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.leaf.instancing.assembly import Assembly
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.footprint import Footprint, footprint
from o3dleaf.leaf.instancing.reduced import reduce_tile
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.surface.isosurface.polygonize import METHODS, march
from tile_fields import LATTICE, PERIOD, area, assemble, layer, made_block, outline, ring, solid_layer

both = pytest.mark.parametrize("method", range(len(METHODS)), ids=METHODS)


def lattice_of(nx, ny, nz=31):
    return TileLattice((0.1, -0.2, -0.4), (PERIOD / nx, PERIOD / ny, 0.8 / (nz - 1)), (nx, ny, nz))


def summary(found):
    report = mesh_report((found.vertices, found.triangles))
    assert report.manifold
    assert report.oriented
    return report


@pytest.mark.few(shape=2)
@both
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (6, 1), (2, 1)])
def test_one_cell_to_a_period_is_enough(method, closed, shape):
    tile = extract_tile(solid_layer, lattice_of(*shape), method)
    sides = 3 * outline()
    report = summary(assemble(tile, sides, closed=closed)[1])
    assert report.components == (1 if closed else 2)
    assert report.boundary_loops == (0 if closed else 2)
    assert report.genus == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (6, 1)])
def test_a_block_of_one_cell_is_closed(shape):
    vertices, triangles, _ = made_block(extract_tile(solid_layer, lattice_of(*shape)))
    report = mesh_report((vertices, triangles))
    assert (report.components, report.boundary_edges, report.genus) == (1, 0, 0)
    assert report.manifold
    assert report.volume > 0


@pytest.mark.few
@both
@pytest.mark.parametrize("closed", [False, True])
def test_a_hole_in_the_outline_is_a_hole_in_the_mesh(method, closed):
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    hole = ring(np.column_stack([2.3 + np.cos(angle), 0.2 + 0.9 * np.sin(angle)]))
    sides = np.concatenate([outline(), hole])
    tile = extract_tile(layer, LATTICE, method)
    report = summary(assemble(tile, sides, closed=closed)[1])
    assert report.components == (1 if closed else 2)
    if closed:
        assert (report.boundary_edges, report.genus) == (0, 1)
        assert report.volume == pytest.approx(2 * 0.1037 * (area(outline()) - area(hole)), rel=0.01)
    else:
        assert report.boundary_loops == 4


@pytest.mark.few
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("across", [0.16, 0.6])
@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4])
def test_a_strip_thinner_than_a_tile_and_a_region_of_a_few_cells(closed, across, turn):
    """Some hundred tiles to the left of the first one, three cells wide and more."""
    middle = np.array([-120.37, -77.11])
    corners = np.array([[-2.0, -across / 2], [2.0, -across / 2], [2.0, across / 2], [-2.0, across / 2]])
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    turned = corners @ rotation + middle
    tile = extract_tile(layer, LATTICE)
    report = summary(assemble(tile, ring(turned), closed=closed)[1])
    assert report.components == (1 if closed else 2)
    if closed:
        assert report.boundary_edges == 0
        grid = np.stack(np.meshgrid(np.linspace(-2, 2, 401), np.linspace(-across / 2, across / 2, 61)), axis=-1)
        x, y = np.moveaxis(grid @ rotation + middle, 2, 0) * 2 * np.pi / PERIOD
        thickness = 2 * (0.1037 + 0.03 * np.sin(y) + 0.02 * np.sin(2 * x))
        assert report.volume == pytest.approx(thickness.mean() * 4.0 * across, rel=0.05)


@both
def test_a_region_of_one_cell_is_two_patches(method):
    tile = extract_tile(solid_layer, LATTICE, method)
    step = np.array(LATTICE.spacing[:2])
    for at in ([3, 4], [-1, -1], [-24, 20], [23, 19]):
        low = LATTICE.origin[:2] + np.array(at) * step
        _, found = assemble(tile, ring([[-9, -9], [9, -9], [9, 9], [-9, 9]]), np.array([low, low + step]))
        assert summary(found).components == 2
        assert np.all(found.vertices[:, :2] >= low - 1e-12)
        assert np.all(found.vertices[:, :2] <= low + step + 1e-12)


def test_a_region_between_lattice_lines_and_one_beside_the_outline_are_refused():
    tile = extract_tile(solid_layer, LATTICE)
    box = ring([[-9, -9], [9, -9], [9, 9], [-9, 9]])
    low = np.array(LATTICE.origin[:2]) + 0.3 * np.array(LATTICE.spacing[:2])
    for region in ([low, low + 0.01], [[20, 20], [30, 30]], [[-90, 0], [-80, 1]]):
        with pytest.raises(ReconstructionError, match="no cell"):
            assemble(tile, box, np.array(region))


@both
def test_a_solid_is_the_brute_force_extraction_of_the_smaller_of_field_and_distance(method):
    """Its vertices, apart from the rim's, are those of the layer; cell by cell it has the triangles of its code."""
    sides = outline()
    tile = extract_tile(layer, LATTICE, method)
    _, found = assemble(tile, sides, closed=True)
    nx, ny, _ = LATTICE.shape
    plane = footprint(sides, np.array(LATTICE.origin[:2]), np.array(LATTICE.spacing[:2]), None)
    low, high = plane.box
    distance = plane.distances(low, high + 1)
    i, j = np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True)), indexing="ij")
    solid = tile.runs.expand((i % nx * ny + j % ny).ravel()).reshape(*i.shape, -1) == INSIDE
    inside = solid & (distance > 0)[..., np.newaxis]
    brute = march(np.where(inside, 1.0, -1.0), inside, method)
    assert len(brute.edges) == len(found.vertices)
    assert len(brute.triangles) == len(found.triangles)


def test_a_point_has_one_answer_in_all_windows():
    """Sides on the lattice but for rounding: y = 1e-17 lies above 0, and 8 + 1e-17 does not lie above 8."""
    tiny = 1e-17
    plane = footprint(ring([[-20, tiny], [20, tiny], [20, 9], [-20, 9]]), np.zeros(2), np.ones(2), None)
    whole = plane.distances([-21, -3], [22, 12])
    for low in ([-21, -3], [-4, -2], [0, 0], [3, 0], [-7, -1]):
        high = np.minimum(np.array(low) + [5, 6], [22, 12])
        part = tuple(slice(a + o, b + o) for a, b, o in zip(low, high, (21, 3), strict=True))
        window = plane.distances(low, high)
        assert np.array_equal(window > 0, whole[part] > 0)
        assert np.array_equal(window, whole[part])


@pytest.mark.parametrize("spacing", [[1.0, 1.0], [0.1, 1.0], [1.0, 0.1]])
def test_distances_are_those_to_all_sides_up_to_two_steps(spacing):
    """The literal twin, also where one step is a tenth of the other."""
    rng = np.random.default_rng(0)
    spacing = np.array(spacing)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 40))
    points = (rng.uniform(4, 7, 40) * [np.cos(angle), np.sin(angle)]).T * spacing * [1, 0.9]
    sides = ring(points)
    plane = footprint(sides, np.zeros(2), spacing, None)
    low, high = plane.box
    i, j = np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True)), indexing="ij")
    at = np.stack([i, j], axis=-1)[..., np.newaxis, :] * spacing
    start, along = sides[:, :2], sides[:, 2:] - sides[:, :2]
    share = np.clip(((at - start) * along).sum(axis=-1) / (along**2).sum(axis=1), 0, 1)
    gap = np.linalg.norm(at - start - share[..., np.newaxis] * along, axis=-1).min(axis=-1)
    expected = np.minimum(gap, 2 * spacing.max())
    inside = ((start[:, 0] > at[..., 0]) != (sides[:, 2] > at[..., 0])) & (
        at[..., 1] > start[:, 1] + along[:, 1] * (at[..., 0] - start[:, 0]) / along[:, 0]
    )
    inside = inside.sum(axis=-1) % 2 == 1
    assert np.abs(plane.distances(low, high) - np.where(inside, expected, -expected)).max() < 1e-12
    for p in range(int(low[0]), int(high[0]), 2):
        for q in range(int(low[1]), int(high[1]), 3):
            window = plane.distances([p, q], [p + 2, q + 3])
            part = plane.distances(low, high + 3)[p - low[0] :, q - low[1] :][:2, :3]
            assert np.array_equal(window, part)


def test_cells_are_those_inside_that_no_side_touches_and_meet_in_no_corner():
    rng = np.random.default_rng(1)
    angle = np.linspace(0, 2 * np.pi, 70, endpoint=False)
    sides = ring((rng.uniform(9, 14, 70) * [np.cos(angle), np.sin(angle)]).T)
    plane = footprint(sides, np.zeros(2), np.ones(2), None)
    low, high = plane.box
    kept = plane.cells(low, high)
    a, b, c, d = kept[:-1, :-1], kept[:-1, 1:], kept[1:, :-1], kept[1:, 1:]
    assert not ((a == d) & (b == c) & (a != b)).any()
    assert kept.sum() > 150
    share = np.linspace(0, 1, 2001)[:, np.newaxis]
    for side in sides:
        i, j = np.floor(side[:2] + share * (side[2:] - side[:2])).astype(int).T
        assert not kept[i - low[0], j - low[1]].any()
    distance = plane.distances(low, high + 1)
    for u, v in ((0, 0), (0, 1), (1, 0), (1, 1)):
        assert (distance[u : u + kept.shape[0], v : v + kept.shape[1]][kept] > 0).all()
    for p, q in ((-9, -9), (0, 0), (3, -8)):
        assert np.array_equal(plane.cells([p, q], [p + 6, q + 5]), kept[p - low[0] :, q - low[1] :][:6, :5])
    clipped = Footprint(plane.rings, plane.spacing, np.array([[-5, -4], [6, 3]]))
    outside = np.ones_like(kept)
    outside[-5 - low[0] : 6 - low[0], -4 - low[1] : 3 - low[1]] = False
    assert not clipped.cells(low, high)[outside].any()
    assert clipped.cells(low, high)[~outside].sum() > 60


@both
def test_hairs_that_leave_the_patch_are_closed_at_its_top_and_bottom(method):
    """A bar in the air that leaves it too is a speck."""

    def hairy(points):
        x, y, z = points.T
        up, down = (0.12 - np.hypot((x - a) % PERIOD - 0.6, (y - b) % PERIOD - 0.6) for a, b in ((0, 0), (0.5, 0.4)))
        hairs = np.maximum(np.where(z > 0, up, -1), np.where(z < 0, down, -1))
        return np.maximum(solid_layer(points), hairs)

    def bar(points):
        return 0.1 - np.hypot((points[:, 0] - 0.3) % PERIOD - 0.6, points[:, 2] - 0.42)

    tile = extract_tile(lambda points: np.maximum(hairy(points), bar(points)), LATTICE, method)
    points = LATTICE.positions(np.stack(np.meshgrid(*map(np.arange, LATTICE.shape), indexing="ij"), -1).reshape(-1, 3))
    expected = (hairy(points) > 0).reshape(-1, LATTICE.shape[2])
    assert expected[:, [0, -1]].any(axis=0).all()
    expected[:, [0, -1]] = False
    assert np.array_equal(tile.runs.expand(np.arange(24 * 20)) == INSIDE, expected)
    assert tile.runs.islands == 1
    report = summary(assemble(tile, outline(), closed=True)[1])
    assert (report.components, report.boundary_edges, report.genus) == (1, 0, 0)


@pytest.mark.parametrize("closed", [False, True])
def test_tiles_of_many_blocks_are_the_tile_of_one(closed):
    tile = extract_tile(layer, LATTICE)
    _, whole = assemble(tile, outline(), closed=closed)
    _, parts = assemble(tile, outline(), closed=closed, batch_size=100)
    for name in ("vertices", "triangles", "labels"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name))


def test_fragments_are_what_is_missing():
    tile = extract_tile(layer, LATTICE)
    sides = np.concatenate([outline(), ring([[20, 20], [20.4, 20], [20.4, 20.4], [20, 20.4]])])
    plane = footprint(sides, np.array(LATTICE.origin[:2]), np.array(LATTICE.spacing[:2]), None)
    less, everything = (Assembly(tile, plane, closed=True, keep_fragments=keep) for keep in (False, True))
    assert less.fragments.pieces == 1
    assert less.fragments.triangles == everything.triangles - less.triangles > 100
    assert (everything.fragments.pieces, everything.fragments.triangles) == (0, 0)


def test_a_reduced_tile_longer_than_wide_is_set_down_in_its_places():
    lattice = TileLattice((0.1, -0.2, -0.4), (PERIOD / 24, PERIOD / 20, 0.8 / 30), (48, 20, 31))
    tile = extract_tile(solid_layer, lattice)
    plane = footprint(outline(), np.array(lattice.origin[:2]), np.array(lattice.spacing[:2]), None)
    same = Assembly(tile, plane, closed=True, reduced=reduce_tile(tile, lambda *mesh: mesh))
    found = Arrays(same)
    same.emit(found, lambda flat: flat)
    _, plain = assemble(tile, outline(), closed=True)
    assert (found.vertices.shape, found.triangles.shape) == (plain.vertices.shape, plain.triangles.shape)
    rows = [each.vertices[np.lexsort(np.round(each.vertices, 9).T)] for each in (found, plain)]
    assert np.abs(rows[0] - rows[1]).max() < 1e-12
