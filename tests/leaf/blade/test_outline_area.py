"""Outlines: distances from their sides, and polygons that one thread asks about at a time, as GEOS needs it."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import shapely

from o3dleaf.leaf.blade.outline_area import distances_beyond, in_polygon
from tolerances import ROUNDING


def test_threads_ask_one_polygon_one_after_the_other(monkeypatch):
    asking, most, counting, ask = [0], [0], threading.Lock(), shapely.intersects_xy

    def counted(*args):
        with counting:
            asking[0] += 1
            most[0] = max(most[0], asking[0])
        time.sleep(0.01)  # long enough for the others to come in, if they may
        found = ask(*args)
        with counting:
            asking[0] -= 1
        return found

    monkeypatch.setattr(shapely, "intersects_xy", counted)
    turn = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    radius = 1 + 0.2 * np.sin(9 * turn)
    star = shapely.Polygon(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (12, 500, 2))
    with ThreadPoolExecutor(6) as threads:
        found = list(threads.map(lambda some: in_polygon(star, some), points))
    assert most == [1]
    angle, far = np.arctan2(points[..., 1], points[..., 0]), np.linalg.norm(points, axis=2)
    clear = np.abs(far - 1 - 0.2 * np.sin(9 * angle)) > 0.01  # chords leave the curve by less
    assert np.array_equal(np.array(found)[clear], (far < 1 + 0.2 * np.sin(9 * angle))[clear])


def test_distances_from_an_outline_are_those_of_geos_and_their_derivatives_point_away_from_it():
    turn = np.linspace(0, 2 * np.pi, 103, endpoint=False)
    star = np.column_stack([(3 + np.sin(9 * turn)) * np.cos(turn), np.sin(turn)])
    area = shapely.Polygon(star, [0.3 * star[::-7] / 3]) | shapely.Polygon([[4, 4], [6, 4], [5, 5]])
    points = np.random.default_rng(1).uniform(-6, 6, (2000, 2))
    found = distances_beyond(area, np.vstack([points, star[:20], [5.0, 4.0]]))
    far, sign = shapely.distance(area.boundary, shapely.points(points)), 1 - 2 * shapely.contains_xy(area, points)
    np.testing.assert_allclose(found[:-21, 0], sign * far, rtol=ROUNDING, atol=ROUNDING)
    assert np.abs(found[-21:]).max() < ROUNDING  # a place on the outline has no side
    back = points - found[:-21, :1] * found[:-21, 1:]
    np.testing.assert_allclose(np.linalg.norm(found[:-21, 1:], axis=1), 1, rtol=ROUNDING)
    assert shapely.distance(area.boundary, shapely.points(back)).max() < ROUNDING
