"""A table is known by what stands over one side of it, and goes on around that; a leaf pressed flat is none."""

from dataclasses import replace

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.leaf.parametric import build
from o3dleaf.leaf.sheet.pieces.table import find_table
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.on_table import KINDS, ON_LEAF, LeafOnTable, drawn_pressed, drawn_table
from tolerances import ON_TABLE, RESTING_AREA


def table_of(points):
    return find_table(points, np.arange(len(points)))


def square(rng, width, count, height=0.0):
    places = rng.uniform(-width / 2, width / 2, (count, 2))
    return np.column_stack([places, np.full(count, height)])


@pytest.mark.few(number=3)
@pytest.mark.parametrize(("number", "is_refused"), [(6, True), (11, True), (22, True), (13, False), (24, False)])
def test_a_table_and_the_leaf_that_rises_from_it_are_told_apart(number, is_refused):
    scan = drawn_table(number).scan()
    table = table_of(scan.points)
    assert table.is_sure == is_refused
    rising = np.concatenate(table.apart + table.joined)
    leaf = np.flatnonzero(scan.what == 1)
    assert len(np.setdiff1d(leaf, rising)) <= ON_TABLE * len(leaf)
    assert np.sum(scan.what[table.on] == 0) >= (1 - ON_TABLE) * np.sum(scan.what == 0)
    assert not np.intersect1d(table.on, rising).size


@pytest.mark.few(draw=1, has=3)
@pytest.mark.parametrize("draw", [0, 2])
@pytest.mark.parametrize("has", range(len(ON_LEAF)))
def test_a_leaf_that_is_pressed_flat_is_no_table(has, draw):
    name, points = drawn_pressed(5 * has + draw)
    assert table_of(points) is None, name


@pytest.mark.slow
def test_a_blade_of_a_table_is_refused_and_the_leaf_made_where_it_is_asked_for():
    scan = drawn_table(6).scan()
    with pytest.raises(
        ReconstructionError, match=r"of one plane .* pieces are 2: 1: .*; 2: .*; give `piece`"
    ) as refused:
        o3l.create_blade(scan.points, unit="mm")
    assert len(refused.value.pieces) == 2
    blade = o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(piece=2))
    area = o3l.samples.leaf_shape("lobed", **KINDS["lobed"]).area
    assert blade.outline.area == pytest.approx(area, rel=RESTING_AREA)
    assert blade.several_pieces


def test_a_leaf_that_lies_on_a_table_is_told_and_a_piece():
    scan = drawn_table(24).scan()
    sheet = find_sheet(scan.points)
    (note,) = (note for note in sheet.notes if "as a leaf over a table" in note)
    assert f"`piece` takes one of {sheet.leftovers.listed()}" in note
    said = int(note.split("with ")[1].split(" of these")[0].replace(",", ""))
    assert said == np.sum(scan.what[sheet.rows] == 1)
    pieces = [np.bincount(scan.what[rows], minlength=2) for rows in sheet.leftovers.pieces]
    assert [int(piece.argmax()) for piece in pieces] == [0, 1]


def test_a_table_of_a_quarter_of_the_points_is_one_and_of_fewer_none():
    rng = np.random.default_rng(1)
    bed, leaf = square(rng, 30, 900), square(rng, 45, 2025, 20.0)
    leaf[:, 2] += leaf[:, 0] ** 2 / 20
    assert [len(group) for group in table_of(np.concatenate([bed, leaf])).apart] == [len(leaf)]
    assert table_of(np.concatenate([bed[:500], leaf])) is None


def test_a_table_is_refused_where_the_sheet_is_its_own():
    """Not where a larger leaf hangs over it, of whatever density."""
    rng = np.random.default_rng(1)
    leaf = square(rng, 45, 2025, 20.0)
    leaf[:, 2] += leaf[:, 0] ** 2 / 100
    small, sparse = square(rng, 30, 3600), square(rng, 90, 1800)
    assert build.refuse_table(np.concatenate([small, leaf]), o3l.BladeOptions()) is None
    with pytest.raises(ReconstructionError, match="as a leaf over a table does"):
        build.refuse_table(np.concatenate([sparse, leaf]), o3l.BladeOptions())


def test_nothing_is_seen_through_a_table():
    """Sheets over both sides of a plane; over one side as many points are a leaf."""
    rng = np.random.default_rng(2)
    bed = square(rng, 80, 6400)
    over = [square(rng, 20, 400, height) for height in (12.0, 24.0)]
    assert table_of(np.concatenate([bed, *over])) is not None
    assert table_of(np.concatenate([bed, over[0], -over[1]])) is None


def test_what_lies_beside_a_plane_is_not_over_it():
    """As another leaf beside a pressed one, bent up."""
    rng = np.random.default_rng(6)
    bed, leaf = square(rng, 80, 6400), square(rng, 20, 400, 15.0)
    assert table_of(np.concatenate([bed, leaf])) is not None
    assert table_of(np.concatenate([bed, leaf + [60, 0, 0]])) is None


@pytest.mark.parametrize(("sagitta", "is_table"), [(0.0, True), (0.4, True), (4.0, False)])
def test_a_table_is_flat_but_for_a_slight_bow(sagitta, is_table):
    rng = np.random.default_rng(3)
    bed = square(rng, 80, 6400)
    bed[:, 2] = sagitta * (bed[:, :2] ** 2).sum(axis=1) / 40**2
    assert (table_of(np.concatenate([bed, square(rng, 20, 400, 15.0)])) is not None) == is_table


def test_what_rises_at_the_rim_of_a_plane_may_be_its_own():
    """A wall around whose foot the plane goes on, and the same at its rim, as the end of a leaf that is bent up."""
    rng = np.random.default_rng(4)
    bed, wall = square(rng, 80, 6400), square(rng, 24, 576)[:, [0, 2, 1]] + [0, 0, 12]
    assert table_of(np.concatenate([bed, wall])) is not None
    assert table_of(np.concatenate([bed, wall + [0, 39, 0]])) is None


def test_a_plant_on_a_table_is_no_petiole_of_it():
    """It was cut off as one, and the table a blade."""
    drawn = replace(drawn_table(4), spacing=1.4)
    assert drawn.pose == "standing"
    with pytest.raises(ReconstructionError, match="as a leaf over a table does"):
        o3l.create_blade(drawn.scan().points, unit="mm")


def test_on_a_table_no_petiole_is_looked_for(monkeypatch):
    """Where what lies on it is told only."""

    def looked_for(*_):
        raise AssertionError

    def stop(*_):
        raise ReconstructionError("the next step")

    monkeypatch.setattr(build, "find_petiole", looked_for)
    monkeypatch.setattr(build, "find_both_sides", stop)
    with pytest.raises(ReconstructionError, match="the next step"):
        o3l.create_blade(drawn_table(24).scan().points, unit="mm")


def test_few_points_are_no_table():
    assert table_of(np.random.default_rng(5).normal(size=(150, 3))) is None
    assert LeafOnTable().scan().what.max() == 1
