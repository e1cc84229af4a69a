"""Averages of voxels lie more densely along a margin, which is found where the leaf ends all the same."""

import numpy as np
import pytest
import shapely
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge.edge_score import BLUR, CUT, crowded, score
from o3dleaf.leaf.margin.margin import Margin
from tolerances import CROWDED, LATTICE_AREA, ROWS_AREA, VOXEL_AREA

ELLIPSE = shapely.affinity.scale(shapely.Point(0, 0).buffer(1.0, quad_segs=256), 60, 18)


def averages(points, turn, origin):
    """Averages of planar points over cubes of side 1 in another frame, back in the plane."""
    placed = np.c_[points, np.zeros(len(points))] @ turn.T
    voxel = np.unique(np.floor(placed - origin), axis=0, return_inverse=True)[1].ravel()
    sums = np.stack([np.bincount(voxel, column) for column in placed.T], axis=1)
    return (sums / np.bincount(voxel)[:, None] @ turn)[:, :2]


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_more_points_along_an_edge_move_it_out_by_as_much_as_their_scores(noise):
    """Independent points of density 1 inside 0, and an excess of 0.4 for each length: where the scores sum to ℓ."""
    length, excess, rng = 30_000, 0.4, np.random.default_rng(0)
    places = [rng.uniform(-5, 0, 5 * length), rng.uniform(-CUT, 0, int(excess * length))]
    moved = [each + noise * rng.normal(size=len(each)) for each in places]
    blur = np.hypot(BLUR, noise)
    roots = [
        brentq(lambda d, x=x: (score((d - x) / blur) / blur).sum() - length, -1, 1)
        for x in (moved[0], np.concatenate(moved))
    ]
    assert abs(roots[1] - roots[0] - crowded(np.array([noise]), excess)[0]) < CROWDED


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(3))
def test_averages_of_voxels_end_where_the_leaf_does(seed):
    """Each voxel of three spacings that the leaf reaches into has one point: the area of the leaf is no larger."""
    rng = np.random.default_rng(seed)
    points = leaves.uniform(ELLIPSE, round(9 * ELLIPSE.area), rng)
    turn = Rotation.random(random_state=seed).as_matrix()
    margin = Margin.fit(averages(points, turn, rng.random(3)))
    assert abs(margin.area / ELLIPSE.area - 1) < VOXEL_AREA
    assert "averages of voxels" in margin.notes[0]
    assert not any("averages of voxels" in note for note in Margin.fit(points[::9]).notes)


def test_where_a_lattice_crosses_a_leaf_ends_where_the_leaf_does():
    """Points in twos and threes, with gaps: their margin is found in its place in the mean of a few turns."""
    leaf = leaves.ellipse()
    areas = [Margin.fit(leaves.crossings(leaf, 2.0, np.random.default_rng(seed))).area for seed in range(4)]
    assert abs(np.mean(areas) / leaf.area - 1) < LATTICE_AREA


def test_rows_along_an_edge_are_no_averages_of_voxels():
    """They lie in one strip along the edge or the next, deeper inside as at the edge."""
    box = shapely.box(0, 0, 100, 9)
    margin = Margin.fit(leaves.crossings(box, 1.0, np.random.default_rng(35)))
    assert not any("averages of voxels" in note for note in margin.notes)
    assert abs(margin.area / box.area - 1) < ROWS_AREA
