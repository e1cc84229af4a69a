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


def test_beside_a_corner_of_the_rim_no_rounding_chooses_a_triangle():
    """A fan that is no plane, of which each triangle would carry a point past its middle to another place."""
    angle = np.linspace(-2.0, 2.0, 6)
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(3 * angle)])
    vertices = np.concatenate([[[0.0, 0.0, 0.0]], ring])
    triangles = np.array([[0, k, k + 1] for k in range(1, 6)])
    rng = np.random.default_rng(4)
    past = np.column_stack([-rng.uniform(0.5, 1.5, 200), rng.uniform(-0.2, 0.2, (200, 2))])
    found = carry_chart(vertices, triangles, vertices[:, :2], past)
    turned = carry_chart(vertices, triangles[::-1, [1, 2, 0]].copy(), vertices[:, :2], past)
    assert turned == pytest.approx(found, abs=tol.TWIN)
    moved = carry_chart(vertices + 1e-12 * rng.normal(size=vertices.shape), triangles, vertices[:, :2], past)
    assert moved == pytest.approx(found, abs=tol.ONE_REST)
