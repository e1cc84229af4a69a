"""The periodic index: tiling copies neither points nor coefficients, and equals the sum over shifted copies."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import reference
from o3dleaf import PUInterpolant, RBFInterpolant
from o3dleaf.fitting.cover import ball_loops, tree
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fields import LocalFields
from tolerances import FIELD_GRADIENT, FIELD_TWIN, SEAM


def patch(period):
    """A field of the unit box whose data wander, so that opposite faces do not agree by themselves."""
    rng = np.random.default_rng(4)
    points = rng.random((300, 3))
    values = np.sin(5 * points[:, 0]) + points[:, 1] ** 2 - 2 * points[:, 2]
    field = PUInterpolant.fit(points, values, points_per_ball=(15, 40))
    return field, BallIndex.periodic(field.cover.centers, field.cover.radii, field.bounds, np.array(period))


def jets(local, index, queries, level=1):
    return local.blend(index, queries, level=level, dtype=np.dtype(float))


def twin_fits(field):
    """The local splines of a field, called in the data's own coordinates."""
    rows = np.split(field.cover.members, field.cover.offsets[1:-1])
    sites = np.split(field.local.sites, 3 * field.cover.offsets[1:-1])
    fits = []
    for ball, members in enumerate(rows):
        points = sites[ball].reshape(3, len(members)).T * field.cover.radii[ball] + field.cover.centers[ball]
        lam = field.local.weights[field.cover.offsets[ball] : field.cover.offsets[ball + 1]]
        fits.append((points, lam, field.local.tails[ball], field.cover.centers[ball], field.cover.radii[ball]))

    def evaluator(points, lam, tail, centre, radius):
        def call(x):
            phi = reference.PHI[3](reference.distances(x, points) / radius)
            return phi @ lam + np.prod(((x - centre) / radius)[:, None] ** field.local.exponents, axis=2) @ tail

        return call

    return [evaluator(*fit) for fit in fits]


@pytest.mark.parametrize("period", [(1.0, 1.0, 0.0), (0.9, 1.1, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.8)])
def test_it_equals_the_literal_sum_over_shifted_copies(period):
    field, index = patch(period)
    queries = np.random.default_rng(5).uniform(field.bounds[0], field.bounds[1], (25, 3))
    shifts = np.array(list(itertools.product(*[range(-4, 5) if p else [0] for p in period]))) * period
    expected = reference.partition_of_unity(queries, field.cover.centers, field.cover.radii, twin_fits(field), shifts)
    found = jets(field.local, index, queries)
    np.testing.assert_allclose(found[0], expected, rtol=0, atol=FIELD_TWIN)
    differences = reference.difference(lambda x: jets(field.local, index, x, 0)[0], queries)
    np.testing.assert_allclose(found[1:].T, differences, rtol=0, atol=FIELD_GRADIENT * np.abs(differences).max())


def test_opposite_faces_carry_the_same_values():
    """F(x) = F(x + period), across the seam too; without tiling they differ by much."""
    field, index = patch((1.0, 1.0, 0.0))
    low = field.bounds[0] + 1e-9
    faces = np.random.default_rng(6).uniform(low, low + [0, 0.99, 0.99], (40, 3))
    cell = np.vstack([low, low + 1])
    wide = BallIndex.periodic(field.cover.centers, field.cover.radii, cell, np.array([1.0, 1.0, 0.0]))
    here = jets(field.local, wide, faces)
    there = jets(field.local, wide, faces + [1.0, 0, 0])
    np.testing.assert_allclose(here, there, rtol=0, atol=SEAM)
    plain = field(np.minimum(faces + [1.0, 0, 0], field.bounds[1])) - field(faces)
    assert np.abs(plain).max() > 0.5
    assert len(index.balls) > len(field.cover.radii)


def test_any_other_local_fit_is_tiled_alike():
    """Each ball's fit is asked at z − s, not at z."""
    field, index = patch((0.9, 1.1, 0.0))
    rng = np.random.default_rng(4)
    points = rng.random((300, 3))
    values = np.sin(5 * points[:, 0]) + points[:, 1] ** 2 - 2 * points[:, 2]
    rows = np.split(field.cover.members, field.cover.offsets[1:-1])
    plain = LocalFields([RBFInterpolant.fit(points[r], values[r]) for r in rows])
    queries = rng.uniform(field.bounds[0], field.bounds[1], (200, 3))
    fast, slow = (jets(local, index, queries) for local in (field.local, plain))
    np.testing.assert_allclose(fast[0], slow[0], rtol=0, atol=FIELD_TWIN)
    np.testing.assert_allclose(fast[1:], slow[1:], rtol=0, atol=FIELD_TWIN * np.abs(slow[1:]).max())


def test_no_period_means_the_plain_index():
    field, index = patch((0.0, 0.0, 0.0))
    queries = np.random.default_rng(7).uniform(field.bounds[0], field.bounds[1], (100, 3))
    np.testing.assert_array_equal(jets(field.local, index, queries, 0)[0], field(queries))


