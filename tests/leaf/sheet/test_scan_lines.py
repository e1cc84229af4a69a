"""Scan lines far apart are thinned along themselves, so that neighbors lie on the surface; an even scan stays whole."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.leaf.sheet.scan_lines import without_scan_lines
from o3dleaf.leaf.sheet.sheet import find_sheet

SIDE = 40.0
SHEET_AREA = 0.1
"""Of the leaf's, 0.07 and 0.09 less: a sheet ends at the outermost points, half a line's distance inside."""


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def lines(ratio, rng):
    """One point a unit of area, on lines that are `ratio` times farther apart than points along them."""
    apart, count = np.sqrt(ratio), round(SIDE * np.sqrt(ratio))
    places = np.arange(apart / 2, SIDE, apart)
    return np.array([[x, y, 0.0] for x in places for y in rng.uniform(0, SIDE, count)])


@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("width", [3.0, SIDE])
def test_an_even_scan_stays_whole(rng, noise, width):
    points = np.column_stack([rng.uniform([0, 0], [1600 / width, width], (1600, 2)), np.zeros(1600)])
    assert len(without_scan_lines(points + rng.normal(0, noise, points.shape))) == len(points)


@pytest.mark.parametrize(("ratio", "noise"), [(9.0, 0.0), (9.0, 0.2), (25.0, 0.0), (25.0, 0.1), (100.0, 0.0)])
def test_lines_become_as_dense_along_as_across(rng, ratio, noise):
    points = lines(ratio, rng)
    kept = points[without_scan_lines(points + rng.normal(0, noise, points.shape))]
    along = SIDE * len(np.unique(points[:, 0])) / len(kept)
    assert 0.2 < along / np.sqrt(ratio) < 0.5


@pytest.mark.few(kind=1)
@pytest.mark.parametrize("kind", ["curled", "twisted"])
def test_a_sheet_runs_through_lines_far_apart(kind):
    leaf = o3l.samples.leaf_shape(kind)
    scan = o3l.samples.scan_leaf(leaf, spacing=0.7, noise=0.2, pattern="stripes")
    sheet = find_sheet(scan.points)
    assert triangle_areas(sheet.vertices, sheet.triangles).sum() == pytest.approx(leaf.area, rel=SHEET_AREA)
    assert len(sheet.rows) > 0.95 * len(scan.points)
