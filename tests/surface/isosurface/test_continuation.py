"""Continuation: the same surface as on the whole lattice, from any seed, for the price of its area."""

import numpy as np
import pytest

from mesh_fields import BLOCK_HALF, CENTRE, Analytic, block, sphere, torus, wavy_sheets
from o3dleaf import extract_isosurface, get_num_threads, mesh_report, set_num_threads
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.isosurface.crease_edges import join_creases
from o3dleaf.surface.mesh.components import connected_components
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import EdgeTable
from tolerances import ASKED_PER_CELL, BOX_INDEPENDENCE, EDGE_OF_BLOCK, ISOSURFACE_ORDER, LATTICE_EDGE, SHARPENED_ORDER


def sponge():
    """One surface with hundreds of handles and ambiguous faces: waves of three cells of 3/32; low, to end at once."""
    return Analytic(lambda x, y, z: (np.sin(20 * x + y) + np.sin(19 * y - z) + np.sin(21 * z + x) - 0.1) / 64)


def blobs():
    """Hundreds of pieces, no two in one cell of 1/16."""
    return Analytic(lambda x, y, z: (np.sin(11 * x + y) * np.sin(9 * y - z) * np.sin(10 * z + x) - 0.4) / 64)


def everywhere(field, spacing):
    """Return the surface of a field that falls outside its bounds, as it falls."""
    return extract_isosurface(field, spacing, field.bounds + np.multiply([[-1], [1]], spacing), closed=False)


def canonical(mesh):
    """Return vertices in the order of their places and triangles in the order of their vertices, least corner first."""
    vertices, triangles = mesh_arrays(mesh)
    order = np.lexsort(np.round(vertices / BOX_INDEPENDENCE).T)
    triangles = np.argsort(order)[triangles]
    turned = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    triangles = np.take_along_axis(triangles, turned, axis=1)
    return vertices[order], triangles[np.lexsort(triangles.T)]


@pytest.mark.parametrize("field", [sphere(), torus(), wavy_sheets(0.06), sponge()])
@pytest.mark.parametrize("spacing", [3 / 32, (3 / 32, 1 / 8, 5 / 64)])
def test_a_band_is_the_surface_of_the_whole_lattice(field, spacing):
    """Steps are sums of few powers of two: lattices are the same wherever they begin, and so are ties."""
    whole = everywhere(field, spacing)
    seeds = mesh_arrays(whole)[0] + 0.02
    band = extract_isosurface(field, spacing, seeds=seeds, sharpen=False, closed=False)
    expected, found = canonical(whole), canonical(band)
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=LATTICE_EDGE)
    assert np.array_equal(expected[1], found[1])


def test_a_seed_leads_to_its_piece_and_no_other():
    whole = everywhere(blobs(), 1 / 16)
    labels, areas = connected_components(whole)
    vertices, triangles = mesh_arrays(whole)
    assert len(areas) > 100
    for piece in (0, 1, 50):
        seed = vertices[triangles[labels == piece][0]].mean(axis=0)
        band = extract_isosurface(blobs(), 1 / 16, seeds=seed[None], sharpen=False, closed=False)
        assert connected_components(band)[1] == pytest.approx([areas[piece]], rel=BOX_INDEPENDENCE)


def test_vertices_lie_closer_by_two_orders_once_sharpened():
    a = np.array(CENTRE)
    cubed = Analytic(lambda x, y, z: 1 - ((x - a[0]) ** 2 + (y - a[1]) ** 2 + (z - a[2]) ** 2) ** 1.5)
    spacings, errors = np.array([0.2, 0.1, 0.05, 0.025]), []
    for spacing in spacings:
        bands = [
            extract_isosurface(cubed, spacing, seeds=[[1.0, 0.2, 0.1]], sharpen=sharpen) for sharpen in (False, True)
        ]
        errors.append([np.abs(np.linalg.norm(mesh_arrays(band)[0] - a, axis=1) - 1).max() for band in bands])
    rates = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert abs(rates[0] - 2) < ISOSURFACE_ORDER
    assert rates[1] > SHARPENED_ORDER


