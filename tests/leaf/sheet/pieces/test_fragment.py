"""A fragment of another sheet on a leaf is left out of it; the leaf's own end, rolled up over it, is not."""

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.leaf.sheet.layers.widths import OFF
from o3dleaf.leaf.sheet.open_sheets import OpenSheets
from o3dleaf.leaf.sheet.pieces.fragment import _on_boundary, is_fragment
from o3dleaf.leaf.sheet.pieces.minimum_cut import Links, minimum_cut
from o3dleaf.leaf.sheet.pieces.resting import MIN_SHARE, REACH, _facing, _one_over_another, find_resting
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.resting import drawn_fragment
from o3dleaf.surface.mesh.topology import find_holes
from tolerances import RESTING_WRONG

LENGTH, WIDTH = 40, 24


def leaf_and_part(seam, begin=0.0, hole=None):
    """A plane and a strip that rises from it by 20°, off a line across it, on square lattices, and which is the strip.

    The strip begins half a lattice's cell beside the line, or farther off; the plane may have a hole (4,) in it.
    """
    leaf = np.stack(np.meshgrid(np.arange(LENGTH + 1.0), np.arange(WIDTH + 1.0)), axis=-1).reshape(-1, 2)
    if hole is not None:
        leaf = leaf[~((leaf > hole[:2]) & (leaf < hole[2:])).all(axis=1)]
    strip = np.stack(np.meshgrid(np.arange(0.5, 11) + begin, np.arange(6.5, 18)), axis=-1).reshape(-1, 2)
    slope = np.radians(20.0)
    rises = np.column_stack([seam + strip[:, 0] * np.cos(slope), strip[:, 1], strip[:, 0] * np.sin(slope)])
    points = np.concatenate([np.column_stack([leaf, 0 * leaf[:, 0]]), rises])
    part = np.arange(len(points)) >= len(leaf)
    normals = np.where(part[:, np.newaxis], [-np.sin(slope), 0, np.cos(slope)], [0.0, 0.0, 1.0])
    return points, Links.of(points, normals, 1.0), part


@pytest.mark.parametrize(("seam", "is_other"), [(15, True), (LENGTH, False)], ids=["inside", "end"])
def test_a_part_is_a_fragment_where_the_leaf_goes_on_at_its_seam(seam, is_other):
    points, links, part = leaf_and_part(seam)
    assert is_fragment(points, 0.0, links, part, part, 1.0) is is_other


@pytest.mark.parametrize(("share", "is_other"), [(0.45, False), (0.55, True)])
def test_a_fragment_lies_over_the_leaf_for_the_most_part(share, is_other):
    points, links, part = leaf_and_part(15)
    layered = part & (np.cumsum(part) <= share * part.sum())
    assert is_fragment(points, 0.0, links, part, layered, 1.0) is is_other


def test_or_it_hides_the_leaf():
    points, links, part = leaf_and_part(15, hole=(15, 5, 26, 19))
    assert is_fragment(points, 0.0, links, part, np.zeros(len(part), bool), 1.0)


def test_what_hangs_on_nothing_is_a_fragment():
    points, links, part = leaf_and_part(LENGTH, begin=3.0)
    assert is_fragment(points, 0.0, links, part, np.zeros(len(part), bool), 1.0)


def test_a_closed_sheet_has_no_rim_that_a_seam_could_be_on():
    height, turn = 1 - np.arange(1, 1000, 2) / 500, np.pi * (3 - np.sqrt(5)) * np.arange(500)
    across = np.sqrt(1 - height**2)
    ball = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    sheets = OpenSheets.of(ball, np.zeros(len(ball)), np.sqrt(4 * np.pi / len(ball)))
    assert not len(find_holes(*sheets.sheet()).edges)
    assert _on_boundary(sheets, ball[:5], np.ones(5, int)) == (0, 0)


@pytest.mark.few(number=1)
@pytest.mark.parametrize("number", [43, 46], ids=["joined", "apart"])
def test_a_leaf_is_made_without_the_fragment_on_it_which_is_told(number):
    scan = drawn_fragment(number).scan()
    sheet = find_sheet(scan.points)
    held = np.bincount(scan.leaf[sheet.rows], minlength=2)
    count = np.bincount(scan.leaf)
    assert held[0] >= (1 - RESTING_WRONG) * count[0]
    assert held[1] <= RESTING_WRONG * count[0]
    assert sum(len(piece) for piece in sheet.leftovers.pieces[1:]) >= count[1] - RESTING_WRONG * count[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_bit_of_another_sheet_over_a_real_leaf_is_a_layer_of_its_own(seed, real_scan):
    """Half a millimeter, three spacings, above one side, and some of it on it; whatever the order of the points."""
    points = np.asarray(o3d.io.read_point_cloud(str(real_scan("leaves/tomato_leaflet_two_layers.ply"))).points)
    sheet = find_sheet(np.random.default_rng(seed).permutation(points))
    assert len(sheet.leftovers.pieces[1]) > 100
    assert "another layer" in sheet.leftovers.tell()[0]


def rolled_strip(rng):
    """A strip 8 wide whose end is rolled up over it, in 1.6 turns of a radius that falls from 9 by 4 with each turn."""
    angle = np.linspace(0, 3.2 * np.pi, 2000)
    steps = (9 - 4 * angle[:-1] / (2 * np.pi)) * np.diff(angle)
    rolled, along, up = (
        np.append(0, np.cumsum(each)) for each in (steps, steps * np.cos(angle[:-1]), steps * np.sin(angle[:-1]))
    )
    u, v = rng.uniform([-200, -4], [rolled[-1], 4], (8 * round(200 + rolled[-1]), 2)).T
    over = np.maximum(u, 0)
    return np.column_stack([np.minimum(u, 0) + np.interp(over, rolled, along), v, np.interp(over, rolled, up)])


def test_the_end_of_a_leaf_that_is_rolled_up_over_it_is_no_fragment():
    points = rolled_strip(np.random.default_rng(3))
    sheets = OpenSheets.of(points, np.zeros(len(points)), 1.0)
    normals = _facing(sheets)
    upper, lower, _ = _one_over_another(points, normals, REACH, OFF)
    above, below, _ = minimum_cut(Links.of(points, normals, 1.0), upper, lower)
    end = min(above, below, key=np.count_nonzero)
    assert 24 < end.sum() < MIN_SHARE * len(points)
    assert np.mean((upper | lower)[end]) > 0.5
    assert not len(find_resting(points, 0.0, sheets, np.arange(len(points))).fragment)
