import numpy as np
import pytest
import shapely
from scipy.optimize import brentq
from scipy.spatial import cKDTree

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge.edge_fit import fit_edge
from o3dleaf.leaf.margin.edge.edge_frame import EdgeSample
from o3dleaf.leaf.margin.edge.edge_score import blurred, score
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.margin_curve import Spacing
from tolerances import (
    CORNER_HELD,
    EDGE_DEVIATION,
    EDGE_RMS,
    EDGE_RMS_NOISY,
    EDGE_STAYS,
    EDGE_TURNED,
    FOUND_EDGE,
    TIP_LENGTH,
)

RADIUS = 14.0
DISC = shapely.Point(0, 0).buffer(RADIUS, quad_segs=256)
NO_TIPS = np.empty((0, 2))


@pytest.mark.parametrize("noise", [0.0, 0.2, 0.5])
def test_a_straight_edge_comes_out_where_the_tables_say_and_as_far_off_as_they_say(noise):
    """By simulation: a half plane of independent points that ends at 0; the scores sum up to the length of its edge."""
    rng, length, pieces = np.random.default_rng(0), 40, 2000
    samples = [rng.uniform(-4, 0, n) + rng.normal(0, noise, n) for n in rng.poisson(4 * length, pieces)]
    blur, offset, information = (float(each[0]) for each in blurred(np.array([noise]))[:3])

    def edge(across):
        near = across[across > -2]  # the strip's other side is no edge
        return brentq(lambda e: np.sum(score((e - near) / blur)) / blur - length, -2, 2)

    found = np.array([edge(across) for across in samples]) - offset
    assert np.mean(found) == pytest.approx(0, abs=FOUND_EDGE)
    assert np.std(found) == pytest.approx((information * length) ** -0.5, rel=EDGE_DEVIATION)


@pytest.mark.parametrize(("noise", "most"), [(0.0, EDGE_RMS), (0.5, EDGE_RMS_NOISY)])
def test_the_margin_of_a_disc_strays_less_than_its_outermost_points(noise, most):
    squares = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        points = leaves.uniform(DISC, 1225, rng)
        spacing = leaves.true_spacing(DISC, points)
        points += rng.normal(0, noise * spacing, points.shape)
        ring = Margin.fit(points, noise=noise * spacing).ring
        squares.append(np.mean((np.hypot(*ring.T) - RADIUS) ** 2) / spacing**2)
    assert np.sqrt(np.mean(squares)) < most


def test_corners_stay_where_a_stiffer_curve_would_cut_them():
    leaf = shapely.box(0, 0, 30, 20)
    corners, off = shapely.get_coordinates(leaf)[:4], []
    for seed in range(4):
        points = leaves.uniform(leaf, 600, np.random.default_rng(seed))
        off += list(shapely.distance(shapely.points(corners), Margin.fit(points).polygon.exterior))
    assert np.mean(off) < CORNER_HELD


def test_a_narrow_tip_ends_in_the_mean_where_the_leaf_does():
    """Tips of 20 degrees; the last points are 1.6 spacings short in the mean."""
    leaf, short = leaves.strip(20, length=45.0), []
    for seed in range(8):
        points = leaves.uniform(leaf, 470, np.random.default_rng(seed))
        short.append((45 - Margin.fit(points).bounds[1, 0]) / leaves.true_spacing(leaf, points))
    assert abs(np.mean(short)) < TIP_LENGTH


def test_the_curve_stays_for_a_lattice_and_over_what_was_filled():
    points = leaves.uniform(DISC, 1225, np.random.default_rng(0))
    local = Spacing(cKDTree(points), np.full(len(points), leaves.true_spacing(DISC, points)))
    curve = (RADIUS - 1) * np.stack([np.cos(leaves.TURN), np.sin(leaves.TURN)], axis=1)
    left = shapely.box(-30, -30, 0, 30)
    lattice = fit_edge(curve, NO_TIPS, EdgeSample(local, 0.0, 0.0, shapely.MultiPolygon())).curve
    filled = fit_edge(curve, NO_TIPS, EdgeSample(local, 0.0, 1.0, left)).curve
    radius = np.hypot(*filled.T)
    assert np.hypot(*lattice.T) == pytest.approx(RADIUS - 1, abs=EDGE_TURNED)
    assert radius[filled[:, 0] < -RADIUS / 2].mean() == pytest.approx(RADIUS - 1, abs=EDGE_STAYS)
    assert radius[filled[:, 0] > RADIUS / 2].mean() == pytest.approx(RADIUS, abs=EDGE_STAYS)
