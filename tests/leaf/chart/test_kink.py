"""Likelihoods of points beside a stalk: those of the normal distribution's Φ, point by point."""

import numpy as np
import pytest
from scipy.special import ndtr

from o3dleaf.leaf.chart.stalk.kink_loops import add_margin_costs
from tests import tolerances as tol


def test_costs_of_margins_are_sums_over_points_on_either_side_of_them_and_near_them():
    rng = np.random.default_rng(0)
    at, beside, fringe = rng.uniform(-20, 20, 200), rng.uniform(0, 12, 200), rng.uniform(0, 0.1, 200)
    places, slopes, jumps = np.linspace(-6, 6, 7), np.array([0.2, 1.0, 5.0]), np.array([0.0, 2.0])
    cost = np.ones((7, 3, 2))
    add_margin_costs(at, beside, fringe, places, slopes, jumps, 4.0, 0.5, 0.002, cost)
    from_place, slope, jump = np.meshgrid(places, slopes, jumps, indexing="ij")
    literal = np.ones((7, 3, 2))
    for x, y, stalk in zip(at, beside, fringe, strict=True):
        ahead = x - from_place
        inside = np.minimum((jump + slope * ahead - y) / np.sqrt(1 + slope**2), ahead)
        literal -= np.log(4.0 * (ndtr(inside / 0.5) + 0.002) + stalk)
    assert cost == pytest.approx(literal, rel=tol.ROUNDED_SUM)
