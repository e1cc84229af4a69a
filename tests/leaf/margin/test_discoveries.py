import numpy as np
import pytest
from scipy.special import chdtrc

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge import discoveries, edge_fit
from o3dleaf.leaf.margin.edge.discoveries import FALSE, find_discoveries
from o3dleaf.leaf.margin.margin import Margin
from tolerances import TEETH_AREA

FREE = np.full(800, 0.05)


def by_chance(seed):
    """Twice the logarithm of the ratio of each node, where the softer curve finds what chance leaves."""
    return np.random.default_rng(seed).chisquare(FREE)


def test_of_smooth_curves_no_more_than_the_share_that_is_allowed_have_a_discovery():
    found = [find_discoveries(by_chance(seed), FREE, 9).any() for seed in range(100)]
    assert np.mean(found) <= FALSE


def test_what_is_a_little_more_likely_everywhere_is_found_by_its_length_alone():
    assert find_discoveries(3 * FREE, FREE, 9).all()
    assert not find_discoveries(3 * FREE[:60], FREE[:60], 9).any()


def test_windows_and_discoveries_are_those_of_their_definitions():
    """Sums over each window around each node, and the largest p that is no more than its rank's share."""
    twice = by_chance(0)
    twice[200:260] += 0.6
    windows = [9, 17, 33, 65, 129, 257]
    offsets = [np.arange(-(window // 2), window // 2 + 1) for window in windows]
    rows = [(np.arange(800)[:, np.newaxis] + each) % 800 for each in offsets]
    p = np.array([chdtrc(FREE[each].sum(axis=1), twice[each].sum(axis=1)) for each in rows])
    limit = max(value for rank, value in enumerate(np.sort(p, axis=None), 1) if value <= FALSE * rank / p.size)
    expected = np.zeros(800, dtype=bool)
    for each, probability in zip(rows, p, strict=True):
        expected[each[probability <= limit]] = True
    found = find_discoveries(twice, FREE, 9)
    assert (found == expected).all()
    assert found[200:260].all()
    assert not found.all()
    assert (np.roll(found, 13) == find_discoveries(np.roll(twice, 13), FREE, 9)).all()


def test_where_nothing_is_seen_and_on_the_shortest_curves_nothing_is_found():
    assert not find_discoveries(np.full(800, 1.0), np.zeros(800), 9).any()
    assert not find_discoveries(np.full(17, 9.0), np.full(17, 0.05), 9).any()


@pytest.mark.few(seed=2)
@pytest.mark.parametrize("seed", range(8))
def test_the_area_of_a_leaf_with_teeth_is_that_of_its_teeth(seed):
    """Six spacings deep and eight apart: bandwidths of 1.5 spacings leave it 7 % too large."""
    leaf = leaves.toothed(8.0, 6.0)
    margin = Margin.fit(leaves.uniform(leaf, round(leaf.area), np.random.default_rng(seed)))
    assert margin.area == pytest.approx(leaf.area, rel=TEETH_AREA)


@pytest.mark.few(seed=2)
@pytest.mark.parametrize("seed", range(8))
def test_a_smooth_margin_is_as_stiff_as_without_a_search_for_teeth(monkeypatch, seed):
    points = leaves.uniform(leaves.ellipse(), 3000, np.random.default_rng(seed))
    found = Margin.fit(points).ring
    monkeypatch.setattr(edge_fit, "SOFTER", 0)
    np.testing.assert_array_equal(found, Margin.fit(points).ring)


def test_fewer_are_found_the_fewer_may_be_false(monkeypatch):
    twice = by_chance(0)
    twice[200:260] += 0.3
    found = find_discoveries(twice, FREE, 9)
    monkeypatch.setattr(discoveries, "FALSE", 1e-9)
    assert found.any()
    assert not find_discoveries(twice, FREE, 9).any()
