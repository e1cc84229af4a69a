"""Finer windows in a coarser surface: one mesh, no crack, each level the surface of its own spacing."""

from functools import cache
from itertools import combinations

import numpy as np
import pymeshlab
import pytest
import shapely

from o3dleaf import mesh_report
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.levels import Level, _curtain, extract_levels, refine_face
from o3dleaf.leaf.instancing.sets.tile_set import TileSet
from o3dleaf.leaf.instancing.stitch import _on_box
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.surface.isosurface.polygonize import polygonize
from tile_fields import LATTICE, WIDE, area, assemble, layer, outline

SIDES = outline(reach=WIDE)


@cache
def tile(ratio=1):
    """The tile of the layer, its lattice finer by `ratio`, as a set."""
    nx, ny, nz = LATTICE.shape
    spacing = tuple(np.array(LATTICE.spacing) / ratio)
    lattice = TileLattice(LATTICE.origin, spacing, (nx * ratio, ny * ratio, (nz - 1) * ratio + 1))
    return TileSet.of(extract_tile(layer, lattice))


def nested(ratios=(3, 2), *, closed=False):
    """The layer with a window, and a window in the window."""
    root = Level(
        tile(),
        footprint(SIDES, np.array(LATTICE.origin[:2]), np.array(LATTICE.spacing[:2]), None),
        np.array([[-90, -50], [160, 60]]),
        closed,
    )
    box = np.array([[30, 22], [44, 34]]) * ratios[0]
    window = Level(tile(ratios[0]), root.footprint, box, False, ratios[0])
    inner = np.array([box[0] + [6, 7], box[0] + [20, 17]]) * ratios[1]
    window.children.append(Level(tile(ratios[0] * ratios[1]), root.footprint, inner, False, ratios[1]))
    root.children.append(window)
    return root


def crossing_pairs(vertices, triangles):
    """Pairs of triangles without a common corner that no plane parts, among those that MeshLab takes for crossing.

    Its filter counts some that are apart; two convex bodies are apart if and only if one of the normals of their
    sides, or a product of their edges, parts them.
    """
    session = pymeshlab.MeshSet(verbose=False)
    session.add_mesh(pymeshlab.Mesh(vertices, triangles.astype(np.int32)))
    session.compute_selection_by_self_intersections_per_face()
    suspects = np.flatnonzero(session.current_mesh().face_selection_array())
    return [
        (one, other)
        for one, other in combinations(suspects.tolist(), 2)
        if not set(triangles[one]) & set(triangles[other]) and not are_apart(vertices[triangles[[one, other]]])
    ]


def are_apart(pair):
    edges = np.roll(pair, -1, axis=1) - pair
    normals = np.cross(edges[:, 0], edges[:, 1])
    within = np.cross(normals[:, np.newaxis], edges).reshape(-1, 3)
    across = np.cross(edges[0][:, np.newaxis], edges[1]).reshape(-1, 3)
    axes = np.concatenate([normals, within, across])
    low, high = (end(pair @ axes.T, axis=1) for end in (np.min, np.max))
    return bool(np.any((low[0] > high[1]) | (low[1] > high[0])))


@pytest.mark.few
@pytest.mark.parametrize(
    "ratios", [(3, 2), (2, 3), *(pytest.param(each, marks=pytest.mark.slow) for each in ((4, 2), (2, 4)))]
)
@pytest.mark.parametrize("closed", [False, True])
def test_a_mesh_with_windows_is_manifold_and_has_no_crack(ratios, closed):
    vertices, triangles, labels = extract_levels(nested(ratios, closed=closed))
    report = mesh_report((vertices, triangles))
    assert report.manifold
    assert report.oriented
    assert report.components == (1 if closed else 2)
    assert report.boundary_loops == (0 if closed else 2)
    assert report.holes == 0
    assert report.genus == 0
    assert not crossing_pairs(vertices, triangles)
    assert set(np.unique(labels)) == ({0, 1, 2} if closed else {0, 1})
    if closed:
        assert report.volume == pytest.approx(2 * 0.1037 * area(SIDES), rel=0.01)


