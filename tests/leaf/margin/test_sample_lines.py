import numpy as np
import pytest
import shapely

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge.lines_variance import lines_variance
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.sample_lines import sample_lines
from o3dleaf.leaf.margin.sample_region import cover_sample
from o3dleaf.leaf.margin.sample_spacing import SampleNeighbors
from tolerances import (
    CELLS_COVERED,
    CELLS_OF_LAST_LINE,
    LINES_ALONG,
    LINES_APART,
    LINES_AREA,
    LINES_DEVIATION,
    UNEVEN_LINES_AREA,
)

RADIUS = 40.0


def bent(points):
    """Places (x, y) as (x/R, R + y) around a center: lines along x turn."""
    turn, radius = points[:, 0] / RADIUS, RADIUS + points[:, 1]
    return np.stack([radius * np.sin(turn), radius * np.cos(turn)], axis=1)


def spaced(points, spacing):
    return sample_lines(SampleNeighbors.of(points), np.full(len(points), spacing))


@pytest.mark.parametrize("ratio", [3, 6])
@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_lines_have_their_direction_and_distance(ratio, angle):
    lines = spaced(leaves.lines(leaves.ellipse(), 1.3, ratio, angle, np.random.default_rng(0)), 1.3)
    assert lines.clear.all()
    assert np.median(np.abs(lines.along @ [np.cos(angle), np.sin(angle)])) == pytest.approx(1, abs=LINES_ALONG)
    assert np.median(lines.apart) == pytest.approx(1.3 * np.sqrt(ratio), rel=LINES_APART)


@pytest.mark.parametrize("sampler", [leaves.uniform, leaves.jittered, leaves.lattice, leaves.graded])
@pytest.mark.parametrize("leaf", [leaves.ellipse(), leaves.strip(20)], ids=["ellipse", "strip"])
def test_even_and_independent_points_have_no_lines(sampler, leaf):
    for seed in range(5):
        assert spaced(sampler(leaf, 300, np.random.default_rng(seed)), 1.0) is None


@pytest.mark.parametrize("stretch", [1.0, 1.01, 1.2])
@pytest.mark.parametrize("noise", [0.0, 1e-12, 0.01])
def test_a_lattice_of_triangles_has_no_lines(stretch, noise):
    """Six points are nearest to each: which of them seem nearer than others is a rounding, the same all over it."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        points = leaves.triangles(leaves.ellipse(), 600, rng, stretch=stretch)
        assert spaced(points + rng.normal(0, noise, points.shape), 2.3) is None


@pytest.mark.few
@pytest.mark.parametrize("ratio", [4, *(pytest.param(ratio, marks=pytest.mark.slow) for ratio in (6, 9)), 12])
@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize("bend", [lambda points: points, bent], ids=["straight", "bent"])
def test_the_area_of_lines_is_that_of_their_cells(ratio, noise, bend):
    """Along the margin, straight and bent: d times the step for each point (Pick), wherever the first line lies."""
    spacing, rng = 0.6, np.random.default_rng(ratio)
    points = leaves.lines(shapely.box(0, -4, 60, 4), spacing, ratio, 0.0, rng)
    cells = spacing**2 * (np.ones(len(points)) if bend is not bent else 1 + points[:, 1] / RADIUS)
    margin = Margin.fit(bend(points) + rng.normal(0, noise * spacing, points.shape), noise=noise * spacing)
    assert margin.area == pytest.approx(cells.sum(), rel=LINES_AREA)


@pytest.mark.few
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("ratio", [4, 8])
def test_a_smooth_line_along_the_margin_is_none_that_was_set_on_it(ratio, seed):
    """As vertices along the rim of a mesh are, beside others less smooth; the leaf goes on beyond it."""
    rng = np.random.default_rng(seed)
    points = leaves.lines(shapely.box(0, -2.5, 60, 2.5), 0.5, ratio, 0.0, rng)
    inner = np.abs(points[:, 1]) < np.abs(points[:, 1]).max() - 0.3 * np.sqrt(ratio)
    points[inner] += rng.normal(0, 0.1, (inner.sum(), 2))
    assert Margin.fit(points).area == pytest.approx(len(points) * 0.25, rel=UNEVEN_LINES_AREA)


def test_noise_does_not_hide_lines_of_many_points():
    """Four neighbors of noise lie in any direction, and sixteen along the line."""
    strip = shapely.box(0, -15, 60, 15)
    points = leaves.lines(strip, 1.0, 16, 0.3, np.random.default_rng(0))
    lines = spaced(points + np.random.default_rng(1).normal(0, 0.35, points.shape), 1.0)
    assert np.median(np.abs(lines.along @ [np.cos(0.3), np.sin(0.3)])) == pytest.approx(1, abs=LINES_ALONG)
    assert np.median(lines.apart) == pytest.approx(4.0, rel=LINES_APART)


def test_lines_that_turn_leave_the_sides_anywhere_within_their_distance():
    strip, ratio = shapely.box(0, -6, 60, 6), 4
    points = bent(leaves.lines(strip, 0.6, ratio, 0.0, np.random.default_rng(0)))
    ring = bent(shapely.get_coordinates(strip.segmentize(0.2).exterior))
    told = lines_variance(points, shapely.Polygon(ring))
    sides = 60 * (1 + 6 / RADIUS), 60 * (1 - 6 / RADIUS)
    assert told == pytest.approx(np.square(sides).sum() * 0.36 * ratio / 12, rel=LINES_DEVIATION)


@pytest.mark.few(ratio=1)
@pytest.mark.parametrize("ratio", [9, 12, 16])
def test_points_of_the_last_line_stand_for_as_much_as_others(ratio):
    """Of a line seen through noise few points lie at the border, and triangles to the next line are few and long."""
    strip = shapely.box(0, -6, 60, 6)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        points = leaves.lines(strip, 0.6, ratio, 0.0, rng)
        last = points[:, 1] > points[:, 1].max() - 0.3 * np.sqrt(ratio)
        region = cover_sample(points + rng.normal(0, 0.12, points.shape))
        assert (region.spacing[last] ** 2).mean() == pytest.approx(0.36, rel=CELLS_OF_LAST_LINE)
        covered = shapely.area(shapely.polygons(region.points[region.triangles])).sum()
        assert covered + region.missing.sum() == pytest.approx((region.spacing**2).sum(), rel=CELLS_COVERED)
