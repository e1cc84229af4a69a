"""The compiled loops that split balls: how the sheets of a ball meet, and which constraints belong to each."""

import math

import numpy as np
from numba import njit

from o3dleaf.fitting.creases.quadric_loops import product
from o3dleaf.fitting.creases.sheet_loops import find_sheets, place_of, squared_distance

LEAST_POINTS = 40
"""Points that a sheet is fitted to, from beyond the ball where it holds fewer."""

LEAST_SITES = 4
"""Constraints off the surface that a sheet needs: with fewer, its inside is not told from its outside."""

LOST = 0.03
"""Share of a ball's points that may lie on none of its sheets, as noise makes them: else one sheet was not found."""

MIXED = 0.2
"""Share of a sheet's points, weighed by distance, that may lie on the wrong side of another that they meet."""


@njit(nogil=True, cache=True)
def points_of(ball, cover, belonging):
    """Return the rising measured points that constraints of a ball belong to."""
    members = cover[3][cover[2][ball] : cover[2][ball + 1]]
    found, count = np.empty(members.size, dtype=np.int64), 0
    for row in members:
        point = belonging.point_of[row]
        if point >= 0:
            found[count] = point
            count += 1
    found = np.sort(found[:count])
    kept = 0
    for at in range(count):
        if at == 0 or found[at] != found[at - 1]:
            found[kept] = found[at]
            kept += 1
    return found[:kept]


@njit(nogil=True, cache=True)
def reach(start, stop, balls, cover, belonging, points, far):
    """Write the radius about the centre of each ball that holds it and the points of its constraints."""
    for at in range(start, stop):
        centre, square = cover[0][balls[at]], cover[1][balls[at]] ** 2
        for point in points_of(balls[at], cover, belonging):
            square = max(square, squared_distance(points[point], centre))
        far[at] = math.sqrt(square)


@njit(nogil=True, cache=True, error_model="numpy")
def order_sheets(labels, away, sheets, joins):
    """Order the sheets so that each is joined to those before it by minimum (−1) or maximum (1); return what is mixed.

    The last of them has all points of the others on one of its sides: the solid is cut off by it, or added to.
    """
    count = sheets.size
    worst = 0.0
    for last in range(count - 1, 0, -1):
        least, chosen, join = np.inf, 0, 0
        for at in range(last + 1):
            outside, inside = 0.0, 0.0
            for i in range(labels.size):
                for other in range(last + 1):
                    if other != at and labels[i] == sheets[other]:
                        outside += max(away[sheets[at], i], 0.0)
                        inside += max(-away[sheets[at], i], 0.0)
            total = max(outside + inside, 1e-300)
            if outside / total < least:
                least, chosen, join = outside / total, at, -1
            if inside / total < least:
                least, chosen, join = inside / total, at, 1
        worst = max(worst, least)
        sheets[chosen], sheets[last] = sheets[last], sheets[chosen]
        joins[last] = join
    joins[0] = 0
    return worst


@njit(nogil=True, cache=True)
def nearest_of(own, inside, squares):
    """Return the points `own` of a sheet that lie in the ball and, where they are too few, the nearest ones besides."""
    held = own[inside[own]]
    if held.size >= LEAST_POINTS:
        return held
    beyond = own[~inside[own]]
    return np.concatenate((held, beyond[np.argsort(squares[beyond], kind="mergesort")][: LEAST_POINTS - held.size]))


@njit(nogil=True, cache=True)
def constraints_of(points, trusted, belonging):
    """Return the rising rows of all constraints of measured points, those off the surface of trusted ones alone.

    Return also how many of them are off the surface.
    """
    first, rows = belonging.first, belonging.rows
    count = 0
    for point in points:
        count += first[point + 1] - first[point]
    found, count, sites = np.empty(count, dtype=np.int64), 0, 0
    for k in range(points.size):
        for at in range(first[points[k]], first[points[k] + 1]):
            off = belonging.off[rows[at]]
            if trusted[k] or not off:
                found[count] = rows[at]
                count += 1
                sites += off
    return np.sort(found[:count]), sites


@njit(nogil=True, cache=True, error_model="numpy")
def split_ball(ball, rows, cover, cloud, belonging):
    """Return the rows of the constraints of the sheets of a ball, end to end, how many each has, and the joins.

    `rows` are the rising measured points around it. Of a ball with one sheet, or where it is not sure, all are empty.
    """
    held = points_of(ball, cover, belonging)
    labels, lying, away, outward = find_sheets(rows, cloud)
    inside, squares = np.zeros(rows.size, dtype=np.bool_), np.empty(rows.size)
    for i in range(rows.size):
        squares[i] = squared_distance(cloud.points[rows[i]], cover[0][ball])
    for row in held:
        inside[place_of(rows, row)] = True
    none = members = np.empty(0, dtype=np.int64)
    sheets = np.unique(labels[inside])
    if sheets.size < 2 or sheets[0] < 0 or np.sum(inside & ~lying) > LOST * held.size:
        return none, none, none
    joins, sizes = np.empty(sheets.size, dtype=np.int64), np.empty(sheets.size, dtype=np.int64)
    if order_sheets(labels, away, sheets, joins) > MIXED:
        return none, none, none
    for k in range(sheets.size):
        chosen = nearest_of(np.flatnonzero(labels == sheets[k]), inside, squares)
        trusted = np.empty(chosen.size, dtype=np.bool_)
        for i in range(chosen.size):
            trusted[i] = product(outward[sheets[k], chosen[i]], cloud.normals[rows[chosen[i]]]) >= cloud.half
        part, sites = constraints_of(rows[chosen], trusted, belonging)
        if sites < LEAST_SITES:
            return none, none, none
        members, sizes[k] = np.concatenate((members, part)), part.size
    return members, sizes, joins


@njit(nogil=True, cache=True)
def split_balls(start, stop, balls, offsets, around, cover, cloud, belonging):
    """Return what `split_ball` says of balls[start:stop], end to end, and how many sheets each has, 0 for one.

    Points offsets[k]:offsets[k + 1] of `around` lie around ball k. Many balls at once, since between compiled calls
    threads wait for one another.
    """
    counts = np.empty(stop - start, dtype=np.int64)
    members, sizes, joins = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    for at in range(start, stop):
        rows = around[offsets[at] : offsets[at + 1]]
        part, count, join = split_ball(balls[at], rows, cover, cloud, belonging)
        counts[at - start] = count.size
        members, sizes = np.concatenate((members, part)), np.concatenate((sizes, count))
        joins = np.concatenate((joins, join))
    return counts, members, sizes, joins
