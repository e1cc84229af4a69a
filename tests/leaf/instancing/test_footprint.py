"""What an outline leaves of places of the plane, told row by row, beside what its cells and columns say one by one."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from o3dleaf.leaf.blade.outline_area import sides_of
from o3dleaf.leaf.instancing.footprint import CUT, MIN_DEPTH, OUTSIDE, ROUNDING, WHOLE, footprint
from tolerances import TAKEN_INSIDE

SHAPE = 32, 35
"""Cells of a place."""


def rings(seed, squeezed):
    """Return the sides of a random star about a random middle, with a hole in it, in a plane of unit spacing."""
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0, 2 * np.pi, random.integers(3, 200)))
    round_it = np.stack([np.cos(angles), np.sin(angles) * squeezed], axis=1) * random.uniform(
        250, 400, (len(angles), 1)
    )
    middle = random.uniform(-300, 300, 2)
    parts = [round_it + middle, 0.2 * round_it[::-1] + middle]
    return np.concatenate([np.hstack([part, np.roll(part, -1, axis=0)]) for part in parts])


@settings(max_examples=8)
@given(seed=st.integers(0, 10_000), squeezed=st.sampled_from([1.0, 0.3]), boxed=st.booleans(), holed=st.booleans())
def test_coverage_of_places_is_that_of_all_their_cells_and_columns(seed, squeezed, boxed, holed):
    spacing = np.array([1.0, 1.3])
    sides = rings(seed, squeezed)
    middle = sides[:, :2].mean(axis=0)
    area = footprint(sides, np.zeros(2), spacing, np.stack([middle - 300, middle + 220]) if boxed else None)
    if holed:
        first = (middle / spacing).astype(np.int64) + [150, 0]
        area = area.without(np.stack([first, first + [3, 50]]))
    (first, first_column), (last, last_column) = np.floor(area.box / SHAPE).astype(int).tolist()
    columns = range(first_column - 1, last_column + 2)
    for p in range(first - 1, last + 2):
        low = np.array([p, columns.start]) * SHAPE
        high = np.array([p + 1, columns.stop]) * SHAPE
        strip = area.strip(low[0], high[0])
        cells, distances = area.cells(low - 1, high), area.distances(low - 1, high + 1)
        np.testing.assert_array_equal(strip.cells(low - 1, high), cells)
        np.testing.assert_array_equal(strip.distances(low - 1, high + 1), distances)
        for q, told in enumerate(strip.coverage(p, columns, SHAPE)):
            here = slice(q * SHAPE[1], (q + 1) * SHAPE[1] + 1)
            if told != CUT:
                assert (cells[:, here] == (told == WHOLE)).all()
                assert ((distances[:, here] > 0) == (told == WHOLE)).all()


@pytest.mark.parametrize("size", [10, 40])
def test_only_places_by_the_outline_are_looked_at(size):
    """Of a square of n × n places those beside its sides: a share of 8 / n at most."""
    width = size * np.array(SHAPE) + 1.0
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * width - 0.5
    area = footprint(np.hstack([corners, np.roll(corners, -1, axis=0)]), np.zeros(2), np.ones(2), None)
    told = np.stack([area.coverage(p, range(size), SHAPE) for p in range(size)])
    assert (told == OUTSIDE).sum() == 0
    assert (told == CUT).sum() <= 8 * size


def wedges(random, ends, wide, count=30):
    """Wedges all around, from a tip at one of the distances `ends` to a base so far beyond the other, so wide."""
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False) + random.uniform(0, 1, count) * np.pi / count:
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        half = random.uniform(*wide) * across
        yield shapely.Polygon([random.uniform(*ends[0]) * along, ends[1] * along - half, ends[1] * along + half])


def slits(seed):
    """A disc in a plane of unit spacing, cut by wedges that end within the width of a cell."""
    wedged = shapely.unary_union(list(wedges(np.random.default_rng(seed), ((10, 30), 45), (0.3, 1.2))))
    return max(shapely.get_parts(shapely.Point(0, 0).buffer(40.0) - wedged), key=lambda part: part.area)


def spikes(seed):
    """A disc in a plane of unit spacing, with wedges on it that end within the width of a cell."""
    wedged = list(wedges(np.random.default_rng(seed), ((20, 40), 5), (0.3, 1.2)))
    return shapely.unary_union([shapely.Point(0, 0).buffer(15.0), *wedged])


@settings(max_examples=8)
@given(shape=st.builds(lambda kind, seed: kind(seed), st.sampled_from([slits, spikes]), st.integers(0, 10_000)))
def test_no_cell_is_crossed_twice_whatever_the_window(shape):
    area = footprint(sides_of(shape), np.zeros(2), np.ones(2), None)
    low, high = area.box
    found, distance = area.single_distances(low, high), area.distances(low, high)
    inside = found > 0
    a, b, c, d = inside[:-1, :-1], inside[:-1, 1:], inside[1:, :-1], inside[1:, 1:]
    assert not ((a == d) & (b == c) & (a != b)).any()
    # Columns near the margin are a little off it, those on it outside.
    off = np.where(distance > ROUNDING, np.maximum(distance, MIN_DEPTH), np.minimum(distance, -MIN_DEPTH))
    turned = inside != (off > 0)
    assert inside[turned].all()
    assert 0 < turned.sum() < 0.05 * np.sum(np.abs(distance) < 1)
    assert np.array_equal(found[~turned], off[~turned])
    assert (np.abs(found) >= MIN_DEPTH).all()
    # The sheet ends at those columns, and nowhere between them and the next.
    assert (found[turned] == MIN_DEPTH).all()
    middle = (low + high) // 2
    assert np.array_equal(area.single_distances(middle, high), found[tuple(slice(k, None) for k in middle - low)])


@settings(max_examples=8)
@given(seed=st.integers(0, 10_000), kind=st.sampled_from([slits, spikes]))
def test_a_column_taken_inside_lies_little_more_than_a_cell_off(seed, kind):
    """At the end of a slit half its diagonal; beside a tip columns may follow one another out, to the next column."""
    area = footprint(sides_of(kind(seed)), np.zeros(2), np.ones(2), None)
    distance = area.distances(*area.box)
    turned = (area.single_distances(*area.box) > 0) & (distance < -ROUNDING)
    assert 0 < -distance[turned].min() < (np.sqrt(0.5) if kind is slits else TAKEN_INSIDE)
