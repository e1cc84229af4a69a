"""Samples thinned to a least distance lie more densely along a margin, which is found in its place all the same."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial import cKDTree

import o3dleaf as o3l
import planar_leaves as leaves
from o3dleaf.leaf.margin.edge.edge_score import BLUR, SHUT_OUT, blurred, score
from o3dleaf.leaf.margin.edge.least_distance import excess_beside, least_distance
from o3dleaf.leaf.margin.margin import Margin
from tolerances import AREA_OF_THINNED, LEAST_DISTANCE, THINNED_BLADE, THINNED_EXCESS, THINNED_OFFSET

RATIOS = {0.552: 1.97, 0.685: 4.26, 0.762: 13.8}
"""Points thinned to so many spacings of what is left, and how many there were for each of these."""
DEEP = 3.0
"""Spacings from an edge within which points are more than the density."""


def apart(points, distance, boxsize=None):
    """Rows of points that are taken in turn, each unless one that was taken is nearer."""
    tree, open_ = cKDTree(points, boxsize=boxsize), np.ones(len(points), dtype=bool)
    taken = []
    for row in range(len(points)):
        if open_[row]:
            taken.append(row)
            open_[tree.query_ball_point(points[row], distance)] = False
    return np.array(taken)


def thinned(leaf, count, share, rng):
    spacing = np.sqrt(leaf.area / count)
    points = leaves.uniform(leaf, round(RATIOS[share] * count), rng)
    return points[apart(points, share * spacing)]


@pytest.fixture(scope="module", params=RATIOS)
def strip(request):
    """Distances of a thinned sample's points from two edges of a leaf, length of these, and least distance in spacings.

    Periodic along the edges, and all in spacings of the density in the middle between them.
    """
    share, length, width = request.param, 6000.0, 12.0
    rng = np.random.default_rng(0)
    points = rng.uniform(0, (width, length), (round(RATIOS[share] * length * width), 2))
    across = points[apart(points, share, boxsize=(4 * width, length)), 0]
    spacing = np.sqrt(length * (width - 2 * DEEP) / np.count_nonzero(np.abs(across - width / 2) < width / 2 - DEEP))
    depths = np.concatenate([across, width - across]) / spacing
    return depths[depths < DEEP], 2 * length / spacing, share / spacing


@pytest.mark.few(strip=1)
def test_there_are_as_many_points_more_beside_an_edge_as_the_law_says(strip):
    depths, length, share = strip
    assert abs(len(depths) / length - DEEP - excess_beside(share)) < THINNED_EXCESS


@pytest.mark.few(strip=1)
def test_they_move_the_edge_out_by_as_much_as_their_scores(strip):
    depths, length, share = strip
    found = brentq(lambda d: (score((d + depths) / BLUR) / BLUR).sum() - length, -1, 1)
    told = blurred(np.zeros(1), excess_beside(share), SHUT_OUT).offset[0]
    assert abs(found - told) < THINNED_OFFSET


@pytest.mark.few(share=1, seed=1)
@pytest.mark.parametrize("share", RATIOS)
@pytest.mark.parametrize("seed", range(2))
def test_a_thinned_sample_ends_where_the_leaf_does(share, seed):
    leaf = leaves.ellipse()
    points = thinned(leaf, 2000, share, np.random.default_rng(seed))
    margin = Margin.fit(points)
    assert abs(margin.area / leaf.area - 1) < AREA_OF_THINNED
    assert "after thinning to a least distance" in margin.notes[0]


@pytest.mark.slow
def test_the_least_distance_is_told_in_space_through_noise():
    """Noise is there before a scan is thinned: of its feet on the leaf some are nearer."""
    leaf, spacing = o3l.samples.leaf_shape("curled"), 0.7
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=spacing, noise=0.3)
    points = np.asarray(scan.cloud.points)
    points = points[apart(points, 1.5 * spacing)]
    blade = o3l.create_blade(points, unit="mm")
    assert abs(blade.outline.area / leaf.area - 1) < THINNED_BLADE
    assert any("least distance of 1.05 mm" in note for note in blade.notes)


@pytest.mark.parametrize("scale", [1e-3, 1.0])
def test_a_distance_is_least_where_neighbors_are_no_nearer(scale):
    leaf, rng = leaves.ellipse(), np.random.default_rng(3)
    points = scale * thinned(leaf, 1000, 0.685, rng)
    found = least_distance(points)
    assert found >= cKDTree(points).query(points, k=2)[0][:, 1].min()
    assert abs(found / (scale * 0.685 * np.sqrt(leaf.area / 1000)) - 1) < LEAST_DISTANCE
    for sampler in (leaves.uniform, leaves.jittered, leaves.graded):
        assert least_distance(sampler(leaf, 1000, rng)) == 0.0
    assert least_distance(points[np.argsort(np.linalg.norm(points, axis=1))[:99]]) == 0.0


def test_a_lattice_was_not_thinned():
    """The sides of its cells are a least distance, too, but rows end at its margin anywhere."""
    leaf, rng = leaves.ellipse(), np.random.default_rng(4)
    points = leaves.lattice(leaf, 1500, rng, across=1.7, jitter=0.004)
    assert least_distance(points) > 0
    assert Margin.fit(points).area == Margin.fit(points, thinned_to=0.0).area
