"""Area that a blade lacks as it smooths relief away: never more than there is, and nothing where all is noise."""

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely

from blade_fields import KnownOutline, RolledBlade
from o3dleaf.leaf.fit_quality import FitQuality
from o3dleaf.leaf.residuals.lost_relief import MIN_POINTS, find_lost_relief
from tolerances import LOST_IN_ANY_CHART, LOST_ON_A_BEND, LOST_TO_SHORT_LAGS, RELIEF_ALONG_LINES

SIDE = 60.0
"""Of a square, in spacings."""
LONG = 2 * np.pi / 6.0
"""Wave number of waves of six spacings."""


def square(seed=0):
    """Return random places, one to a unit square."""
    return np.random.default_rng(seed).uniform(0, SIDE, (int(SIDE**2), 2))


def waves(plane, high=0.5):
    """Return heights (n,) of waves that run askew."""
    return high * np.sin(LONG * plane @ [0.8, 0.6])


def noise(plane, size):
    return size * np.random.default_rng(3).normal(size=len(plane))


def lines(apart, turn, seed=0):
    """Return places on scan lines that lie `apart` and cross a square askew, one to a unit square, and their lines."""
    rng = np.random.default_rng(seed)
    line, along = (each.ravel() for each in np.mgrid[0 : SIDE / apart, 0 : SIDE * apart])
    places = np.column_stack([apart * line, along / apart]) + 0.1 / apart * rng.normal(size=(len(line), 2))
    return places @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]], line.astype(int)


def lost(plane, blade, scan):
    """Return what a blade's heights (n,) over a plane lack of a scan's."""
    return find_lost_relief(plane, np.column_stack([plane, blade]), scan - blade, 1.0)


SLOPES = 0.25 * (0.5 * LONG) ** 2
"""Half the mean of the squared slopes of the waves."""


@pytest.mark.few
@pytest.mark.parametrize("size", [0.0, 0.2])
@pytest.mark.parametrize("held", [0.0, 0.5, 1.0])
def test_what_is_missing_is_the_area_of_the_scan_less_that_of_the_blade(held, size):
    """½ (1 − T²) mean |∇z|² of waves of which a blade holds T; what is held by half lacks more than its residuals."""
    plane = square()
    found = lost(plane, held * waves(plane), waves(plane) + noise(plane, size))
    truth = np.sqrt(1 + 2 * max(1 - held**2, 0) * SLOPES) - 1
    assert LOST_TO_SHORT_LAGS * truth - 3 * found.deviation <= found.share <= truth + 3 * found.deviation + 1e-12
    assert found.told == (held < 1)
    assert found.deviation < 0.015


@pytest.mark.few
@pytest.mark.parametrize("size", [0.0, 0.1])
@pytest.mark.parametrize("long", [1.5, 1.75, 2.0])
def test_relief_that_only_nearest_neighbors_show_is_told_as_such(long, size):
    """As short as the lags by which longer waves are seen, waves cancel between them."""
    plane = square()
    wave = 0.3 * np.sin(2 * np.pi / long * plane) @ [1.0, 1.0]
    found = lost(plane, np.zeros(len(plane)), wave + noise(plane, size))
    truth = np.sqrt(1 + (0.3 * 2 * np.pi / long) ** 2) - 1
    assert found.told
    assert found.is_short
    assert LOST_TO_SHORT_LAGS * truth < found.share + 3 * found.deviation
    assert found.share < truth + 3 * found.deviation


def test_of_many_small_samples_with_noise_none_has_short_relief():
    """Few pairs are that near: within one deviation, by one of three lags, half of these would have some."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        plane = rng.uniform(0, 20, (400, 2))
        assert not lost(plane, np.zeros(400), 0.3 * rng.normal(size=400)).told


@pytest.mark.few
@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4, 2.0])
@pytest.mark.parametrize("apart", [1.0, 1.4, 2.0])
def test_scan_lines_that_are_off_one_another_are_no_relief(apart, turn):
    """Along a line heights have one covariance, and none across: the fall from one to the other is no slope."""
    plane, line = lines(apart, turn)
    shifts = 0.25 * np.random.default_rng(5).normal(size=line.max() + 1)
    level = np.zeros(len(plane))
    assert not lost(plane, level, shifts[line] + noise(plane, 0.05)).told
    found = lost(plane, level, waves(plane) + noise(plane, 0.05))
    assert found.told
    assert found.share <= np.sqrt(1 + 2 * SLOPES) - 1 + 3 * found.deviation


@pytest.mark.few(turn=2)
@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4, 2.0])
def test_neighbors_along_scan_lines_tell_nothing_of_slopes_across(turn):
    """Nearly straight rows, a bit scattered: what pairs within them hardly span isn't solved for."""
    for seed in range(4):
        plane, _ = lines(2.5, turn, seed)
        found = lost(plane, np.zeros(len(plane)), 0.6 * np.random.default_rng(seed).normal(size=len(plane)))
        assert not found.told
        assert found.deviation < RELIEF_ALONG_LINES


