"""Leaves that cross are told apart, at the crossing by heights where both are seen; single leaves are one."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.leaf.sheet.pieces.arms import find_arms
from o3dleaf.leaf.sheet.pieces.crossing import _part, find_crossing
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.crossing import drawn_crossing
from tolerances import CROSSING_AREA, CROSSING_WRONG, NEARER_WRONG

SAID = "cross around"


def told(sheet):
    return [note for note in sheet.notes if SAID in note]


@pytest.mark.few(number=2)
@pytest.mark.parametrize("number", [2, 18, 21, 25, 27], ids=["gap 2", "gap 0", "two densities", "gap 1", "gap 3"])
def test_two_leaves_that_cross_are_two_pieces(number):
    scan = drawn_crossing(number).scan()
    sheet = find_sheet(scan.points)
    pieces = [np.bincount(scan.leaf[rows], minlength=2) for rows in sheet.leftovers.pieces]
    assert len(pieces) == 2
    assert {int(piece.argmax()) for piece in pieces} == {0, 1}
    for piece in pieces:
        assert piece.min() <= CROSSING_WRONG * np.bincount(scan.leaf)[piece.argmin()]
    (note,) = told(sheet)
    assert note.startswith("two leaves cross")
    assert f"`piece` takes one of {sheet.leftovers.listed()}" in note


def test_where_leaves_touch_points_go_to_the_nearer_of_quadrics_through_those_around():
    scan = drawn_crossing(18).scan()
    for rows in find_sheet(scan.points).leftovers.pieces:
        piece = np.bincount(scan.leaf[rows], minlength=2)
        assert piece.min() <= NEARER_WRONG * np.bincount(scan.leaf)[piece.argmin()]


@pytest.mark.slow
def test_of_a_leaf_that_another_one_crosses_in_front_of_both_ends_are_seen():
    leaves = drawn_crossing(7)
    scan = leaves.scan()
    sheet = find_sheet(scan.points)
    (note,) = told(sheet)
    assert "where one hides the other" in note
    pieces = [np.bincount(scan.leaf[rows], minlength=2) for rows in sheet.leftovers.pieces]
    assert sorted(int(piece.argmax()) for piece in pieces) == [0, 0, 1]
    for piece in pieces:
        assert piece.min() <= CROSSING_WRONG * np.bincount(scan.leaf)[piece.argmin()]


@pytest.mark.slow
def test_points_within_the_noise_of_both_are_told_and_many_where_leaves_touch():
    """At a gap of one spacing and a noise of a fifth, one in ten or more; at two spacings none."""
    (near,), (far,) = (told(find_sheet(drawn_crossing(number).scan().points)) for number in (25, 8))
    said = near.split("nearer to, ")[1]
    assert "within the noise of both" in said
    assert float(said.split(" %")[0]) > 10
    assert "within the noise" not in far


@pytest.mark.slow
def test_each_leaf_has_its_area():
    scan = drawn_crossing(18).scan()
    for piece, leaf in ((1, 1), (2, 0)):
        blade = o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(piece=piece))
        assert blade.outline.area == pytest.approx(scan.areas[leaf], rel=CROSSING_AREA)


def lobed(lobes, depth, spacing=1.2):
    leaf = o3l.samples.leaf_shape("lobed", length=70, width=60, lobes=lobes, depth=depth)
    return find_sheet(o3l.samples.scan_leaf(leaf, seed=lobes, spacing=spacing, noise=0.2).points)


@pytest.mark.few(lobes=1, depth=1)
@pytest.mark.parametrize("lobes", [4, 5, 7])
@pytest.mark.parametrize("depth", [0.18, 0.3])
def test_lobes_no_longer_than_wide_are_those_of_one_leaf(lobes, depth):
    assert not told(lobed(lobes, depth))


@pytest.mark.slow
def test_four_long_lobes_are_told_to_show_by_their_outline_alone():
    (note,) = told(lobed(4, 0.8, spacing=0.8))
    assert note.startswith("two leaves, or lobes of one, cross around")
    assert "may be of either" in note


@pytest.mark.few(lobes=1)
@pytest.mark.parametrize("lobes", [5, 6, 7])
def test_more_lobes_than_two_leaves_have_arms_are_those_of_one_leaf(lobes):
    assert not told(lobed(lobes, 0.8))


def cross(arm, width, turn=90.0):
    """A flat mesh of two strips that cross at a square of `width` cells, with arms of `arm` cells beyond it."""
    size = 2 * arm + width
    x, y = np.meshgrid(np.arange(size + 1), np.arange(size + 1), indexing="ij")
    corner = (np.arange(size)[:, np.newaxis] * (size + 1) + np.arange(size)).astype(np.int64)
    middle = (np.arange(size) >= arm) & (np.arange(size) < arm + width)
    cells = corner[middle[:, np.newaxis] | middle]
    one = np.column_stack([cells, cells + size + 1, cells + size + 2])
    other = np.column_stack([cells, cells + size + 2, cells + 1])
    used, triangles = np.unique(np.concatenate([one, other]), return_inverse=True)
    plane = np.column_stack([x.ravel(), y.ravel()])[used] - size / 2
    angle = np.radians(turn)
    vertices = np.column_stack([plane @ [[1, 0], [np.cos(angle), np.sin(angle)]], np.zeros(len(plane))])
    return vertices, triangles.reshape(-1, 3), plane


@pytest.mark.parametrize("turn", [90.0, 60.0, 45.0])
@pytest.mark.parametrize("width", [10, 20])
def test_the_arms_of_a_cross_are_what_lies_beyond_a_square(width, turn):
    vertices, triangles, plane = cross(20, width, turn)
    arms = find_arms(vertices, triangles)
    away = np.abs(plane).max(axis=1)
    which = np.where(np.abs(plane[:, 0]) > np.abs(plane[:, 1]), np.sign(plane[:, 0]), 2 * np.sign(plane[:, 1]))
    beyond, inside = away > width / 2 + 2, away < width / 2 - 2
    assert (arms.arm[inside] == -1).all()
    names = [np.unique(arms.arm[beyond & (which == each)]) for each in (1, -1, 2, -2)]
    assert [len(name) for name in names] == [1] * 4
    one, opposite, other, last = (int(name[0]) for name in names)
    assert {one, opposite, other, last} == {0, 1, 2, 3}
    assert (one - opposite) % 4 == (other - last) % 4 == 2


@pytest.mark.parametrize("turn", [90.0, 60.0])
def test_a_cross_with_short_arms_is_none(turn):
    """Arms of which the rim is one width and two fifths of one long."""
    assert find_arms(*cross(4, 20, turn)[:2]) is None


@pytest.mark.parametrize(("bend", "is_one_leaf"), [(25.0, True), (50.0, False)])
def test_a_margin_goes_on_behind_a_corner_as_straight_as_contours_do(bend, is_one_leaf):
    """Both arms of a strip turned outside the square, by one angle to one side."""
    vertices, triangles, plane = cross(20, 10)
    beyond = np.maximum(np.abs(plane[:, 1]) - 5, 0)
    vertices[:, 0] += np.tan(np.radians(bend)) * beyond
    assert (find_arms(vertices, triangles) is not None) == is_one_leaf


@pytest.mark.parametrize(("gap", "is_sure"), [(0.5, False), (1.5, True)])
def test_where_one_leaf_hides_the_other_surfaces_a_spacing_apart_are_two(gap, is_sure):
    """One strip at height 0, the other `gap` spacings above it, at the square the lower one's points alone."""
    _, _, plane = cross(20, 10)
    across = np.abs(plane).argmax(axis=1)
    arm = np.where(np.abs(plane).max(axis=1) <= 5, -1, across + 2 * (plane[np.arange(len(plane)), across] > 0))
    points = np.column_stack([plane, gap * (arm % 2 == 1) * (arm >= 0)])
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    free = np.flatnonzero(arm < 0)
    assert _part(points, normals, arm, free, 1.0, 0.0, is_double=False).is_sure == is_sure


def test_a_strip_has_no_arms():
    vertices, triangles, plane = cross(20, 10)
    strip = triangles[(np.abs(plane[triangles, 1]) <= 5).all(axis=1)]
    used, rows = np.unique(strip, return_inverse=True)
    assert find_arms(vertices[used], rows.reshape(-1, 3)) is None


@pytest.mark.parametrize("height", [2.0, 4.0])
def test_arms_that_do_not_tell_how_a_leaf_goes_on_are_not_those_of_a_hidden_one(height):
    """A wavy leaf with four lobes: the cubic through two of them is off it between them, and so is it off a quadric."""
    vertices, triangles, _ = cross(12, 16)
    vertices[:, 2] = height * np.sin(vertices[:, 0] / 5 + 0.8)
    points = vertices + np.random.default_rng(0).normal(0, 0.02, vertices.shape)
    assert find_arms(vertices, triangles) is not None
    assert find_crossing(points, vertices, triangles, 1.0, np.arange(len(points)), None) is None
