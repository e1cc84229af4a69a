import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.macro import outline
from o3dleaf.leaf.macro.outline import AlphaShape, circumradii


def ring(rng, count=1500):
    angle, radius = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(4, 9, count))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def test_circumradius_of_a_right_triangle_is_half_its_hypotenuse():
    assert circumradii(np.array([[0, 0], [3, 0], [0, 4.0]]), np.array([[0, 1, 2]]))[0] == pytest.approx(2.5)


def test_flat_triangles_have_an_infinite_circumradius():
    assert circumradii(np.array([[0, 0], [1, 0], [2, 0.0]]), np.array([[0, 1, 2]]))[0] == np.inf


@given(st.integers(0, 10**6))
def test_an_infinite_alpha_is_the_convex_hull(seed):
    points = np.random.default_rng(seed).uniform(0, 1, (40, 2))
    shape = AlphaShape(points, 1e9)
    queries = np.random.default_rng(seed + 1).uniform(-0.2, 1.2, (200, 2))
    assert np.array_equal(shape.contains(queries), Delaunay(points).find_simplex(queries) >= 0)


def test_membership_is_that_of_the_kept_triangles_with_holes_filled():
    points = ring(np.random.default_rng(0))
    shape = AlphaShape(points, 0.5)
    corners = points[shape.triangles]
    queries = np.random.default_rng(1).uniform(-3.2, 3.2, (2000, 2))
    in_triangle = np.zeros(len(queries), dtype=bool)
    for triangle in corners:
        sides = [
            (b[0] - a[0]) * (queries[:, 1] - a[1]) - (b[1] - a[1]) * (queries[:, 0] - a[0])
            for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True)
        ]
        in_triangle |= np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)
    hole = np.linalg.norm(queries, axis=1) < 1.9
    inside = shape.contains(queries)
    assert np.all(inside[in_triangle])
    assert np.all(inside[hole])
    assert not np.any(inside[~in_triangle & (np.linalg.norm(queries, axis=1) > 3)])


def test_automatic_alpha_is_the_least_that_holds_all_points_in_one_piece():
    points = ring(np.random.default_rng(2))
    shape = AlphaShape(points)
    assert shape.automatic
    assert len(np.unique(shape.triangles)) == len(points)
    assert shape.contains(points).all()
    below = AlphaShape(points, shape.alpha * (1 - 1e-9))
    assert len(np.unique(below.triangles)) < len(points)


def test_automatic_alpha_scales_and_turns_with_the_points():
    points = ring(np.random.default_rng(3))
    turn = np.array([[np.cos(1), -np.sin(1)], [np.sin(1), np.cos(1)]])
    assert AlphaShape(1000 * points @ turn.T).alpha == pytest.approx(1000 * AlphaShape(points).alpha, rel=1e-9)


def test_what_has_no_area_is_refused():
    with pytest.raises(InputError, match="one line"):
        AlphaShape(np.column_stack([np.arange(10.0), 2 * np.arange(10.0)]))
    with pytest.raises(InputError, match="at least 3"):
        AlphaShape(np.zeros((2, 2)))
    with pytest.raises(InputError, match="below every circumradius"):
        AlphaShape(ring(np.random.default_rng(4)), 1e-6)


@pytest.mark.parametrize("alpha", [0.09, 0.2, None])
def test_the_union_of_many_triangles_is_that_of_few(monkeypatch, alpha):
    """The boundary alone says the same as all triangles: with notches, holes and corners that touch, too."""
    points = ring(np.random.default_rng(5))
    one = AlphaShape(points, alpha)
    assert one.polygon.area > 0
    monkeypatch.setattr(outline, "MANY", 0)
    other = AlphaShape(points, alpha)
    assert other.alpha == one.alpha
    assert other.polygon.normalize().equals_exact(one.polygon.normalize(), 0.0)
