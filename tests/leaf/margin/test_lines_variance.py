import numpy as np
import pytest
import shapely

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge.lines_variance import lines_variance
from tolerances import LINES_DEVIATION


def ring_of(leaf):
    return leaf.segmentize(0.2)


@pytest.mark.parametrize("width", [12.0, 12.6])
def test_lines_along_a_strip_leave_either_side_anywhere_within_their_distance(width):
    """Each of two sides of length L is off by a number uniform within the distance d of lines: 2 L² d²/12.

    Whether the sides are whole numbers of d apart or not: their places are found from the lines themselves.
    """
    strip, spacing, ratio = shapely.box(0, -width / 2, 60, width / 2), 0.6, 4
    points = leaves.lines(strip, spacing, ratio, 0.0, np.random.default_rng(0))
    apart = spacing * np.sqrt(ratio)
    assert lines_variance(points, ring_of(strip)) == pytest.approx((60 * apart) ** 2 / 6, rel=LINES_DEVIATION)


def test_lines_across_a_strip_tell_its_sides():
    strip = shapely.box(0, -6, 60, 6)
    variance = lines_variance(leaves.lines(strip, 0.6, 4, 0.5, np.random.default_rng(0)), ring_of(strip))
    assert np.sqrt(variance) < 0.005 * strip.area


def test_independent_points_have_no_lines():
    points = leaves.uniform(leaves.ellipse(), 600, np.random.default_rng(0))
    assert lines_variance(points, ring_of(leaves.ellipse())) == 0
