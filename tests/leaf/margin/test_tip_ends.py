import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

import planar_leaves as leaves
from o3dleaf.leaf.margin import margin_rings
from o3dleaf.leaf.margin.edge.edge_fit import EdgeFit, fit_edge
from o3dleaf.leaf.margin.edge.edge_frame import NODE_STEP, EdgeSample
from o3dleaf.leaf.margin.edge.tip_ends import LONGEST, _tip, with_ends
from o3dleaf.leaf.margin.edge.tip_likelihood import TipLikelihood
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.margin_curve import Spacing
from tolerances import TIP_LEAST, TIP_SLOPE

LENGTH, POINTS = 45.0, 470
SHAPE = np.array([2.4, 0.25, 0.004, 0.1, -0.05, 0.006])
"""Half width, taper and bulge; place, slope and bend of the middle line."""
TWO_TIPS = [(12, -4), (24, 0), (12, 0)], [(12, 0), (24, 3), (12, 4)]


def tip_of(seed, filled=None, angle=20):
    """A tip of so many degrees drawn in a spacing of 1: the most likely curve from the true one, and its sample."""
    leaf, rng = leaves.strip(angle, length=LENGTH), np.random.default_rng(seed)
    points = leaves.uniform(leaf, POINTS, rng)
    unit = leaves.true_spacing(leaf, points)
    points, leaf = points / unit, shapely.affinity.scale(leaf, 1 / unit, 1 / unit, origin=(0, 0))
    filled = shapely.MultiPolygon() if filled is None else filled
    sample = EdgeSample(Spacing(cKDTree(points), np.ones(len(points))), 0.0, 1.0, filled)
    apex = np.array([[LENGTH / unit, 0.0]])
    return leaf, fit_edge(shapely.get_coordinates(leaf.exterior)[:-1], apex, sample), sample


@pytest.mark.parametrize("seed", range(2))
def test_the_ends_of_tips_cross_nothing(seed, monkeypatch):
    """Of two tips beside each other with a slit between, too narrow to show: one tip, whose end would not fit."""
    leaf = shapely.union_all([shapely.box(-12, -12, 12, 12)] + [shapely.Polygon(tip) for tip in TWO_TIPS])
    rng, ended = np.random.default_rng(seed), []
    monkeypatch.setattr(margin_rings, "with_ends", lambda *given: ended.append(with_ends(*given)) or ended[-1])
    Margin.fit(leaves.uniform(leaf, rng.poisson(leaf.area), rng))
    assert ended
    assert shapely.is_valid([shapely.Polygon(curve) for curve in ended]).all()


