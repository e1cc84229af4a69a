import numpy as np
import pytest
import shapely
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import brentq
from scipy.spatial import cKDTree
from scipy.special import ive

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge import edge_fit
from o3dleaf.leaf.margin.edge.edge_fit import fit_edge, most_likely, moved_along, moved_apart, softened
from o3dleaf.leaf.margin.edge.edge_frame import EdgeSample, edge_frame
from o3dleaf.leaf.margin.edge.edge_score import blurred, score
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.margin_curve import Spacing
from tolerances import (
    AREA_MOVED,
    CORNER_HELD,
    CURVED_EDGE,
    EDGE_DEVIATION,
    EDGE_RMS,
    EDGE_RMS_NOISY,
    EDGE_STAYS,
    EDGE_TURNED,
    FITTED_EDGE,
    FOUND_EDGE,
    PART_OF_THE_WAY,
    SOFTER_BY_CHANCE,
    TIP_FLANKS,
    TIP_LENGTH,
)

RADIUS = 14.0
DISC = shapely.Point(0, 0).buffer(RADIUS, quad_segs=256)
NO_TIPS = np.empty((0, 2))


@pytest.mark.few(noise=2)
@pytest.mark.parametrize("noise", [0.0, 0.2, 0.5])
def test_a_straight_edge_comes_out_where_the_tables_say_and_as_far_off_as_they_say(noise):
    """By simulation: a half plane of independent points that ends at 0; the scores sum up to the length of its edge."""
    rng, length, pieces = np.random.default_rng(0), 40, 2000
    samples = [rng.uniform(-4, 0, n) + rng.normal(0, noise, n) for n in rng.poisson(4 * length, pieces)]
    blur, offset, information = (float(each[0]) for each in blurred(np.array([noise]))[:3])

    def edge(across):
        near = across[across > -2]  # the strip's other side is no edge
        return brentq(lambda e: np.sum(score((e - near) / blur)) / blur - length, -2, 2)

    found = np.array([edge(across) for across in samples]) - offset
    assert np.mean(found) == pytest.approx(0, abs=FOUND_EDGE)
    assert np.std(found) == pytest.approx((information * length) ** -0.5, rel=EDGE_DEVIATION)


def circle(radius):
    turn = np.linspace(0, 2 * np.pi, round(10 * np.pi * radius), endpoint=False)
    return radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def edge_of_disc(radius, noise, seed, randomness=1.0):
    """A sample of density 1 that ends at a circle, and its edge."""
    rng = np.random.default_rng(seed)
    count = rng.poisson(np.pi * (radius**2 - (radius - 8) ** 2))
    turn, away = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform((radius - 8) ** 2, radius**2, count))
    points = away[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1) + rng.normal(0, noise, (count, 2))
    return EdgeSample(Spacing(cKDTree(points), np.ones(count)), noise, randomness, shapely.MultiPolygon())


@pytest.mark.few(noise=2)
@pytest.mark.parametrize("noise", [0.0, 0.2, 0.5])
def test_the_edge_of_a_disc_is_off_by_its_curvature_as_the_table_says(noise):
    """The density at a radius, blurred: a Gaussian about each place of the disc, in polar coordinates."""
    radius, seen = 20.0, blurred(np.array([noise]))
    r, t = np.linspace(radius - 10, radius + 5, 6001), np.linspace(radius - 14, radius, 2801)
    density = np.clip((radius - r) / (r[1] - r[0]) + 0.5, 0, 1)
    if noise:
        part = np.exp(-((r[::4, None] - t) ** 2) / (2 * noise**2)) * ive(0, r[::4, None] * t / noise**2) * t / noise**2
        density = np.interp(r, r[::4], np.trapezoid(part, t, axis=1))

    def excess(edge):
        """The scores at a circle, in the mean, less its length, over that."""
        at = radius + edge
        return np.trapezoid(density * r * score((at - r) / seen.blur), r) / seen.blur[0] / at - 1

    assert brentq(excess, -1, 1) - seen.offset[0] == pytest.approx(seen.curved[0] / radius, abs=CURVED_EDGE)


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_a_softer_edge_bends_to_its_points_by_as_much_more_as_is_said(noise):
    seen, found, wide = blurred(np.array([noise])), [], (4.0, 2.0)
    for seed in range(8):
        frame = edge_frame(circle(60.0), NO_TIPS, edge_of_disc(60.0, noise, seed))
        blur, start = np.full(len(frame.curve), seen.blur[0]), np.zeros(len(frame.curve))
        stiff, soft = (most_likely(frame, blur, seen.information * each**6 + start, start) for each in wide)
        found.append(np.mean(soft - stiff))
    expected = seen.fitted[0] * (1 / wide[1] - 1 / wide[0])
    assert np.mean(found) == pytest.approx(expected, abs=FITTED_EDGE)


