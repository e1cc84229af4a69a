import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

import planar_leaves as leaves
from o3dleaf.core.errors import InputError
from o3dleaf.io.models.model_file import read_model, write_model
from o3dleaf.leaf.margin.gaps.hole import Hole
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.margin_curve import Spacing, resample
from o3dleaf.leaf.margin.margin_rings import begin_ring
from o3dleaf.leaf.saved.model_arrays import check_model
from tolerances import (
    MARGIN_AREA,
    MARGIN_AREA_RANDOM,
    MARGIN_HELD,
    MARGIN_HELD_RANDOM,
    MARGIN_MOVED,
    MARGIN_TURNED,
    ON_RING,
    STRIP_AREA,
    TIP_LOST,
)

REGULAR = ("lattice", "jittered", "lines")
SHAPES = {"ellipse": leaves.ellipse(), "strip": leaves.strip(20), "lobed": leaves.lobed(), "eaten": leaves.eaten(6)}


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", [6, 9])
def test_no_slit_reaches_into_a_leaf_from_between_its_teeth(seed):
    """Teeth of eight spacings are rounded off; the notches between them, which pass for tips, end where they do."""
    pitch, depth = 4.1, 3.1
    along = np.linspace(0, 1, 4000, endpoint=False)
    around = np.stack([30 * np.cos(2 * np.pi * along), 14 * np.sin(2 * np.pi * along)], axis=1)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(around, axis=0).T))])
    out = around / [30.0**2, 14.0**2]
    tooth = depth * (lengths / pitch % 1 - 0.5) / np.hypot(*out.T)
    leaf = shapely.Polygon(around + tooth[:, np.newaxis] * out)
    points = leaves.uniform(leaf, 5000, np.random.default_rng(seed))
    margin, spacing = Margin.fit(points), leaves.true_spacing(leaf, points)
    assert leaf.buffer(-3 * spacing).difference(margin.polygon).area == 0


@pytest.mark.few(shape=3, sampler=3)
@pytest.mark.parametrize("sampler", leaves.SAMPLERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_area_and_margin_are_those_of_the_leaf_not_of_its_outermost_points(shape, sampler):
    leaf = SHAPES[shape]
    points = leaves.SAMPLERS[sampler](leaf, 2000, np.random.default_rng(7))
    margin, spacing = Margin.fit(points), leaves.true_spacing(leaf, points)
    regular = sampler in REGULAR
    assert margin.area == pytest.approx(leaf.area, rel=MARGIN_AREA if regular else MARGIN_AREA_RANDOM)
    for distances in leaves.margin_distances(leaf, margin.polygon, spacing / 4):
        assert np.mean(distances <= spacing) >= (MARGIN_HELD if regular else MARGIN_HELD_RANDOM)


@pytest.mark.parametrize("angle", [10, 20, 40])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_sharp_tips_are_kept(angle, seed):
    leaf = leaves.strip(angle)
    points = leaves.uniform(leaf, 1200, np.random.default_rng(seed))
    reached = Margin.fit(points).bounds[1, 0]
    assert abs(reached - 150) <= TIP_LOST / angle * leaves.true_spacing(leaf, points)


def test_the_margin_is_a_simple_curve_and_holds_every_point_of_a_lattice():
    points = leaves.lattice(leaves.lobed(), 2000, np.random.default_rng(0))
    margin = Margin.fit(points)
    assert margin.polygon.is_valid
    assert margin.polygon.exterior.is_ccw
    assert margin.contains(points).all()
    assert margin.rounded is margin.polygon
    assert np.array_equal(margin.bounds, np.reshape(margin.polygon.bounds, (2, 2)))
    sides = np.hypot(*np.diff(np.vstack([margin.ring, margin.ring[:1]]), axis=0).T)
    assert sides.max() < 0.5 * margin.spacing


def test_a_hole_is_told_and_kept_or_filled_up_to_a_size():
    leaf = leaves.ellipse().difference(shapely.Point(10, 2).buffer(5, quad_segs=64))
    points = leaves.uniform(leaf, 2500, np.random.default_rng(1))
    kept, filled = Margin.fit(points), Margin.fit(points, fill_holes=11.0)
    (hole,) = kept.holes
    assert hole.place == pytest.approx([10, 2], abs=kept.spacing)
    assert hole.width == pytest.approx(10, abs=kept.spacing)
    assert not hole.filled
    assert not kept.contains([[10, 2]])[0]
    assert filled.contains([[10, 2]])[0]
    assert filled.holes[0].filled
    assert filled.area - kept.area == pytest.approx(hole.area)
    assert Margin.fit(points, fill_holes=9.0).area == kept.area


def test_a_slit_is_filled_up_to_a_size_and_a_bay_is_not():
    leaf = leaves.eaten(6)
    bay = leaf.difference(shapely.Point(0, -21).buffer(6))
    points = leaves.uniform(bay, 2500, np.random.default_rng(1))
    kept, filled = Margin.fit(points, fill_holes=4.0), Margin.fit(points, fill_holes=8.0)
    slit, bite = [[-17, 10], [-17, 15]], [[0, -18], [3, -18]]
    assert not kept.contains(slit).any()
    assert filled.contains(slit).all()
    assert not filled.contains(bite).any()
    whole = bay.union(shapely.box(-20, 6, -14, 40).intersection(leaves.ellipse()))
    assert filled.area == pytest.approx(whole.area, rel=MARGIN_AREA_RANDOM)


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(3))
def test_a_gap_that_a_random_sample_has_by_chance_is_no_hole(seed):
    leaf = leaves.ellipse()
    points = leaves.uniform(leaf, 2000, np.random.default_rng(seed))
    spacing = leaves.true_spacing(leaf, points)
    assert not Margin.fit(points).holes
    assert len(Margin.fit(points[np.hypot(*points.T) > 4 * spacing]).holes) == 1


