"""The dual of an octree: closed, manifold and outward on leaves of any widths, and as near as the leaves are narrow."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from mesh_fields import BLOCK_HALF, CENTRE, Analytic, block, sphere, torus
from o3dleaf import extract_isosurface, get_num_threads, mesh_report, set_num_threads
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.isosurface.continuation import Continuation
from o3dleaf.surface.isosurface.octree import loop_vertices, octree_loops
from o3dleaf.surface.isosurface.octree.octree_band import MAX_CELLS, OctreeBand
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from tolerances import DUAL_CREASE, DUAL_ORDER, DUAL_SPHERE, ROUNDING


def sponge():
    """One surface with hundreds of handles and ambiguous faces."""
    return Analytic(lambda x, y, z: (np.sin(20 * x + y) + np.sin(19 * y - z) + np.sin(21 * z + x) - 0.1) / 64)


def seeds_of(field, spacing=0.1):
    """Return places on all parts of a field's surface."""
    return mesh_arrays(extract_isosurface(field, spacing))[0]


def scattered(count, seed, least=-5.0, most=-2.0):
    """Return steps from 1/32 to 1/4, at random."""
    return np.exp2(np.random.default_rng(seed).uniform(least, most, count))


def follow(field, seeds, steps, within=None):
    """Return a surface on the leaves of an octree."""
    return Continuation.on_octree(field, steps, seeds, 0.0, within=within, box=field.bounds)


def drawn(field, seeds, steps, *, within=None, features=False):
    """Return its vertices and triangles."""
    return follow(field, seeds, steps, within).draw(sharpen=True, features=features)


def is_outward(field, vertices, triangles):
    """Return which triangles look to where a field falls."""
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return (normal * field.gradient(corners.mean(axis=1))).sum(axis=1) < 0


@pytest.mark.few
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("field", "genus"), [(sphere(), 0), (torus(), 1)])
def test_on_leaves_of_any_widths_a_surface_is_closed_manifold_and_outward(field, genus, seed):
    seeds = seeds_of(field)
    vertices, triangles = drawn(field, seeds, scattered(len(seeds), seed))
    report = mesh_report((vertices, triangles))
    assert report.watertight
    assert (report.components, report.genus, report.self_intersections) == (1, genus, 0)
    assert is_outward(field, vertices, triangles).all()


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(3))
def test_ambiguous_faces_and_doubled_sides_leave_no_crack_and_no_edge_of_three(seed):
    """Waves of three leaves, cut by the box: handles everywhere, and two pairs of edges of a face in the same loops."""
    field, rng = sponge(), np.random.default_rng(seed)
    seeds = rng.uniform(-1.1, 1.1, (200, 3))
    continued = follow(field, seeds, scattered(len(seeds), seed, -4.0, -2.0))
    vertices, triangles = continued.draw(sharpen=True, features=False)
    report = mesh_report((vertices, triangles))
    assert report.manifold
    assert report.oriented
    assert report.boundary_edges == 0
    assert len(vertices) > len(continued.band.traced().leaf)  # of doubled sides
    assert np.all(np.abs(vertices) <= 1.2)


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(2))
def test_each_crossed_least_edge_of_all_leaves_has_its_polygon(seed):
    """Against all leaves of the box, found place by place: edges of all, halved where a narrower one has them."""
    field = sponge()
    seeds = np.random.default_rng(seed).uniform(-1.1, 1.1, (60, 3))
    band = follow(field, seeds, scattered(len(seeds), seed, -4.0, -2.0)).band
    traced = band.traced()
    some = traced.incidences
    keys = np.column_stack([band.keys[some.lower], band.keys[some.upper]])
    found = {tuple(pair) for pair in keys.tolist()}
    assert np.all(traced.edges.around >= 0)
    assert found == brute_edges(band)


