"""Pieces of different densities are told, and ordered, by their own; what of a piece its sheet leaves out is told."""

import re

import numpy as np
import pytest

from o3dleaf.leaf.sheet.pieces.leftovers import Leftovers
from tolerances import TOLD_AREA


def square(side, spacing, seed, at):
    rng = np.random.default_rng(seed)
    count = round((side / spacing) ** 2)
    return np.column_stack([rng.uniform(0, side, (count, 2)), np.zeros(count)]) + at


DENSE, SPARSE = square(20, 0.5, 1, [0, 0, 0]), square(39, 1.0, 2, [40, 0, 0])
SCAN = np.concatenate([DENSE, SPARSE])
PARTS = np.arange(len(DENSE)), np.arange(len(DENSE), len(SCAN))


def test_a_piece_has_the_area_of_points_as_dense_as_its_own():
    told = Leftovers.apart(SCAN, np.arange(len(SCAN)), 1.0).listed()
    areas = [float(each.replace(",", "")) for each in re.findall(r"area about ([\d,.]+)", told)]
    assert areas == [pytest.approx(400, rel=TOLD_AREA), pytest.approx(39**2, rel=TOLD_AREA)]


def test_parts_of_a_sheet_are_counted_by_their_areas():
    """The dense one has more points."""
    assert len(DENSE) > len(SPARSE)
    parts = Leftovers(SCAN, (), (), (), (), np.arange(len(SCAN)), 1.0, PARTS)
    assert [len(rows) for rows in parts.pieces] == [len(SPARSE), len(DENSE)]


def test_what_of_a_piece_is_off_its_sheet_is_told_but_for_stragglers():
    pieces = Leftovers(SCAN, (), (), (), (), np.arange(len(SCAN)), 1.0)
    (line,) = pieces.off_sheet_of(1, PARTS[1])
    assert line.startswith("piece 1 is more than one sheet")
    assert f"{len(DENSE):,} of its {len(SCAN):,} points lie off that" in line
    assert pieces.off_sheet_of(1, np.arange(20, len(SCAN))) == ()


def test_what_touches_a_sheet_but_lies_beside_it_is_no_layer_over_it():
    vertices, triangles = np.array([[0.0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    for at, kind in (([20.5, 0, 0], "another piece"), ([0.0, 0, 1], "another layer")):
        scan = np.concatenate([DENSE, square(20, 0.5, 3, at)])
        told = Leftovers.of(scan, np.arange(len(DENSE)), vertices, triangles, 0.5).tell()
        assert any(f"left out: {kind}" in line for line in told)
