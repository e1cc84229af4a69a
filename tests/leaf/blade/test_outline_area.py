"""GEOS is asked by one thread at a time: its prepared polygons are no property of several."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import shapely

from o3dleaf.leaf.blade.outline_area import in_polygon


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