def test_the_margin_turns_and_grows_with_the_points():
    points = leaves.uniform(leaves.eaten(6), 1200, np.random.default_rng(3))
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    margin, turned = Margin.fit(points), Margin.fit(3 * points @ turn + [100, -50])
    assert turned.area == pytest.approx(9 * margin.area, rel=MARGIN_TURNED)
    assert turned.spacing == pytest.approx(3 * margin.spacing)
    moved = shapely.Polygon(3 * margin.ring @ turn + [100, -50])
    assert shapely.Polygon(turned.ring).symmetric_difference(moved).area < MARGIN_TURNED * turned.area


@pytest.mark.few(leaf=1)
@pytest.mark.parametrize(
    ("leaf", "seed"), [(leaves.strip(10), 1), (leaves.strip(20), 2), (leaves.strip(20), 3), (leaves.eaten(6), 4)]
)
def test_a_rounding_of_the_points_is_one_of_the_margin(leaf, seed):
    random = np.random.default_rng(seed)
    points = leaves.uniform(leaf, 800, random)
    margin = Margin.fit(points, noise=0.1)
    moved = Margin.fit(points + 1e-11 * random.normal(size=points.shape), noise=0.1)
    apart = margin.polygon.symmetric_difference(moved.polygon).area / margin.polygon.length
    assert apart < MARGIN_MOVED * margin.spacing


def test_where_a_ring_is_resampled_does_not_depend_on_its_corners():
    random = np.random.default_rng(0)
    ring = shapely.get_coordinates(leaves.eaten(6).exterior)[:-1]
    side, share = np.sort(random.integers(0, len(ring), 200)), random.uniform(size=(200, 1))
    between = ring[side] + share * (np.roll(ring, -1, axis=0)[side] - ring[side])
    order = np.argsort(np.concatenate([np.arange(len(ring)), side + share[:, 0]]), kind="stable")
    points = leaves.uniform(leaves.eaten(6), 800, random)
    spacing = Spacing(cKDTree(points), random.uniform(0.5, 1.5, len(points)))
    found, told, taken = resample(ring, spacing)
    again, told_again, taken_again = resample(np.concatenate([ring, between])[order], spacing)
    assert np.allclose(again, found, rtol=0, atol=ON_RING)
    assert np.allclose(taken_again, taken, rtol=0, atol=ON_RING)
    assert np.array_equal(told_again, told)


