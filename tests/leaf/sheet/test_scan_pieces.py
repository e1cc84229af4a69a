"""Pieces are numbered as `piece` takes them, and told with their size and place."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.leaf.sheet.sheet import find_sheet
from tolerances import TOLD_AREA

SPACING = 0.5


def square(side, seed, at):
    rng = np.random.default_rng(seed)
    count = round((side / SPACING) ** 2)
    return np.column_stack([rng.uniform(0, side, (count, 2)), np.zeros(count)]) + at


SMALL, LARGE = square(8, 1, [0, 0, 0]), square(14, 2, [20, 0, 5])
SCAN = np.concatenate([SMALL, LARGE, [[10.0, 30.0, 0.0]]])


def test_pieces_are_those_that_piece_takes():
    pieces = o3l.find_pieces(SCAN, unit="mm")
    assert np.array_equal(pieces.number, np.repeat([2, 1, 0], [len(SMALL), len(LARGE), 1]))
    for number in (1, 2):
        assert set(find_sheet(SCAN, piece=number).rows) <= set(np.flatnonzero(pieces.number == number))
    assert pieces.areas == pytest.approx([14**2, 8**2], rel=TOLD_AREA)
    assert np.abs(pieces.places - [[27, 7, 5], [4, 4, 0]]).max() < 2 * SPACING
    assert [line.split(" points (area about ")[0] for line in pieces.lines] == [f"1: {len(LARGE)}", f"2: {len(SMALL)}"]
    assert all("mm²) at " in line for line in pieces.lines)


def test_what_has_no_sheet_is_a_piece_too():
    ball = np.random.default_rng(3).normal(size=(2000, 3))
    ball *= 8 / np.linalg.norm(ball, axis=1, keepdims=True)
    assert (o3l.find_pieces(ball).number == 1).all()
    beside = o3l.find_pieces(np.concatenate([ball, LARGE]))
    assert np.array_equal(beside.number, np.repeat([1, 2], [len(ball), len(LARGE)]))


def test_pieces_are_counted_and_shown_without_points_that_a_blade_leaves_out():
    """An outlier and a point repeated, before all others: what is drawn are the places of the pieces' points."""
    scan = np.concatenate([[[300.0, 0, 0]], LARGE[:1], SCAN])
    number = o3l.find_pieces(scan, unit="mm").number
    assert np.array_equal(np.bincount(number), [3, len(LARGE), len(SMALL)])
    assert (number[2 : 2 + len(SMALL)] == 2).all()
    with pytest.raises(ReconstructionError, match="piece: is 9, but the scan has 2") as refused:
        o3l.create_blade(scan, unit="mm", options=o3l.BladeOptions(piece=9))
    large, small = refused.value.pieces
    assert {*map(tuple, large)} == {*map(tuple, LARGE)}
    assert np.array_equal(small, SMALL)
