import numpy as np
import pytest
import shapely

from o3dleaf.leaf.margin.tips.margin_tips import ROUNDED
from o3dleaf.leaf.margin.tips.tip_loops import TipBounds, area_and_centroid, center_tip, lies_within, next_tip
from tolerances import ROUNDING


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def star(rng, corners):
    """A polygon (n, 2) that goes around its first corners' middle once, and is not convex."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    return rng.uniform(0.5, 2.0, corners)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


@pytest.mark.parametrize("turn", [1, -1])
def test_area_and_centroid_are_those_of_the_polygon(rng, turn):
    corners = star(rng, 30)[::turn] + 5.0
    area, *away = area_and_centroid(corners)
    polygon = shapely.Polygon(corners)
    assert turn * area == pytest.approx(polygon.area, rel=ROUNDING)
    assert corners[0] + away == pytest.approx(shapely.get_coordinates(polygon.centroid)[0], rel=ROUNDING)


def test_places_lie_within_a_ring_as_they_do_within_its_polygon(rng):
    ring = star(rng, 20)
    places = rng.uniform(-2.5, 2.5, (300, 2))
    near = shapely.dwithin(shapely.Polygon(ring), shapely.points(places), 0.2)
    assert 50 < near.sum() < 250
    assert [lies_within(place[None], ring, 0.2) for place in places] == near.tolist()
    assert lies_within(places[near], ring, 0.2)
    assert not lies_within(places, ring, 0.2)


def wedge(half, length, step):
    """A curve (n, 2) around a triangle that points along x, its corner at the origin, and the number of the corner."""
    along = np.arange(step, length, step)
    flank = np.column_stack([-along * np.cos(half), along * np.sin(half)])
    return np.vstack([(flank * [1, -1])[::-1], [[0.0, 0.0]], flank]), len(along)


@pytest.mark.parametrize("off", [-3, 0, 3])
def test_a_wedge_begins_where_its_flanks_are_so_far_apart_whichever_place_near_its_corner_is_asked(off):
    half, width = np.radians(20), 1.0
    curve, corner = wedge(half, 20.0, 0.1)
    middle, first = center_tip(np.vstack([curve] * 3), corner + off, width)
    assert middle == corner
    assert 2 * 0.1 * first * np.sin(half) >= width > 2 * 0.1 * (first - 1) * np.sin(half)


def test_the_triangle_of_a_wedge_is_the_wedge_and_flanks_that_never_part_are_none():
    half, widths = np.radians(20), np.array([1000.0, 1.0])
    curve, corner = wedge(half, 20.0, 0.1)
    trial, triangle = next_tip(np.vstack([curve] * 3), corner, widths, 0, ROUNDED)
    assert trial == 1
    assert triangle.axis == pytest.approx([1.0, 0.0], abs=ROUNDING)
    assert triangle.height == pytest.approx(0.1 * triangle.first * np.cos(half), rel=ROUNDING)
    assert triangle.base == pytest.approx(0.2 * triangle.first * np.sin(half), rel=ROUNDING)
    assert next_tip(np.vstack([curve] * 3), corner, widths, 2, ROUNDED)[0] == 2


def test_an_elliptic_end_of_a_strip_is_no_tip():
    """Its triangle would be sharp enough, but has four fifths of its area."""
    angle, side = np.linspace(-np.pi / 2, np.pi / 2, 101), np.linspace(-20, 0, 201)[:-1]
    cap = np.column_stack([2 * np.cos(angle), np.sin(angle)])
    curve = np.vstack([np.column_stack([side, -np.ones(200)]), cap, np.column_stack([side, np.ones(200)])[::-1]])
    rounds, widths = np.vstack([curve] * 3), np.array([1.97])
    assert center_tip(rounds, 250, widths[0])[0] == 250
    assert next_tip(rounds, 250, widths, 0, ROUNDED)[0] == 1
    assert next_tip(rounds, 250, widths, 0, TipBounds(ROUNDED.sharpest, ROUNDED.bluntest, 1.0))[0] == 0
