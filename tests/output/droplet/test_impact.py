"""The frame of an impact, and its numbers in the solver's units."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leaf_fields import leaf_of, texture
from o3dleaf.output.droplet.frame import ImpactFrame, mean_height
from o3dleaf.output.droplet.surfaces import grid_solid
from o3dleaf.output.droplet.units import LENGTH, MASS, TIME, Impact
from tolerances import FIRST_ORDER, ROUNDING, SCALED_NUMBERS

positive = st.floats(1e-3, 1e3)


@pytest.fixture(scope="module")
def leaf():
    return leaf_of(texture(lambda x, y, z: 0.31**2 - z**2 + 0.0 * x), bend=15.0)


@pytest.mark.parametrize("place", [(4.0, -1.0), (10.0, 0.0), (16.0, 2.0)])
def test_the_frame_is_right_handed_and_turns_what_it_says(leaf, place):
    blade, lift = leaf[0].blade, leaf[1]
    frame = ImpactFrame.at(blade, place)
    assert np.allclose(frame.axes @ frame.axes.T, np.eye(3), atol=ROUNDING)
    assert np.linalg.det(frame.axes) > 0
    # Of a strip about a circle, along, across and normal are known.
    turn = place[0] / 15.0
    known = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    assert np.allclose(frame.axes, known, atol=FIRST_ORDER)
    assert np.allclose(frame.to_local(lift(*np.array([[*place, 0.2]]).T)), [[0, 0, 0.2]], atol=FIRST_ORDER)
    assert np.allclose(frame.raised(0.2).to_local(lift(*np.array([[*place, 0.2]]).T)), 0, atol=FIRST_ORDER)
    # Gravity keeps its size, and comes back.
    gravity = np.array(frame.turn((1.0, -2.0, -9.0)))
    assert np.allclose(gravity @ frame.axes, [1.0, -2.0, -9.0], atol=10 * ROUNDING)


@given(positive, positive, positive, positive, positive, positive)
def test_scaled_constants_have_the_same_dimensionless_numbers(diameter, speed, density, viscosity, tension, pull):
    impact = Impact(
        diameter=diameter * 1e-3, speed=speed, density=density, viscosity=viscosity * 1e-6, tension=tension,
        gravity=(0.3 * pull, -pull, 2 * pull),
    )  # fmt: skip
    scaled = impact.scaled()
    for name in ("weber", "reynolds", "bond"):
        assert math.isclose(getattr(scaled, name), getattr(impact, name), rel_tol=SCALED_NUMBERS)
    assert math.isclose(
        scaled.density / scaled.gas_density, impact.density / impact.gas_density, rel_tol=SCALED_NUMBERS
    )
    assert math.isclose(
        scaled.viscosity / scaled.gas_viscosity, impact.viscosity / impact.gas_viscosity, rel_tol=SCALED_NUMBERS
    )
    # A step is a time.
    cell = 0.1 * impact.diameter
    assert math.isclose(
        scaled.capillary_step(cell / LENGTH) * TIME, impact.capillary_step(cell), rel_tol=SCALED_NUMBERS
    )


def test_speeds_and_tension_are_the_same_numbers_in_both():
    assert math.isclose(LENGTH / TIME, 1.0)
    assert math.isclose(MASS / TIME**2, 1.0)


def test_a_mean_height_counts_what_stands_over_the_plane():
    """Of z = a + b x over a square it is that of the middle; a block on it adds its volume over the area."""
    x, y = np.meshgrid(np.linspace(0, 2, 9), np.linspace(0, 3, 7), indexing="ij")
    plane = np.column_stack([x.ravel(), y.ravel(), 0.5 + 0.25 * x.ravel()])
    triangles = grid_solid(9, 7)[0][: 2 * 8 * 6]
    assert math.isclose(mean_height(plane, triangles), 0.75, abs_tol=ROUNDING)
    block, faces = closed_block((1.0, 1.0, 0.6), (0.5, 0.4, 1.0))
    vertices = np.concatenate([plane, block])
    both = np.concatenate([triangles, faces + len(plane)])
    assert math.isclose(mean_height(vertices, both), 0.75 + 0.5 * 0.4 * 1.0 / 6.0, abs_tol=ROUNDING)


def closed_block(corner, size):
    """A block as a closed surface, looking outward: seen from above, its walls hide nothing and count nothing."""
    x, y = np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij")
    flat = [np.column_stack([x.ravel(), y.ravel(), np.full(4, z)]) for z in (1.0, 0.0)]
    return corner + np.concatenate(flat) * size, grid_solid(2, 2)[0]
