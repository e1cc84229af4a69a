"""Sines of smallest angles, and distances to triangles, against slow twins and Open3D."""

import numpy as np
import open3d as o3d
import pytest
from scipy.optimize import minimize

import reference
from o3dleaf.surface.remeshing.shape_loops import normal_of, roundness, square, square_to_segment, square_to_triangle
from tolerances import FAR_TRIANGLE, NEAREST_POINT, ROUNDING, SINGLE_PRECISION_DISTANCE, SMALL_SINE


def triangles(seed, count=200):
    """Corners at random, in every fourth triangle nearly on a line."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(count, 3, 3))
    corners[::4, 2] = (corners[::4, 0] + corners[::4, 1]) / 2 + 1e-6 * corners[::4, 2]
    return corners


def found_roundness(corners):
    return roundness(*corners, normal_of(*corners, np.empty(3)))


def test_roundness_is_the_sine_of_the_smallest_angle():
    for corners in triangles(0):
        expected = np.sin(np.radians(reference.smallest_angle(*corners)))
        for turn in range(3):
            assert found_roundness(np.roll(corners, turn, axis=0)) == pytest.approx(expected, rel=SMALL_SINE)


def test_roundness_of_a_triangle_without_area_is_zero_and_of_an_equilateral_one_the_sine_of_60_degrees():
    p, q = np.array([0.1, 0.2, 0.3]), np.array([1.1, 0.2, 0.3])
    for corners in ([p, p, q], [p, q, q], [q, p, q], [p, p, p], [p, q, 2 * q - p]):
        assert found_roundness(corners) == 0.0
    for size in (1e-30, 1.0, 1e30):
        assert found_roundness(size * np.eye(3)) == pytest.approx(np.sqrt(3) / 2, rel=ROUNDING)


def test_normals_are_cross_products():
    normal = np.empty(3)
    for p, q, r in triangles(1, 20):
        length = normal_of(p, q, r, normal)
        assert normal == pytest.approx(np.cross(q - p, r - p), rel=ROUNDING, abs=ROUNDING)
        assert length == pytest.approx(np.linalg.norm(np.cross(q - p, r - p)), rel=1e-9)
        assert square(p, q) == pytest.approx(np.sum((p - q) ** 2), rel=ROUNDING)


def test_distances_to_triangles_are_those_of_the_nearest_of_their_points():
    """The twin minimises |x − p − s (q − p) − t (r − p)|² over s, t, and over the sides."""
    rng = np.random.default_rng(2)
    inside = 0
    for corners in triangles(3, 60):
        p, q, r = corners
        x = rng.normal(size=3) * 0.7
        sides = np.column_stack([q - p, r - p])
        s, t = np.linalg.lstsq(sides, x - p, rcond=None)[0]
        expected = min(np.linalg.norm(on_side(x, a, b) - x) for a, b in ((p, q), (q, r), (r, p)))
        if min(s, t, 1 - s - t) >= 0:
            inside += 1
            expected = min(expected, np.linalg.norm(sides @ [s, t] + p - x))
        for turn in range(3):
            found = np.sqrt(square_to_triangle(x, *np.roll(corners, turn, axis=0)))
            assert found == pytest.approx(expected, rel=NEAREST_POINT, abs=NEAREST_POINT)
    assert inside > 10


def on_side(x, a, b):
    """Return the nearest point of a segment, by minimising."""
    found = minimize(lambda s: np.sum((a + s[0] * (b - a) - x) ** 2), [0.5], bounds=[(0, 1)], tol=1e-14)
    return a + found.x[0] * (b - a)


def test_distances_to_triangles_are_those_of_open3d():
    rng = np.random.default_rng(4)
    for corners in triangles(5, 30):
        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            *(o3d.core.Tensor(a) for a in (corners.astype(np.float32), np.array([[0, 1, 2]], np.uint32)))
        )
        points = rng.normal(size=(40, 3)).astype(np.float32)
        expected = scene.compute_distance(o3d.core.Tensor(points)).numpy()
        single = corners.astype(np.float32).astype(float)
        found = [np.sqrt(square_to_triangle(x, *single)) for x in points.astype(float)]
        assert np.abs(found - expected).max() < SINGLE_PRECISION_DISTANCE


def test_distances_to_what_has_no_area_are_those_to_its_sides():
    p, q, x = np.array([0.0, 0, 0]), np.array([2.0, 0, 0]), np.array([3.0, 0, 4])
    assert square_to_triangle(x, p, q, p) == pytest.approx(17)
    assert square_to_triangle(x, p, p, p) == square_to_segment(x, p, p) == pytest.approx(25)
    assert square_to_segment(x, p, q) == pytest.approx(17)
    assert square_to_segment(np.array([1.0, 3, 0]), p, q) == pytest.approx(9)


def test_far_from_the_origin_the_distance_is_as_good_as_its_coordinates():
    rng = np.random.default_rng(6)
    for corners in triangles(7, 20):
        x, far = rng.normal(size=3), 1e6
        near = np.sqrt(square_to_triangle(x, *corners))
        assert np.sqrt(square_to_triangle(x + far, *(corners + far))) == pytest.approx(near, abs=FAR_TRIANGLE)