def test_of_a_smooth_edge_a_softer_curve_is_as_much_more_likely_as_its_parameters_say(monkeypatch):
    """Twice the logarithm of the ratio is their number in the mean (Wilks 1938)."""
    sums = []

    def noted(twice, free, _):
        sums.append([twice.sum(), free.sum()])
        return np.zeros(len(twice), dtype=bool)

    monkeypatch.setattr(edge_fit, "find_discoveries", noted)
    for seed in range(8):
        sample = edge_of_disc(60.0, 0.0, seed)
        frame = edge_frame(circle(60.0), NO_TIPS, sample)
        seen, first = sample.seen(frame.spacing), np.full(len(frame.curve), edge_fit.FIRST)
        moved = most_likely(frame, seen.blur, seen.information * first**6, 0 * first)
        softened(frame, seen, moved, first)
    twice, free = np.sum(sums, axis=0)
    assert twice == pytest.approx(free, rel=SOFTER_BY_CHANCE)


def test_only_the_softest_parts_of_a_curve_become_softer(monkeypatch):
    monkeypatch.setattr(edge_fit, "find_discoveries", lambda twice, *_: np.ones(len(twice), dtype=bool))
    sample = edge_of_disc(60.0, 0.0, 0)
    frame = edge_frame(circle(60.0), NO_TIPS, sample)
    seen, bandwidth = sample.seen(frame.spacing), np.full(len(frame.curve), edge_fit.FIRST)
    bandwidth[::2] *= edge_fit.WIDEN
    narrower = softened(frame, seen, 0 * bandwidth, bandwidth)[1]
    assert (narrower[::2] == bandwidth[::2]).all()
    np.testing.assert_allclose(narrower[1::2], edge_fit.FIRST / edge_fit.WIDEN**edge_fit.SOFTER)


def test_an_edge_that_goes_a_part_of_the_way_ends_where_it_would_in_the_mean():
    off = []
    for seed in range(8):
        whole, part = (
            fit_edge(circle(60.0), NO_TIPS, edge_of_disc(60.0, 0.0, seed, share)).curve for share in (1, 0.7)
        )
        off.append(np.hypot(*part.T).mean() - np.hypot(*whole.T).mean())
    assert np.mean(off) == pytest.approx(0, abs=PART_OF_THE_WAY)


def test_the_lengths_of_nodes_are_the_area_that_they_move_over():
    turn = np.linspace(0, 2 * np.pi, 3000, endpoint=False)
    rough = ((30 + 0.3 * np.cos(60 * turn)) * [np.cos(turn), np.sin(turn)]).T
    frame = edge_frame(rough, NO_TIPS, edge_of_disc(30.0, 0.0, 0))
    by = 1e-5
    areas = [shapely.Polygon(frame.curve + side * by * frame.normals).area for side in (1, -1)]
    assert (areas[0] - areas[1]) / (2 * by) == pytest.approx(frame.length.sum(), rel=AREA_MOVED)


