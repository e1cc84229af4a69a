"""The compiled loops that split balls: how the sheets of a ball meet, and which constraints belong to each."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.cover.ball_loops import rows_of
from o3dleaf.surface.creases.quadric_loops import product
from o3dleaf.surface.creases.sheet_loops import find_sheets, place_of, squared_distance

MIN_POINTS = 40
"""Points that a sheet is fitted to, from beyond the ball where it contains fewer."""

MIN_SITES = 4
"""Constraints off the surface that a sheet needs: with fewer, its inside cannot be distinguished from its outside."""

LOST = 0.03
"""Share of a ball's points that may lie on none of its sheets, as noise makes them: else one sheet was missed."""

MIXED = 0.2
"""Share of a sheet's points, weighed by distance, that may lie on the wrong side of another that they meet."""


@njit(nogil=True, cache=True)
def points_of(ball, balls, groups):
    """Return the rising measured points that constraints of a ball are made from."""
    members = rows_of(balls, ball)
    points, count = np.empty(members.size, dtype=np.int64), 0
    for row in members:
        point = groups.point_of[row]
        if point >= 0:
            points[count] = point
            count += 1
    points = np.sort(points[:count])
    kept = 0
    for k in range(count):
        if k == 0 or points[k] != points[k - 1]:
            points[kept] = points[k]
            kept += 1
    return points[:kept]


@njit(nogil=True, cache=True)
def reach(start, stop, numbers, balls, groups, points, radii):
    """Write the radius about the center of each ball that contains it and the points of its constraints."""
    for k in range(start, stop):
        center, square = balls.centers[numbers[k]], balls.radii[numbers[k]] ** 2
        for point in points_of(numbers[k], balls, groups):
            square = max(square, squared_distance(points[point], center))
        radii[k] = math.sqrt(square)


@njit(nogil=True, cache=True, error_model="numpy")
def order_sheets(labels, distances, sheets, composition):
    """Order the sheets so that each is composed with those before it by minimum (−1) or maximum (1).

    The last of them has all points of the others on one of its sides: the solid is cut off by it, or added to. Return
    the largest share of points, weighed by distance, that lie on the other.
    """
    worst = 0.0
    others = np.zeros(len(distances) + 1, dtype=np.bool_)
    others[sheets] = True
    for last in range(sheets.size - 1, 0, -1):
        least, chosen, sign = np.inf, 0, 0
        for k in range(last + 1):
            outside, inside = 0.0, 0.0
            others[sheets[k]] = False
            for i in range(labels.size):
                distance = distances[sheets[k], i] if others[labels[i]] else 0.0
                outside += max(distance, 0.0)
                inside += max(-distance, 0.0)
            others[sheets[k]] = True
            total = max(outside + inside, 1e-300)
            if outside / total < least:
                least, chosen, sign = outside / total, k, -1
            if inside / total < least:
                least, chosen, sign = inside / total, k, 1
        worst = max(worst, least)
        sheets[chosen], sheets[last] = sheets[last], sheets[chosen]
        others[sheets[last]] = False
        composition[last] = sign
    composition[0] = 0
    return worst


@njit(nogil=True, cache=True)
def nearest_of(own, inside, squares):
    """Return the points `own` of a sheet that lie in the ball and, where they are too few, the nearest ones besides."""
    within = own[inside[own]]
    if within.size >= MIN_POINTS:
        return within
    beyond = own[~inside[own]]
    return np.concatenate((within, beyond[np.argsort(squares[beyond], kind="mergesort")][: MIN_POINTS - within.size]))


@njit(nogil=True, cache=True)
def constraints_of(points, trusted, groups):
    """Return the rising rows of all constraints of measured points, those off the surface of trusted ones alone.

    Return also how many of them are off the surface.
    """
    first = groups.first
    count = 0
    for point in points:
        count += first[point + 1] - first[point]
    rows, count, sites = np.empty(count, dtype=np.int64), 0, 0
    for k in range(points.size):
        for row in groups.rows[first[points[k]] : first[points[k] + 1]]:
            off = groups.off[row]
            if trusted[k] or not off:
                rows[count] = row
                count += 1
                sites += off
    return np.sort(rows[:count]), sites


@njit(nogil=True, cache=True, error_model="numpy")
def split_ball(ball, rows, balls, measured, groups):
    """Return the rows of the constraints of the sheets of a ball, end to end, their numbers, and the composition.

    `rows` are the rising measured points around it. Of a ball with one sheet, or where it is not sure, all are empty.
    """
    contained = points_of(ball, balls, groups)
    labels, lying, distances, outward = find_sheets(rows, measured)
    inside, squares = np.zeros(rows.size, dtype=np.bool_), np.empty(rows.size)
    for i in range(rows.size):
        squares[i] = squared_distance(measured.points[rows[i]], balls.centers[ball])
    for row in contained:
        inside[place_of(rows, row)] = True
    none = members = np.empty(0, dtype=np.int64)
    sheets = np.unique(labels[inside])
    if sheets.size < 2 or sheets[0] < 0 or np.sum(inside & ~lying) > LOST * contained.size:
        return none, none, none
    composition, sizes = np.empty(sheets.size, dtype=np.int64), np.empty(sheets.size, dtype=np.int64)
    if order_sheets(labels, distances, sheets, composition) > MIXED:
        return none, none, none
    for k in range(sheets.size):
        chosen = nearest_of(np.flatnonzero(labels == sheets[k]), inside, squares)
        trusted = np.empty(chosen.size, dtype=np.bool_)
        for i in range(chosen.size):
            normal = measured.normals[rows[chosen[i]]]
            trusted[i] = product(outward[sheets[k], chosen[i]], normal) >= measured.cosine
        part, sites = constraints_of(rows[chosen], trusted, groups)
        if sites < MIN_SITES:
            return none, none, none
        members, sizes[k] = np.concatenate((members, part)), part.size
    return members, sizes, composition


@njit(nogil=True, cache=True)
def split_balls(start, stop, numbers, offsets, around, balls, measured, groups):
    """Return the sheets of the balls numbers[start:stop], end to end, and how many sheets each has, 0 for one.

    Points offsets[k]:offsets[k + 1] of `around` lie around ball k. Many balls at once, since between compiled calls
    threads wait for one another.
    """
    counts, nothing = np.empty(stop - start, dtype=np.int64), np.empty(0, dtype=np.int64)
    members, sizes, composition = nothing, nothing, nothing
    for k in range(start, stop):
        rows = around[offsets[k] : offsets[k + 1]]
        part, count, signs = split_ball(numbers[k], rows, balls, measured, groups)
        counts[k - start] = count.size
        members, sizes = np.concatenate((members, part)), np.concatenate((sizes, count))
        composition = np.concatenate((composition, signs))
    return counts, members, sizes, composition
