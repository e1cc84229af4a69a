"""Blades that leave a tube are told and taken one by one; the ends of a tube are no holes, and holes no ends."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.leaf.sheet.pieces.blades import find_blades
from o3dleaf.leaf.sheet.pieces.tube_ends import find_tube_ends
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.seedling import Seedling
from tolerances import BLADE_OF_SEEDLING

AROUND, ALONG = 24, 30
SMALL = Seedling(lengths=(26.0, 20.0), widths=(8.0, 7.0), radius=1.6, height=5.0, spacing=0.7, seed=3)


def lattice(across, along, *, closed):
    """Triangles of rows of vertices; closed, the last column is joined to the first."""
    rows, columns = np.meshgrid(np.arange(along - 1), np.arange(across if closed else across - 1), indexing="ij")
    right = (columns + 1) % across
    one, two = rows * across + columns, rows * across + right
    three, four = one + across, two + across
    return np.stack([one, two, four, one, four, three], axis=-1).reshape(-1, 3)


def tube(*, turn=360.0, bend=0.0):
    """A tube of radius 4 around z, or the part of one that turns by less, bent by some degrees along it; no hole."""
    angle = np.radians(turn) * np.arange(AROUND) / (AROUND if turn == 360 else AROUND - 1)
    high, angle = np.meshgrid(np.arange(ALONG, dtype=float), angle, indexing="ij")
    x, y = 4 * np.cos(angle), 4 * np.sin(angle)
    if bend:
        radius = ALONG / np.radians(bend)
        x, high = radius - (radius - x) * np.cos(high / radius), (radius - x) * np.sin(high / radius)
    points = np.stack([x, y, high], axis=-1).reshape(-1, 3)
    return points, lattice(AROUND, ALONG, closed=turn == 360)


@pytest.mark.parametrize("bend", [0.0, 120.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_an_end_of_a_tube_however_ragged_is_one(seed, bend):
    """Of two ends the longer loop is the rim."""
    vertices, triangles = tube(bend=bend)
    rng = np.random.default_rng(seed)
    ragged = (triangles // AROUND).min(axis=1) >= ALONG - 5
    triangles = triangles[~ragged | (rng.random(len(triangles)) < 0.5)]
    triangles = triangles[(triangles // AROUND).max(axis=1) < ALONG - 3]
    ends = find_tube_ends(vertices, triangles)
    assert len(ends) >= AROUND
    assert (np.isin(np.arange(AROUND), np.flatnonzero((vertices[:, None] == ends).all(axis=2).any(axis=1)))).all()


@pytest.mark.parametrize("turn", [20.0, 180.0, 300.0])
def test_a_hole_of_a_sheet_however_curled_is_no_end(turn):
    vertices, triangles = tube(turn=turn)
    row, column = np.divmod(triangles, AROUND)
    inside = ((np.abs(row - 12) <= 4) & (np.abs(column - 11) <= 4)).all(axis=1)
    assert len(find_tube_ends(vertices, triangles[~inside])) == 0


def test_a_tube_without_blades_has_none():
    """Its mouth has two points, a quarter as wide as the tube is around, and shorter than that."""
    vertices, triangles = tube()
    triangles = triangles[(triangles // AROUND).min(axis=1) >= 10]
    mouth = ALONG - 8 + 7 * np.abs(np.sin(2 * np.pi * np.arange(AROUND) / AROUND))
    kept = (triangles // AROUND <= mouth[triangles % AROUND]).all(axis=1)
    ends = find_tube_ends(vertices, triangles[kept])
    assert len(ends)
    assert find_blades(vertices, triangles[kept], ends) is None


@pytest.mark.few
@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize("gap", [0.0, 100.0])
def test_blades_of_a_seedling_are_pieces_of_one_leaf_each(gap, noise):
    scan = Seedling(gap=gap, noise=noise, radius=1.9, spacing=0.6, seed=4).scan()
    sheet = find_sheet(scan.points)
    assert sheet.blades.startswith("2 blades")
    assert any("2 blades" in note for note in sheet.notes)
    for leaf in range(2):
        rows = next(rows for rows in sheet.leftovers.pieces if scan.leaf[rows[0]] == leaf)
        assert (scan.leaf[rows] == leaf).all()
        assert len(rows) * 0.6**2 == pytest.approx(scan.areas[leaf], rel=BLADE_OF_SEEDLING)


def test_a_seedling_is_refused_with_its_blades_and_each_can_be_taken():
    scan = SMALL.scan()
    with pytest.raises(
        ReconstructionError, match=r"2 blades, areas .* leave a tube.*pieces are 3: 1: .* give `piece`"
    ) as told:
        o3l.create_blade(scan.points, unit="mm")
    assert len(told.value.pieces) == 3
    blade = o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(piece=1))
    assert blade.outline.area == pytest.approx(scan.areas[0], rel=BLADE_OF_SEEDLING)