def test_a_curtain_hangs_from_every_column_around_a_window_and_keeps_the_samples_of_its_parent():
    root = nested()
    window = root.children[0]
    curtain = _curtain(window, root.tiles)
    (i0, j0), (i1, j1) = window.box
    around = {(i, j) for i in range(i0, i1 + 1) for j in range(j0, j1 + 1) if i in {i0, i1} or j in {j0, j1}}
    assert curtain.keys() == around
    shared = np.array(sorted(each for each in around if not any(np.remainder(each, window.ratio))))
    kept = np.array([curtain[i, j] for i, j in shared.tolist()])[:, :: window.ratio]
    np.testing.assert_array_equal(kept, root.tiles.samples(shared // window.ratio))


def test_each_level_is_the_surface_of_its_own_spacing():
    """A ring of cells from every curtain, the vertices are those of the whole surface at that spacing."""
    root = nested()
    vertices, _, _ = extract_levels(root)
    coarse = assemble(root.tiles, SIDES)[1].vertices
    window = root.children[0]
    low, high = (window.tiles.lattice.positions([[*corner, 0]])[0, :2] for corner in window.box)
    step = np.array(LATTICE.spacing[:2])

    def outside(points):
        return ((points[:, :2] < low - step) | (points[:, :2] > high + step)).any(axis=1)

    assert np.array_equal(as_rows(vertices[outside(vertices)]), as_rows(coarse[outside(coarse)]))
    fine = assemble(window.tiles, SIDES, np.array([low, high]))[1].vertices
    hole = np.array([window.tiles.lattice.positions([[*c, 0]])[0, :2] for c in window.children[0].box // 2])

    def within(points):
        edge = step / 3 * 1.5
        inner = ((points[:, :2] > low + edge) & (points[:, :2] < high - edge)).all(axis=1)
        return inner & ((points[:, :2] < hole[0] - edge) | (points[:, :2] > hole[1] + edge)).any(axis=1)

    assert within(fine).sum() > 1000
    assert np.array_equal(as_rows(vertices[within(vertices)]), as_rows(fine[within(fine)]))


def as_rows(points):
    return points[np.lexsort(points.T)]


@pytest.mark.parametrize("ratio", [2, 4, 8])
def test_a_refined_face_is_crossed_where_the_coarse_one_is_and_keeps_its_curves(ratio):
    """As many curves, ending on the same edges, also where inside corners lie across from one another."""
    rng = np.random.default_rng(1)
    coarse = rng.normal(size=(12, 9))
    fine = refine_face(coarse, ratio)
    assert np.array_equal(fine[::ratio, ::ratio], coarse)

    def curves(samples):
        mesh = polygonize(np.stack([samples, samples]), 0.0)
        report = mesh_report(mesh)
        return report.components, report.boundary_loops

    assert curves(fine) == curves(coarse)


def test_the_edges_of_squares_are_refined_alike_from_both_sides():
    rng = np.random.default_rng(2)
    coarse = rng.normal(size=(2, 3))
    whole = refine_face(coarse, 4)
    assert np.array_equal(refine_face(coarse[:, :2], 4)[:, -1], whole[:, 4])
    assert np.array_equal(refine_face(coarse[:, 1:], 4)[:, 0], whole[:, 4])


@pytest.mark.parametrize(("direction", "step"), [(1, (1, 0)), (2, (0, 1)), (4, (0, 0))])
def test_an_edge_lies_in_a_box_s_sides_if_its_middle_does(direction, step):
    box = np.array([[1, 2], [4, 6]])
    low = np.stack(np.meshgrid(np.arange(7), np.arange(9), indexing="ij"), axis=-1).reshape(-1, 2)
    sides = shapely.box(*box[0], *box[1]).exterior
    expected = [sides.distance(shapely.LineString([ends, ends + step]).centroid) == 0 for ends in low]
    names = np.column_stack([low, np.full(len(low), 3), np.full(len(low), direction)])
    assert np.array_equal(_on_box(names, box), expected)


def test_a_window_that_reaches_the_rim_is_refused():
    root = nested()
    root.children[0] = Level(root.children[0].tiles, root.footprint, np.array([[120, 0], [140, 12]]) * 4, False, 4)
    with pytest.raises(InputError, match="reaches the rim"):
        extract_levels(root)


@pytest.mark.few(closed=1)
@pytest.mark.parametrize("closed", [False, True])
def test_an_outline_of_two_parts_is_refused_though_one_has_a_fine_window(closed):
    root = nested((2, 2), closed=closed)
    sides = np.concatenate([SIDES, SIDES + [20, 0, 20, 0]])
    plane = footprint(sides, np.array(LATTICE.origin[:2]), np.array(LATTICE.spacing[:2]), None)
    two = Level(root.tiles, plane, root.box, closed, children=root.children)
    with pytest.raises(ReconstructionError, match="2 pieces" if closed else "4 sheets"):
        extract_levels(two)
