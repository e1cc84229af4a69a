"""Points on both sides of a blade are judged by their own side; those of one layer, wherever it lies, as they are."""

import numpy as np
import pytest

from blade_fields import RolledBlade
from o3dleaf.leaf.fit_quality import FitQuality
from o3dleaf.leaf.residuals.two_layers import find_two_layers
from tolerances import DISTANCE_OF_SIDES, HEIGHT_OF_LAYERS, NOISE_OF_NEIGHBORS, ROUNDED_MOVE

SIDE = 40.0
NOISE = 0.1


def square(seed=0):
    return np.random.default_rng(seed).uniform(0, SIDE, (int(SIDE**2), 2))


def normal(count, seed=1):
    return np.random.default_rng(seed).normal(size=count)


def sides(count, share=0.5):
    return np.where(np.random.default_rng(2).random(count) < share, 1.0, -1.0)


def layers_of(plane, distance):
    feet = np.column_stack([plane, np.zeros(len(plane))])
    return find_two_layers(plane, feet, distance, np.arange(len(plane)), 1.0)


@pytest.mark.parametrize("share", [0.5, 0.8])
@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_each_point_is_judged_by_its_own_layer(turn, share):
    """A blade in between, as of a leaf whose thickness falls from 6 spacings to none; its rim has two sides as well."""
    plane = square()
    half = 3.0 * (1 - plane[:, 0] / SIDE)
    side, errors = sides(len(plane), share), NOISE * normal(len(plane))
    found = layers_of(plane, side * half + errors)
    thick = half > 5 * NOISE
    off = np.abs(found.height - side * half)
    # At the border, where all neighbors are on one side of a place, as well.
    assert max(np.median(off[thick]), np.median(off[plane[:, 0] < 1])) < HEIGHT_OF_LAYERS * NOISE
    assert found.apart == pytest.approx(2 * np.median(half[half > 0.75]), rel=DISTANCE_OF_SIDES)
    axes = np.linalg.qr(np.array([[1, turn, 0], [0, 1, turn], [0, 0, 1]]))[0]
    feet = np.column_stack([plane, np.zeros(len(plane))]) @ axes
    points = feet + np.outer(side * half + errors, axes[2])
    moved, rest = found.onto_blade(points, feet, side * half + errors)
    # The median: some places have too few points of a lesser side.
    assert np.median(np.abs(rest[thick])) == pytest.approx(0.6745 * NOISE, rel=NOISE_OF_NEIGHBORS)
    assert np.allclose((moved - feet) @ axes[2], rest, atol=ROUNDED_MOVE)
    assert np.allclose(np.linalg.norm(moved - feet, axis=1), np.abs(rest), atol=ROUNDED_MOVE)


@pytest.mark.parametrize(
    "distance",
    [
        np.zeros,
        lambda count: 2.0 * normal(count),  # noise, however large
        lambda count: np.random.default_rng(3).uniform(-3, 3, count),  # a slab filled
        lambda count: 0.7 * sides(count) + 0.05 * normal(count),  # layers nearer than 1.5 spacings
        lambda count: 1.5 + 1.5 * sides(count) + 0.1 * normal(count),  # one at the blade, one over it
        lambda count: 3.0 + 0.1 * normal(count),  # one layer beside the blade
        lambda count: 3.0 * sides(count, 0.04) + 0.1 * normal(count),  # stragglers
    ],
)
def test_of_one_layer_there_are_not_two(distance):
    plane = square()
    assert layers_of(plane, distance(len(plane))) is None


def test_of_a_thick_leaf_neither_points_nor_gaps_are_told_but_how_thick_it_is():
    blade = RolledBlade(radius=40.0)
    points, places = blade.scan(0.5, 0.1)
    up = blade.lift(np.column_stack([places, np.ones(len(places))])) - blade.lift(
        np.column_stack([places, 0 * places[:, 0]])
    )
    quality = FitQuality.of(blade, points + 2.5 * sides(len(points))[:, np.newaxis] * up)
    assert [line.split(",")[1] for line in quality.warnings] == [" 5 mm apart"]
    assert quality.layers.apart == pytest.approx(5.0, rel=DISTANCE_OF_SIDES)
    assert quality.noise == pytest.approx(0.05, rel=NOISE_OF_NEIGHBORS)
