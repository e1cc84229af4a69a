from functools import partial

import numpy as np
import pytest
import shapely

import planar_leaves as leaves
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.sample_lines import local_lines
from o3dleaf.leaf.margin.sample_region import cover_sample
from o3dleaf.leaf.margin.sample_spacing import SampleNeighbors
from o3dleaf.leaf.margin.scan_planes import find_scan_planes
from tolerances import HOLE_PLACE, PASSED_BY, SCAN_PLANES, SCAN_PLANES_TURN

DEPTH, STEP, APART = 1 / 120, 0.5, 0.6
"""Of a bowl z = (x² + y²) / 120; the step of points along lines, and the distance of a scanner's planes."""
TILT, LEVEL = (0.18, 0.12, 1.0), (0.05, 0.02, 1.0)
"""Normals of planes: lines are closed about the place where these are the bowl's."""


def lift(places, depth=DEPTH):
    """The bowl over its plane, which is no chart that keeps lengths, but nearly where it is flat."""
    flat, count = np.eye(2, 3), len(places)
    derivatives = np.broadcast_to(flat, (count, 2, 3)).copy()
    derivatives[:, :, 2] = 2 * depth * places
    return np.column_stack([places, depth * (places**2).sum(axis=1)]), derivatives


def lines_in_planes(outline, rng, *, noise=0.0, depth=DEPTH, first=None, tilt=TILT):
    """Places on circles in which planes cut the bowl, the first so much of their distance above its lowest place."""
    gradient = tilt / np.linalg.norm(tilt) / APART
    middle = -gradient[:2] / (2 * depth * gradient[2])
    first = rng.uniform() if first is None else first
    reach = shapely.hausdorff_distance(shapely.Point(middle), outline)
    found = []
    for height in np.arange(first, depth * gradient[2] * reach**2):
        radius = np.sqrt(height / (depth * gradient[2]))
        count = max(int(2 * np.pi * radius / STEP), 3)
        turn = 2 * np.pi * (rng.uniform() + np.arange(count) + rng.normal(0, 0.1, count)) / count
        found.append(middle + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1))
    places = np.concatenate(found)
    places = places + rng.normal(0, noise, places.shape)
    return places[shapely.contains_xy(outline, *places.T)]


def planes_of(places, depth=DEPTH):
    near = SampleNeighbors.of(places)
    lines = local_lines(near, np.full(len(places), np.sqrt(leaves.ellipse().area / len(places))))
    return find_scan_planes(lines, partial(lift, depth=depth))


@pytest.mark.parametrize(
    ("tilt", "depth", "noise"), [(TILT, DEPTH, 0.0), (TILT, 1 / 400, 0.1), (LEVEL, DEPTH, 0.0), (LEVEL, DEPTH, 0.1)]
)
def test_planes_have_their_normal_and_distance(tilt, depth, noise):
    places = lines_in_planes(leaves.ellipse(), np.random.default_rng(1), noise=noise, depth=depth, tilt=tilt)
    planes = planes_of(places, depth)
    distance = 1 / np.linalg.norm(planes.gradient)
    assert distance == pytest.approx(APART, rel=SCAN_PLANES)
    assert abs(planes.gradient @ tilt) * distance / np.linalg.norm(tilt) == pytest.approx(1, abs=SCAN_PLANES_TURN)


@pytest.mark.few(depth=1)
@pytest.mark.parametrize("depth", [0.0, DEPTH])
def test_lines_of_no_equal_distance_are_of_no_planes(depth):
    rng = np.random.default_rng(2)
    places = leaves.lines(leaves.ellipse(), 0.7, 4, 0.3, rng)
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    along, across = (places @ turn).T
    uneven = np.stack([along, across + 3 * np.sin(across / 4)], axis=1) @ turn.T
    assert planes_of(places, 0.0) is not None
    assert planes_of(uneven, depth) is None


@pytest.mark.few(sampler=1, seed=1)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sampler", [leaves.uniform, leaves.jittered, leaves.lattice])
def test_without_lines_the_surface_changes_nothing(sampler, seed):
    places = np.unique(sampler(leaves.eaten(6), 1500, np.random.default_rng(seed)), axis=0)
    flat, lifted = cover_sample(places), cover_sample(places, lift=lift)
    assert np.array_equal(flat.triangles, lifted.triangles)
    assert lifted.passed_by == 0


@pytest.mark.few(angle=1)
@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_where_lines_are_equally_far_apart_the_surface_changes_nothing(angle):
    """Slivers between ends of lines, and holes, are no place that planes pass by."""
    places = leaves.lines(leaves.eaten(6), 0.8, 4, angle, np.random.default_rng(3))
    flat, lifted = cover_sample(places), cover_sample(places, lift=partial(lift, depth=0.0))
    assert planes_of(places, 0.0) is not None
    assert np.array_equal(flat.triangles, lifted.triangles)
    assert lifted.passed_by == 0


@pytest.mark.few(first=1)
@pytest.mark.parametrize("first", [0.001, 0.3, 0.9])
def test_where_planes_pass_by_a_bowl_there_is_no_hole(first):
    """Its bottom lies along them: 12 wide and more between two lines, of points 0.5 apart, or a few points inside."""
    leaf, rng = leaves.ellipse(), np.random.default_rng(0)
    places = lines_in_planes(leaf, rng, noise=0.1 * (first > 0.5), first=first)
    margin = Margin.fit(places, lift=lift)
    assert Margin.fit(places).area < (1 - PASSED_BY) * leaf.area
    assert not margin.holes
    assert margin.area == pytest.approx(leaf.area, rel=PASSED_BY)
    assert any("along the scanner's planes" in note for note in margin.notes)


@pytest.mark.few(seed=1)
@pytest.mark.parametrize(("seed", "place"), [(0, (10, 4)), (1, (-2, -4)), (1, (10, 4)), (0, (-2, -4))])
def test_where_lines_end_there_is_a_hole(seed, place):
    """Also where the bowl lies along the planes, if one passes."""
    leaf = leaves.ellipse().difference(shapely.Point(*place).buffer(5.5))
    places = lines_in_planes(leaf, np.random.default_rng(seed), noise=0.1 * seed)
    margin = Margin.fit(places, lift=lift)
    assert len(margin.holes) == 1
    assert np.hypot(*(margin.holes[0].place - place)) < HOLE_PLACE
    assert margin.area == pytest.approx(leaf.area, rel=PASSED_BY)
