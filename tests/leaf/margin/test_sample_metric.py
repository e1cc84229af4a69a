import numpy as np
import pytest

import planar_leaves as leaves
from o3dleaf.leaf.margin.sample_metric import own_metric
from tolerances import LINES_APART


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
@pytest.mark.parametrize("leaf", [leaves.ellipse(), leaves.strip(20)], ids=["ellipse", "strip"])
def test_an_even_sample_has_the_metric_of_the_plane(sampler, leaf):
    """That of a narrow leaf too, along whose margin the triangles are long by chance."""
    for seed in range(10):
        assert np.array_equal(own_metric(sampler(leaf, 300, np.random.default_rng(seed))), np.eye(2))
