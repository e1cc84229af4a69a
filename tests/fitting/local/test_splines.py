"""Splines of some balls, put together with those of others."""

import numpy as np
import pytest

from o3dleaf import PUInterpolant


@pytest.mark.few
@pytest.mark.parametrize("rho", [1e-3, "gcv-per-ball"])
@pytest.mark.parametrize(
    "rows", [[0, 2, 4], [2, 1, 0], [0, 1, 2, 3], ["one of the others"], [0, "one of the others", 2], [-1, 0]]
)
def test_each_ball_of_two_sets_comes_out_as_it_was(rho, rows):
    """In any order, with gaps in it, and where the other set is a single ball."""
    rng = np.random.default_rng(0)
    points = rng.random((900, 3))
    field = PUInterpolant.fit(points, rng.random(900), rho=rho)
    splines, alone = field.local, field.local.composed(field.local, np.array([3]))
    old = len(splines.tails)
    chosen = np.array([old if row == "one of the others" else row % old for row in rows])
    found = splines.composed(alone, chosen)
    assert len(found.tails) == len(found.offsets) - 1 == len(chosen)
    for ball, row in enumerate(chosen):
        source = 3 if row == old else row
        for ours, theirs in zip(found.ball(ball), splines.ball(source), strict=True):
            np.testing.assert_array_equal(ours, theirs)
        np.testing.assert_array_equal(found.tails[ball], splines.tails[source])
        assert found.ranks[ball] == splines.ranks[source]
        assert found.diagonals[ball] == splines.diagonals[source]
