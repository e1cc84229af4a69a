"""The compiled loops of creases: whether splitting a ball is worth it."""

import numpy as np
from numba import njit

from o3dleaf.fitting.pu.ball_loops import gather
from o3dleaf.fitting.rbf.evaluation_loops import radial_values, squared_distances
from o3dleaf.fitting.rbf.solve_loops import solve_local, tail_matrix

HELD_OUT = 4
"""One in so many points of a ball is left out to judge by."""

MUCH = 0.3
"""Share of the squared errors of one spline below which sheets are better beyond doubt."""

ALIKE = 2.0
"""Squared errors near creases over those elsewhere which chance may make of nothing but noise."""


@njit(nogil=True, cache=True)
def spline_values(points, weights, tail, exponents, power, queries):
    """Return the values of a spline in unit coordinates at the columns of `queries` (d, ·)."""
    found = tail_matrix(queries, exponents) @ tail
    squared, radial, z = np.empty(weights.size), np.empty(weights.size), np.empty(len(points))
    for i in range(found.size):
        for axis in range(z.size):
            z[axis] = queries[axis, i]
        squared_distances(z, points, weights.size, squared)
        radial_values(power, squared, weights.size, radial)
        found[i] += radial @ weights
    return found


@njit(nogil=True, cache=True)
def judge_balls(start, stop, balls, first, data, cover, split, tail, power, diagonals, better):
    """Write what `judge` says of balls[start:stop], of which ball i has the sheets first[i]:first[i + 1]."""
    for at in range(start, stop):
        pieces = first[balls[at]], first[balls[at] + 1]
        better[at] = judge(balls[at], data, cover, (pieces, split[0], split[1]), tail, power, diagonals)


@njit(nogil=True, cache=True)
def judge(whole, data, cover, split, tail, power, diagonals):
    """Return whether the sheets of a ball foretell every fourth of its points better than its one spline does.

    Those are left out with all their constraints. The sheets must be much better, or as good near creases as
    elsewhere, up to chance: noise can be all that is left.
    """
    points, values, _, owners, calm = data
    pieces, piece_cover, joins = split
    exponents, least = tail
    members = cover[3][cover[2][whole] : cover[2][whole + 1]]
    rows = members[owners[members] == members][::HELD_OUT]
    queries, _ = gather(points, values, rows, cover[0][whole], cover[1][whole])
    one = predict(whole, rows, queries, data, cover, exponents, power, diagonals[0])
    many = np.zeros(rows.size)
    for piece in range(pieces[0], pieces[1]):
        found = predict(piece, rows, queries, data, piece_cover, exponents[:least], power, diagonals[1])
        for i in range(rows.size):
            if joins[piece] == 0 or joins[piece] * (found[i] - many[i]) > 0.0:
                many[i] = found[i]
    squares, counts = np.zeros(2), np.zeros(2)
    before, after = 0.0, 0.0
    for i in range(rows.size):
        before += (one[i] - values[rows[i]]) ** 2
        error = (many[i] - values[rows[i]]) ** 2
        after += error
        squares[int(calm[rows[i]])] += error
        counts[int(calm[rows[i]])] += 1.0
    alike = squares[0] * counts[1] <= ALIKE * squares[1] * counts[0]
    return after < MUCH * before or (after < before and alike)


@njit(nogil=True, cache=True)
def predict(ball, rows, queries, data, cover, exponents, power, diagonals):
    """Return the values at `queries` (d, ·) of the spline of a ball without all constraints of the points `rows`."""
    points, values, trust, owners, _ = data
    members = cover[3][cover[2][ball] : cover[2][ball + 1]]
    kept = np.empty(members.size, dtype=np.int64)
    count = 0
    for row in members:
        at = np.searchsorted(rows, owners[row])
        if at == rows.size or rows[at] != owners[row]:
            kept[count] = row
            count += 1
    kept = kept[:count]
    sites, there = gather(points, values, kept, cover[0][ball], cover[1][ball])
    diagonal = diagonals[ball] / cover[1][ball] ** power / trust[kept]
    weights, tail, _, _ = solve_local(sites, there, exponents, power, diagonal)
    return spline_values(sites, weights, tail, exponents, power, queries)
