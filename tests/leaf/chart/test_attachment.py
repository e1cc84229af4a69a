"""A petiole is joined to its blade across one section of it; a leaf that lies over ground is joined to that aside."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from o3dleaf import samples
from o3dleaf.leaf.chart.petiole import find_petiole

SPACING = 0.8


def test_a_stalk_is_joined_to_a_sheet_across_one_section():
    rng = np.random.default_rng(4)
    x, y = rng.uniform(-20, 20, (2, 2500))
    turn, up = rng.uniform([[0.0], [0.0]], [[2 * np.pi], [30.0]], (2, int(np.pi * 3.0 * 30.0 / SPACING**2)))
    tube = np.column_stack([20 + 1.5 * np.cos(turn), 1.5 * np.sin(turn), up - 10])
    _, petiole, part = find_petiole(np.concatenate([np.column_stack([x, y, -(x**2) / 40]), tube]))
    assert petiole.width == pytest.approx(3.0, abs=SPACING)
    assert part is None


def leaf_over_ground():
    """An arched leaf that all but touches a ridge, which is not seen under it."""
    points = samples.scan_leaf(samples.leaf_shape("eaten", length=40, width=16), seed=0, spacing=SPACING).points
    points = points - [*points[:, :2].mean(axis=0), points[:, 2].min() - 0.75 * SPACING]
    reach = np.abs(points[:, :2]).max(axis=0) * 2
    ground = np.random.default_rng(3).uniform(-reach, reach, (int(4 * reach.prod() / SPACING**2), 2))
    seen = ground[cKDTree(points[:, :2]).query(ground)[0] > SPACING]
    return np.concatenate([points, np.column_stack([seen, -(seen[:, 0] ** 2) / 400])])


def test_a_leaf_over_uneven_ground_is_no_petiole_of_it():
    kept, petiole, part = find_petiole(leaf_over_ground())
    assert kept.all()
    assert petiole is None
    assert "is joined to the rest over" in str(part)
