"""Cleaning twice is cleaning once, makes nothing worse, moves nothing farther than it says; simplifying keeps lines."""

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay, cKDTree

from mesh_fields import sphere, wavy_sheets
from o3dleaf import LabelledMesh, clean_mesh, extract_isosurface, mesh_report, simplify_mesh, surface_distance
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays, triangle_areas
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.repair.clean import FOLD_ANGLE, Cleaning
from o3dleaf.surface.repair.editable_mesh import EditableMesh
from o3dleaf.surface.repair.flips import folded_edges
from o3dleaf.surface.repair.repairs import weld
from tolerances import MERGED, SINGLE_PRECISION_DISTANCE

NEVER = ("nonmanifold_edges", "nonmanifold_vertices", "degenerate_triangles", "duplicate_triangles")
NOT_MORE = (*NEVER, "inconsistent_edges", "self_intersections", "folded")


@pytest.fixture(scope="module")
def ball():
    return mesh_arrays(o3d.geometry.TriangleMesh.create_icosahedron(1.0).subdivide_loop(2))


def figures(vertices, triangles, angle=FOLD_ANGLE):
    """Return every figure of a mesh that counts defects."""
    folded = folded_edges(vertices, EdgeTable.of(triangles), angle)
    return mesh_report((vertices, triangles)).to_dict() | {"folded": int(folded.sum())}


def soup(rng):
    """Return random triangles between few points: non-manifold, crossing, flat, twice there, turned anyhow."""
    many = int(rng.integers(3, 30))
    vertices = rng.random((many, 3)) if rng.random() < 0.6 else np.round(3 * rng.random((many, 3))) / 3
    vertices[:, 2] *= rng.random() < 0.7
    return vertices, rng.integers(0, many, (int(rng.integers(1, 60)), 3))


def battered(rng, ball):
    """Return a sphere with holes, flipped and duplicated triangles, fins, and vertices torn apart a little."""
    vertices, triangles = ball
    kept = triangles[rng.random(len(triangles)) > 0.1]
    torn = rng.random(kept.shape) < 0.1
    copies = vertices[kept[torn]] + 0.01 * rng.normal(size=(torn.sum(), 3)) * (rng.random() < 0.7)
    kept[torn] = len(vertices) + np.arange(torn.sum())
    vertices = np.concatenate([vertices, copies])
    fins = np.column_stack([kept[:5, :2], rng.integers(0, len(vertices), 5)])
    return vertices, np.concatenate([kept, kept[5:9, ::-1], kept[20:25], fins])


def crumpled(rng):
    """Return a sheet with holes whose vertices are pushed about in its plane, and hardly out of it."""
    many = int(rng.integers(4, 9))
    x, y = np.meshgrid(np.arange(many), np.arange(many), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(many**2)], axis=1) / 4
    vertices += rng.normal(size=vertices.shape) * rng.choice([0.0, 0.05, 0.15]) * [1, 1, rng.choice([0.0, 0.02, 0.3])]
    a = (x[:-1, :-1] * many + y[:-1, :-1]).ravel()
    triangles = np.concatenate([[a, a + many, a + 1], [a + 1, a + many, a + many + 1]], axis=1).T
    turned = rng.random(len(triangles)) < rng.choice([0.0, 0.1])
    triangles[turned] = triangles[turned, ::-1]
    return vertices, triangles[rng.random(len(triangles)) > rng.choice([0.0, 0.1, 0.3])]


OPTIONS = st.fixed_dictionaries(
    {
        "merge": st.sampled_from([0.0, 0.0, 0.03, 0.2]),
        "smallest_component": st.sampled_from([0.0, 0.4]),
        "smallest_area": st.sampled_from([0.0, 0.1]),
        "fewest_triangles": st.sampled_from([0, 3]),
        "largest_hole": st.sampled_from([0.0, 2.0, 10.0]),
        "smallest_height": st.sampled_from([0.0, 0.01, 0.1]),
        "fold_angle": st.sampled_from([FOLD_ANGLE, 30.0]),
        "untangle": st.booleans(),
        "orient": st.sampled_from([True, True, False]),
    }
)


