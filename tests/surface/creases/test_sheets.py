"""Sheets of balls: planes are told apart, quadrics come back, and a cover keeps the balls that are not split."""

import numpy as np
import pytest

from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.surface.creases import quadric_loops, sheet_loops
from o3dleaf.surface.creases.sheets import MeasuredPoints, PointGroups, SplitBalls, find_splits, replace
from tolerances import ROUNDING

TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def quadric_patch(curvature):
    """Points of z = ½ κ (u² − v²), turned, and their normals."""
    u, v = np.random.default_rng(1).uniform(-1, 1, (2, 50))
    points = np.column_stack([u, v, 0.5 * curvature * (u * u - v * v)])
    normals = np.column_stack([-curvature * u, curvature * v, np.ones(50)])
    return points @ TURN, normals / np.linalg.norm(normals, axis=1)[:, np.newaxis] @ TURN


def test_a_plane_is_its_own_quadric():
    points, normals = quadric_patch(0.0)
    misfit, scale = quadric_loops.misfit(points, normals, np.ones(50, dtype=bool))
    spread = np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert misfit < ROUNDING
    assert scale == pytest.approx(spread, rel=ROUNDING)


def test_the_system_of_a_quadric_is_solved_as_numpy_does():
    half = np.random.default_rng(2).normal(size=(6, 9))
    matrix, right = half @ half.T, np.arange(6.0)
    wanted = np.linalg.solve(matrix, right)
    quadric_loops.eliminate(np.triu(matrix), right)
    np.testing.assert_allclose(right, wanted, rtol=ROUNDING * np.linalg.cond(matrix))


def roof(slope):
    """Points of two half planes that fall off on both sides of an edge, constraints off every third, the measured.

    At slope 0 they are one plane.
    """
    x, y = np.random.default_rng(3).uniform(-1, 1, (2, 900))
    points = np.column_stack([x, y, -slope * np.abs(x)])
    normals = np.column_stack([slope * np.sign(x), np.zeros(900), np.ones(900)])
    normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
    base = np.arange(0, 900, 3)
    sites = np.concatenate([points, points[base] + 0.03 * normals[base]])
    values, groups = np.repeat([0.0, -0.03], [900, 300]), np.append(np.arange(900), base)
    return sites, values, groups, MeasuredPoints.of(points, normals, 30.0), x


@pytest.mark.parametrize("slope", [0.0, 0.1, 1.0])
def test_balls_over_an_edge_are_split_into_its_two_sides(slope):
    """At 2 × 45° there are two sheets, joined by a minimum; at 2 × 6° it is no crease."""
    sites, values, groups, measured, x = roof(slope)
    bounds = np.array([sites.min(axis=0), sites.max(axis=0)])
    cover = Cover.fit(sites, bounds, (60, 150), 1.1)
    splits = find_splits(cover, measured, PointGroups.of(np.arange(900), groups, values))
    assert (len(splits.balls) > 0) == (slope == 1.0)
    assert np.all(splits.counts == 2)
    assert np.array_equal(splits.composition, np.tile([0, -1], len(splits.balls)))
    parts = np.split(splits.members, np.cumsum(splits.sizes)[:-1])
    for k, ball in enumerate(splits.balls):
        assert set(cover.members[cover.offsets[ball] : cover.offsets[ball + 1]]) <= {*parts[2 * k], *parts[2 * k + 1]}
    for part in parts:
        across = x[part[part < 900]]
        assert len(set(np.sign(across[np.abs(across) > 0.02]))) <= 1
        assert np.all(np.diff(part) > 0)