def test_of_steep_waves_no_more_is_missing_than_there_is():
    """The mean of √(1 + |∇z|²) is less than 1 + ½ |∇z|²."""
    plane = square()
    steepest = 1.8 * LONG
    truth = np.sqrt(1 + (steepest * np.cos(np.linspace(0, 2 * np.pi, 721)[1:])) ** 2).mean() - 1
    assert LOST_TO_SHORT_LAGS * truth < lost(plane, np.zeros(len(plane)), waves(plane, 1.8)).share < truth


@pytest.mark.few(size=1)
@pytest.mark.parametrize("size", [0.2, 0.5])
def test_noise_of_points_and_of_passes_is_no_relief(size):
    plane = square(1)
    level = np.zeros(len(plane))
    passes = np.random.default_rng(2).integers(0, 2, len(plane)) * size
    for scan in (noise(plane, size), noise(plane, size) + passes):
        found = lost(plane, level, scan)
        assert abs(found.share) < 3 * found.deviation
        assert not found.told
    # Pairs of points, as on lines of a scanner, that err alike.
    twice = np.concatenate([plane, plane + [0.0, 0.2]])
    alike = lost(twice / np.sqrt(0.5), np.zeros(len(twice)), np.tile(noise(plane, size), 2))
    assert alike.is_short


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(4))
def test_noise_that_a_blade_follows_is_no_area_that_it_lacks(seed):
    """Of noise half of which the blade goes through, smoothed or not, nothing is missing."""
    plane = square(seed)
    scan = noise(plane, 0.5)
    found = lost(plane, 0.5 * scan, scan)
    assert found.share < 3 * found.deviation
    assert not found.told


@pytest.mark.few(chart=1)
@pytest.mark.parametrize("chart", [[[2.0, 0.0], [0.0, 2.0]], [[0.6, -0.8], [0.8, 0.6]], [[1.1, 0.3], [0.0, 0.9]]])
def test_the_area_is_that_of_the_world_in_any_chart_and_unit(chart):
    plane = square()
    blade, scan = 0.5 * waves(plane), waves(plane)
    one = lost(plane, blade, scan)
    feet = 1e-3 * np.column_stack([plane, blade])
    other = find_lost_relief(plane @ np.transpose(chart), feet, 1e-3 * (scan - blade), 1e-3)
    assert other.share == pytest.approx(one.share, rel=LOST_IN_ANY_CHART)


def test_a_bent_blade_lacks_what_a_flat_one_does_and_shows_where():
    """Waves on an eighth of a sheet rolled up, with their area in its unit; the smooth rest adds nothing."""
    outline = KnownOutline(shapely.box(0, -12, 60, 12))
    blade = RolledBlade(outline=outline)
    points, places = blade.scan(0.6, 0.1)
    raised = 0.45 * np.sin(LONG / 0.6 * places[:, 0]) * (places[:, 0] > 30) * (places[:, 1] > 6)
    up = blade.lift(np.column_stack([places, np.ones(len(places))])) - blade.lift(np.pad(places, ((0, 0), (0, 1))))
    quality = FitQuality.of(blade, points + raised[:, np.newaxis] * up)
    truth = (0.45 / 0.3) ** 2 * SLOPES * 180 / outline.area
    assert LOST_TO_SHORT_LAGS * truth < quality.lost.share < truth + 3 * quality.lost.deviation
    (place,) = quality.lost.places
    u, v, _ = blade.flatten(np.array([place.center]))[0]
    assert 35 < u < 55
    assert 6 < v < 12
    (line,) = (line for line in quality.warnings if "lacks" in line)
    assert str(place) in line
    read = json.loads(json.dumps(quality.to_dict()))["relief"]
    assert read["lost"] == pytest.approx(read["share"] * quality.area[0], rel=1e-12)
    assert f"{read['lost']:.2g} mm²" in line
    smooth, flat = (FitQuality.of(each, each.scan(0.6, 0.1)[0]) for each in (blade, replace(blade, radius=1e6)))
    assert not any("lacks" in line for line in smooth.warnings)
    assert smooth.lost.deviation < LOST_ON_A_BEND * flat.lost.deviation
    assert smooth.lost.places == flat.lost.places == ()


def test_few_points_tell_nothing():
    plane = square()[: MIN_POINTS - 1]
    assert lost(plane, np.zeros(len(plane)), waves(plane)) == (0.0, 1.0, False, ())


def test_points_of_one_place_in_the_chart_are_no_trouble():
    """As points beyond a tip have: a window of no extent."""
    plane = np.concatenate([square(), np.tile([[30.0, 30.0]], (100, 1))])
    found = lost(plane, np.zeros(len(plane)), noise(plane, 0.2))
    assert abs(found.share) < 3 * found.deviation < 1