def test_a_margin_does_not_depend_on_where_the_ring_of_an_area_begins():
    points = leaves.uniform(leaves.strip(20), 800, np.random.default_rng(0))
    spacing = Spacing(cKDTree(points), np.full(len(points), leaves.true_spacing(leaves.strip(20), points)))
    ring = shapely.get_coordinates(leaves.strip(20).exterior)[:-1]
    curves = [
        begin_ring(shapely.Polygon(np.roll(ring, by, axis=0)), spacing, hole=False)[0] for by in (0, len(ring) // 3)
    ]
    assert np.allclose(*curves, rtol=0, atol=ON_RING)


def test_order_and_repeated_points_do_not_matter():
    points = leaves.uniform(leaves.ellipse(), 800, np.random.default_rng(4))
    shuffled = np.random.default_rng(5).permutation(np.vstack([points, points[:200]]))
    assert np.array_equal(Margin.fit(points).ring, Margin.fit(shuffled).ring)


def test_a_margin_comes_back_from_a_file_the_same(tmp_path):
    margin = Margin.fit(leaves.uniform(leaves.eaten(6), 1200, np.random.default_rng(6)), unit="mm")
    write_model(margin, tmp_path / "margin.o3l")
    again = read_model(tmp_path / "margin.o3l", {"Margin": Margin, "Hole": Hole}, check_model)
    assert again.polygon.equals_exact(margin.polygon)
    assert (again.unit, again.notes, again.spacing) == (margin.unit, margin.notes, margin.spacing)
    assert str(again.holes[0]) == str(margin.holes[0])


def test_pieces_are_joined_over_a_narrow_gap_and_left_out_and_told_beyond_a_wide_one():
    points = leaves.uniform(leaves.ellipse(), 3000, np.random.default_rng(8))
    spacing = leaves.true_spacing(leaves.ellipse(), points)
    narrow = Margin.fit(points[np.abs(points[:, 0] - 30) > 2.5 * spacing])
    wide = Margin.fit(points[np.abs(points[:, 0] - 30) > 8 * spacing])
    assert narrow.area == pytest.approx(leaves.ellipse().area, rel=0.03)
    assert "joined" in narrow.notes[0]
    assert "left out" in wide.notes[0]
    assert wide.bounds[1, 0] < 30


@pytest.mark.slow
@pytest.mark.parametrize("width", [4.0, 6.0])
def test_a_strip_few_spacings_wide_is_whole_and_has_no_holes(width):
    leaf, areas = leaves.strip(40, width, 1000 / width), []
    for seed in range(4):
        margin = Margin.fit(leaves.uniform(leaf, 1000, np.random.default_rng(seed)))
        areas.append(margin.area / leaf.area)
        assert not margin.holes
    assert np.mean(areas) == pytest.approx(1.0, abs=STRIP_AREA)


def test_a_slit_no_wider_than_gaps_of_chance_is_told_and_a_hole_is_not():
    points = leaves.uniform(leaves.ellipse(), 3000, np.random.default_rng(9))
    spacing = leaves.true_spacing(leaves.ellipse(), points)
    slit = (np.abs(points[:, 1]) <= 1.5 * spacing) & (np.abs(points[:, 0]) <= 15 * spacing)
    margin = Margin.fit(points[~slit])
    assert margin.hole_rings
    assert f"chance leaves between points, {len(margin.hole_rings)} of up to" in margin.notes[0]
    told = float(margin.notes[0].split("fill_holes")[1].split()[0])
    assert not Margin.fit(points[~slit], fill_holes=told).hole_rings
    disc = np.hypot(*points.T) <= 4 * spacing
    assert len((whole := Margin.fit(points[~disc])).hole_rings) == 1
    assert not whole.notes


def test_points_on_a_line_are_refused():
    with pytest.raises(InputError, match="one line"):
        Margin.fit(np.stack([np.arange(10.0), np.zeros(10)], axis=1))