def test_a_cover_keeps_the_balls_that_are_not_split():
    sites, *_ = roof(1.0)
    cover = Cover.fit(sites, np.array([sites.min(axis=0), sites.max(axis=0)]), (60, 150), 1.1)
    members = np.arange(12)
    three = SplitBalls(
        np.array([1, 4]), np.array([2, 3]), members, np.array([2, 2, 3, 3, 2]), np.array([0, 1, 0, -1, 1])
    )
    sheets = replace(cover, three.only(np.array([False, True])))
    assert np.array_equal(np.flatnonzero(np.diff(sheets.first) > 1), [4])
    over, first = sheets.cover, sheets.first
    assert np.array_equal(over.members[over.offsets[4] : over.offsets[7]], members[4:])
    assert np.array_equal(over.counts[4:7], [3, 3, 2])
    assert np.array_equal(sheets.composition[4:7], [0, -1, 1])
    for ball in np.delete(np.arange(len(cover.radii)), 4):
        at = first[ball]
        part = over.members[over.offsets[at] : over.offsets[at + 1]]
        assert np.array_equal(part, cover.members[cover.offsets[ball] : cover.offsets[ball + 1]])
        assert np.array_equal(over.centers[at], cover.centers[ball])
    assert np.count_nonzero(sheets.composition) == 2


def test_a_point_is_smooth_where_its_neighbours_agree_or_lie_on_the_other_side():
    normals = np.array([[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0]])
    neighbors, smooth = np.array([[1, 1], [0, 0], [0, 1]]), np.empty(3, dtype=bool)
    sheet_loops.find_smooth(0, 3, normals, neighbors, 0.9, smooth)
    assert smooth.tolist() == [True, True, False]


@pytest.mark.parametrize(("slope", "sheets"), [(0.0, 1), (0.2, 1), (0.8, 2), (1.5, 2)])
def test_sheets_that_do_not_turn_where_they_meet_are_one(slope, sheets):
    """A plane goes on as a curved sheet that no quadric fits with it, doubtful points between: by the angle there."""
    x, y = np.random.default_rng(6).uniform(-1, 1, (2, 900))
    right = np.maximum(x, 0)
    points = np.column_stack([x, y, slope * right + 0.3 * right**2])
    slopes = np.where(x > 0, slope + 0.6 * right, 0.0)
    normals = np.column_stack([-slopes, np.zeros(900), np.ones(900)]) / np.hypot(slopes, 1)[:, np.newaxis]
    measured = MeasuredPoints.of(points, normals, 30.0)
    measured = measured._replace(smooth=measured.smooth & (np.abs(x) > 0.15))
    labels, lying, distances, _ = sheet_loops.find_sheets(np.arange(900), measured)
    assert len(distances) == sheets
    assert set(labels[lying].tolist()) == set(range(sheets))
    if sheets == 2:
        assert len(set(labels[x < -0.2].tolist())) == len(set(labels[x > 0.2].tolist())) == 1


@pytest.mark.parametrize(("gone", "into"), [(1, 0), (2, 0), (3, 1), (3, 2)])
def test_a_sheet_that_is_given_to_another_leaves_its_number_to_the_last(gone, into):
    labels = np.array([0, 1, 2, 3, -1, -2, 3, 2, 1, 0])
    expected = [into if label == gone else gone if label == 3 else label for label in labels.tolist()]
    sheet_loops.relabel(labels, gone, into, 3)
    assert labels.tolist() == expected


def test_the_place_of_a_row_is_found_and_no_other_is_said_to_be_there():
    rng = np.random.default_rng(5)
    for size in range(12):
        rows = np.sort(rng.permutation(40)[:size])
        places = [sheet_loops.place_of(rows, row) for row in range(-1, 41)]
        assert places == [list(rows).index(row) if row in rows else -1 for row in range(-1, 41)]


@pytest.mark.parametrize("stride", [1, 3, 1 << 20])
def test_a_table_of_rows_knows_their_places_and_no_others(stride):
    rng = np.random.default_rng(7)
    for size in (0, 1, 9, 300):
        rows = stride * np.sort(rng.permutation(400)[:size])
        table = sheet_loops.enter(rows)
        assert np.sum(table >= 0) == size
        assert len(table) >= 2 * size
        places = [sheet_loops.look_up(stride * row, rows, table) for row in range(400)]
        assert places == [sheet_loops.place_of(rows, stride * row) for row in range(400)]
