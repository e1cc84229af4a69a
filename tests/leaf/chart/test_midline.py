import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from o3dleaf.leaf.chart.axis.ends import SLICES, slice_axis
from o3dleaf.leaf.chart.axis.sections import resample, within
from o3dleaf.leaf.chart.flattening.geodesics import Ways
from o3dleaf.leaf.chart.midline import _recenter, find_midline
from o3dleaf.samples.leaves.cut_base import drawn_cut_leaf
from o3dleaf.samples.leaves.plane_mesh import triangulate
from tests import tolerances as tol
from tests.sheet_shapes import blade, ellipse, lobed, rolled, sickle, triangulated


def straight(length):
    return np.stack([np.linspace(0, length, 400), np.zeros(400)], axis=1)


ARC = sickle()
TEAR = shapely.box(120, -5, 150, -2).union(shapely.box(120, -13, 123, -2))
LEAVES = {
    "long": (blade(), straight(120)),
    "cut obliquely": (blade(oblique=0.5), straight(120)),
    "ellipse of 2 : 1": (ellipse(100, 50), straight(100)),
    "ellipse of 4 : 3": (ellipse(80, 60), straight(80)),
    "rectangle of 6 : 5": (shapely.box(0, -25, 60, 25), straight(60)),
    "heart": (ellipse(80, 70, notch=22), straight(80)[110:]),
    "lobed": (lobed(), straight(100)),
    "sickle": ARC,
    "bitten": (blade().difference(shapely.Point(60, 6).buffer(6)), straight(120)),
    "one margin gone over two widths": (blade(200, 20).difference(shapely.box(50, 5, 90, 20)), straight(200)),
    "torn, a shred pointing back": (blade(200, 24).difference(TEAR), straight(200)),
    "hole": (blade(width=20).difference(shapely.Point(50, 2).buffer(4)), straight(120)),
}


def sheet_of(outline, step):
    flat, triangles = triangulated(outline, step)
    return flat, rolled(flat), triangles


def test_the_slices_of_a_strip_follow_one_another_along_its_middle():
    """At equal steps, all up to the side of a triangle."""
    side = 0.5
    flat, triangles = triangulated(shapely.box(0, -2, 80, 2), side)
    area = shapely.area(shapely.polygons(flat[triangles]))
    axis = slice_axis(Ways(flat, triangles), area, int(np.argmin(np.linalg.norm(flat, axis=1))))
    assert len(axis) == SLICES + 2
    assert np.abs(np.diff(axis[1:-1, 0]) - 80 / SLICES).max() < side
    assert np.abs(axis[1:-1, 1]).max() < side


@pytest.mark.parametrize("leaf", LEAVES)
def test_the_midrib_is_midway_and_ends_in_the_middle_of_the_base_and_at_the_tip(leaf):
    outline, truth = LEAVES[leaf]
    flat, sheet, triangles = sheet_of(outline, 2.0)
    # The chart is known here: what is judged is the midline alone.
    found = find_midline(sheet, triangles, flat)
    away = cKDTree(truth).query(found.curve)[0]
    assert away.max() < tol.MIDWAY * found.width
    ends = np.linalg.norm(found.base - truth[[0, -1]], axis=1), np.linalg.norm(found.tip - truth[[0, -1]], axis=1)
    first, last = (ends[0][0], ends[1][1]) if ends[0][0] < ends[0][1] else (ends[0][1], ends[1][0])
    assert max(first, last) < tol.MIDRIB_END * found.width
    steps = np.linalg.norm(np.diff(found.curve, axis=0), axis=1)
    assert np.ptp(steps) < 0.01 * steps.mean()


def test_the_midrib_of_a_leaf_with_rough_margins_ends_in_the_middle_of_its_cut():
    away = []
    for number in range(4):
        leaf = drawn_cut_leaf(number, 0.1)
        flat, triangles = triangulate(leaf.outline, leaf.width / 12)
        found = find_midline(np.insert(flat, 2, 0.0, axis=1), triangles, flat, base=np.append(leaf.midrib[0], 0.0))
        away.append(np.linalg.norm(found.base - leaf.midrib[0]) / leaf.width)
    assert np.median(away) < tol.CUT_MIDDLE


def test_the_curve_through_the_middles_moves_no_farther_than_the_one_before():
    """By some times as much: else no round would be near the one before, and the midrib need not come to rest."""
    at = np.linspace(0, 1, 400)
    half = 6 * np.minimum(1, 8 * (1 - at))
    above, below = half * (1 + 0.2 * np.sin(14 * np.pi * at)), -half * (1 + 0.2 * np.cos(14 * np.pi * at))
    axis = straight(120)
    outline = shapely.Polygon(np.concatenate([axis + above[:, None] * [0, 1], (axis + below[:, None] * [0, 1])[::-1]]))
    step = 0.02
    shifted = [resample(within(outline, axis + shift * np.array([1, 0])), 72) for shift in np.arange(-2, 2, step)]
    curves = [resample(_recenter(outline, curve, fixed=False), 72) for curve in shifted]
    moved = np.linalg.norm(np.diff(curves, axis=0), axis=-1).max(axis=1)
    assert 0.1 * step < moved.max() < tol.RECENTERED * step


@pytest.mark.parametrize(
    ("leaf", "why"),
    [
        ("long", "wider end"),
        ("cut obliquely", "wider end"),
        ("heart", "notched"),
        ("sickle", "stays wide"),
        ("hole", "wider end"),
    ],
)
def test_the_base_is_known_by_shape(leaf, why):
    outline, truth = LEAVES[leaf]
    flat, sheet, triangles = sheet_of(outline, 2.0)
    found = find_midline(sheet, triangles, flat)
    assert np.linalg.norm(found.base - truth[0]) < np.linalg.norm(found.base - truth[-1])
    assert why in found.notes[0]


def test_of_two_like_ends_the_lower_one_is_the_base_and_a_point_given_wins():
    flat, sheet, triangles = sheet_of(ellipse(100, 50), 2.0)
    left, right = sheet[np.argmin(flat[:, 0])], sheet[np.argmax(flat[:, 0])]
    for up in (sheet, sheet * [1, 1, -1]):
        lower = flat[:, 0].min() if up[np.argmin(flat[:, 0]), 2] < up[np.argmax(flat[:, 0]), 2] else flat[:, 0].max()
        found = find_midline(up, triangles, flat)
        assert abs(found.base[0] - lower) < 1
        assert "lower end" in found.notes[0]
    for hint in (left, right):
        found = find_midline(sheet, triangles, flat, base=hint + 3)
        assert np.linalg.norm(sheet[np.argmin(np.linalg.norm(flat - found.base, axis=1))] - hint) < 5


def test_the_midrib_moves_with_its_chart_and_is_mirrored_with_it():
    flat, sheet, triangles = sheet_of(*[LEAVES["sickle"][0], 2.0])
    found = find_midline(sheet, triangles, flat)
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    for matrix in (turn, turn * [1, -1]):
        moved = find_midline(sheet, triangles, flat @ matrix + [30, -200])
        np.testing.assert_allclose(moved.curve, found.curve @ matrix + [30, -200], atol=tol.MOVED_MIDRIB)


def test_widths_are_those_of_the_blade():
    flat, sheet, triangles = sheet_of(blade(), 2.0)
    found = find_midline(sheet, triangles, flat)
    at = found.curve[:, 0]
    truth = 12 * np.minimum(1, np.maximum(0, 120 - at) / 40) ** 0.7
    inner = (at > 2) & (at < 110)
    assert np.abs(found.widths - truth)[inner].max() < 0.5