def points_of(seed):
    """Points, a spacing apart in the mean, of the tip of that shape, and two strays."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0.0, 12.0, 96), rng.uniform(-4.0, 4.0, 96)
    half, middle = SHAPE[:3] @ [u**0, -u, u**2], SHAPE[3:] @ [u**0, u, u**2]
    inside = np.abs(v - middle) < half
    return np.append(u[inside], [11.5, 6.0]), np.append(v[inside], [0.5, 3.5])


@pytest.mark.parametrize("seed", range(3))
def test_the_gradient_is_that_of_differences(seed):
    likelihood = TipLikelihood(*points_of(seed), 0.35, 2.5, 10.0)
    slope = likelihood(SHAPE)[1]
    steps = 1e-6 * np.eye(len(SHAPE))
    differences = [(likelihood(SHAPE + step)[0] - likelihood(SHAPE - step)[0]) / 2e-6 for step in steps]
    assert slope == pytest.approx(differences, rel=TIP_SLOPE, abs=TIP_SLOPE)


@pytest.mark.parametrize("seed", range(3))
def test_scoring_ends_where_the_gradient_is_none(seed):
    likelihood = TipLikelihood(*points_of(seed), 0.35, 2.5, 10.0)
    start = np.array([2.5, 0.25, 0.0, 0.0, 0.0, 0.0])
    slope, information = likelihood(likelihood.least(start))[1:]
    assert slope @ np.linalg.solve(information, slope) < TIP_LEAST


def test_the_more_points_the_more_parameters_they_tell():
    u, v = points_of(0)
    few, many = (TipLikelihood(np.tile(u, k), np.tile(v, k), 0.35, 2.5, 10.0) for k in (1, 10_000))
    assert few.parameters(SHAPE) < 5 < many.parameters(SHAPE) < 6


def test_what_has_no_end_within_reach_stays():
    """A strip that goes on beyond the square end of the curve."""
    leaf = shapely.box(0, -2.5, 60, 2.5)
    points = leaves.uniform(leaf, round(leaf.area), np.random.default_rng(0))
    sample = EdgeSample(Spacing(cKDTree(points), np.ones(len(points))), 0.0, 1.0, shapely.MultiPolygon())
    curve = shapely.get_coordinates(shapely.box(0, -2.5, 40, 2.5).exterior)[:-1]
    edge = fit_edge(curve, np.array([[40.0, 0.0]]), sample)
    assert np.array_equal(with_ends(edge, sample), edge.curve)


def test_a_tip_of_fewer_points_than_parameters_stays():
    _, edge, sample = tip_of(0)
    points = np.asarray(sample.local.tree.data)
    away = points[points[:, 0] < edge.curve[edge.apexes[0], 0] - 20.0]
    few = EdgeSample(Spacing(cKDTree(away), np.ones(len(away))), 0.0, 1.0, sample.filled)
    assert np.array_equal(with_ends(edge, few), edge.curve)


def test_a_tip_over_a_gap_that_was_filled_stays():
    box = shapely.box(38.0, 0.8, 44.0, 6.0)
    _, edge, sample = tip_of(0, filled=shapely.MultiPolygon([box]))
    assert np.array_equal(with_ends(edge, sample), edge.curve)
    assert not np.array_equal(with_ends(*tip_of(0)[1:]), edge.curve)


@pytest.mark.parametrize("seed", range(8))
def test_the_tip_of_a_sample_moves_and_that_of_a_lattice_stays(seed):
    _, edge, sample = tip_of(seed)
    lattice = EdgeSample(sample.local, 0.0, 0.0, sample.filled)
    assert not np.array_equal(with_ends(edge, sample), edge.curve)
    assert np.array_equal(with_ends(edge, lattice), edge.curve)


@pytest.mark.parametrize(("beyond", "moves"), [(3.0, True), (5.5, False)])
def test_a_blunt_tip_does_not_end_before_its_last_point_but_before_a_stray(beyond, moves):
    _, edge, sample = tip_of(3, angle=70)
    found = with_ends(edge, sample)[edge.apexes[0]]
    points = np.vstack([np.asarray(sample.local.tree.data), found + [beyond, 0.0]])
    more = EdgeSample(Spacing(cKDTree(points), np.ones(len(points))), 0.0, 1.0, sample.filled)
    ended = with_ends(edge, more)[edge.apexes[0], 0]
    assert (ended > found[0] + 0.95 * beyond) == moves


def test_of_a_long_tip_its_end_is_looked_at():
    leaf = leaves.strip(2, width=4.0, length=80.0)
    points = leaves.uniform(leaf, round(leaf.area), np.random.default_rng(0))
    sample = EdgeSample(Spacing(cKDTree(points), np.ones(len(points))), 0.0, 1.0, shapely.MultiPolygon())
    edge = fit_edge(shapely.get_coordinates(leaf.exterior)[:-1], np.array([[80.0, 0.0]]), sample)
    assert _tip(edge, edge.apexes[0]).steps * NODE_STEP <= LONGEST + NODE_STEP


def test_tips_of_a_short_leaf_have_half_of_each_flank():
    leaf = shapely.Polygon([(-9, 0), (0, -2.2), (9, 0), (0, 2.2)])
    points = leaves.uniform(leaf, round(leaf.area), np.random.default_rng(0))
    sample = EdgeSample(Spacing(cKDTree(points), np.ones(len(points))), 0.0, 1.0, shapely.MultiPolygon())
    edge = fit_edge(shapely.get_coordinates(leaf.exterior)[:-1], np.array([[9.0, 0.0], [-9.0, 0.0]]), sample)
    steps = [_tip(edge, apex).steps for apex in edge.apexes]
    assert 2 * sum(steps) <= len(edge.curve)
    moved = with_ends(edge, sample)
    assert shapely.Polygon(moved).is_valid
    assert not np.array_equal(moved, edge.curve)


def test_a_notch_is_no_tip():
    """The same rows the other way around: the leaf lies outside of them."""
    _, edge, sample = tip_of(2)
    count = len(edge.curve)
    around = EdgeFit(edge.curve[::-1], edge.spacing[::-1], edge.gap[::-1], [count - 1 - edge.apexes[0]])
    assert np.array_equal(with_ends(around, sample), around.curve)
