"""Octrees: leaves are no wider than points ask for, and of leaves that touch one is at most twice as wide."""

import numpy as np
import pytest

from o3dleaf.surface.isosurface.band.morton_loops import encode
from o3dleaf.surface.isosurface.octree.octree import Octree
from o3dleaf.surface.isosurface.octree.octree_loops import decode

SIDE = 64


def named(places):
    """Return the keys of whole numbers (n, 3)."""
    keys = np.empty(len(places), dtype=np.int64)
    encode(np.asarray(places, dtype=np.int64), keys)
    return keys


def around(cell):
    """Return a cell and the 26 that touch it."""
    return {tuple(np.add(cell, step) - 1) for step in np.ndindex(3, 3, 3)}


def split_cells(points, levels):
    """Return the split cells of each level, by the definition."""
    split = {0: set()}
    for level in range(1, levels.max() + 1):
        asking = [tuple(point >> level) for point, own in zip(points, levels, strict=True) if own == level - 1]
        cells = set().union(*map(around, asking))
        for child in split[level - 1]:
            cells |= {tuple(np.array(beside) >> 1) for beside in around(child)}
        split[level] = cells
    return split


@pytest.fixture(scope="module", params=[0, 1, 2])
def grown(request):
    """Points that ask for levels 0 to 4, the octree, and the levels of all places."""
    rng = np.random.default_rng(request.param)
    points, levels = rng.integers(20, 20 + SIDE, (12, 3)), rng.integers(0, 5, 12)
    places = np.stack(np.meshgrid(*[np.arange(16, 24 + SIDE)] * 3, indexing="ij"), axis=-1)
    octree = Octree.of(named(points), levels)
    keys, found = octree.leaves_at(named(places.reshape(-1, 3)))
    return points, levels, octree, places, keys.reshape(places.shape[:3]), found.reshape(places.shape[:3])


def test_leaves_are_those_of_the_definition(grown):
    points, levels, _, places, keys, found = grown
    split = split_cells(points, levels)
    for index in np.random.default_rng(5).integers(0, len(places), (2_000, 3)):
        level = levels.max()
        while tuple(places[tuple(index)] >> level) in split[level]:
            level -= 1
        assert found[tuple(index)] == level
        assert keys[tuple(index)] == named([places[tuple(index)] >> level << level])[0]


def test_leaves_with_points_are_no_wider_than_these_ask_for(grown):
    points, levels, octree, *_ = grown
    assert np.all(octree.leaves_at(named(points))[1] <= levels)
    assert np.any(grown[5] > levels.min())


def test_of_leaves_that_touch_one_is_at_most_twice_as_wide(grown):
    found = grown[5]
    for step in np.ndindex(2, 3, 3):
        # One side of each pair of places that are a step apart.
        shifts = np.array(step) - [0, 1, 1]
        here = tuple(slice(max(0, -by), len(found) - max(0, by)) for by in shifts)
        there = tuple(slice(max(0, by), len(found) - max(0, -by)) for by in shifts)
        assert np.abs(found[here] - found[there]).max() <= 1


def test_keys_are_read_as_they_are_written():
    places = np.random.default_rng(1).integers(0, 1 << 20, (100, 3))
    read = np.empty_like(places)
    decode(named(places), read)
    assert np.array_equal(read, places)