def test_a_sharpened_crease_stays_closed_and_on_its_edges():
    cube = Analytic(lambda x, y, z: 0.7 - np.maximum(np.maximum(np.abs(x), np.abs(y - 0.01)), np.abs(z + 0.02)))
    band = extract_isosurface(cube, 0.11, seeds=[[0.7, 0.0, 0.0]])
    report = mesh_report(band)
    assert (report.watertight, report.manifold, report.components, report.genus) == (True, True, 1, 0)
    vertices = mesh_arrays(band)[0]
    on_lines = np.abs(vertices / 0.11 - np.rint(vertices / 0.11)) < BOX_INDEPENDENCE
    assert (on_lines.sum(axis=1) >= 2).all()


@pytest.mark.parametrize("spacing", [0.1, 0.05, 0.025])
def test_features_draw_the_edges_of_a_block_that_cubes_chamfer(spacing):
    field, turn = block()
    seed = CENTRE + turn[:, 0] * BLOCK_HALF[0]
    share, signs = np.linspace(-1, 1, 200), np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    edges = [np.insert(np.repeat(signs, 200, axis=0), axis, np.tile(share, 4), axis=1) for axis in range(3)]
    edges = CENTRE + (np.concatenate(edges) * BLOCK_HALF) @ turn.T
    off, lost = [], []
    for features in (False, True):
        report = mesh_report(band := extract_isosurface(field, spacing, seeds=seed[None], features=features))
        assert (report.watertight, report.manifold, report.components, report.genus) == (True, True, 1, 0)
        assert report.self_intersections == 0
        off.append(distance_to_mesh(*mesh_arrays(band), edges).max() / spacing)
        lost.append(abs(report.volume / (8 * BLOCK_HALF.prod()) - 1))
    assert off[0] > 3 * EDGE_OF_BLOCK
    assert off[1] < EDGE_OF_BLOCK
    assert lost[1] < lost[0] / 4


def test_features_leave_a_smooth_surface_as_it_is():
    plain, with_features = (
        extract_isosurface(torus(), 0.02, seeds=[[1.1, 0.0, 0.0]], features=each) for each in (False, True)
    )
    for one, other in zip(mesh_arrays(plain), mesh_arrays(with_features), strict=True):
        assert np.array_equal(one, other)


def test_creases_everywhere_leave_every_edge_two_triangles():
    """Cells of nearly a wave's length, where the normals of most disagree; once the band ends in them."""
    for within in (None, 0.7):
        report = mesh_report(extract_isosurface(sponge(), 0.11, seeds=[[0.1, 0.2, 0.0]], within=within, features=True))
        assert report.manifold
        assert report.oriented
        assert (report.boundary_edges == 0) == (within is None)


def test_fans_that_meet_twice_are_joined_once():
    """About 6 the loop 0 1 2 3, about 7 the loop 1 0 4 3 2 5: the edges 0 1 and 2 3 separate both."""
    loops = ((6, (0, 1, 2, 3)), (7, (1, 0, 4, 3, 2, 5)))
    fans = np.array([(loop[n], loop[(n + 1) % len(loop)], hub) for hub, loop in loops for n in range(len(loop))])
    before, after = EdgeTable.of(fans), EdgeTable.of(join_creases(fans, 6))
    assert sorted(after.count) == sorted(before.count)
    assert not after.inconsistent.any()
    assert [6, 7] in after.ends.tolist()


def test_a_band_does_not_depend_on_seeds_or_threads():
    rng, threads = np.random.default_rng(3), get_num_threads()
    cloud = rng.normal(size=(2000, 3))
    cloud /= np.linalg.norm(cloud, axis=1)[:, None]
    expected = mesh_arrays(extract_isosurface(sphere(), 0.02, seeds=cloud))
    try:
        for count, seeds in ((1, cloud[::-1]), (2, cloud[:1]), (3, 1.3 * cloud[:7])):
            set_num_threads(count)
            found = mesh_arrays(extract_isosurface(sphere(), 0.02, seeds=seeds))
            assert all(np.array_equal(one, other) for one, other in zip(expected, found, strict=True))
    finally:
        set_num_threads(threads)


