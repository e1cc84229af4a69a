"""Sections across an outline: those that the plane's overlay of lines and a polygon has."""

import numpy as np
import pytest
import shapely

from o3dleaf.leaf.chart.axis.sections import cut_across
from tests import tolerances as tol


def star(center, radii):
    """A closed ring of corners around a center, at even angles."""
    angle = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    return center + np.column_stack([radii * np.cos(angle), radii * np.sin(angle)])


@pytest.mark.parametrize("holes", [0, 2])
def test_sections_are_the_nearest_parts_of_lines_inside_an_outline(holes):
    rng = np.random.default_rng(holes)
    rings = [star(np.array([4.0 * k - 2, 0.5]), rng.uniform(0.3, 1.5, 9)) for k in range(holes)]
    outline = shapely.Polygon(star(np.zeros(2), rng.uniform(4, 9, 60)), rings)
    points, turns = rng.uniform(-9, 9, (300, 2)), rng.uniform(0, 2 * np.pi, 300)
    normals = np.column_stack([np.cos(turns), np.sin(turns)])
    missed = 0
    for point, normal, middle, length in zip(points, normals, *cut_across(outline, points, normals), strict=True):
        line = shapely.LineString([point - 40 * normal, point + 40 * normal])
        parts = shapely.get_parts(shapely.intersection(line, outline))
        missed += not len(parts) or parts[0].is_empty
        if length == 0:
            assert not shapely.length(parts).any()
            assert np.array_equal(middle, point)
            continue
        nearest = parts[np.argmin(shapely.distance(parts, shapely.Point(point)))]
        assert length == pytest.approx(nearest.length, rel=tol.ROUNDED_SUM)
        assert middle == pytest.approx(nearest.interpolate(0.5, normalized=True).coords[0], abs=tol.ROUNDED_SUM * 40)
    assert 0 < missed < 100


def test_a_line_through_a_corner_of_an_outline_goes_in_or_out_there_once():
    """Of a square the diagonals, and of a kite the line that touches a corner from outside."""
    square, ways = shapely.box(-1, -1, 1, 1), np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2)
    middles, lengths = cut_across(square, np.full((2, 2), 0.0), ways)
    assert lengths == pytest.approx(2 * np.sqrt(2))
    assert middles == pytest.approx(np.zeros((2, 2)), abs=tol.ROUNDED_SUM)
    kite = shapely.Polygon([(0, 0), (1, 1), (0, 2), (-1, 1)])
    for height, length in ((0.0, 0.0), (2.0, 0.0), (1.0, 2.0)):
        assert cut_across(kite, np.array([[0.1, height]]), np.array([[1.0, 0.0]]))[1] == pytest.approx([length])