@pytest.mark.parametrize("period", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.9, 1.1, 0.0), (0.5, 0.25, 2.0)])
def test_points_are_folded_by_whole_periods_or_else_to_the_nearest_point(period):
    """Into the cell first (low, period) where an axis repeats, to the box elsewhere; then down the tree to one leaf."""
    period, low = np.array(period), np.array([-1.0, 2.0, 0.5])
    bounds = np.array([low, low + np.where(period > 0, period, 1.5)])
    rng = np.random.default_rng(8)
    centres, radii = rng.uniform(*bounds, (60, 3)), rng.uniform(0.2, 0.6, 60)
    index = BallIndex.periodic(centres, radii, bounds, period)
    queries = np.vstack([rng.uniform(-40, 40, (300, 3)), bounds, low + period * [[-3], [5]], [[1e6, -1e6, 1e-300]]])
    folded, leaves = index.fold(queries)
    wrapped = queries - np.floor((queries - low) / np.where(period > 0, period, np.inf)) * period
    np.testing.assert_array_equal(folded, np.clip(wrapped, *bounds))
    tree = index.tree
    for point, leaf in zip(folded, leaves, strict=True):
        node = 0
        while tree.axes[node] >= 0:
            node = tree.children[node] + (point[tree.axes[node]] >= tree.splits[node])
        assert node == leaf
        inside = np.linalg.norm(point - index.centers, axis=1) < index.radii
        assert set(np.flatnonzero(inside)) <= set(tree.images[tree.starts[leaf] : tree.stops[leaf]])


@given(st.one_of(*(st.lists(st.integers(0, most), max_size=60) for most in (9, 3 << 21))))
def test_grouping_is_a_stable_sort(leaves):
    """Of numbers of few bits and of many."""
    leaves = np.array(leaves, dtype=np.int64)
    order = ball_loops.order_by_leaf(leaves, int(leaves.max(initial=0)) + 1)
    np.testing.assert_array_equal(order, np.argsort(leaves, kind="stable"))


def test_points_share_a_ball_as_their_distances_say():
    rng = np.random.default_rng(3)
    centers, radii = rng.uniform(size=(40, 3)), rng.uniform(0.1, 0.3, size=40)
    some, points = rng.uniform(size=(3, 3)), rng.uniform(-0.2, 1.2, size=(2_000, 3))
    index = BallIndex.build(centers, radii, np.array([[0.0] * 3, [1.0] * 3]))
    inside = np.linalg.norm(np.clip(points, 0, 1)[:, np.newaxis] - centers, axis=2) <= radii
    chosen = (np.linalg.norm(some[:, np.newaxis] - centers, axis=2) <= radii).any(axis=0)
    expected = inside[:, chosen].any(axis=1)
    assert np.array_equal(index.share_ball(some, points), expected)
    assert 0 < expected.sum() < len(points)


@pytest.mark.parametrize("side", [-3.0, 3.0])
def test_images_of_balls_beside_the_cell_are_all_that_reach_into_it(side):
    """Of balls that lie beyond one end of the cell, and of others that lie in it: as of all shifts, one by one."""
    rng = np.random.default_rng(3)
    bounds, period = np.array([[0.0, 0.0], [1.0, 2.0]]), np.array([1.0, 0.0])
    centers, radii = rng.random((20, 2)) * [0.5, 2] + [side, 0], rng.uniform(0.05, 0.4, 20)
    index = BallIndex.periodic(centers, radii, bounds, period)
    expected = set()
    for step in range(-9, 10):
        moved = centers + step * period
        gap = moved - np.clip(moved, *bounds)
        expected |= {(ball, step) for ball in np.flatnonzero(np.linalg.norm(gap, axis=1) < radii)}
    assert {(ball, round(shift[0])) for ball, shift in zip(index.balls, index.shifts, strict=True)} == expected


def test_a_point_on_the_rim_of_a_ball_lies_in_it():
    """On a lattice, where distances and radii are whole: 3² + 4² = 5²."""
    points = np.stack(np.meshgrid(np.arange(11.0), np.arange(11.0)), axis=-1).reshape(-1, 2)
    centers, radii = np.array([[5.0, 5.0], [2.0, 4.0], [7.0, 3.0]]), np.array([5.0, 2.0, 1.0])
    index = BallIndex.build(centers, radii, np.array([[0.0, 0.0], [10.0, 10.0]]))
    offsets, rows = index.members(points)
    for image, ball in enumerate(index.balls):
        within = np.sum((points - centers[ball]) ** 2, axis=1) <= radii[ball] ** 2
        assert np.array_equal(rows[offsets[image] : offsets[image + 1]], np.flatnonzero(within))


def test_a_tree_made_at_once_lists_the_balls_of_one_made_by_branches(monkeypatch):
    rng = np.random.default_rng(3)
    points, centers, radii = rng.random((2000, 3)), rng.random((3000, 3)), rng.uniform(0.01, 0.2, 3000)
    found = []
    for few, together in ((tree.FEW, tree.TOGETHER), (0, tree.TOGETHER), (0, 500)):
        monkeypatch.setattr(tree, "FEW", few)
        monkeypatch.setattr(tree, "TOGETHER", together)
        index = BallIndex.build(centers, radii, np.array([[0.0] * 3, [1.0] * 3]))
        leaves, boxes = index.fold(points)[1], index.tree
        found.append([boxes.images[boxes.starts[leaf] : boxes.stops[leaf]].tolist() for leaf in leaves])
    assert found[0] == found[1] == found[2]
