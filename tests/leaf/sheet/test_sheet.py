"""Theorems of the open sheet: a disc with holes through any scan of a leaf, and what is none named with its place."""

import re
from collections.abc import Callable

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import Delaunay, cKDTree

from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.leaf.sheet.average import average_across, thin
from o3dleaf.leaf.sheet.averaged_sheets import _thickness
from o3dleaf.leaf.sheet.gluing import glue_sheets
from o3dleaf.leaf.sheet.hole_loops import triangulate_hole
from o3dleaf.leaf.sheet.holes import cut_off_flaps, fill_small_holes
from o3dleaf.leaf.sheet.open_sheets import OpenSheets, unit_normals
from o3dleaf.leaf.sheet.sheet import OpenSheet, find_sheet
from o3dleaf.leaf.sheet.stars import triangulate
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import EdgeTable, fans_per_vertex, find_holes, label_fans, label_triangles
from tolerances import OPEN_SHEET_AREA, OPEN_SHEET_NEAR, ROUNDING, SPARSE_PART

STEP = 0.6
Shape = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def strip(seed: int, length: float, width: float, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """Return places at random on a strip, 1/step² of them on each unit of area."""
    rng = np.random.default_rng(seed)
    count = int(length * width / step**2)
    return length * rng.random(count), width * (rng.random(count) - 0.5)


def flat(t, v):
    """Return a gently waved blade, and its normals."""
    return np.column_stack([t, v, 4 * np.sin(t / 25)]), unit([-4 / 25 * np.cos(t / 25), 0 * t, 1 + 0 * t])


def twisted(t, v):
    """Return a blade turned by 180° over 100, and its normals."""
    a = np.pi * t / 100
    return np.column_stack([t, v * np.cos(a), v * np.sin(a)]), unit([0 * t, -np.sin(a), np.cos(a)])


def curled(t, v):
    """Return a blade whose margins, at v = ±12, have turned by 110°, and its normals."""
    a = np.radians(110) / 12 * v
    r = 12 / np.radians(110)
    return np.column_stack([t, r * np.sin(a), r * (1 - np.cos(a))]), unit([0 * t, -np.sin(a), np.cos(a)])


def unit(parts):
    rows = np.column_stack(parts)
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def scan(shape: Shape, seed: int, length: float, width: float, noise: float = 0.0) -> np.ndarray:
    """Return points of a shape with noise along its normals, in spacings."""
    t, v = strip(seed, length, width)
    points, normals = shape(t, v)
    return points + noise * STEP * np.random.default_rng(seed + 1).standard_normal((len(t), 1)) * normals


def euler(triangles: np.ndarray) -> int:
    edges = EdgeTable.of(triangles)
    return len(np.unique(triangles)) - len(edges.ends) + len(triangles)


def rims(vertices: np.ndarray, triangles: np.ndarray) -> int:
    return len(find_holes(vertices, triangles).perimeter)


def assert_open_sheet(vertices, triangles) -> None:
    """A connected, oriented manifold of genus 0 with a rim, of which every vertex is used."""
    edges = EdgeTable.of(triangles)
    assert edges.count.max() <= 2
    assert not edges.inconsistent.any()
    assert (fans_per_vertex(triangles, label_fans(triangles), len(vertices)) == 1).all()
    assert label_triangles(triangles).max() == 0
    assert euler(triangles) == 2 - rims(vertices, triangles) < 2


@pytest.mark.few(shape=2, noise=2)
@pytest.mark.parametrize("noise", [0.0, 0.2, 0.5])
@pytest.mark.parametrize(("shape", "width"), [(flat, 20.0), (twisted, 16.0), (curled, 24.0)])
def test_a_blade_is_a_disc_that_holds_all_points_and_their_area(shape, width, noise):
    points = scan(shape, 3, 40.0, width, noise)
    sheet = find_sheet(points)
    assert_open_sheet(sheet.vertices, sheet.triangles)
    assert rims(sheet.vertices, sheet.triangles) == 1
    assert len(sheet.rows) == len(points)
    assert distance_to_mesh(sheet.vertices, sheet.triangles, points).max() < (OPEN_SHEET_NEAR + 5 * noise) * STEP
    half = 0.5 * sheet.spacing * 2 * (40 + width)  # what the outermost random points leave of a margin
    area = triangle_areas(sheet.vertices, sheet.triangles).sum()
    truth = len(points) * STEP**2
    assert truth - 2 * half < area + half < (1 + OPEN_SHEET_AREA) * truth + half


def test_a_hole_of_ten_spacings_stays_and_a_gap_does_not():
    points = scan(flat, 4, 60.0, 20.0)
    far = np.linalg.norm(points[:, :2] - [30, 0], axis=1)
    assert rims(*_mesh(find_sheet(points[far > 5 * STEP]))) == 2
    assert rims(*_mesh(find_sheet(points[far > 1.5 * STEP]))) == 1


def _mesh(sheet: OpenSheet):
    return sheet.vertices, sheet.triangles


def test_passes_that_disagree_become_one_sheet_or_are_refused_with_the_place():
    one, other = scan(flat, 5, 60.0, 20.0, 0.1), scan(flat, 15, 60.0, 20.0, 0.1) + [0, 0, 1.0]
    other = other[other[:, 0] > 30]
    sheet = find_sheet(np.concatenate([one, other]))
    assert_open_sheet(*_mesh(sheet))
    assert triangle_areas(*_mesh(sheet)).sum() == pytest.approx(60 * 20, rel=0.05)
    assert len(sheet.rows) > 0.99 * len(one) + 0.99 * len(other)
    assert sheet.scale > 0.5
    told = [note for note in sheet.notes if "two layers" in note]
    assert float(re.search(r"two layers ([\d.]+) apart", told[0])[1]) == pytest.approx(1.0, abs=0.1)
    with pytest.raises(ReconstructionError, match="another layer lies") as refusal:
        find_sheet(np.concatenate([one, other]), one_sheet=False)
    x, y, _ = _place(str(refusal.value), "around")
    assert 30 < x < 60
    assert abs(y) < 10
    assert find_sheet(one, one_sheet=False).scale == 0


def _place(text: str, after: str) -> tuple[float, ...]:
    found = re.search(after + r" (-?[\d.e-]+) (-?[\d.e-]+) (-?[\d.e-]+)", text)
    assert found, text
    return tuple(float(x) for x in found.groups())


def test_pieces_are_told_by_number_size_and_place_and_taken_by_number():
    large, small = scan(flat, 6, 60.0, 20.0), scan(flat, 7, 20.0, 10.0) + [5, 40, 0]
    points = np.concatenate([small, large])
    sheet = find_sheet(points)
    assert (sheet.rows >= len(small)).all()
    told = sheet.leftovers.tell()
    assert "2 pieces" in told[-2]
    assert f"{len(small):,} points" in told[-1]
    assert np.linalg.norm(np.array(_place(told[-1], "at")) - np.median(small, axis=0)) < 3
    second = find_sheet(points, piece=2)
    assert second.rows.max() < len(small)
    assert not len(sheet.others)
    with pytest.raises(ReconstructionError, match="has 2: "):
        find_sheet(points, piece=3)
    with pytest.raises(InputError, match="count pieces from 1"):
        find_sheet(points, piece=0)


@pytest.mark.slow
def test_a_point_belongs_to_the_nearest_piece_whether_that_holds_it_or_not():
    large, small = scan(flat, 6, 60.0, 20.0), scan(flat, 7, 20.0, 10.0) + [5, 40, 0]
    few = np.random.default_rng(8).normal(0, 0.1, (10, 3))
    points = np.concatenate([small, large, few + [15, 20, 0], few + [15, 28, 0]])
    of_small = np.r_[0 : len(small), len(points) - len(few) : len(points)]
    assert np.array_equal(find_sheet(points, piece=1).others, of_small)
    assert np.array_equal(find_sheet(points, piece=2).others, np.setdiff1d(np.arange(len(points)), of_small))


def test_where_the_largest_piece_has_no_sheet_its_points_are_another_pieces():
    rng = np.random.default_rng(9)
    ball, leaf = unit(rng.normal(size=(3, 2000))) * 8, scan(flat, 7, 20.0, 10.0) + [30, 0, 0]
    assert np.array_equal(find_sheet(np.concatenate([ball, leaf]), piece=2).others, np.arange(len(ball)))


def test_what_a_sheet_holds_after_all_is_not_told_as_left_out():
    large, few, piece = scan(flat, 6, 60.0, 20.0), scan(flat, 7, 3.0, 3.0)[:20], scan(flat, 7, 20.0, 10.0) + [5, 40, 0]
    sheet = find_sheet(np.concatenate([large, few + [66, 0, 4 * np.sin(60 / 25)], piece]))
    rows = len(large) + np.arange(len(few))
    assert np.array_equal(np.sort(sheet.leftovers.beyond(12.0)), rows)
    assert len(sheet.leftovers.beyond(8.0)) == 0
    rest = sheet.leftovers.without(rows)
    assert [len(group) for group in rest.groups] == [len(piece)]
    assert np.array_equal(rest.held, np.sort(np.append(sheet.rows, rows)))
    assert len(rest.tell()) == len(sheet.leftovers.tell()) - 1


def test_a_line_where_three_sheets_meet_is_told():
    points = scan(flat, 8, 60.0, 20.0, 0.2)
    t, v = strip(9, 30.0, 12.0)
    wall = np.column_stack([15 + t, 0 * t + 2, 4 * np.sin((15 + t) / 25) + v + 6.3])
    sheet = find_sheet(np.concatenate([points, wall]))
    assert_open_sheet(*_mesh(sheet))
    meeting = [note for note in sheet.leftovers.tell() if "3 sheets meet" in note]
    assert meeting
    x, y, _ = _place(meeting[0], "at")
    assert 14 < x < 46
    assert abs(y - 2) < 3 * STEP


def test_what_is_no_open_sheet_is_refused_with_its_place():
    rng = np.random.default_rng(0)
    ball = rng.standard_normal((3000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    with pytest.raises(ReconstructionError, match=r"close around a volume at [\d.-]+ [\d.-]+ [\d.-]+"):
        find_sheet(ball)
    with pytest.raises(ReconstructionError, match=r"points at [\d.-]+ [\d.-]+ [\d.-]+ show no surface"):
        find_sheet(rng.random((2000, 3)))


@pytest.mark.slow
def test_beside_what_is_no_sheet_the_leaf_is_named_and_can_be_taken():
    points = scan(flat, 3, 30.0, 10.0, 0.0)
    rng = np.random.default_rng(0)
    pot = rng.standard_normal((2000, 3))
    pot = np.array([15.0, 0.0, -25.0]) + 8 * pot / np.linalg.norm(pot, axis=1, keepdims=True)
    whole = np.concatenate([pot, points])
    with pytest.raises(
        ReconstructionError, match=r"close around a volume .*; the scan's pieces are 2: 1: 2,000 points"
    ):
        find_sheet(whole)
    leaf = find_sheet(whole, piece=2)
    assert_open_sheet(*_mesh(leaf))
    assert leaf.rows.min() >= len(pot)
    assert len(leaf.rows) > 0.98 * len(points)
    with pytest.raises(ReconstructionError, match="close around a volume"):
        find_sheet(whole, piece=1)
    with pytest.raises(ReconstructionError, match="piece: is 3, but the scan has 2"):
        find_sheet(whole, piece=3)


def test_a_sheet_does_not_depend_on_unit_place_or_threads():
    points = scan(twisted, 10, 40.0, 12.0, 0.2)
    sheet, threads = find_sheet(points), get_num_threads()
    try:
        set_num_threads(1)
        again = find_sheet(points)
    finally:
        set_num_threads(threads)
    assert np.array_equal(sheet.vertices, again.vertices)
    assert np.array_equal(sheet.triangles, again.triangles)
    scaled = find_sheet(points * 2.0**-10)
    assert np.array_equal(sheet.triangles, scaled.triangles)
    assert np.array_equal(sheet.vertices * 2.0**-10, scaled.vertices)


@pytest.mark.slow
def test_more_points_than_a_chart_needs_are_thinned_and_all_of_them_told():
    t, v = strip(11, 40.0, 15.0, 0.15)
    sheet = find_sheet(flat(t, v)[0])
    assert len(sheet.vertices) <= 20_000 < len(sheet.rows) == len(t)
    assert sheet.spacing == pytest.approx(0.15, rel=0.1)


def torus(rings: int, around: int):
    """Return a closed mesh of genus 1."""
    i, j = (part.ravel() for part in np.meshgrid(np.arange(rings), np.arange(around), indexing="ij"))
    at = lambda a, b: (a % rings) * around + b % around  # noqa: E731
    one = np.column_stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)])
    triangles = np.concatenate([one, np.column_stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)])])
    a, b = 2 * np.pi * i / rings, 2 * np.pi * j / around
    return np.column_stack([(3 + np.cos(b)) * np.cos(a), (3 + np.cos(b)) * np.sin(a), np.sin(b)]), triangles


