"""Which side of a sheet faces up."""

import numpy as np
import pytest

from o3dleaf.leaf.chart.turn import facing


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("mean", "up", "decided"), [(0.5, True, True), (-0.5, False, True), (0.05, True, False)])
def test_the_side_that_faces_up_is_told_by_shares_of_the_area(size, mean, up, decided):
    """In any unit, and however many triangles: rooms of a roof lean by a mean cosine."""
    lean = np.sqrt(1 - mean**2)
    corners = size * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, mean, lean]])
    vertices, triangles = np.tile(corners, (500, 1)), np.arange(1500).reshape(500, 3)
    found, note = facing(vertices, triangles, None)
    assert found == up
    assert ("undecided" in note) == (not decided)
    for stated in (2.0, 1e-3):
        assert facing(vertices, triangles, stated * np.array([0.0, 0.0, -1.0]))[0] != up
