"""A petiole is joined to its blade across one section of it, at its margin; what lies over ground is joined to that."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from o3dleaf import samples
from o3dleaf.leaf.chart.petiole import find_petiole

SPACING = 0.8


def stalk_on_sheet(at, width=3.0, length=30.0, half=20.0):
    """A round stalk that rises from a bowed sheet at a place along x, and goes out from it at its margin."""
    rng = np.random.default_rng(4)
    x, y = rng.uniform(-half, half, (2, int((2 * half / SPACING) ** 2)))
    turn, up = rng.uniform([[0.0], [0.0]], [[2 * np.pi], [length]], (2, int(np.pi * width * length / SPACING**2)))
    tube = [at + width / 2 * np.cos(turn), width / 2 * np.sin(turn), up]
    return np.concatenate([np.column_stack([x, y, -(x**2) / 40]), np.column_stack(tube) - [0, 0, at**2 / 40]])


def test_a_stalk_is_a_petiole_at_the_margin_of_a_sheet_and_inside_is_told():
    points = stalk_on_sheet(20.0)
    kept, petiole, told = find_petiole(points)
    assert petiole.width == pytest.approx(3.0, abs=SPACING)
    assert told == ()
    kept, petiole, (told,) = find_petiole(stalk_on_sheet(0.0))
    assert kept.all()
    assert petiole is None
    assert "the rest goes on all around it, as ground does around a leaf" in told


def leaf_over_ground():
    """An arched leaf that all but touches a ridge, which is not seen under it."""
    points = samples.scan_leaf(samples.leaf_shape("eaten", length=40, width=16), seed=0, spacing=SPACING).points
    points = points - [*points[:, :2].mean(axis=0), points[:, 2].min() - 0.75 * SPACING]
    reach = np.abs(points[:, :2]).max(axis=0) * 2
    ground = np.random.default_rng(3).uniform(-reach, reach, (int(4 * reach.prod() / SPACING**2), 2))
    seen = ground[cKDTree(points[:, :2]).query(ground)[0] > SPACING]
    return np.concatenate([points, np.column_stack([seen, -(seen[:, 0] ** 2) / 400])])


def test_a_leaf_over_uneven_ground_is_no_petiole_of_it():
    kept, petiole, (told,) = find_petiole(leaf_over_ground())
    assert kept.all()
    assert petiole is None
    assert "is joined to the rest over" in told