def hold(mesh, options):
    """Assert what cleaning promises."""
    given_, cleaned = weld(EditableMesh.of(*mesh)), Cleaning(**options).of(EditableMesh.of(*mesh))
    moved = np.linalg.norm(cleaned.vertices - np.asarray(mesh[0])[cleaned.vertex_origin], axis=1)
    assert (moved == 0).all()
    if not len(cleaned.triangles):
        return
    # A corner may be another vertex of the input than it was, but none farther away than `merge`.
    old = np.flatnonzero(np.isin(cleaned.triangle_origin, given_.triangle_origin))
    far = cKDTree(cleaned.vertices).query(mesh[0][np.unique(mesh[1][cleaned.triangle_origin[old]])])[0]
    assert far.max(initial=0.0) <= options["merge"] * (1 + MERGED)
    before, after = (figures(each.vertices, each.triangles, options["fold_angle"]) for each in (given_, cleaned))
    assert [name for name in NOT_MORE if after[name] > before[name]] == []
    assert [name for name in NEVER if after[name]] == []
    gone = len(np.setdiff1d(given_.triangle_origin, cleaned.triangle_origin))
    assert after["boundary_edges"] <= before["boundary_edges"] + 3 * gone
    again = Cleaning(**options).of(EditableMesh.of(cleaned.vertices, cleaned.triangles))
    assert again.vertices.tobytes() == cleaned.vertices.tobytes()
    assert np.array_equal(again.triangles, cleaned.triangles)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), options=OPTIONS)
def test_nothing_gets_worse_in_a_soup_of_triangles(seed, options):
    hold(soup(np.random.default_rng(seed)), options)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), options=OPTIONS)
def test_nothing_gets_worse_on_a_crumpled_sheet(seed, options):
    hold(crumpled(np.random.default_rng(seed)), options)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), options=OPTIONS)
def test_nothing_gets_worse_on_a_battered_sphere(ball, seed, options):
    hold(battered(np.random.default_rng(seed), ball), options)


def test_tears_up_to_the_tolerance_are_sewn_up(ball):
    vertices, triangles = ball
    rng = np.random.default_rng(0)
    apart = vertices[triangles].reshape(-1, 3) + 1e-4 * rng.uniform(-1, 1, (triangles.size, 3))
    torn = apart, np.arange(triangles.size).reshape(-1, 3)
    sewn = clean_mesh(torn, merge=4e-4)
    report = mesh_report(sewn)
    assert (report.watertight, report.triangles, report.vertices) == (True, len(triangles), len(vertices))
    assert mesh_report(clean_mesh(torn, merge=1e-7)).components == len(triangles)


def test_a_merge_that_would_break_the_mesh_is_left_out():
    """Two hexagons 0.01 apart, cut up in two ways: joined along their rims, they would be folded onto each other."""
    ring = np.array([[np.cos(t), np.sin(t), 0] for t in np.arange(6) * np.pi / 3] + [[0, 0, 0]])
    hub, fan = [[k, (k + 1) % 6, 6] for k in range(6)], [[0, k + 1, k] for k in range(1, 5)]
    both = np.concatenate([ring, ring[:6] + [0, 0, 0.01]]), np.concatenate([hub, np.array(fan) + 7])
    report = mesh_report(clean_mesh(both, merge=0.02))
    assert (report.triangles, report.components, report.manifold) == (10, 2, True)
    both[0][6] = 0, 0, -1
    assert mesh_report(clean_mesh(both, merge=0.02)).components == 1


def test_a_merge_left_out_leaves_the_others_in(ball):
    ring = np.array([[np.cos(t), np.sin(t), 0] for t in np.arange(6) * np.pi / 3] + [[0, 0, 0]])
    hub, fan = [[k, (k + 1) % 6, 6] for k in range(6)], np.array([[0, k + 1, k] for k in range(1, 5)])
    hexagons = np.concatenate([ring, ring[:6] + [0, 0, 0.01]]), np.concatenate([hub, fan + 7])
    apart = ball[0][ball[1]].reshape(-1, 3) + 5, np.arange(ball[1].size).reshape(-1, 3) + 13
    apart[0][::2] += 0.001
    mesh = np.concatenate([hexagons[0], apart[0]]), np.concatenate([hexagons[1], apart[1]])
    assert mesh_report(clean_mesh(mesh, merge=0.02)).components == 3


def test_no_chain_of_merges_moves_a_vertex_farther_than_it_says():
    along = np.arange(40) * 0.9
    vertices = np.concatenate([[[x, y, 0] for x in along] for y in (0, 30)])
    strip = [[k, k + 1, 40 + k] for k in range(39)] + [[k + 1, 41 + k, 40 + k] for k in range(39)]
    merged = clean_mesh((vertices, strip), merge=1.0)
    found = np.asarray(merged.vertices)
    assert cKDTree(found).query(vertices)[0].max() <= 1.0
    assert len(found) == 40
    assert cKDTree(found).query_pairs(1.0) == set()


