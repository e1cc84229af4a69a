"""A drop at rest: on a plate that of Young and Laplace, on ridges with the angle that was set."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from leaf_fields import leaf_of, texture
from o3dleaf.commands.droplet import case_options
from o3dleaf.commands.export import ExportJob
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.output.static_drop import evolver
from o3dleaf.output.static_drop.cap import cap_radius
from o3dleaf.output.static_drop.datafile import StaticDrop
from o3dleaf.output.static_drop.evolver import has_evolver, settle_drop, write_drop
from o3dleaf.output.static_drop.ground import CosineSeries
from o3dleaf.output.static_drop.site import drop_on_leaf
from tolerances import ANGLE_AT_LINE, DROP_BASE, DROP_HEIGHT, RIDGE_HEIGHT

needs_evolver = pytest.mark.skipif(
    not has_evolver(), reason="Surface Evolver is not here (apt-get install evolver-nox)"
)
PLATE = CosineSeries(np.zeros((1, 1)), np.array([4e-3, 4e-3]))
WAVE = 0.28e-3


def ridges(height, size=1.12e-3):
    """Ridges across y, one under the middle."""
    weights = np.zeros((1, 9))
    weights[0, 8] = height
    return CosineSeries(weights, np.array([size, size]))


def young_laplace(angle, bond):
    """Height and radius of the base of a drop on a plate, of the volume of a unit ball, by integration from the top."""

    def profile(curvature):
        def slope(_, state):
            r, depth, turn, _ = state
            side = np.sin(turn) / r if r > 1e-9 else curvature
            return [np.cos(turn), np.sin(turn), 2 * curvature + bond * depth - side, np.pi * r**2 * np.sin(turn)]

        def at_plate(_, state):
            return state[2] - angle

        at_plate.terminal = True
        return solve_ivp(slope, (0, 20 / curvature), [0.0] * 4, events=at_plate, rtol=1e-10, atol=1e-12).y[:, -1]

    curvature = brentq(lambda each: profile(each)[3] - 4 * np.pi / 3, 0.05, 3)
    radius, height = profile(curvature)[:2]
    return height, radius


@needs_evolver
@pytest.mark.parametrize(
    ("angle", "diameter", "gravity"),
    [
        (120.0, 0.6e-3, 0.0),
        (150.0, 0.6e-3, 9.81),
        (120.0, 3e-3, 9.81),
        *(
            pytest.param(angle, diameter, 9.81, marks=pytest.mark.slow)
            for angle in (90.0, 140.0, 150.0)
            for diameter in (0.6e-3, 3e-3)
        ),
    ],
)
def test_on_a_plate_a_drop_is_that_of_young_and_laplace(angle, diameter, gravity):
    drop = StaticDrop(PLATE, angle, diameter, gravity=gravity)
    found = settle_drop(drop)
    height, radius = young_laplace(np.radians(angle), drop.bond_number)
    if not gravity:  # a cap of a sphere
        sphere = cap_radius(np.radians(angle))
        assert height == pytest.approx(sphere * (1 - np.cos(np.radians(angle))), rel=1e-6)
        assert found.pressure == pytest.approx(2 * drop.tension / (sphere * drop.radius), rel=DROP_HEIGHT)
    assert found.height == pytest.approx(height * drop.radius, rel=DROP_HEIGHT)
    for width in found.base_widths:
        assert width == pytest.approx(2 * radius * drop.radius, rel=DROP_BASE)
    assert found.wetted_area == pytest.approx(np.pi * (radius * drop.radius) ** 2, rel=2 * DROP_BASE)
    assert np.abs(found.contact_angles - angle).max() < ANGLE_AT_LINE


@needs_evolver
def test_on_ridges_the_angle_at_the_line_is_the_one_that_was_set():
    found = settle_drop(StaticDrop(ridges(2.5e-5), 120.0, 0.6e-3))
    assert abs(found.contact_angles.mean() - 120) < ANGLE_AT_LINE
    assert np.abs(found.contact_angles - 120).max() < 2.5
    # It rests on a crest, which is symmetric: nothing holds it, and it is so itself.
    assert np.abs(found.held).max() < 1e-3
    # All of the line is on the surface, and nothing else touches it.
    line = found.vertices[found.line].reshape(-1, 3)
    assert np.abs(line[:, 2] - ridges(2.5e-5)(line[:, 0], line[:, 1])).max() < 1e-9
    assert found.clearance > -0.005 * found.drop.radius
    # Wetted: more than its shadow, by the slope of the ridges, which is 0.56 at most.
    x, y, _ = found.vertices[found.line[:, 0]].T
    order = np.argsort(np.arctan2(y, x))
    shadow = np.sum(x[order] * np.roll(y[order], -1) - np.roll(x[order], -1) * y[order]) / 2
    assert 1.02 < found.wetted_area / shadow < 1.15


@needs_evolver
@pytest.mark.slow
def test_what_does_not_come_to_rest_is_refused():
    with pytest.raises(O3DLeafError, match=r"rest|second time|done"):
        settle_drop(StaticDrop(ridges(2e-4), 150.0, 2e-3), timeout=60)


def test_without_evolver_the_file_is_written_and_a_line_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr(evolver, "PROGRAM", "no-such-evolver")
    drop = StaticDrop(PLATE, 120.0, 0.6e-3)
    with pytest.raises(InputError, match="apt-get install evolver-nox"):
        settle_drop(drop)
    write_drop(drop, tmp_path / "a.fe")
    assert (tmp_path / "a.fe").read_text(encoding="ascii") == drop.text()
    leaf = leaf_of(texture(lambda x, y, z: 0.3**2 - z**2 + 0.0 * x))[0]
    leaf.save(tmp_path / "leaf.o3l")
    job = ExportJob(
        tmp_path / "leaf.o3l", tmp_path / "b.fe", consumer="evolver", at=(10.0, 0.1), angle=120.0, diameter=0.2
    )
    said = []
    monkeypatch.setattr(case_options, "note", said.append)
    assert "settle" in job.run()
    assert "parameter contact_angle = 120" in (tmp_path / "b.fe").read_text(encoding="ascii")
    assert len(said) == 1
    assert "apt-get install evolver-nox" in said[0]


def ridged(x, y, z):
    """Ridges along x, 0.04 high above and below 0.3."""
    return np.where(z > 0, 0.3 + 0.04 * np.cos(np.pi * y) - z, z + 0.3) + 0.0 * x


def hairy(x, y, z):
    """The same with a blunt hair in the middle of a tile."""
    return ridged(x, y, z) + 0.2 * np.exp(-(x**2 + y**2) / 0.02) * (z > 0)


def test_the_ground_is_the_leafs_own_ridges():
    leaf = leaf_of(texture(ridged, half=0.4, n=17))[0]
    drop = drop_on_leaf(leaf, (9.0, 0.5), angle=120.0, diameter=0.4)
    assert drop.ground.coefficients.shape[0] == 1
    y = np.linspace(-0.3, 0.3, 13) * 1e-3
    found = drop.ground(0 * y, y) * 1e3
    wanted = 0.3 + 0.04 * np.cos(np.pi * (1e3 * y + 0.5))
    assert np.abs(found - wanted).max() < RIDGE_HEIGHT
    both = drop_on_leaf(leaf, (9.0, 0.5), angle=120.0, diameter=0.4, mean_along=False)
    assert np.abs(both.ground(0 * y, y) * 1e3 - wanted).max() < RIDGE_HEIGHT


def test_a_hair_is_refused_and_so_is_the_edge_of_the_blade():
    leaf = leaf_of(texture(hairy, half=0.6, n=21))[0]
    with pytest.raises(InputError, match="a hair stands"):
        drop_on_leaf(leaf, (10.0, 0.0), angle=120.0, diameter=0.2)
    assert drop_on_leaf(leaf, (9.0, 1.0), angle=120.0, diameter=0.2).diameter == pytest.approx(2e-4)
    with pytest.raises(InputError, match="leaves the blade"):
        drop_on_leaf(leaf, (10.0, 2.9), angle=120.0)
    with pytest.raises(InputError, match="from 10 to 170"):
        drop_on_leaf(leaf, (9.0, 1.0), angle=175.0)
