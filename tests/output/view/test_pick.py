"""Picking by hand: everything but the window itself, which needs a screen."""

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.output.view import pick, pick_midrib, window
from o3dleaf.output.view.pick import control_points

POINTS = np.random.default_rng(0).uniform(0, 1, (30, 3))


@pytest.fixture
def screen(monkeypatch):
    """A window in which the points of the given numbers are picked."""

    def picking(numbers):
        class Window:
            shown = None

            def create_window(self, **options):
                return True

            def add_geometry(self, geometry):
                Window.shown = np.asarray(geometry.points)

            def run(self):
                pass

            def destroy_window(self):
                pass

            def get_picked_points(self):
                return numbers

        monkeypatch.setattr(window, "has_display", lambda: True)
        for name in ("Visualizer", "VisualizerWithEditing"):
            monkeypatch.setattr(o3d.visualization, name, Window)
        return Window

    return picking


def test_picked_points_are_control_points_in_the_order_of_picking(screen):
    shown = screen([7, 3, 21])
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    assert np.array_equal(pick_midrib(cloud), POINTS[[7, 3, 21]])
    assert np.array_equal(shown.shown, POINTS)


def test_a_place_picked_twice_counts_once_where_it_came_first():
    doubled = np.concatenate([POINTS, POINTS[[5]]])
    assert np.array_equal(control_points(doubled, [9, 5, 9, 2, 30, 4]), POINTS[[9, 5, 2, 4]])


@pytest.mark.parametrize("picked", [[], [4], [4, 4]])
def test_fewer_than_two_places_are_refused_with_how_to_pick(screen, picked):
    screen(picked)
    with pytest.raises(InputError, match=r"shift \+ left click"):
        pick_midrib(POINTS)


def test_without_a_screen_it_says_so_and_what_else_to_do(monkeypatch):
    monkeypatch.setattr(pick, "_pick", lambda points: pytest.fail("a window opened"))
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(O3DLeafError, match=r"no screen.*find_midrib"):
        pick_midrib(POINTS)


def test_an_empty_cloud_is_refused_before_a_window_opens():
    with pytest.raises(InputError, match="at least 2"):
        pick_midrib(np.empty((0, 3)))