def glued(vertices, triangles, quality=None):
    """Return the glued mesh, its vertices as corners came apart, and the edges cut."""
    quality = np.zeros(len(triangles)) if quality is None else quality
    mesh, source, cut = glue_sheets(triangles, unit_normals(vertices, triangles), quality)
    return vertices[source], mesh, cut


def test_a_torus_is_cut_once_around_where_it_is_worst_and_a_sphere_is_not():
    vertices, triangles = torus(24, 12)
    worst = np.tile(np.arange(24 * 12) < 12, 2)
    mirrored = np.where((np.arange(len(triangles)) % 3 == 0)[:, np.newaxis], triangles[:, ::-1], triangles)
    mesh = glued(vertices, mirrored, 1.0 * worst)
    assert euler(mesh[1]) == 2 - rims(*mesh[:2]) == 0
    cuts = vertices[mirrored.ravel()[mesh[2]]].mean(axis=1)
    assert len(cuts) >= 12
    assert (np.abs(np.arctan2(cuts[:, 1], cuts[:, 0])) < 2.5 * 2 * np.pi / 24).all()
    assert_open_sheet(*mesh[:2])
    fold = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    _, closed, cut = glued(corners, fold)
    assert len(cut) == 0
    assert euler(closed) == 2


def test_a_moebius_strip_is_cut_across():
    turns, width = 40, 4
    i, j = (part.ravel() for part in np.meshgrid(np.arange(turns), np.arange(width), indexing="ij"))

    def at(a, b):
        return np.where(a == turns, width - b, a * (width + 1) + b)

    one = np.column_stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)])
    triangles = np.concatenate([one, np.column_stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)])])
    a, v = (
        part.ravel()
        for part in np.meshgrid(np.arange(turns) / turns, np.arange(width + 1) / width - 0.5, indexing="ij")
    )
    r = 2 + v * np.cos(np.pi * a)
    points = np.column_stack([r * np.cos(2 * np.pi * a), r * np.sin(2 * np.pi * a), v * np.sin(np.pi * a)])
    vertices, mesh, cut = glued(points, triangles)
    assert len(cut) >= width
    assert_open_sheet(vertices, mesh)