def folded_sheet(apex):
    """Return a flat sheet of four triangles around a square, one of which has its apex at `apex`."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1, 0], apex, [1.2, -1, 0], [-0.2, -1, 0]])
    return vertices, np.array([[0, 1, 2], [1, 0, 3], [1, 3, 4], [3, 0, 5]])


@pytest.mark.parametrize("apex", [[0.5, 0.4, 0.001], [0.4, 0.3, 0.0]])
def test_a_folded_triangle_is_flipped_flat(apex):
    mesh = folded_sheet(apex)
    assert figures(*mesh)["folded"] > 0
    cleaned = mesh_arrays(clean_mesh(mesh))
    after = figures(*cleaned)
    assert (after["folded"], after["triangles"], after["manifold"], after["components"]) == (0, 4, True, 1)
    assert after["self_intersections"] == 0
    assert np.array_equal(cleaned[0], mesh[0])


def test_meshlab_unfolds_alike():
    pymeshlab = pytest.importorskip("pymeshlab")
    mesh = folded_sheet([0.5, 0.4, 0.001])
    session = pymeshlab.MeshSet(verbose=False)
    session.add_mesh(pymeshlab.Mesh(mesh[0], mesh[1].astype(np.int32)))
    session.meshing_remove_folded_faces()
    theirs = session.current_mesh().face_matrix()
    ours = mesh_arrays(clean_mesh(mesh))[1]
    assert {frozenset(t) for t in theirs.tolist()} == {frozenset(t) for t in ours.tolist()}


def test_a_vertex_on_an_edge_is_given_its_place_instead_of_a_crack(ball):
    """The flat triangle between a vertex and the edge it stands on is flipped, so that the mesh stays closed."""
    vertices, triangles = ball
    a, b, c = triangles[0]
    foot = (vertices[a] + vertices[b]) / 2
    tee = (
        np.append(vertices, [foot], axis=0),
        np.concatenate([[[a, len(vertices), c], [len(vertices), b, c], [a, b, len(vertices)]], triangles[1:]]),
    )
    assert mesh_report(tee).degenerate_triangles == 1
    report = mesh_report(clean_mesh(tee))
    assert (report.watertight, report.degenerate_triangles, report.vertices) == (True, 0, len(vertices) + 1)
    crack = tee[0], np.delete(tee[1], 2, axis=0)
    assert mesh_report(crack).holes == 1
    assert mesh_report(clean_mesh(crack, largest_hole=1.0)).watertight
    low = tee[0].copy()
    low[-1] += 0.001 * (vertices[c] - foot)
    assert mesh_report(clean_mesh((low, tee[1]))).min_angle_deg < 0.2
    assert mesh_report(clean_mesh((low, tee[1]), smallest_height=0.01)).min_angle_deg > 5
    assert mesh_report(clean_mesh((low, tee[1]), smallest_height=0.01)).watertight


def rough(seed, height):
    """Return a rough sheet of slim triangles."""
    rng = np.random.default_rng(seed)
    x, y = (side.ravel() for side in np.meshgrid(np.arange(12.0), np.arange(12.0)))
    plane = np.stack([x, y], axis=1) + rng.uniform(-0.4, 0.4, (144, 2))
    triangles = Delaunay(plane).simplices
    return np.column_stack([plane * [1.0, 0.25], height * rng.normal(size=144)]), triangles


@pytest.mark.few(seed=3)
@pytest.mark.parametrize("seed", range(8))
def test_flips_make_no_triangle_slimmer_and_no_folds(seed):
    flat, ridged = rough(seed, 0.0), rough(seed, 0.3)
    flipped = mesh_arrays(clean_mesh(flat, smallest_height=0.15, fold_angle=0.0))
    assert not np.array_equal(flipped[1], flat[1])

    def slimmest(vertices, triangles):
        sides = np.linalg.norm(vertices[triangles] - vertices[np.roll(triangles, 1, axis=1)], axis=2)
        return (2 * triangle_areas(vertices, triangles) / sides.max(axis=1) ** 2).min()

    assert slimmest(*flipped) >= slimmest(*flat) * (1 - MERGED)
    flipped = mesh_arrays(clean_mesh(ridged, smallest_height=0.2, fold_angle=60.0))
    assert not np.array_equal(flipped[1], ridged[1])
    assert figures(*flipped, 60.0)["folded"] <= figures(*ridged, 60.0)["folded"]


def border(vertices, triangles):
    """Return the vertices and edges of a border, by their places."""
    edges = EdgeTable.of(triangles)
    ends = vertices[edges.ends[edges.count == 1]]
    return {frozenset(tuple(v) for v in each) for each in ends.tolist()}


def test_cleaning_leaves_the_border_of_a_tile_as_it_is():
    """So that a tile is cleaned once and set down everywhere."""
    mesh = mesh_arrays(extract_isosurface(wavy_sheets(), 0.1, [[-1] * 3, [1] * 3]))
    cleaned = mesh_arrays(clean_mesh(mesh, smallest_height=0.02))
    before, after = mesh_report(mesh), mesh_report(cleaned)
    assert after.share_below_10deg < before.share_below_10deg
    assert after.min_angle_deg >= before.min_angle_deg
    assert border(*cleaned) == border(*mesh)
    assert np.array_equal(cleaned[0], mesh[0])
    assert surface_distance(mesh, cleaned) < 0.02


def test_crossing_triangles_go_on_request_and_their_holes_are_closed(ball):
    vertices, triangles = ball
    pulled = vertices.copy()
    pulled[triangles[0, 0]] *= -1.5
    assert mesh_report((pulled, triangles)).self_intersections > 0
    assert mesh_report(clean_mesh((pulled, triangles))).self_intersections > 0
    report = mesh_report(clean_mesh((pulled, triangles), untangle=True, largest_hole=10.0))
    assert (report.self_intersections, report.watertight, report.components) == (0, True, 1)


def test_a_fin_goes_and_what_it_stands_on_stays(ball):
    vertices, triangles = ball
    a, b = triangles[0, :2]
    tips = vertices[[a, b]] * 3
    fin = [[a, b, len(vertices)], [b, len(vertices) + 1, len(vertices)]]
    finned = np.concatenate([vertices, tips]), np.concatenate([fin, triangles])
    cleaned = clean_mesh(finned, fewest_triangles=3)
    assert np.array_equal(mesh_arrays(cleaned)[1], triangles)


@pytest.mark.parametrize("option", [{"smallest_area": 1.0}, {"fewest_triangles": 100}, {"smallest_component": 1.0}])
def test_small_pieces_go_by_area_number_or_size(ball, option):
    beside = 0.2 * ball[0] + 3, ball[1][ball[0][ball[1]][:, :, 2].min(axis=1) > 0.5]
    both = np.concatenate([ball[0], beside[0]]), np.concatenate([ball[1], beside[1] + len(ball[0])])
    assert mesh_report(both).components == 2
    cleaned = mesh_arrays(clean_mesh(both, **option))
    assert np.array_equal(cleaned[1], ball[1])


def test_a_hole_that_cannot_be_closed_leaves_the_others_to_be(ball):
    """Around a triangle that hangs by its corners alone; and one in a plane, three vertices of which are in line."""
    sheet = mesh_arrays(extract_isosurface(wavy_sheets(), 0.1, [[-1] * 3, [1] * 3]))
    pierced = sheet[0] + 5, np.delete(sheet[1], [300, 301, 302], axis=0)
    both = np.concatenate([pierced[0], ball[0]]), np.concatenate([pierced[1], ball[1][3:] + len(sheet[0])])
    cleaned = clean_mesh(both, largest_hole=5.0)
    alone = clean_mesh((ball[0], ball[1][3:]), largest_hole=5.0)
    assert len(alone.triangles) == len(ball[1]) - 3
    assert len(cleaned.triangles) == len(sheet[1]) + len(alone.triangles)


def test_colours_and_labels_stay_with_their_places(ball):
    vertices, triangles = ball
    kept = triangles[:4:-1]
    mesh = build_mesh(np.concatenate([vertices[6::-1], vertices]), kept + 7)
    mesh.vertex_colors = o3d.utility.Vector3dVector((np.asarray(mesh.vertices) + 2) / 4)
    mesh.compute_vertex_normals()
    labels = np.array([f"triangle {k}" for k in range(len(kept))])
    parts = clean_mesh(LabelledMesh(mesh, labels, ("one", "other"), "mm"), largest_hole=5.0)
    assert (parts.names, parts.unit) == (("one", "other"), "mm")
    cleaned, left = parts.mesh, parts.labels
    found = np.asarray(cleaned.vertices)
    assert np.array_equal(np.asarray(cleaned.vertex_colors), (found + 2) / 4)
    assert (np.einsum("ij,ij->i", np.asarray(cleaned.vertex_normals), found) > 0).all()
    assert len(left) == len(cleaned.triangles) == len(triangles)
    assert np.array_equal(left[: len(kept)], labels)
    beside = np.isin(kept, triangles[:5]).any(axis=1)
    assert set(left[len(kept) :]) <= set(labels[beside])
    with pytest.raises(InputError, match="one per triangle"):
        clean_mesh(LabelledMesh(mesh, labels[1:]))


def lines(mesh, labels):
    """Return the edges, as pairs of places, between triangles of two labels."""
    vertices, triangles = mesh_arrays(mesh)
    edges = EdgeTable.of(triangles)
    pair = np.flatnonzero(edges.count == 2)
    two = edges.order[edges.first(pair)[:, np.newaxis] + [0, 1]] // 3
    between = pair[labels[two[:, 0]] != labels[two[:, 1]]]
    return {frozenset(tuple(v) for v in each) for each in vertices[edges.ends[between]].tolist()}


def test_simplifying_keeps_the_lines_between_labels():
    mesh = extract_isosurface(sphere(), 0.08)
    vertices, triangles = mesh_arrays(mesh)
    middle = vertices[triangles].mean(axis=1)
    labels = np.where(middle[:, 2] > 0.3, 7, np.where(middle[:, 0] > 0, 3, -2))
    parts = simplify_mesh(LabelledMesh(mesh, labels, unit="mm"), target_triangles=len(triangles) // 3)
    assert parts.unit == "mm"
    smaller, left = parts.mesh, parts.labels
    assert len(smaller.triangles) == pytest.approx(len(triangles) / 3, abs=1)
    assert lines(smaller, left) == lines(mesh, labels)
    assert set(left) == {7, 3, -2}
    report = mesh_report(smaller)
    assert (report.watertight, report.oriented, report.components, report.genus) == (True, True, 1, 0)
    assert lines(simplify_mesh(mesh, target_triangles=len(triangles) // 3), left) != lines(mesh, labels)


@pytest.mark.few(allowed=1)
@pytest.mark.parametrize("allowed", [0.004, 0.02])
def test_simplifying_stays_within_the_deviation(allowed):
    mesh = extract_isosurface(wavy_sheets(), 0.1, [[-1] * 3, [1] * 3])
    smaller = simplify_mesh(mesh, deviation=allowed)
    assert len(smaller.triangles) < len(mesh.triangles)
    assert surface_distance(mesh, smaller) <= allowed
    fewer = simplify_mesh(mesh, target_triangles=int(0.8 * len(smaller.triangles)))
    assert surface_distance(mesh, fewer) > allowed or len(fewer.triangles) == len(smaller.triangles)
    both = simplify_mesh(mesh, deviation=allowed, target_triangles=len(smaller.triangles) + 100)
    assert len(both.triangles) == pytest.approx(len(smaller.triangles) + 100, abs=1)


def test_the_distance_of_parallel_sheets_and_of_a_hole():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    assert surface_distance(square, (square[0] + [0, 0, 0.3], square[1])) == pytest.approx(
        0.3, abs=SINGLE_PRECISION_DISTANCE
    )
    half = square[0], square[1][:1]
    assert surface_distance(square, half) == pytest.approx(np.sqrt(0.5), abs=SINGLE_PRECISION_DISTANCE)
    with pytest.raises(InputError, match="no triangles"):
        surface_distance(square, (square[0], np.empty((0, 3), dtype=int)))


def test_what_cannot_be_meant_is_refused(ball):
    for name in ("merge", "smallest_area", "fewest_triangles", "smallest_height", "fold_angle"):
        with pytest.raises(InputError, match=name):
            clean_mesh(ball, **{name: -1})
    with pytest.raises(InputError, match="give one of them"):
        simplify_mesh(ball)
    with pytest.raises(InputError, match="deviation"):
        simplify_mesh(ball, deviation=0.0)
    with pytest.raises(InputError, match="one per triangle"):
        simplify_mesh(LabelledMesh(ball, [1, 2]), target_triangles=10)
