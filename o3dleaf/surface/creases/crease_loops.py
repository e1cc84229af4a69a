"""The compiled loops of creases: whether splitting a ball is worth it."""

from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.cover.ball_loops import rows_of
from o3dleaf.fitting.local.fit_loops import gather
from o3dleaf.fitting.rbf.radial_loops import radial_values, squared_distances
from o3dleaf.fitting.rbf.solve_loops import solve_local, tail_matrix
from o3dleaf.surface.creases.sheet_loops import squared_distance

HELD_OUT = 4
"""One in so many points of a ball is left out to compare by."""

MUCH = 0.3
"""Share of the squared errors of one spline below which sheets are better beyond doubt."""

ALIKE = 2.0
"""Squared errors near creases over those elsewhere which chance may make of nothing but noise."""


WRONG = 0.25
"""Share of the distance of a site off the surface by which it may come out on the other side, as some at creases do."""


class GroupedValues(NamedTuple):
    """The constraints of a fit: `WeightedValues`, their groups, and which are measured points away from any crease."""

    data: Any
    groups: Any
    smooth: Any


class SheetBalls(NamedTuple):
    """A cover with a ball for each sheet, of which ball i has first[i]:first[i + 1], and their composition."""

    balls: Any
    first: Any
    composition: Any


class SplineSystem(NamedTuple):
    """Exponents of the tail, how many of them sheets have, power of the kernel, diagonals of balls and of sheets."""

    exponents: Any
    terms: Any
    power: Any
    of_balls: Any
    of_sheets: Any


@njit(nogil=True, cache=True)
def spline_values(points, weights, tail, exponents, power, queries):
    """Return the values of a spline in unit coordinates at the columns of `queries` (d, ·)."""
    values = tail_matrix(queries, exponents) @ tail
    squared, radial, z = np.empty(weights.size), np.empty(weights.size), np.empty(len(points))
    for i in range(values.size):
        for axis in range(z.size):
            z[axis] = queries[axis, i]
        squared_distances(z, points, weights.size, squared)
        radial_values(power, squared, weights.size, radial)
        values[i] += radial @ weights
    return values


@njit(nogil=True, cache=True)
def compare_balls(start, stop, numbers, values, balls, sheets, system, better):
    """Write whether the balls numbers[start:stop] are better split."""
    for k in range(start, stop):
        better[k] = is_better_split(numbers[k], values, balls, sheets, system)


@njit(nogil=True, inline="always")  # compiled once, in its one caller
def is_better_split(ball, values, balls, sheets, system):
    """Return whether the sheets of a ball predict every fourth of its points better than its one spline does.

    Those are left out with their whole groups. The sheets must be much better, or as good near creases as
    elsewhere, up to chance: noise can be all that is left. And at no site off the surface their composition may take
    inside for outside: one sheet that goes on where it has no points would cut the others there.
    """
    data, exponents = values.data, system.exponents
    members = rows_of(balls, ball)
    rows = members[values.groups[members] == members][::HELD_OUT]
    asked = np.concatenate((rows, sites_of(ball, values, sheets)))
    queries, _ = gather(data, asked, balls, ball)
    measured = queries[:, : rows.size].copy()
    one = predict(ball, rows, measured, values, balls, exponents, system.power, system.of_balls)
    many, few = np.zeros(asked.size), exponents[: system.terms]
    for sheet in range(sheets.first[ball], sheets.first[ball + 1]):
        part = predict(sheet, rows, queries, values, sheets.balls, few, system.power, system.of_sheets)
        sign = sheets.composition[sheet]
        for i in range(asked.size):
            if sign == 0 or sign * (part[i] - many[i]) > 0.0:
                many[i] = part[i]
    for i in range(rows.size, asked.size):
        if many[i] * data.values[asked[i]] < -WRONG * data.values[asked[i]] ** 2:
            return False
    squares, counts = np.zeros(2), np.zeros(2)
    before, after = 0.0, 0.0
    for i in range(rows.size):
        before += (one[i] - data.values[rows[i]]) ** 2
        error = (many[i] - data.values[rows[i]]) ** 2
        after += error
        squares[int(values.smooth[rows[i]])] += error
        counts[int(values.smooth[rows[i]])] += 1.0
    alike = squares[0] * counts[1] <= ALIKE * squares[1] * counts[0]
    return after < MUCH * before or (after < before and alike)


@njit(nogil=True, cache=True)
def sites_of(ball, values, sheets):
    """Return the rows of the constraints off the surface that the sheets of a ball have within it."""
    center, square = sheets.balls.centers[sheets.first[ball]], sheets.balls.radii[sheets.first[ball]] ** 2
    count = 0
    for sheet in range(sheets.first[ball], sheets.first[ball + 1]):
        count += rows_of(sheets.balls, sheet).size
    found, count = np.empty(count, dtype=np.int64), 0
    for sheet in range(sheets.first[ball], sheets.first[ball + 1]):
        for row in rows_of(sheets.balls, sheet):
            if values.groups[row] != row and squared_distance(values.data.points[row], center) < square:
                found[count] = row
                count += 1
    return found[:count].copy()


@njit(nogil=True, cache=True)
def predict(ball, rows, queries, values, balls, exponents, power, diagonals):
    """Return the values at `queries` (d, ·) of the spline of a ball without the whole groups of the points `rows`."""
    data, members = values.data, rows_of(balls, ball)
    kept = np.empty(members.size, dtype=np.int64)
    count = 0
    for row in members:
        place = np.searchsorted(rows, values.groups[row])
        if place == rows.size or rows[place] != values.groups[row]:
            kept[count] = row
            count += 1
    kept = kept[:count]
    sites, known = gather(data, kept, balls, ball)
    diagonal = diagonals[ball] / balls.radii[ball] ** power / data.weights[kept]
    weights, tail, _, _ = solve_local(sites, known, exponents, power, diagonal)
    return spline_values(sites, weights, tail, exponents, power, queries)
