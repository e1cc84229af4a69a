"""The wall over a cut cell: how its loops close along the cell's sides, and in what triangles."""

import numpy as np
import pytest

from o3dleaf.leaf.instancing.cut.flip_loops import is_better
from o3dleaf.leaf.instancing.cut.wall_loops import fill_loop, join_sides


@pytest.mark.parametrize("seed", range(4))
def test_borders_that_end_on_a_side_go_on_in_pairs_from_below(seed):
    """The solid lies between the first and the second end on a side, the third and the fourth, in whatever order."""
    rng = np.random.default_rng(seed)
    sides = np.repeat(np.arange(4), (2, 4, 6, 0))
    heights = rng.random(len(sides))
    following, leading = np.full(len(sides), -1), np.full(len(sides), -1)
    pairs = []
    for side in range(3):
        rows = np.flatnonzero(sides == side)
        rows = rows[np.argsort(heights[rows])]
        for low, high in rows.reshape(-1, 2):
            start, stop = rng.permutation([low, high])
            pairs.append((stop, start))  # the border that ends at `stop` goes on at `start`
            following[start], leading[stop] = 1000 + start, 1000 + stop  # borders lead away from the side
    order = rng.permutation(len(sides))
    join_sides(order, sides, heights, following, leading)
    for stop, start in pairs:
        assert following[stop] == start
        assert leading[start] == stop


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_a_loop_is_filled_with_the_triangles_that_delaunay_wants(turn):
    """Over a convex polygon in an upright plane, whichever way it faces: all of its area, and no better diagonal."""
    angles = np.sort(np.random.default_rng(2).uniform(0, 2 * np.pi, 24))
    flat = np.column_stack([3 * np.cos(angles), np.sin(angles)])
    places = np.column_stack([flat[:, 0] * np.cos(turn), flat[:, 0] * np.sin(turn), flat[:, 1]])
    triangles = np.empty((22, 3), dtype=np.int64)
    assert fill_loop(np.arange(24), places, np.full(24, -1), triangles, 0) == 22
    corners = flat[triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    whole = (flat[:, 0] * np.roll(flat[:, 1], -1) - np.roll(flat[:, 0], -1) * flat[:, 1]).sum() / 2
    assert (np.sign(areas) == np.sign(areas[0])).all()
    assert abs(areas.sum()) == pytest.approx(whole)
    beyond = {(t[k], t[k - 2]): t[k - 1] for t in triangles.tolist() for k in range(3)}
    inner = [edge for edge in beyond if edge[::-1] in beyond]
    assert len(inner) == 2 * 21
    towards = flat * (np.sign(areas[0]), 1.0)
    assert not [(a, b) for a, b in inner if is_better(towards, a, b, beyond[a, b], beyond[b, a])]
