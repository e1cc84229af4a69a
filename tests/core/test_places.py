import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.places import tell_middle, tell_place

GRID = np.array([431234.5, 5421345.25, 123.4])
"""A place in a grid of the Earth, in meters."""


@pytest.mark.parametrize("size", [0.09, 1.0, 90.0, 4e4])
@pytest.mark.parametrize("origin", [np.zeros(3), GRID, -1e3 * GRID])
def test_a_place_is_told_to_a_thousandth_of_the_size_wherever_it_is(size, origin):
    cloud = origin + size * np.random.default_rng(0).random((100, 3))
    told = [float(word) for word in tell_place(cloud[7], cloud).split()]
    assert np.abs(told - cloud[7]).max() <= 1e-3 * size


def test_a_place_has_no_more_digits_than_its_cloud_is_worth():
    assert tell_place(np.array([-0.0001, 12.3456, 80.0]), np.array([[0.0] * 3, [90.0] * 3])) == "0.00 12.35 80.00"
    assert tell_place(np.array([431234.56, 7.0]), np.array([[4e5, 0.0], [5e5, 10.0]])) == "431235 7"


def test_the_middle_of_some_points_is_one_of_them():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [50, 0, 0]])
    assert tell_middle(points, points) == "1.00 0.00 0.00"


@pytest.mark.slow
def test_a_blade_tells_its_petiole_as_near_in_a_grid_of_the_earth_as_at_the_origin():
    scan = o3l.samples.scan_leaf(o3l.samples.leaf_shape("petiole"), spacing=1.6, seed=2)
    end = []
    for origin in (0.0, 1e3 * GRID):
        notes = o3l.create_blade(scan.points + origin, unit="mm").notes
        told = next(note for note in notes if note.startswith("petiole"))
        end.append(np.array([float(word) for word in told.split("from ")[1].split(" to ")[0].split()]))
    assert end[1] - end[0] == pytest.approx(1e3 * GRID, abs=0.02)
