import numpy as np
import pytest

import planar_leaves as leaves
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.sample_metric import own_metric
from tolerances import LINES_APART, LINES_AREA


@pytest.mark.parametrize("ratio", [4, 6])
@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_scan_lines_are_even_in_their_own_metric(ratio, angle):
    points = leaves.lines(leaves.ellipse(), 1.3, ratio, angle, np.random.default_rng(0))
    stretch = own_metric(points)
    assert np.linalg.det(stretch) == pytest.approx(1)
    assert np.linalg.cond(stretch) == pytest.approx(ratio, rel=LINES_APART)
    along = np.linalg.eigh(stretch)[1][:, 1]
    assert abs(along @ [np.cos(angle), np.sin(angle)]) == pytest.approx(1, abs=1e-2)


@pytest.mark.parametrize("sampler", [leaves.uniform, leaves.jittered])
def test_an_even_sample_has_the_metric_of_the_plane(sampler):
    for leaf in (leaves.ellipse(), leaves.strip(20)):
        assert np.array_equal(own_metric(sampler(leaf, 600, np.random.default_rng(1))), np.eye(2))


@pytest.mark.parametrize("angle", [0.0, 0.2])
def test_a_margin_of_scan_lines_holds_a_cell_for_each_point(angle):
    """Lines at equal distances count an area without bias, wherever they begin."""
    points = leaves.lines(leaves.ellipse(), 1.3, 6, angle, np.random.default_rng(2))
    assert Margin.fit(points).area == pytest.approx(len(points) * 1.3**2, rel=LINES_AREA)