def test_stars_of_a_plane_are_its_delaunay_triangles():
    rng = np.random.default_rng(2)
    places = rng.random((800, 2))
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    points = np.column_stack([places, np.zeros(800)]) @ turn.T
    reach = 0.12
    triangles, votes, radius = triangulate(points, np.tile(turn[:, 2], (800, 1)), np.full(800, reach))
    truth = np.sort(Delaunay(places).simplices, axis=1)
    a, b, c = (places[truth[:, k]] for k in range(3))
    sides = [np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))]
    across = np.abs(np.cross(np.pad(b - a, ((0, 0), (0, 1))), np.pad(c - a, ((0, 0), (0, 1))))[:, 2])
    circumradius = np.prod(sides, axis=0) / (2 * across)
    expected = {tuple(t): r for t, r in zip(truth.tolist(), circumradius, strict=True) if r <= reach}
    assert {tuple(t) for t in triangles.tolist()} == set(expected)
    assert (votes == 3).all()
    assert radius == pytest.approx([expected[tuple(t)] for t in triangles.tolist()], rel=1e-9)


def test_averaging_leaves_a_plane_and_moves_no_point_along_it():
    rng = np.random.default_rng(3)
    plane = np.column_stack([10 * rng.random((2000, 2)), np.zeros(2000)])
    noisy = plane + np.column_stack([np.zeros((2000, 2)), 0.1 * rng.standard_normal(2000)])
    still, normals = average_across(plane, np.full(2000, 0.5), 0.5)
    assert np.abs(still - plane).max() < ROUNDING * 10
    assert np.abs(normals[:, 2]) == pytest.approx(1)
    moved, _ = average_across(noisy, np.full(2000, 0.5), 0.5)
    assert np.std(moved[:, 2]) < 0.4 * np.std(noisy[:, 2])
    assert np.array_equal(average_across(noisy, np.zeros(2000), 0.5)[0], noisy)


