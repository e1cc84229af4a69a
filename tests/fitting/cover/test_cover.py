"""The cover: no point and no query is left out, no ball is too full, and members are the brute-force ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import reference
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.cover import Cover, _halve_until_small, as_ball_size
from o3dleaf.fitting.cover.index import BallIndex


def cloud(kind, d, count=400, seed=0):
    rng = np.random.default_rng(seed)
    if kind == "uniform":
        return rng.random((count, d))
    if kind == "clustered":
        return rng.standard_normal((count, d)) ** 3 + 10 * rng.integers(0, 3, (count, 1))
    if kind == "lattice":
        side = round(count ** (1 / d))
        return np.stack(np.meshgrid(*[0.024 * np.arange(side)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    if kind == "flat":
        return rng.random((count, d)) * (np.arange(d) > 0)
    return rng.random((count, 1)) * np.ones(d)  # a diagonal line


def box(points):
    return np.array([points.min(axis=0), points.max(axis=0)])


def rows(cover):
    return np.split(cover.members, cover.offsets[1:-1])


kinds = st.sampled_from(["uniform", "clustered", "lattice", "flat", "line"])
clouds = st.builds(cloud, kinds, st.integers(2, 3), st.integers(1, 400), st.integers(0, 1000)) | st.builds(
    cloud, st.sampled_from(["uniform", "clustered"]), st.sampled_from([1, 4]), st.integers(1, 200), st.integers(0, 9)
)
sizes = st.integers(4, 80)


@settings(max_examples=40)
@given(points=clouds, most=sizes, share=st.floats(0.1, 1), overlap=st.floats(1.05, 1.5))
def test_every_point_and_every_query_lies_in_a_ball_and_no_ball_is_too_full(points, most, share, overlap):
    least = max(1, int(share * most))
    bounds = box(points)
    cover = Cover.fit(points, bounds, (least, most), overlap)
    queries = np.vstack([points, np.random.default_rng(0).uniform(bounds[0], bounds[1], (200, points.shape[1]))])
    depth = reference.distances(queries, cover.centers) / cover.radii
    assert depth.min(axis=1).max() < 1
    assert np.all(cover.counts <= most)
    assert np.all(cover.counts >= min(least, len(points)))
    assert np.array_equal(np.unique(cover.members), np.arange(len(points)))


@settings(max_examples=40)
@given(points=clouds, most=sizes, share=st.floats(0.1, 1))
def test_members_are_those_of_brute_force(points, most, share):
    """All the points of a ball, or its nearest where it holds too few; ties at the rim may fall either way."""
    least = min(max(1, int(share * most)), len(points))
    cover = Cover.fit(points, box(points), (least, most), 1.1)
    for centre, radius, found in zip(cover.centers, cover.radii, rows(cover), strict=True):
        assert np.all(np.diff(found) > 0)
        expected = reference.members(points, centre, radius, least)
        if not np.array_equal(found, expected):
            distance = np.linalg.norm(points - centre, axis=1)
            np.testing.assert_allclose(np.sort(distance[found]), np.sort(distance[expected]), rtol=1e-14)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_larger_bounds_are_covered_too_and_empty_balls_take_the_nearest_points(d):
    points = cloud("uniform", d)
    bounds = np.array([np.full(d, -1.0), np.full(d, 2.0)])
    cover = Cover.fit(points, bounds, (20, 40), 1.1)
    queries = np.random.default_rng(1).uniform(-1, 2, (300, d))
    assert (reference.distances(queries, cover.centers) / cover.radii).min(axis=1).max() < 1
    assert cover.counts.min() >= 20
    np.testing.assert_array_equal(cover.bounds, bounds)


def test_one_ball_holds_all_that_fits_into_it():
    points = cloud("uniform", 3)
    cover = Cover.fit(points, box(points), (200, 400), 1.1)
    assert len(cover.radii) == 1
    assert np.array_equal(cover.members, np.arange(400))


def test_a_refinement_follows_the_density():
    """Radii shrink where points crowd: the paper's adaptive choice, which keeps N/M constant."""
    rng = np.random.default_rng(0)
    points = np.vstack([rng.random((2000, 2)), 0.05 * rng.random((2000, 2))])
    cover = Cover.fit(points, box(points), (10, 40), 1.1)
    crowded = np.all(cover.centers < 0.05, axis=1)
    assert cover.radii[crowded].max() < cover.radii[~crowded].min() * 2
    assert np.median(cover.radii[crowded]) < np.median(cover.radii[~crowded]) / 5


def test_impossible_wishes_are_refused():
    for size in [(0, 10), (20, 10), (-1, -1), 0]:
        with pytest.raises(InputError, match="1 <= least <= most"):
            as_ball_size(size, 1.1)
    for overlap in (1.0, 0.5, np.nan, np.inf):
        with pytest.raises(InputError, match="factor above 1"):
            as_ball_size((10, 20), overlap)


def test_a_ball_size_may_be_any_whole_number():
    assert as_ball_size(np.int64(61), 1.1) == (30, 61)
    assert as_ball_size((np.int32(1), 7), 1.1) == (1, 7)


@pytest.mark.parametrize("place", [0.0, 0.3, 1e6])
@pytest.mark.parametrize("company", [0, 400])
def test_more_coinciding_points_than_a_ball_may_hold_are_refused_at_once(place, company):
    """Halving could go on for ever: a cell of size zero would give two of size zero."""
    piled = np.vstack([cloud("uniform", 3)[:company], np.full((30, 3), place)])
    with pytest.raises(InputError, match="more than 20 coincide near"):
        Cover.fit(piled, box(piled), (10, 20), 1.1)
    assert Cover.fit(piled, box(piled), (10, 30), 1.1).counts.max() <= 30


@settings(max_examples=25)
@given(points=clouds, seed=st.integers(0, 1000))
def test_the_index_finds_every_ball_that_holds_a_query(points, seed):
    """A query's leaf lists all of its balls, in rising order, which fixes the order of the sum."""
    bounds = box(points)
    cover = Cover.fit(points, bounds, (5, 15), 1.2)
    index = BallIndex.build(cover.centers, cover.radii, bounds)
    queries = np.random.default_rng(seed).uniform(bounds[0], bounds[1], (50, points.shape[1]))
    queries = np.vstack([queries, bounds])
    inside = reference.distances(queries, cover.centers) < cover.radii
    for leaf, expected in zip(index.fold(queries)[1], inside, strict=True):
        listed = index.tree.images[index.tree.starts[leaf] : index.tree.stops[leaf]]
        assert np.all(np.diff(listed) > 0)
        assert set(np.flatnonzero(expected)) <= set(listed)


def test_points_are_done_when_their_cell_is():
    """Of two clusters the sparse one at once, the dense one when it has been halved to its end."""
    rng = np.random.default_rng(0)
    sparse, dense = rng.random((10, 3)) * 0.2, 0.8 + rng.random((4000, 3)) * 0.2
    points, reports = np.vstack([sparse, dense]), []
    with progress.listening(lambda done, total: reports.append((done, total))):
        _halve_until_small(cKDTree(points), points, np.array([[0.0] * 3, [1.0] * 3]), 40, 1.1)
    done = np.round(np.array([share / total for share, total in reports]) * len(points))
    assert done[0] == 0  # all are in one cell, which is too full
    assert 10 in done
    assert (np.diff(done) >= 0).all()