def test_the_field_is_asked_at_two_layers_of_points_and_at_the_vertices():
    asked = []
    ball = sphere()
    counting = Analytic(lambda x, y, z: (asked.append(x.size), ball.function(x, y, z))[1])
    vertices, _ = mesh_arrays(extract_isosurface(counting, 0.02, seeds=[[1.0, 0.0, 0.0]], sharpen=False))
    cells = len(vertices)
    assert sum(asked) < ASKED_PER_CELL * cells
    before = sum(asked)
    extract_isosurface(counting, 0.02, seeds=[[1.0, 0.0, 0.0]])
    assert sum(asked) == 2 * before + len(vertices)


@pytest.mark.parametrize("within", [0.5, lambda centres: np.linalg.norm(centres - [1.0, 0, 0], axis=1) <= 0.5])
def test_a_band_ends_open_where_it_may_not_go(within):
    band = extract_isosurface(sphere(), 0.04, seeds=[[1.0, 0.0, 0.0]], within=within, sharpen=False)
    report = mesh_report(band)
    assert (report.components, report.boundary_loops, report.genus, report.manifold) == (1, 1, 0, True)
    distance = np.linalg.norm(mesh_arrays(band)[0] - [1.0, 0, 0], axis=1)
    assert 0.5 - 0.04 * np.sqrt(3) < distance.max() < 0.5 + 0.04 * np.sqrt(3)
    whole = {tuple(row) for row in np.rint(mesh_arrays(extract_isosurface(sphere(), 0.04))[0] / 1e-8).astype(int)}
    assert {tuple(row) for row in np.rint(mesh_arrays(band)[0] / 1e-8).astype(int)} < whole


def test_a_band_that_ends_in_single_cells_is_manifold():
    """Of each five cells along any axis one is not allowed: others touch along an edge alone."""

    def within(centres):
        return np.rint(centres / 0.04 - 0.5).astype(int) @ [1, 2, 3] % 5 > 0

    report = mesh_report(extract_isosurface(sphere(), 0.04, seeds=[[1.0, 0.0, 0.0]], within=within))
    assert report.manifold
    assert report.boundary_loops > 100


def test_a_band_that_cannot_be_says_why():
    with pytest.raises(ReconstructionError, match="none of 1 leads to a cell"):
        extract_isosurface(sphere(), 0.1, seeds=[[1.0, 0.0, 0.0]], isovalue=5.0)
    with pytest.raises(InputError, match="coarsen it or crop the cloud"):
        extract_isosurface(sphere(), 1e-6, seeds=[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    with pytest.raises(InputError, match="within: is"):
        extract_isosurface(sphere(), 0.1, seeds=[[1.0, 0.0, 0.0]], within=lambda centres: np.ones(3))
    with pytest.raises(InputError, match="seeds"):
        extract_isosurface(sphere(), 0.1, seeds=[[np.nan, 0.0, 0.0]])
    with pytest.raises(InputError, match="give seeds"):
        extract_isosurface(sphere(), 0.1, within=0.5)
    with pytest.raises(InputError, match="give seeds"):
        extract_isosurface(sphere(), 0.1, features=True)
    for whole in ({"bounds": [[-1.0, -1, -1], [1, 1, 1]]}, {"method": "tetrahedra"}):
        with pytest.raises(InputError, match="whole lattice"):
            extract_isosurface(sphere(), 0.1, seeds=[[1.0, 0.0, 0.0]], **whole)


@pytest.mark.parametrize("how", [{}, {"seeds": [[1.0, 0.0, 0.0]]}, {"seeds": [[1.0, 0.0, 0.0]], "features": True}])
def test_progress_runs_to_its_end(how):
    heard = []
    with progress.listening(lambda done, total: heard.append(done / total)):
        extract_isosurface(sphere(), 0.02, **how)
        assert heard[-1] == 1
    assert heard == sorted(heard)
    assert len(heard) > 3
    assert any(0.2 < share < 0.8 for share in heard)
