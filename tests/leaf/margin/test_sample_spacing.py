"""The shape of the area that a point stands for: alike in all directions, or as scan lines have it."""

import numpy as np
import pytest
import shapely

import planar_leaves as leaves
from o3dleaf.leaf.margin.sample_region import cover_sample
from o3dleaf.leaf.margin.sample_spacing import (
    FAR,
    JUMP,
    NEIGHBORS,
    SampleNeighbors,
    cell_sizes,
    cells_of,
    is_uneven,
    local_shape,
    spacing_between,
)
from o3dleaf.leaf.margin.sample_triangles import triangulate
from tolerances import BAY_COVERED, JUMP_AREA, NARROW_AREA, ROUNDING, UNEVEN_BY_CHANCE

SIDE = 40.0


def axes_ratio(points):
    """Return the median ratio of the axes of the local metric."""
    xx, xy, yy = triangulate(points).metric.T
    values = np.linalg.eigvalsh(np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2))
    return np.median(np.sqrt(values[:, 1] / values[:, 0]))


@pytest.mark.parametrize("ratio", [9.0, 25.0, 100.0])
def test_scan_lines_have_the_shape_of_their_cells_however_far_apart(ratio):
    rng = np.random.default_rng(0)
    apart, count = np.sqrt(ratio), round(SIDE * np.sqrt(ratio))
    points = np.array([[x, y] for x in np.arange(apart / 2, SIDE, apart) for y in rng.uniform(0, SIDE, count)])
    # Edges across are slanting, and a third of all run along: 0.7 of what the cells have.
    assert 0.6 < axes_ratio(points) / ratio < 0.8


def test_beside_a_gap_a_random_sample_has_no_direction():
    rng = np.random.default_rng(0)
    points = rng.uniform(0, SIDE, (round(SIDE**2), 2))
    points = points[np.abs(points[:, 0] - SIDE / 2) > 2 * FAR]
    beside = np.abs(np.abs(points[:, 0] - SIDE / 2) - 2 * FAR) < 1
    mesh = triangulate(points)
    metric = local_shape(mesh.near, mesh.triangles)[beside]
    assert np.abs(metric.mean(axis=0) - [1.0, 0.0, 1.0]).max() < 0.15


def uneven(leaf, factor, sampler, rng):
    """A sample of a leaf, about two apart in its left half and `factor` times as dense in its right."""
    parts = [leaf.intersection(shapely.box(*box)) for box in ((-100, -100, 0, 100), (0, -100, 100, 100))]
    counts = (round(part.area * density / 4) for part, density in zip(parts, (1, factor), strict=True))
    return np.concatenate([sampler(part, count, rng) for part, count in zip(parts, counts, strict=True)])


def covered(region):
    return shapely.coverage_union_all(shapely.polygons(region.points[region.triangles]))


@pytest.mark.few(factor=2, sampler=2)
@pytest.mark.parametrize("sampler", [leaves.uniform, leaves.jittered])
@pytest.mark.parametrize("factor", [5, 10, 30])
def test_where_the_density_jumps_a_leaf_is_covered_and_no_hole_comes_about(factor, sampler):
    leaf = leaves.ellipse()
    region = cover_sample(uneven(leaf, factor, sampler, np.random.default_rng(factor)))
    area = covered(region)
    assert area.geom_type == "Polygon"
    assert not area.interiors
    assert (area.area + region.missing.sum()) / leaf.area == pytest.approx(1, abs=JUMP_AREA)


@pytest.mark.few(place=2)
@pytest.mark.parametrize(("place", "width"), [(-20, 18), (0, 16), (20, 8)])
def test_beside_a_jump_in_density_holes_stay_on_either_side(place, width):
    hole = shapely.Point(place, 0).buffer(width / 2)
    region = cover_sample(
        uneven(leaves.ellipse().difference(hole), 10, leaves.uniform, np.random.default_rng(place + 30))
    )
    (found,) = covered(region).interiors
    assert shapely.Polygon(found).contains(hole.buffer(-0.05 * width))