def brute_edges(band):
    """Return the keys of both ends of the crossed least edges of all leaves of the box."""
    step = band.step[0]
    ticks = np.arange(np.floor(-1.45 / step), np.ceil(1.45 / step))
    places = (np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * step
    keys, levels = band.octree.leaves_at(band.keys_of(places))
    leaves, first = np.unique(keys, return_index=True)
    low = band.positions(leaves)
    edges = set()
    for axis in range(3):
        for corner in np.ndindex(2, 2):
            shift = np.insert(np.array(corner, dtype=float), axis, 0.0)
            begin = np.rint((low + (shift * step * 2.0 ** levels[first][:, np.newaxis])) / step).astype(np.int64)
            lengths = 1 << levels[first]
            for point, length in zip(begin.tolist(), lengths.tolist(), strict=True):
                edges.add((axis, *point, length))
    # An edge is a least one if none of the same beginning is half as long.
    least = [edge for edge in edges if (*edge[:4], edge[4] // 2) not in edges]
    ends = np.array([[edge[1:4], np.add(edge[1:4], np.eye(3, dtype=int)[edge[0]] * edge[4])] for edge in least])
    places = ends * step
    inside = band.ask(places.reshape(-1, 3)).reshape(-1, 2) > 0
    crossed = places[inside[:, 0] != inside[:, 1]].reshape(-1, 3) + step / 4
    return {tuple(pair) for pair in band.keys_of(crossed).reshape(-1, 2).tolist()}


def test_leaves_lead_to_those_across_their_crossed_faces_and_to_no_others():
    """Of a face, or a quarter of one that narrower leaves share, at least where its corners are on both sides."""
    field = sponge()
    seeds = np.random.default_rng(5).uniform(-1.1, 1.1, (60, 3))
    band = follow(field, seeds, scattered(len(seeds), 5, -4.0, -2.0)).band
    leaves = band.traced().leaves
    found = np.full((len(leaves.keys), 24), -1)
    unvisited = np.zeros_like(band.known)
    known = band.table, band.keys, unvisited
    octree_loops.cross_leaf_faces(0, len(found), band.octree.split, *leaves[:4], *known, found)
    low, side = band.positions(leaves.keys), band.step[0] * np.exp2(leaves.levels)[:, np.newaxis]
    touched, crossed = [], []
    for face in range(6):
        axis, across = face >> 1, np.eye(3)[face >> 1] * (1 if face & 1 else -1)
        for part in np.ndindex(2, 2):
            middle = low + side * np.insert(0.25 + 0.5 * np.array(part), axis, 1.0 if face & 1 else 0.0)
            key, level = band.octree.leaves_at(band.keys_of(middle + 0.1 * band.step[0] * across))
            touched.append(key)
            shared = np.minimum(side, band.step[0] * np.exp2(level)[:, np.newaxis])
            begin = np.floor((middle - low) / shared + 1e-9) * shared + low
            corners = [begin + shared * np.insert(np.array(each, dtype=float), axis, 0.0) for each in np.ndindex(2, 2)]
            inside = np.stack([band.ask(corner) > 0 for corner in corners])
            crossed.append(np.where(inside.any(axis=0) & ~inside.all(axis=0), key, -1))
    for got, all_of_them, least in zip(found, np.transpose(touched), np.transpose(crossed), strict=True):
        assert set(least) <= set(got) <= set(all_of_them) | {-1}


def test_leaves_of_one_width_have_the_topology_of_the_band():
    """Sponges have hundreds of handles in ambiguous cells, which both join alike."""
    field = sponge()
    seeds = seeds_of(field, 1 / 16)
    cubes = mesh_report(extract_isosurface(field, 3 / 32, seeds=seeds))
    dual = mesh_report(drawn(field, seeds, np.full(len(seeds), 3 / 32)))
    assert cubes.genus > 100
    assert (dual.genus, dual.components) == (cubes.genus, cubes.components)


def test_a_plane_is_met_exactly():
    normal = np.array([0.3, -0.5, 0.8])
    field = Analytic(lambda x, y, z: 0.1 - np.stack([x, y, z], axis=1) @ normal)
    seeds = seeds_of(field)
    seeds = seeds[np.abs(seeds).max(axis=1) < 1]
    vertices, triangles = drawn(
        field, seeds, scattered(len(seeds), 1), within=lambda places: np.abs(places).max(axis=1) < 1
    )
    assert np.abs(vertices @ normal - 0.1).max() < 10 * ROUNDING
    corners = vertices[triangles]
    assert np.all(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ normal > 0)
    assert mesh_report((vertices, triangles)).manifold


def test_errors_fall_with_the_square_of_the_leaves():
    seeds, errors = seeds_of(sphere()), []
    for step in (0.2, 0.1, 0.05):
        vertices, triangles = drawn(sphere(), seeds, np.full(len(seeds), step))
        errors.append(np.abs(np.linalg.norm(vertices[triangles].mean(axis=1) - CENTRE, axis=1) - 1).mean())
    assert np.all(np.abs(np.log2(np.divide(errors[:-1], errors[1:])) - 2) < DUAL_ORDER)


def test_each_part_of_a_surface_is_as_near_as_its_own_leaves_are_narrow():
    seeds, step = seeds_of(sphere()), 0.04
    steps = np.where(seeds[:, 0] > 0, step, 8 * step)
    vertices, triangles = drawn(sphere(), seeds, steps)
    middles = vertices[triangles].mean(axis=1)
    off = np.abs(np.linalg.norm(middles - CENTRE, axis=1) - 1)
    assert off[middles[:, 0] > 0.1].mean() < DUAL_SPHERE * step**2
    assert DUAL_SPHERE * step**2 < off[middles[:, 0] < -0.5].mean() < DUAL_SPHERE * (8 * step) ** 2
    assert np.count_nonzero(middles[:, 0] < -0.5) < np.count_nonzero(middles[:, 0] > 0.5) / 20


def test_edges_of_a_block_are_sharp_and_no_triangles_cross():
    field, turn = block()
    seeds = seeds_of(field)
    steps = np.where(seeds[:, 0] > 0, 0.06, 0.2)
    places = np.linspace(-1, 1, 41)[:, np.newaxis] * BLOCK_HALF * [1, 0, 0] + BLOCK_HALF * [0, 1, 1]
    edge = places @ turn.T + CENTRE
    off = []
    for features in (False, True):
        vertices, triangles = drawn(field, seeds, steps, features=features)
        report = mesh_report((vertices, triangles))
        assert report.watertight
        off.append(distance_to_mesh(vertices, triangles, edge).mean())
    assert off[1] < DUAL_CREASE * off[0]


@pytest.mark.parametrize("within", [None, 0.3, lambda places: places[:, 0] < 0.2])
def test_a_changed_field_is_followed_as_one_that_was_so_from_the_beginning(within):
    seeds = seeds_of(sphere())
    seeds = seeds[seeds[:, 0] < 0.5]
    steps, new = scattered(len(seeds), 2), torus(0.8, 0.35)
    continued = follow(sphere(), seeds, steps, within)
    continued.draw(sharpen=True, features=False)
    continued.change(new, lambda places: np.ones(len(places), dtype=bool))
    for array, other in zip(
        continued.draw(sharpen=True, features=False), drawn(new, seeds, steps, within=within), strict=True
    ):
        assert np.array_equal(array, other)


def test_a_surface_ends_open_and_manifold_where_it_is_not_allowed():
    """A third of the leaves, here and there: others touch along an edge or in a vertex alone."""
    seeds = seeds_of(sphere())
    steps = scattered(len(seeds), 3)

    def allowed(places):
        return np.sin(1e4 * places @ [1, 2, 3]) < 0.5

    continued = follow(sphere(), seeds, steps, allowed)
    leaves = continued.band.traced().leaves
    assert allowed(continued.band.place_in(leaves.keys, leaves.levels, 0.5)).all()
    vertices, triangles = continued.draw(sharpen=True, features=False)
    report = mesh_report((vertices, triangles))
    assert report.manifold
    assert report.boundary_edges > 0
    assert is_outward(sphere(), vertices, triangles).all()


def test_the_result_does_not_depend_on_the_threads():
    seeds, threads, meshes = seeds_of(torus()), get_num_threads(), []
    for count in (1, 3):
        set_num_threads(count)
        meshes.append(drawn(torus(), seeds, scattered(len(seeds), 4)))
    set_num_threads(threads)
    assert all(np.array_equal(one, other) for one, other in zip(*meshes, strict=True))


def test_no_vertex_leaves_the_box_where_newton_would(monkeypatch):
    """By slopes that are far too small steps are too long, and end on the faces of leaves and of the box."""
    field = replace(sphere(), bounds=np.array([[-1.1] * 3, [1.1] * 3]))
    seeds = seeds_of(sphere())
    continued = follow(field, seeds, np.full(len(seeds), 0.3))
    monkeypatch.setattr(loop_vertices, "MAX_ITERATIONS", 1)
    vertices, _ = continued.draw(sharpen=True, features=False, exact=Sloping(field))
    assert np.abs(vertices).max() == pytest.approx(1.1, abs=ROUNDING)


@dataclass
class Sloping:
    """A field with slopes a hundredth of its own."""

    field: Analytic

    @property
    def bounds(self):
        return self.field.bounds

    def __call__(self, points):
        return self.field(points)

    def gradient(self, points):
        return self.field.gradient(points) / 100


def test_a_leaf_with_many_seeds_is_named_once():
    seeds = seeds_of(sphere())
    band = OctreeBand.on_steps(seeds, scattered(len(seeds), 6), sphere(), 0.0)
    cells = band.cells_of(seeds)
    assert np.array_equal(cells, np.unique(band.octree.leaves_at(band.keys_of(seeds))[0]))
    assert len(cells) < len(seeds)


def test_the_loops_of_a_band_are_traced_once():
    seeds = seeds_of(sphere())
    continued = follow(sphere(), seeds, np.full(len(seeds), 0.2))
    assert continued.band.traced() is continued.band.traced()


def test_steps_that_are_short_beyond_keys_are_not_taken():
    seeds = seeds_of(sphere())
    steps = np.full(len(seeds), 0.2)
    steps[0] = 1e-12
    band = OctreeBand.on_steps(seeds, steps, sphere(), 0.0)
    assert band.widths[0] < 3 * np.ptp(seeds, axis=0).max() / MAX_CELLS
    assert mesh_report(drawn(sphere(), seeds, steps)).watertight


def test_seeds_that_lead_nowhere_are_refused():
    with pytest.raises(ReconstructionError, match="leads to a cell"):
        follow(sphere(), np.array([[5.0, 5.0, 5.0]]), np.array([0.1]), lambda places: np.zeros(len(places), dtype=bool))
