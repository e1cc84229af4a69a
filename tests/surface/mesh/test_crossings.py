"""Crossings are those that exact fractions find, however triangles touch, however their sizes differ."""

import numpy as np
import pytest

import reference
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.surface.mesh.contact_loops import find_view, meet
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.predicate_loops import line_side, plane_side


def soup(seed, count=26):
    """Return random triangles of a few places that lie in lines and planes: corners, edges and sides touch."""
    rng = np.random.default_rng(seed)
    places = rng.integers(0, 4, size=(18, 3)) * [1, 1, rng.integers(0, 2)]
    triangles = np.array([rng.choice(18, 3, replace=False) for _ in range(count)])
    # Tenths are no floats, and the map is no rotation: what was in a plane is now beside it by a rounding.
    return places * 0.1 @ (np.eye(3) if seed % 2 else rng.normal(size=(3, 3))) + 0.7 * (seed % 3), triangles


def uneven(seed, count=1500):
    """Return triangles of sizes from 1 to 1e-6 with corners at random, one of them far away, and needles."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** -(6 * rng.random((count, 1, 1)) ** 2)
    corners = rng.random((count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    corners[::7, 2] = corners[::7, 1] + 1e-7
    corners[0] += 1e6
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(8))
def test_each_pair_is_told_as_by_fractions(seed):
    vertices, triangles = soup(seed)
    views = [find_view(vertices, tuple(t)) for t in triangles]
    whole = [n for n, corners in enumerate(vertices[triangles]) if not reference.is_line(corners)]
    assert whole == np.flatnonzero(np.array(views) >= 0).tolist()
    found = {False: 0, True: 0}
    for n, one in enumerate(whole):
        for other in whole[:n]:
            told = meet(vertices, tuple(triangles[one]), views[one], tuple(triangles[other]), views[other])
            assert told == reference.meet(vertices[triangles[one]], vertices[triangles[other]])
            found[told] += 1
    assert min(found.values()) > 10


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(3))
def test_the_trees_miss_no_pair(seed):
    vertices, triangles = uneven(seed)
    views, slow = [find_view(vertices, tuple(t)) for t in triangles], np.zeros(len(triangles), dtype=bool)
    lower, upper = vertices[triangles].min(axis=1), vertices[triangles].max(axis=1)
    for one in range(len(triangles)):
        for other in np.flatnonzero(((lower[:one] <= upper[one]) & (lower[one] <= upper[:one])).all(axis=1)):
            if meet(vertices, tuple(triangles[one]), views[one], tuple(triangles[other]), views[other]):
                slow[[one, other]] = True
    found = find_crossings(vertices, triangles)
    assert 100 < found.sum() < len(triangles) - 100
    assert np.array_equal(found, slow)


@pytest.mark.parametrize("seed", range(4))
def test_sides_are_exact_where_rounding_is_all(seed):
    """Points of a plane and of a line, moved by the last bits: most determinants are pure rounding."""
    rng = np.random.default_rng(seed)
    start, edges = 10.0 ** rng.integers(-3, 3) * rng.normal(size=3), rng.normal(size=(2, 3))
    steps, moved = rng.integers(-3, 4, size=(300, 2)), 1 + rng.integers(-1, 2, size=(300, 3)) * 2.0**-52
    plane, line = (start + steps @ edges) * moved, (start + steps[:, :1] * edges[:1]) * moved
    for n in range(0, 300, 4):
        assert plane_side(plane, n, n + 1, n + 2, n + 3) == reference.plane_side(*plane[n : n + 4])
        for axis in range(3):
            seen, up = line[n : n + 3].copy(), np.eye(3)[axis]
            seen[:, axis] = 0
            # A fourth point above the third makes a plane of the line.
            side = reference.plane_side(seen[0], seen[1], seen[2] + up, seen[2])
            assert line_side(line, axis, n, n + 1, n + 2) == side


def test_threads_change_nothing():
    vertices, triangles = uneven(5, 5000)
    threads, found = get_num_threads(), []
    try:
        for number in (1, 4):
            set_num_threads(number)
            # Trees of few triangles are several blocks.
            found.append(find_crossings(vertices, triangles, block=256))
    finally:
        set_num_threads(threads)
    assert np.array_equal(*found)