@pytest.mark.few(noise=1)
@pytest.mark.parametrize(("noise", "most"), [(0.0, EDGE_RMS), (0.5, EDGE_RMS_NOISY)])
def test_the_margin_of_a_disc_strays_less_than_its_outermost_points(noise, most):
    squares = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        points = leaves.uniform(DISC, 1225, rng)
        spacing = leaves.true_spacing(DISC, points)
        points += rng.normal(0, noise * spacing, points.shape)
        ring = Margin.fit(points, noise=noise * spacing).ring
        squares.append(np.mean((np.hypot(*ring.T) - RADIUS) ** 2) / spacing**2)
    assert np.sqrt(np.mean(squares)) < most


def test_corners_stay_where_a_stiffer_curve_would_cut_them():
    leaf = shapely.box(0, 0, 30, 20)
    corners, off = shapely.get_coordinates(leaf)[:4], []
    for seed in range(4):
        points = leaves.uniform(leaf, 600, np.random.default_rng(seed))
        off += list(shapely.distance(shapely.points(corners), Margin.fit(points).polygon.exterior))
    assert np.mean(off) < CORNER_HELD


def test_a_narrow_tip_ends_in_the_mean_where_the_leaf_does_and_its_flanks_lie_there():
    """Tips of 15 degrees; the last points are 1.9 spacings short in the mean."""
    leaf, short, off = leaves.strip(15, length=45.0), [], []
    for seed in range(8):
        points = leaves.uniform(leaf, 470, np.random.default_rng(seed))
        spacing = leaves.true_spacing(leaf, points)
        found, near = Margin.fit(points).polygon, shapely.Point(45.0, 0.0).buffer(12 * spacing)
        short.append((45 - found.bounds[2]) / spacing)
        off.append(found.symmetric_difference(leaf).intersection(near).area / spacing**2)
    assert abs(np.mean(short)) < TIP_LENGTH
    assert np.mean(off) < TIP_FLANKS


def test_the_curve_stays_for_a_lattice_and_over_what_was_filled():
    points = leaves.uniform(DISC, 1225, np.random.default_rng(0))
    local = Spacing(cKDTree(points), np.full(len(points), leaves.true_spacing(DISC, points)))
    curve = (RADIUS - 1) * np.stack([np.cos(leaves.TURN), np.sin(leaves.TURN)], axis=1)
    left = shapely.box(-30, -30, 0, 30)
    lattice = fit_edge(curve, NO_TIPS, EdgeSample(local, 0.0, 0.0, shapely.MultiPolygon())).curve
    filled = fit_edge(curve, NO_TIPS, EdgeSample(local, 0.0, 1.0, left)).curve
    radius = np.hypot(*filled.T)
    assert np.hypot(*lattice.T) == pytest.approx(RADIUS - 1, abs=EDGE_TURNED)
    assert radius[filled[:, 0] < -RADIUS / 2].mean() == pytest.approx(RADIUS - 1, abs=EDGE_STAYS)
    assert radius[filled[:, 0] > RADIUS / 2].mean() == pytest.approx(RADIUS, abs=EDGE_STAYS)


@pytest.mark.parametrize("seed", range(10))
def test_flanks_of_a_tip_move_without_crossing(seed):
    """Elsewhere the curve moves all of the way; a curve that crosses nothing is the one that is moved."""
    rng, leaf = np.random.default_rng(seed), leaves.strip(6, 4.0, 60.0)
    curve = shapely.get_coordinates(leaf.exterior)[:-1]
    sample = EdgeSample(Spacing(cKDTree(leaves.uniform(leaf, 240, rng)), np.ones(240)), 0.0, 1.0, shapely.Polygon())
    frame = edge_frame(curve, np.array([[60.0, 0.0]]), sample)
    waves = gaussian_filter1d(rng.normal(size=len(frame.curve)), 6.0, mode="wrap")
    distance = 0.4 * waves / waves.std()
    share = np.ones(len(distance))
    plain, apart = moved_along(frame, distance, share), moved_apart(frame, distance, share)
    assert shapely.Polygon(apart).is_valid
    if shapely.Polygon(plain).is_valid:
        assert np.array_equal(apart, plain)
    beyond = frame.curve[:, 0] < 25.0
    assert np.array_equal(apart[beyond], plain[beyond])
