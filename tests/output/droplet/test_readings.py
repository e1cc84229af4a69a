"""What the solver writes is read as it is: tables with restarts, and the shape of a droplet that is known."""

import numpy as np
import pytest
from skimage.measure import marching_cubes

from droplet_runs import cap, write_run
from o3dleaf.core.errors import InputError
from o3dleaf.output.droplet.readings import COLUMNS, DropletReadings, cap_of, measure_droplet, read_series, table_of
from o3dleaf.output.droplet.units import LENGTH, TIME
from tolerances import CAP_ANGLE, CAP_AREA, CAP_SHAPE, CAP_VOLUME, ROUNDING


@pytest.mark.parametrize("angle", [90.0, 120.0, 150.0])
def test_a_spherical_cap_is_read_as_it_is(tmp_path, angle):
    share, ticks = cap(angle, shift=(3.0, -2.0))
    write_run(tmp_path, [share, share], ticks, [5, 10])
    found, c = DropletReadings.read(tmp_path), np.cos(np.radians(angle))
    known = {
        "t": 10 * TIME,
        "volume": np.pi * 30**3 * (1 - c) ** 2 * (2 + c) / 3 * LENGTH**3,
        "contact_area": np.pi * (30 * np.sin(np.radians(angle))) ** 2 * LENGTH**2,
        "width_along": 2 * 30 * LENGTH,
        "width_across": 2 * 30 * LENGTH,
        "height": 30 * (1 - c) * LENGTH,
        "velocity_x": 1e-3,
        "velocity_y": -2e-3,
        "velocity_z": -0.4,
        "alpha_min": -2e-8,
        "alpha_max": 1 + 1e-9,
        "fastest": 10.0,
    }
    tolerance = {"volume": CAP_VOLUME, "contact_area": CAP_AREA, "height": CAP_SHAPE}
    tolerance |= {"width_along": CAP_SHAPE, "width_across": CAP_SHAPE}
    for name in COLUMNS:
        assert np.isclose(found.column(name)[-1], known[name], rtol=tolerance.get(name, 10 * ROUNDING)), name
    assert abs(cap_of(found.column("volume")[-1], found.column("height")[-1]) - angle) < CAP_ANGLE
    lines = table_of({"leaf": found}).splitlines()
    assert len(lines) == 3
    assert [float(word) for word in lines[-1].split(",")[1:]] == found.rows[-1].tolist()


def test_a_drop_apart_is_not_the_droplet():
    """Widths are those of the largest piece."""
    share, _ = cap(150.0, radius=20.0)
    share[2:4, 2:4, 20:22] = 1.0
    vertices, triangles, _, _ = marching_cubes(share, 0.5)
    along, across, height = measure_droplet(vertices, triangles.astype(np.int64))
    assert np.allclose([along, across], 20.0, rtol=2 * CAP_SHAPE)
    assert height < 20.0


def test_what_was_written_after_a_restart_takes_the_place_of_what_was(tmp_path):
    for start, rows in (("0", "1 10\n2 20\n3 30\n4 4"), ("2.5", "3 31\n4 41\n"), ("10", "")):
        (tmp_path / start).mkdir()
        (tmp_path / start / "x.dat").write_text(f"# Time value\n{rows}")
    assert read_series(tmp_path).tolist() == [[1, 10], [2, 20], [3, 31], [4, 41]]
    assert read_series(tmp_path / "none").shape == (0, 2)


def test_figures_are_those_of_a_known_course():
    """Touch at 2, lift-off between 5 and 6, in the air it swings on: that ratio does not count."""
    nan = np.zeros(8)
    area = np.array([0.0, 0.0, 0.5, 1.0, 0.8, 0.1, 0.0, 0.0])
    along = np.array([0.8, 1.0, 1.1, 1.3, 1.2, 0.8, 0.6, 1.0])
    across = np.array([1.0, 1.0, 1.1, 1.2, 0.9, 0.9, 1.2, 1.0])
    volume = np.array([1.0, 1.0, 1.0, 1.0, 0.999, 1.0, 1.0, 1.0])
    speed = np.array([-0.5, -0.5, -0.4, 0.0, 0.2, 0.3, 0.31, 0.3])
    rows = np.column_stack(
        [np.arange(8.0), volume, area, along, across, nan, nan, nan, speed, nan - 1e-6, nan + 1, nan + 2]
    )
    found = DropletReadings(rows, []).summary(1.0)
    known = {
        "touch_ms": 2e3,
        "largest_width_along": 1.3,
        "largest_width_across": 1.2,
        "ratio_at_largest_width": 1.3 / 1.2,
        "largest_ratio": 1.2 / 0.9,
        "largest_ratio_at_ms": 4e3,
        "least_ratio": 0.8 / 0.9,
        "least_ratio_at_ms": 5e3,
        "lift_off_ms": 5.5e3,
        "rebound_m_s": 0.31,
        "volume_drift": 1e-3,
        "alpha_min": -1e-6,
        "alpha_max": 1.0,
        "fastest_m_s": 2.0,
    }
    for name, value in known.items():
        assert np.isclose(found[name], value), name
    never = DropletReadings(rows[:5], []).summary(1.0)
    assert np.isnan(never["lift_off_ms"])
    assert np.isnan(never["rebound_m_s"])


def test_a_case_that_did_not_run_has_nothing_to_read(tmp_path):
    with pytest.raises(InputError, match="holds no results yet"):
        DropletReadings.read(tmp_path)