@pytest.mark.few(factor=1, radius=1)
@pytest.mark.parametrize("radius", [5, 7])
@pytest.mark.parametrize("factor", [5, 10])
def test_a_bay_where_the_density_jumps_is_no_gap_of_the_sparser_side(factor, radius):
    """By the sparser side's spacing alone it is small enough to be by chance, and a fifth of it was covered."""
    bay = shapely.Point(0, leaves.ellipse().bounds[3]).buffer(radius)
    leaf, shares = leaves.ellipse().difference(bay), []
    for seed in range(4):
        area = covered(cover_sample(uneven(leaf, factor, leaves.uniform, np.random.default_rng(seed))))
        shares.append(area.intersection(bay).area / bay.intersection(leaves.ellipse()).area)
    assert np.mean(shares) < BAY_COVERED


@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_a_point_is_as_far_from_others_as_the_deep_points_nearest_to_it(share):
    """Whether those nearest to it are all deep, so that they are known, some, or there are no 32 of them."""
    rng = np.random.default_rng(3)
    points, cells = rng.uniform(0, 20, (400, 2)), rng.uniform(0.5, 1.5, 400)
    deep = points[:, 0] < 20 * share
    away = np.linalg.norm(points[:, np.newaxis] - points[deep], axis=2)
    square = cells[deep][np.argsort(away, axis=1)[:, :NEIGHBORS]].mean(axis=1)
    expected = np.sqrt(square * cells[deep].sum() / square[deep].sum())
    assert cell_sizes(SampleNeighbors.of(points), cells, deep) == pytest.approx(expected, rel=ROUNDING)


def test_triangles_of_a_sample_of_one_density_are_judged_by_their_corners():
    points = leaves.uniform(leaves.ellipse(), 3000, np.random.default_rng(0))
    mesh, spacing = triangulate(points), np.random.default_rng(1).uniform(0.9, 1.1, len(points))
    assert (spacing_between(mesh.near.row, mesh.triangles, spacing, JUMP) == spacing[mesh.triangles].mean(axis=1)).all()


@pytest.mark.few(ratio=1)
@pytest.mark.parametrize("ratio", [2, 4])
def test_a_narrow_leaf_that_is_denser_along_one_side_has_its_area(ratio):
    """The deep points nearest to its sparse margin are of the dense side: by them it lacks 0.012, and 0.063."""
    halves = (shapely.box(0, -3, 200, 0), 1), (shapely.box(0, 0, 200, 3), ratio)
    errors = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        points = [leaves.uniform(half, round(half.area * density), rng) for half, density in halves]
        region = cover_sample(np.concatenate(points))
        errors.append((covered(region).area + region.missing.sum()) / (6 * 200) - 1)
    assert abs(np.mean(errors)) < NARROW_AREA


def test_few_cells_that_vary_by_chance_are_even():
    """Of 32 places fifteen terms follow some cells far: the density overflowed on its way, once in 300 draws."""
    told = []
    for seed in range(250, 300):
        rng = np.random.default_rng(seed)
        told.append(is_uneven(rng.uniform(0, 1, (32, 2)), rng.exponential(1, 32)))
    assert np.mean(told) < UNEVEN_BY_CHANCE


@pytest.mark.parametrize("sampler", [leaves.uniform, leaves.jittered])
def test_a_sample_of_one_density_is_even_and_one_twice_as_dense_in_one_half_is_not(sampler):
    leaf, told = leaves.ellipse(), []
    for factor in (1, 2):
        for seed in range(4):
            points = uneven(leaf, factor, sampler, np.random.default_rng(seed))
            mesh = triangulate(points)
            deep = shapely.contains_xy(leaf.buffer(-6), points)
            told.append(is_uneven(points[deep], cells_of(points, mesh.triangles, mesh.areas)[deep]))
    assert told == 4 * [False] + 4 * [True]