def test_two_points_beside_a_sheet_have_its_plane():
    rng = np.random.default_rng(5)
    plane = np.column_stack([10 * rng.random((2000, 2)), np.zeros(2000)])
    beside = np.array([[12.0, 5.0, 0.1], [12.5, 5.0, 0.3]])
    _, normals = average_across(np.concatenate([plane, beside]), np.zeros(2002), 0.5)
    assert np.abs(normals[:, 2]) == pytest.approx(1)


def test_thinned_points_are_apart_and_cover_the_others():
    points = np.random.default_rng(4).random((3000, 3)) * [1, 1, 0.1]
    rows = thin(points, np.full(3000, 0.05))
    assert cKDTree(points[rows]).query(points[rows], k=2)[0][:, 1].min() >= 0.05
    assert cKDTree(points[rows]).query(points)[0].max() < 0.05


def test_a_hole_is_filled_with_the_least_area():
    angle = 2 * np.pi * np.arange(9) / 9
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(9)])
    made = np.empty((7, 3), np.int64)
    assert triangulate_hole(ring, np.zeros((9, 9), bool), made)
    assert triangle_areas(ring, made).sum() == pytest.approx(9 / 2 * np.sin(2 * np.pi / 9))
    edges = EdgeTable.of(made)
    assert (edges.count == 1).sum() == 9
    known = np.ones((9, 9), bool)
    assert not triangulate_hole(ring, known, made)


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a square sheet of 2 n² triangles."""
    i, j = (part.ravel() for part in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    one = np.column_stack([i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1])
    triangles = np.concatenate([one, np.column_stack([one[:, 0], one[:, 2], i * (n + 1) + j + 1])])
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), triangles


def test_small_holes_are_closed_also_where_they_touch_and_large_ones_stay():
    vertices, triangles = grid(12)
    middle = vertices[triangles].mean(axis=1)
    touching = (np.abs(middle[:, :2] - [3.5, 3.5]).max(axis=1) < 0.5) | (
        np.abs(middle[:, :2] - [4.5, 4.5]).max(axis=1) < 0.5
    )
    large = np.abs(middle[:, :2] - [8, 8]).max(axis=1) < 2
    kept = triangles[~touching & ~large]
    fans = label_fans(kept)
    source = np.empty(fans.max() + 1, np.int64)
    source[fans.ravel()] = kept.ravel()
    closed = fill_small_holes(vertices[source], fans, 6.0)
    assert_open_sheet(*closed)
    assert rims(*closed) == 2
    assert triangle_areas(*closed).sum() == pytest.approx(144 - 16)
    assert rims(*fill_small_holes(vertices[source], fans, 20.0)) == 1


def test_of_two_layers_the_one_that_hangs_on_a_rim_is_cut_off():
    vertices, triangles = grid(10)
    flap, over = grid(3)
    shared = {int(k): int(4 * 11 + 4 + j) for j, k in enumerate(range(4))}
    rest = [k for k in range(len(flap)) if k not in shared]
    number = {k: len(vertices) + n for n, k in enumerate(rest)} | shared
    points = np.concatenate([vertices, flap[rest] + [4, 4, 0.5]])
    triangles = triangles[~np.isin(triangles, [4 * 11 + 5, 4 * 11 + 6]).all(axis=1)]
    below = [k for k in range(len(triangles)) if {4 * 11 + 4, 4 * 11 + 5} <= set(triangles[k].tolist())][:1]
    hung = np.concatenate([np.delete(triangles, below, axis=0), np.vectorize(number.get)(over)])
    partner = np.full(len(points), -1)
    partner[len(vertices) :] = [int(x) * 11 + int(y) for x, y in points[len(vertices) :, :2]]
    partner[partner[len(vertices) :]] = np.arange(len(vertices), len(points))
    _, left, gone = cut_off_flaps(points, hung, partner)
    assert np.allclose(gone[:, 2], 0.5)
    assert len(gone) == len(rest)
    assert len(left)


@pytest.mark.few(scan=1)
@pytest.mark.parametrize(
    ("scan", "held"),
    [
        ("leaves/rice_noisy.ply", 0.995),
        ("leaves/soybean_with_normals.ply", 0.99),
        ("leaves/tomato_leaflet_two_layers.ply", 0.93),
        ("wheat/wheat_leaf.ply", 0.995),
    ],
)
def test_a_real_leaf_is_one_open_sheet_that_holds_its_points(scan, held, real_scan):
    points = np.asarray(o3d.io.read_point_cloud(str(real_scan(scan))).points)
    sheet = find_sheet(points)
    assert_open_sheet(*_mesh(sheet))
    assert len(sheet.rows) > held * len(points)
    assert rims(*_mesh(sheet)) <= 3


def rounded_slab(length, width, radius, rng):
    """Points two a unit of area, at a distance from a rectangle: a slab with round edges, a capsule without width."""
    sides = np.array([2 * length * width, 2 * np.pi * radius * (length + width), 4 * np.pi * radius**2])
    around = rng.normal(size=(round(2 * sides.sum()), 3))
    kind = rng.choice(3, len(around), p=sides / sides.sum())
    lengthwise = rng.random(len(around)) * (length + width) < length
    around[kind == 0, :2] = 0
    around[(kind == 1) & lengthwise, 0] = 0
    around[(kind == 1) & ~lengthwise, 1] = 0
    around *= radius / np.linalg.norm(around, axis=1, keepdims=True)
    half, inner = np.array([length, width]) / 2, rng.uniform(-0.5, 0.5, (len(around), 2)) * [length, width]
    inner = np.where(around[:, :2] == 0, inner, np.sign(around[:, :2]) * half)
    return around + np.column_stack([inner, np.zeros(len(around))])


@pytest.mark.parametrize(("width", "radius", "is_flat"), [(12.0, 2.0, True), (0.0, 4.0, False)])
def test_the_sides_of_a_closed_sheet_are_those_of_a_thin_leaf_if_it_is_flat(width, radius, is_flat):
    points = rounded_slab(20.0, width, radius, np.random.default_rng(0))
    sheets = OpenSheets.of(points, np.zeros(len(points)), np.sqrt(0.5))
    assert sheets.is_closed
    thickness = _thickness(sheets)
    assert thickness == pytest.approx(2 * radius, rel=0.1) if is_flat else np.isinf(thickness)


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_sheet_goes_on_where_points_are_much_farther_apart(seed):
    rng, spacing, radius, sparser = np.random.default_rng(seed), 0.5, 8.0, 2.5
    plane = rng.uniform(-15, 15, (round(900 / spacing**2), 2))
    kept = (np.hypot(*plane.T) > radius) | (rng.random(len(plane)) < 1 / sparser**2)
    points = np.column_stack([plane[kept], rng.normal(0, 0.1 * spacing, kept.sum())])
    sheet = find_sheet(points)
    flat = sheet.vertices[sheet.triangles][:, :, :2]
    inside = np.hypot(*flat.mean(axis=1).T) < radius - 2 * spacing
    area = triangle_areas(sheet.vertices, sheet.triangles)[inside].sum()
    assert area == pytest.approx(np.pi * (radius - 2 * spacing) ** 2, rel=SPARSE_PART)
