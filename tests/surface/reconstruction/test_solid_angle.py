"""The winding number of a cloud is the solid angle that its surface fills of the view, signed."""

import numpy as np
import pytest

from cloud_shapes import sphere
from o3dleaf import OrientedCloud
from o3dleaf.surface.reconstruction.solid_angle import WindingNumber
from tolerances import SOLID_ANGLE, WINDING_NODES


@pytest.fixture(scope="module")
def ball():
    """Points of a sphere on a spiral, each with as much area as any other."""
    number = np.arange(4_000)
    height, angle = 1 - (2 * number + 1) / len(number), number * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - height**2)
    points = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), height])
    return OrientedCloud.of(points, points.copy(), spacing=np.sqrt(4 * np.pi / len(points)))


def test_it_is_one_inside_and_nothing_outside(ball):
    directions, _ = sphere(200, seed=4)
    number = WindingNumber.of(ball)
    assert np.abs(number(0.8 * directions) - 1).max() < SOLID_ANGLE
    assert np.abs(number(1.25 * directions)).max() < SOLID_ANGLE


def test_a_gap_takes_its_solid_angle(ball):
    """From the height z on the axis the missing cap is seen as the disc in its rim: 2π (1 − cos φ)."""
    rim = np.radians(40)
    left = ball.points[:, 2] < np.cos(rim)
    number = WindingNumber.of(OrientedCloud.of(ball.points[left], ball.normals[left], spacing=ball.spacing))
    height = np.linspace(-0.7, 0.5, 7)
    gap = (1 - (np.cos(rim) - height) / np.hypot(np.cos(rim) - height, np.sin(rim))) / 2
    np.testing.assert_allclose(number(height[:, np.newaxis] * [0, 0, 1.0]), 1 - gap, rtol=0, atol=SOLID_ANGLE)


def test_far_points_count_together_as_they_do_alone(ball):
    places, _ = sphere(50, seed=5)
    places *= np.linspace(0.3, 3.0, 50)[:, np.newaxis]
    number = WindingNumber.of(ball)
    arm = ball.points - places[:, np.newaxis]
    flux = ball.normals * (ball.point_spacing**2)[:, np.newaxis]
    literal = (np.einsum("nmj,mj->nm", arm, flux) / np.linalg.norm(arm, axis=2) ** 3).sum(axis=1) / (4 * np.pi)
    np.testing.assert_allclose(number(places), literal, rtol=0, atol=WINDING_NODES)


def test_levels_tell_closed_from_open(ball):
    assert WindingNumber.of(ball).level == pytest.approx(0.5, abs=0.1)
    inward = OrientedCloud.of(ball.points, -ball.normals, spacing=ball.spacing)
    assert WindingNumber.of(inward).level == pytest.approx(-0.5, abs=0.1)
    flat = np.column_stack([np.random.default_rng(6).uniform(size=(2_000, 2)), np.zeros(2_000)])
    sheet = OrientedCloud.of(flat, np.tile([0.0, 0.0, 1.0], (2_000, 1)))
    assert np.abs(WindingNumber.of(sheet).levels(np.arange(0, 2_000, 100))).max() < 1e-12
