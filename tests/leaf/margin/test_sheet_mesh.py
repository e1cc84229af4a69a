import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import planar_leaves as leaves
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.sheet_band import triangulate_band
from o3dleaf.leaf.margin.sheet_mesh import _halved, _margin, border_of, triangulate
from tolerances import CUT_SHEET_ANGLE, CUT_SHEET_AREA, ON_THE_MARGIN, ROUNDING

SHAPES = {"ellipse": leaves.ellipse(), "strip": leaves.strip(12), "lobed": leaves.lobed(), "eaten": leaves.eaten(2)}


def areas(vertices, triangles):
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def least_angles(vertices, triangles):
    corners = vertices[triangles]
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    cosines = -(sides * np.roll(sides, 1, axis=1)).sum(axis=2) / (lengths * np.roll(lengths, 1, axis=1))
    return np.degrees(np.arccos(np.clip(cosines, -1, 1))).min(axis=1)


def check(polygon, vertices, triangles):
    """What must be true of any polygon at any step."""
    size = areas(vertices, triangles)
    assert size.min() > 0
    assert size.sum() == pytest.approx(polygon.area, rel=CUT_SHEET_AREA)
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    edges, counts = np.unique(sides, axis=0, return_counts=True)
    assert counts.max() <= 2
    parts = shapely.get_parts(polygon)
    assert len(vertices) - len(edges) + len(triangles) == sum(1 - len(part.interiors) for part in parts)
    assert np.array_equal(np.unique(triangles), np.arange(len(vertices)))
    border = border_of(triangles)
    assert np.array_equal(np.sort(border[:, 0]), np.sort(border[:, 1]))
    assert len(np.unique(border[:, 0])) == len(border)
    off = shapely.distance(polygon.boundary, shapely.points(vertices[border[:, 0]]))
    assert off.max() <= ON_THE_MARGIN * np.abs(vertices).max()


@pytest.mark.few
@pytest.mark.parametrize("step", [10.0, 3.0, 1.0, 0.4])
@pytest.mark.parametrize("shape", SHAPES)
def test_triangles_fill_the_polygon_at_any_step_and_end_on_it(shape, step):
    vertices, triangles = triangulate(SHAPES[shape], step)
    assert triangles.dtype == np.int64
    check(SHAPES[shape], vertices, triangles)
    border = border_of(triangles)
    assert np.linalg.norm(vertices[border[:, 1]] - vertices[border[:, 0]], axis=1).max() <= step * (1 + 1e-9)


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 10**6), step=st.floats(0.1, 3))
def test_any_star_with_a_hole_is_filled(seed, step):
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * (np.arange(60) + rng.uniform(0, 0.5, 60)) / 60
    radius = rng.uniform(0.8, 2.0, 60)
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    star = shapely.Polygon(ring).difference(shapely.Point(0.1, 0).buffer(0.2))
    part = max(shapely.get_parts(star), key=lambda area: area.area)
    if part.is_valid:
        check(part, *triangulate(part, step))


def test_area_converges_with_the_square_of_the_step():
    disc = shapely.Point(0, 0).buffer(10, quad_segs=4000)
    errors = [disc.area - areas(*triangulate(disc, step)).sum() for step in (0.6, 0.3, 0.15)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


@pytest.mark.parametrize("shape", ["ellipse", "lobed"])
def test_no_triangle_within_a_smooth_margin_is_a_sliver(shape):
    assert least_angles(*triangulate(SHAPES[shape], 0.4)).min() >= CUT_SHEET_ANGLE


def test_within_the_margin_triangles_are_those_of_one_lattice():
    vertices, triangles = triangulate(leaves.ellipse(), 1.0)
    angles = least_angles(vertices, triangles)
    assert np.mean(angles > 60 - 1e-6) > 0.85
    window, _ = triangulate(leaves.ellipse(), 1.0, [[0, 0], [10, 10]])
    inner = window[((window > 1.5) & (window < 8.5)).all(axis=1)]
    assert np.abs(vertices[:, None] - inner).max(axis=2).min(axis=0).max() <= ROUNDING * 50


def test_a_region_is_cut_out_and_an_empty_one_refused():
    leaf = leaves.eaten(2)
    box = shapely.box(0, -5, 20, 40)
    vertices, triangles = triangulate(leaf, 0.7, [[0, -5], [20, 40]])
    check(leaf.intersection(box), vertices, triangles)
    with pytest.raises(ReconstructionError, match="outside the margin"):
        triangulate(leaf, 0.7, [[200, 200], [210, 210]])


def test_the_margin_of_a_sample_is_triangulated_with_its_tip_and_hole():
    margin = Margin.fit(leaves.uniform(leaves.eaten(6), 1000, np.random.default_rng(2)))
    for step in (4 * margin.spacing, margin.spacing, margin.spacing / 4):
        check(margin.polygon, *triangulate(margin.polygon, step))


def test_sides_counted_through_all_rings_are_cut_in_the_ring_that_they_are_of():
    """The first side of each ring too, which follows the last of the one before."""
    margin = _margin(shapely.Polygon(leaves.ellipse().exterior, [shapely.Point(0, 0).buffer(0.3).exterior]), 0.5)
    counts = np.array([len(chords.places) for chords in margin])
    starts = np.cumsum(counts) - counts
    for ring, start in enumerate(starts):
        halved = _halved(margin, np.array([start]))
        assert [len(chords.places) for chords in halved] == list(counts + (np.arange(len(counts)) == ring))
        assert halved[ring].places[1] == margin[ring].places[1] / 2


def test_across_a_slit_nothing_outside_comes_into_the_band():
    """A slit 0.05 wide with sides of one: what lies 0.6 outside of one of its sides is inside beyond the other."""
    slit = [(5.05, 10), (5.05, 4), (5.025, 3.95), (5, 4), (5, 10)]
    ring = shapely.Polygon([(0, 0), (10, 0), (10, 10), *slit, (0, 10)]).exterior
    points = shapely.get_coordinates(shapely.segmentize(ring, 1.0))[:-1]
    sides = np.stack([np.arange(len(points)), np.roll(np.arange(len(points)), -1)], axis=1)
    band = triangulate_band(points, sides)
    assert not len(band.missing)
    assert band.triangles.max() < len(points)
    assert areas(points, band.triangles).sum() == pytest.approx(shapely.Polygon(points).area, rel=ROUNDING)
