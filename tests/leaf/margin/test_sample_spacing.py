"""The shape of the area that a point stands for: alike in all directions, or as scan lines have it."""

import numpy as np
import pytest

from o3dleaf.leaf.margin.sample_spacing import FAR, local_shape
from o3dleaf.leaf.margin.sample_triangles import triangulate

SIDE = 40.0


def axes_ratio(points):
    """Return the median ratio of the axes of the local metric."""
    xx, xy, yy = triangulate(points).metric.T
    values = np.linalg.eigvalsh(np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2))
    return np.median(np.sqrt(values[:, 1] / values[:, 0]))


@pytest.mark.parametrize("ratio", [9.0, 25.0, 100.0])
def test_scan_lines_have_the_shape_of_their_cells_however_far_apart(ratio):
    rng = np.random.default_rng(0)
    apart, count = np.sqrt(ratio), round(SIDE * np.sqrt(ratio))
    points = np.array([[x, y] for x in np.arange(apart / 2, SIDE, apart) for y in rng.uniform(0, SIDE, count)])
    # Edges across are slanting, and a third of all run along: 0.7 of what the cells have.
    assert 0.6 < axes_ratio(points) / ratio < 0.8


def test_beside_a_gap_a_random_sample_has_no_direction():
    rng = np.random.default_rng(0)
    points = rng.uniform(0, SIDE, (round(SIDE**2), 2))
    points = points[np.abs(points[:, 0] - SIDE / 2) > 2 * FAR]
    beside = np.abs(np.abs(points[:, 0] - SIDE / 2) - 2 * FAR) < 1
    metric = local_shape(points, triangulate(points).triangles)[beside]
    assert np.abs(metric.mean(axis=0) - [1.0, 0.0, 1.0]).max() < 0.15
