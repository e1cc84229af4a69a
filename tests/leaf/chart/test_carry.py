"""A sheet's parameters go on past its rim as its triangles lie."""

import numpy as np
import pytest
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from o3dleaf.leaf.chart.carry import carry, carry_chart
from tests import tolerances as tol

TURN = np.array([[0.6, -0.8], [0.8, 0.6]])
SHIFT = np.array([4.0, -7.0])


@pytest.fixture(scope="module")
def flat():
    """A sheet in a tilted plane: its places, vertices, triangles, and the map from places to the world."""
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 10, (80, 2))
    axes = Rotation.random(random_state=1).as_matrix()
    triangles = Delaunay(places).simplices.astype(np.int64)
    return places, triangles, lambda plane, height: np.column_stack([plane, height]) @ axes.T + 3.0


@pytest.mark.parametrize("scale", [1.0, 1.3])
def test_past_the_rim_a_flat_sheet_goes_on_as_the_plane_does(flat, scale):
    places, triangles, lift = flat
    chart = scale * places @ TURN.T + SHIFT
    vertices = lift(places, np.zeros(len(places)))
    rng = np.random.default_rng(2)
    inside, beyond = rng.uniform(3, 7, (200, 2)), rng.uniform(-3, 13, (400, 2))
    found = carry_chart(vertices, triangles, chart, lift(inside, rng.normal(size=200)))
    assert found == pytest.approx(scale * inside @ TURN.T + SHIFT, abs=tol.TWIN)
    # What lies past it goes on without stretch, from the parameters of its foot.
    points = lift(beyond, rng.normal(size=400))
    foot = carry(vertices, triangles, places, points)
    expected = (scale * foot + (beyond - foot)) @ TURN.T + SHIFT
    assert carry_chart(vertices, triangles, chart, points) == pytest.approx(expected, abs=tol.TWIN)
    assert np.linalg.norm(beyond - foot, axis=1).max() > 2


def test_a_triangle_without_area_gives_the_parameters_of_its_first_corner():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    found = carry_chart(vertices, np.array([[0, 1, 2]]), vertices[:, :2], np.array([[0.5, 1.0, 0.0]]))
    assert np.array_equal(found, [[0.0, 0.0]])
