"""Both sides of a thin leaf: points of either are moved to the middle between them, and of other scans none is."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.leaf.sheet.layers.two_sides import _beside, _orthonormal, find_both_sides
from tests import tolerances as tol

SPACING = 0.7


@pytest.fixture(scope="module")
def leaf():
    return o3l.samples.leaf_shape("cupped", length=40, width=30)


def scan_of(leaf, thickness, noise, share):
    """Return points of both sides, and where they would lie on a leaf without thickness."""
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=SPACING, noise=noise)
    side = np.where(np.random.default_rng(1).random(len(scan.places)) < share, 0.5, -0.5)
    return scan.points + (thickness * SPACING * side)[:, np.newaxis] * leaf.normals(scan.places), scan.points


@pytest.mark.few(thickness=1)
@pytest.mark.parametrize(
    ("thickness", "noise", "share"),
    [(2.0, 0.0, 0.5), (2.0, 0.0, 0.25), (3.0, 0.3, 0.5), (4.0, 0.2, 0.25), (5.0, 0.1, 0.25)],
)
def test_points_of_either_side_move_to_the_middle_whatever_their_share(leaf, thickness, noise, share):
    points, middle = scan_of(leaf, thickness, noise, share)
    both = find_both_sides(points)
    assert both.apart == pytest.approx(thickness * SPACING, rel=tol.DISTANCE_OF_SIDES)
    off = np.linalg.norm(both.points - middle, axis=1)
    assert np.mean(off <= tol.MOVED_TO_MIDDLE * SPACING) >= tol.SHARE_MOVED
    assert "both sides" in both.tell()


@pytest.mark.parametrize("noise", [0.0, 0.2, 0.5])
def test_a_single_layer_has_no_sides_whatever_its_noise(leaf, noise):
    assert find_both_sides(o3l.samples.scan_leaf(leaf, seed=0, spacing=SPACING, noise=noise).points) is None


def test_stragglers_beside_a_layer_are_no_other_side(leaf):
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=SPACING)
    off = np.where(np.random.default_rng(2).random(len(scan.places)) < 0.03, 3 * SPACING, 0.0)
    assert find_both_sides(scan.points + off[:, np.newaxis] * leaf.normals(scan.places)) is None


@pytest.mark.parametrize("step", [0.3, 1.0, 2.0])
def test_depths_that_are_rounded_are_no_sides(leaf, step):
    """Levels lie beside one another, where sides lie over one another."""
    points = o3l.samples.scan_leaf(leaf, seed=0, spacing=SPACING, pattern="grid").points
    points[:, 2] = np.round(points[:, 2] / (step * SPACING)) * step * SPACING
    assert find_both_sides(points) is None


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_leaf_folded_in_two_is_none_of_two_sides(noise):
    """Its halves lie as far apart as sides do; but one sheet goes from the one round to the other."""
    rng = np.random.default_rng(0)
    apart, half, spacing = 2.5, 16.0, 0.6
    count = round(50 * 2 * half / spacing**2)
    u, v = rng.uniform(0, 50, count), rng.uniform(-half, half, count)
    radius, bent = apart / 2, np.pi * apart / 4
    angle = np.clip(v, -bent, bent) / radius
    flat = np.maximum(np.abs(v) - bent, 0.0)
    points = np.column_stack([u, radius * np.cos(angle) - flat, radius * np.sin(angle)])
    assert find_both_sides(points + rng.normal(0, noise * spacing, points.shape)) is None


@pytest.mark.few(turns=1)
@pytest.mark.parametrize("turns", [1.4, 2.2])
def test_a_leaf_rolled_up_into_a_scroll_is_none_of_two_sides(turns):
    """Its layers lie farther apart than triangles join, and face one way; one sheet winds through all of them."""
    rng, apart, spacing = np.random.default_rng(0), 4.0, 0.7
    turn = np.linspace(0, 2 * np.pi * turns, 4000)
    spiral = (3 + apart * turn / (2 * np.pi))[:, np.newaxis] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(spiral, axis=0).T))])
    count = round(40 * along[-1] / spacing**2)
    wound = rng.uniform(0, along[-1], count)
    points = np.stack([rng.uniform(0, 40, count), *(np.interp(wound, along, axis) for axis in spiral.T)], axis=1)
    assert find_both_sides(points + rng.normal(0, 0.1 * spacing, points.shape)) is None


def test_a_second_layer_over_a_part_is_no_other_side():
    leaf = o3l.samples.leaf_shape("layers", length=40, width=24, height=2.0)
    assert find_both_sides(o3l.samples.scan_leaf(leaf, seed=0, spacing=SPACING).points) is None


def test_sides_are_left_as_they_are_in_few_points():
    assert find_both_sides(np.random.default_rng(0).random((30, 3))) is None


def test_columns_that_depend_on_others_have_the_least_squares_of_least_norm():
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(20, 40, 4))
    values = rng.normal(size=(20, 40))
    twice = np.concatenate([columns, columns[..., :2] - columns[..., 2:]], axis=2)
    for given in (columns, twice):
        basis, weights = _orthonormal(given)
        fitted = [np.linalg.lstsq(column, value)[0] for column, value in zip(given, values, strict=True)]
        np.testing.assert_allclose(given @ weights, basis, atol=tol.ROUNDING)
        found = (weights @ (basis.mT @ values[..., np.newaxis]))[..., 0]
        np.testing.assert_allclose(found, fitted, atol=tol.ROUNDING)
        left = values - (given @ np.array(fitted)[..., np.newaxis])[..., 0]
        np.testing.assert_allclose(_beside(basis, values), left, atol=tol.ROUNDING)
