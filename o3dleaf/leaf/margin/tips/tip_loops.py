"""The compiled loops of sharp tips: where one begins on a curve, its triangle, and what lies off it."""

import math
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit


class TipTriangle(NamedTuple):
    """The triangle with the centroid of an arc, on the same base.

    Attributes
    ----------
    middle, first : int
        Where on the curve the arc has its middle, and how many steps to either side.
    axis : (2,) ndarray
        The unit vector from the middle of the base to the centroid.
    height, base : float
    """

    middle: Any
    first: Any
    axis: Any
    height: Any
    base: Any


class TipBounds(NamedTuple):
    """Between which angles a tip is sharp, and by what share its area may differ from its triangle's."""

    sharpest: float
    bluntest: float
    unlike: float


@njit(nogil=True, cache=True)
def first_apart(rounds, center, width):
    """Return the steps to both sides of a place until the curve is `width` apart; less than half of it, or all of it.

    `rounds` is three times the curve, so that what lies around a place of it is a slice.
    """
    count = len(rounds) // 3
    middle = count + center
    for steps in range(1, count // 2):
        before, after = rounds[middle - steps], rounds[middle + steps]
        if math.hypot(after[0] - before[0], after[1] - before[1]) >= width:
            return steps
    return count


@njit(nogil=True, cache=True)
def center_tip(rounds, center, width):
    """Return where a tip is farthest from its base, and the steps from it to where the flanks are `width` apart."""
    count = len(rounds) // 3
    first = count
    for _ in range(3):
        wide = first_apart(rounds, center, width)
        if wide == count:
            return center, count
        first, start, stop = wide, count + center - wide, count + center + wide
        along, across = rounds[stop, 0] - rounds[start, 0], rounds[stop, 1] - rounds[start, 1]
        best, farthest = start, 0.0
        for i in range(start + 1, stop + 1):
            off = (rounds[i, 0] - rounds[start, 0]) * across - (rounds[i, 1] - rounds[start, 1]) * along
            if off > farthest:
                best, farthest = i, off
        last, center = center, best % count
        if center == last:
            break
    return center, first


@njit(nogil=True, cache=True)
def area_and_centroid(arc):
    """Return the area, above 0 counter-clockwise, of the polygon (n, 2), and its centroid, less the first corner."""
    area, along, across = 0.0, 0.0, 0.0
    for i in range(1, len(arc) - 1):
        x, y = arc[i, 0] - arc[0, 0], arc[i, 1] - arc[0, 1]
        u, v = arc[i + 1, 0] - arc[0, 0], arc[i + 1, 1] - arc[0, 1]
        twice = x * v - y * u
        area += twice / 2
        along += twice * (x + u) / 6
        across += twice * (y + v) / 6
    if area != 0.0:
        along, across = along / area, across / area
    return area, along, across


@njit(nogil=True, cache=True)
def next_tip(rounds, center, widths, start, bounds):
    """Return the first of the widths (w,) from `start` on at which a curve has a rounded tip, and its triangle.

    Its number is w where it is none. That of a tip that begins where the flanks are so wide apart has their width as
    its base, and the centroid of the arc, at a third of its height.
    """
    count, axis = len(rounds) // 3, np.zeros(2)
    for trial in range(start, len(widths)):
        middle, first = center_tip(rounds, center, widths[trial])
        if first >= count // 4:
            continue
        arc = rounds[count + middle - first : count + middle + first + 1]
        area, along, across = area_and_centroid(arc)
        x, y = arc[0, 0] - arc[-1, 0], arc[0, 1] - arc[-1, 1]
        axis[0], axis[1] = along + x / 2, across + y / 2
        third = math.hypot(axis[0], axis[1])
        axis /= max(third, 1e-300)
        height, base = 3 * third, x * axis[1] - y * axis[0]
        angle = 2 * math.atan2(base / 2, height)
        if bounds.sharpest <= angle <= bounds.bluntest and abs(abs(area) / (base * height / 2) - 1) <= bounds.unlike:
            return trial, TipTriangle(middle, first, axis, height, base)
    return len(widths), TipTriangle(center, count, axis, 0.0, 0.0)


@njit(nogil=True, cache=True)
def lies_within(places, ring, reach):
    """Return whether all places (k, 2) lie inside a closed ring (n, 2), or no farther from it than a reach.

    The places go along the ring, more or less: each is compared first with the side that the last one was near.
    """
    count, first = len(ring), 0
    for k in range(len(places)):
        x, y, inside, near, i = places[k, 0], places[k, 1], False, False, first
        for _ in range(count):
            u, v = ring[i, 0] - x, ring[i, 1] - y
            after = i + 1 if i + 1 < count else 0
            along, across = ring[after, 0] - x - u, ring[after, 1] - y - v
            square = along * along + across * across
            share = min(max(-(u * along + v * across) / square, 0.0), 1.0) if square > 0.0 else 0.0
            du, dv = u + share * along, v + share * across
            if du * du + dv * dv <= reach * reach:
                near, first = True, i
                break
            if (v > 0.0) != (v + across > 0.0) and (u * across - v * along) * across > 0.0:
                inside = not inside
            i = after
        if not (inside or near):
            return False
    return True
