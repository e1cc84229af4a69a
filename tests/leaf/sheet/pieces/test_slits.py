import numpy as np
import pytest
import shapely
from scipy.spatial import Delaunay

import o3dleaf as o3l
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.leaf.sheet.pieces.slits import find_slits
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.surface.mesh.topology import find_holes, label_triangles

SIDE = 60.0
ELSEWHERE = 0.04
"""Share of the area that may be cut farther than a spacing from the gap."""
SHEET_AREA = 0.08
"""Of the leaf's, 0.063 and 0.071 less: sheets end at the outermost points, half a spacing inside, and beside slits."""
SQUARE = shapely.box(2, 2, SIDE - 2, SIDE - 2)


def sheet_of(flat, whole):
    """Points of the plane one spacing apart on the mean, and their Delaunay triangles within a polygon."""
    triangles = Delaunay(flat).simplices.astype(np.int64)
    return np.column_stack([flat, np.zeros(len(flat))]), triangles[
        shapely.contains_xy(whole, *flat[triangles].mean(axis=1).T)
    ]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def square(rng):
    """Random points one spacing apart on the mean."""
    return rng.uniform(0, SIDE, (int(SIDE**2), 2))


def test_random_points_have_no_slit(square):
    assert find_slits(*sheet_of(square, SQUARE)) is None


def test_a_lattice_has_no_gap_at_all():
    lattice = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
    assert find_slits(*sheet_of(lattice, SQUARE)) is None


@pytest.mark.parametrize(("wide", "long"), [(2.5, 30), (2.0, 45)])
def test_a_long_gap_is_cut_and_little_else(square, wide, long):
    """Random points leave places free beside the gap, into which an empty disc gets a few spacings far."""
    x, y = square.T
    vertices, triangles = sheet_of(square[~((x < long) & (np.abs(y - SIDE / 2) < wide / 2))], SQUARE)
    kept = find_slits(vertices, triangles).kept
    cut = vertices[triangles[~kept]].mean(axis=1)
    assert np.ptp(cut[:, 0]) > 0.9 * long
    area = triangle_areas(vertices, triangles)
    beside = np.abs(cut[:, 1] - SIDE / 2) > wide / 2 + 1
    assert area[~kept][beside].sum() < ELSEWHERE * area.sum()
    # What the slit parts is joined beyond its end alone.
    along = kept & (vertices[triangles][:, :, 0].max(axis=1) < 0.8 * long)
    above = vertices[triangles[along]].mean(axis=1)[:, 1] > SIDE / 2
    label = label_triangles(triangles[along])
    assert not set(label[above]) & set(label[~above])


def test_between_scan_lines_nothing_is_cut(rng):
    along = np.sort(rng.uniform(0, SIDE, (20, 180)), axis=1)
    across = np.arange(20)[:, np.newaxis] * SIDE / 20 + rng.normal(0, 0.05, (20, 180))
    assert find_slits(*sheet_of(np.stack([along.ravel(), across.ravel()], axis=1), SQUARE)) is None


@pytest.mark.parametrize("wide", [0.0, 3.0])
def test_a_short_gap_from_rim_to_rim_is_cut(rng, wide):
    """A ring ten spacings wide, as a leaf is whose margins come near each other in one place."""
    ring = shapely.Point(0, 0).buffer(20).difference(shapely.Point(0, 0).buffer(10))
    points = rng.uniform(-20, 20, (1600, 2))
    points = points[shapely.contains_xy(ring.difference(shapely.box(0, -wide / 2, 30, wide / 2)), points)]
    vertices, triangles = sheet_of(points, ring.buffer(-1))
    slits = find_slits(vertices, triangles)
    if wide == 0:
        assert slits is None
    else:
        cut = vertices[triangles[~slits.kept]].mean(axis=1)
        beside = (cut[:, 0] < 0) | (np.abs(cut[:, 1]) > wide / 2 + 1)
        area = triangle_areas(vertices, triangles)
        assert area[~slits.kept][beside].sum() < ELSEWHERE * area.sum()
        assert np.ptp(cut[:, 0]) > 7
        assert "along 1 gap between" in slits.note


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", [0, 5])
def test_a_leaf_whose_margins_are_joined_all_along_is_opened(seed):
    """Triangles close the tube of seed 0 at once, and that of seed 5 when its small holes are closed."""
    leaf = o3l.samples.leaf_shape("curled", angle=165, length=60, width=24)
    scan = o3l.samples.scan_leaf(leaf, seed=seed, spacing=0.7)
    sheet = find_sheet(scan.points)
    assert find_holes(sheet.vertices, sheet.triangles).is_rim.any()
    assert any("rolled up" in note for note in sheet.notes)
    area = triangle_areas(sheet.vertices, sheet.triangles).sum()
    assert area == pytest.approx(leaf.area, rel=SHEET_AREA)
    # It was not thinned, as the sides of a thin leaf are.
    assert len(sheet.rows) > 0.99 * len(scan.points)
