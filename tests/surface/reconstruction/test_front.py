"""Distances to the lines of a front."""

import numpy as np
import pytest

from o3dleaf.surface.reconstruction.vertex_support_loops import _to_line
from tolerances import ROUNDING


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_the_distance_from_a_line_is_that_from_the_nearest_of_its_points(size):
    """Beside it, beyond either end, and of a line that is a point."""
    rng = np.random.default_rng(0)
    shares = np.linspace(0, 1, 20_001)[:, np.newaxis]
    for point, one, other in size * rng.normal(size=(50, 3, 3)):
        nearest = np.linalg.norm(one + shares * (other - one) - point, axis=1).min()
        assert _to_line(point, np.array([one, other])) == pytest.approx(nearest, rel=1e-4)
        length = np.linalg.norm(point - one)
        assert _to_line(point, np.array([one, one])) == pytest.approx(length, rel=ROUNDING)
