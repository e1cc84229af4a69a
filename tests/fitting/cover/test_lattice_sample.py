"""A sample of a lattice's balls is that of the whole cover, whatever is held at once."""

import numpy as np
import pytest

from o3dleaf.fitting.cover import lattice_sample
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.cover.lattice_sample import sample_balls

ANGLE = 0.2
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])
ORIGIN = np.array([-2.0, 1.0, 0.5])


@pytest.mark.parametrize("turn", [np.eye(3), TURN])
@pytest.mark.parametrize("shape", [(60, 50, 40), (7, 9, 30), (5, 80, 6)])
@pytest.mark.parametrize("together", [1, 100, 1 << 16])
def test_a_sample_is_taken_from_the_balls_that_reach_into_the_box(shape, turn, together, monkeypatch):
    """The same tiles, sorted into the same classes in the same order; and one ball of the class of the most."""
    monkeypatch.setattr(lattice_sample, "TOGETHER", together)
    steps = np.diag([1.0, 1.0, 1.2]) @ turn.T
    box = ORIGIN + np.array([[0.2, 0.2, 0.2], [0.7, 0.7, 0.7]]) * np.array(shape)
    whole = VoxelCover.fit(shape, steps, 300, 1.1).reaching(*box, ORIGIN)
    sample, usual = sample_balls(shape, steps, 300, 1.1, box, ORIGIN, 20)
    rows = np.unique(np.linspace(0, len(whole.starts) - 1, 20).round().astype(int))
    np.testing.assert_array_equal(sample.starts, whole.starts[rows])
    np.testing.assert_array_equal(sample.keys[sample.classes], whole.keys[whole.classes[rows]])
    np.testing.assert_array_equal(
        np.argsort(sample.classes, kind="stable"), np.argsort(whole.classes[rows], kind="stable")
    )
    most = np.bincount(whole.classes).argmax()
    np.testing.assert_array_equal(usual.keys, whole.keys[[most]])
    assert (whole.starts[whole.classes == most] == usual.starts).all(axis=1).any()
