"""The surface of a chart: its splines are those of three interpolants, its feet the closest points of all."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from chart_fields import LENGTH, RADIUS, WIDTH, curled, curled_normals, inner_places, rolled, surface_of, twisted
from o3dleaf import PUInterpolant
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.leaf.parametric.surface import ChartSurface
from tolerances import (
    CHART_FIT,
    CHART_FOOT,
    CHART_ROUNDING,
    CHART_SLOPE,
    DIFFERENCED_BENDS,
    DIFFERENCED_SLOPES,
)

STEP = 1e-5


@pytest.fixture(scope="module")
def cylinder():
    return surface_of(curled)


@pytest.fixture(scope="module")
def spiral():
    return surface_of(rolled)


def test_it_equals_three_interpolants():
    rng = np.random.default_rng(3)
    uv = rng.uniform([0, -3], [20, 3], (900, 2))
    points, weights = twisted(uv) + rng.normal(0, 0.1, (900, 3)), rng.uniform(0.2, 2, 900)
    options = {"smoothing": 0.3, "weights": weights, "points_per_ball": (60, 120)}
    surface = ChartSurface.fit(uv, points, **options)
    jets = surface.jet(uv, 2)
    for k in range(3):
        single = PUInterpolant.fit(uv, points[:, k], degree=1, **options)
        values, gradients, hessians = single.jets(uv, 2)
        twin = values, gradients, hessians[:, (0, 0, 1), (0, 1, 1)]
        for part, expected in zip(jets, twin, strict=True):
            assert np.abs(part[..., k] - expected).max() <= CHART_ROUNDING * max(np.abs(expected).max(), 20)
    for order in (0, 1):
        assert all(np.allclose(a, b, rtol=0, atol=1e-12) for a, b in zip(surface.jet(uv, order), jets, strict=False))


@pytest.mark.parametrize("smoothing", [0.0, 1.0, 1e6])
def test_it_reproduces_linear_maps_everywhere(smoothing):
    rng = np.random.default_rng(4)
    uv, turn = rng.uniform(0, 10, (500, 2)), rng.normal(size=(2, 3))
    surface = ChartSurface.fit(uv, uv @ turn + [1, 2, 3], smoothing=smoothing)
    places = rng.uniform(-5, 15, (300, 2))
    points, slopes, bends = surface.jet(places)
    assert np.abs(points - places @ turn - [1, 2, 3]).max() <= CHART_FIT
    assert np.abs(slopes - turn).max() <= CHART_FIT
    assert np.abs(bends).max() <= CHART_FIT


def test_derivatives_are_limits_of_difference_quotients(cylinder):
    uv = inner_places(400)
    uv = np.concatenate([uv, uv + [LENGTH, 0], uv + [0, WIDTH], uv + [LENGTH, WIDTH]])
    _, slopes, bends = cylinder.jet(uv)
    for axis, rows in ((0, (0, 1)), (1, (1, 2))):
        shift = STEP * np.eye(2)[axis]
        ahead, behind = (cylinder.jet(uv + sign * shift, 1) for sign in (1, -1))
        assert np.abs((ahead[0] - behind[0]) / (2 * STEP) - slopes[:, axis]).max() <= DIFFERENCED_SLOPES
        difference = (ahead[1] - behind[1]) / (2 * STEP)
        assert np.abs(difference[:400] - bends[:400][:, rows]).max() <= DIFFERENCED_BENDS


def test_outside_it_goes_on_straight_with_continuous_slopes(cylinder):
    (_, low), (right, high) = cylinder.bounds
    v = np.linspace(low, high, 20)[1:-1]
    near, far, farther = (np.column_stack([np.full(18, right + d), v]) for d in (1e-9, 2.0, 4.0))
    edge = np.column_stack([np.full(18, right - 1e-9), v])
    assert np.abs(cylinder.jet(near, 1)[1] - cylinder.jet(edge, 1)[1]).max() <= 1e-6
    steps = [np.diff([cylinder.jet(a, 0)[0], cylinder.jet(b, 0)[0]], axis=0) for a, b in ((near, far), (far, farther))]
    assert np.abs(steps[0] - steps[1]).max() <= 1e-6


def test_lengths_and_curvatures_of_a_cylinder(cylinder):
    uv = inner_places(500)
    assert np.abs(cylinder.metric(uv) - np.eye(2)).max() <= CHART_SLOPE
    assert np.abs(cylinder.normals(uv) - curled_normals(uv)).max() <= CHART_SLOPE
    low, high = np.median(cylinder.curvatures(uv), axis=0) * RADIUS
    assert low == pytest.approx(-1, abs=CHART_SLOPE)
    assert abs(high) <= CHART_SLOPE


def closest_by_search(surface, points):
    """Distance to the nearest of very many places of the surface, each moved to the foot within its neighborhood."""
    along, across = np.linspace(0, LENGTH, 1601), np.linspace(-WIDTH / 2, WIDTH / 2, 601)
    grid = np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1).reshape(-1, 2)
    return cKDTree(surface.jet(grid, 0)[0]).query(points)[0]


@pytest.mark.few(name=1)
@pytest.mark.parametrize("name", ["cylinder", "spiral"])
def test_feet_are_the_closest_points_of_all(name, request):
    surface, rng = request.getfixturevalue(name), np.random.default_rng(5)
    uv = inner_places(800, inset=1.0)
    reach = 0.9 if name == "cylinder" else 1.5
    points = surface.jet(uv, 0)[0] + rng.uniform(-reach, reach, (800, 1)) * surface.normals(uv)
    found, heights, converged = surface.feet(points)
    nearest = closest_by_search(surface, points)
    over = np.all((found > [0.5, -WIDTH / 2 + 0.5]) & (found < [LENGTH - 0.5, WIDTH / 2 - 0.5]), axis=1)
    room = 1 - (heights[:, np.newaxis] * surface.curvatures(found)).max(axis=1)
    over &= room > 0.1
    assert over.mean() > 0.6
    assert converged[over].all()
    assert np.all(np.abs(heights) <= nearest + 1e-9)
    # The search misses a foot by half a cell of its grid at most, which a height of 0.01 hardly feels.
    assert np.all(nearest[over] <= np.hypot(heights[over], 0.02) + 1e-3)
    off = points - surface.jet(found, 0)[0] - heights[:, np.newaxis] * surface.normals(found)
    assert np.abs(off[over]).max() <= CHART_FOOT


def test_feet_from_a_start_are_those_of_the_search(cylinder):
    uv, rng = inner_places(1000), np.random.default_rng(6)
    points = cylinder.jet(uv, 0)[0] + rng.uniform(-0.8, 0.8, (1000, 1)) * cylinder.normals(uv)
    found, heights, _ = cylinder.feet(points)
    again, high, converged = cylinder.feet(points, uv + rng.normal(0, 0.3, (1000, 2)))
    assert converged.all()
    assert np.abs(again - found).max() <= CHART_FOOT
    assert np.abs(high - heights).max() <= CHART_FOOT
    assert np.abs(found - uv).max() <= CHART_FOOT


def test_each_point_has_its_own_start(cylinder):
    with pytest.raises(InputError, match="start: has 0 places for 2 points; give one for each"):
        cylinder.feet(np.ones((2, 3)), np.empty((0, 2)))


def test_beyond_the_focus_feet_are_numbers(cylinder):
    points = np.random.default_rng(7).uniform(-60, 60, (500, 3))
    found, heights, _ = cylinder.feet(points)
    assert np.isfinite(found).all()
    assert np.isfinite(heights).all()


def test_a_point_whose_foot_is_not_found_stays_where_its_search_began(cylinder):
    uv = inner_places(3)
    points = cylinder.jet(uv, 0)[0]
    points[1] = 1e300
    found, heights, converged = cylinder.feet(points, uv)
    assert np.abs(found - uv).max() <= CHART_FOOT
    assert np.isfinite(heights).all()
    assert converged.tolist() == [True, False, True]
    with pytest.raises(InputError, match="too far away"):
        cylinder.feet(points)


def test_it_moves_with_its_points():
    rng = np.random.default_rng(8)
    uv = rng.uniform([0, -6], [40, 6], (1500, 2))
    turn, shift = np.linalg.qr(rng.normal(size=(3, 3)))[0], np.array([300.0, -200.0, 100.0])
    turn *= np.linalg.det(turn)
    here = ChartSurface.fit(uv, curled(uv), smoothing=1e-3)
    there = ChartSurface.fit(uv, curled(uv) @ turn.T + shift, smoothing=1e-3)
    places = inner_places(300)
    points = here.jet(places, 0)[0] + rng.uniform(-0.5, 0.5, (300, 1)) * here.normals(places)
    (a, h, _), (b, g, _) = here.feet(points), there.feet(points @ turn.T + shift)
    assert np.abs(a - b).max() <= 10 * CHART_FOOT
    assert np.abs(h - g).max() <= 10 * CHART_FOOT


def test_any_number_of_threads_gives_the_same_bits(cylinder):
    points = curled(inner_places(20_000)) * 1.01
    threads, results = get_num_threads(), []
    try:
        for count in (1, 2, 5):
            set_num_threads(count)
            results.append([*cylinder.feet(points), *cylinder.jet(points[:, :2])])
    finally:
        set_num_threads(threads)
    assert all(np.array_equal(a, b) for other in results[1:] for a, b in zip(results[0], other, strict=True))


def test_it_refuses_what_does_not_fit():
    uv = np.random.default_rng(9).uniform(0, 1, (50, 2))
    with pytest.raises(InputError, match="one for each"):
        ChartSurface.fit(uv, np.zeros((49, 3)), smoothing=0.1)
    with pytest.raises(InputError, match="bounds"):
        ChartSurface.fit(uv, np.zeros((50, 3)), smoothing=0.1, bounds=[[0.5, 0], [1, 1]])
