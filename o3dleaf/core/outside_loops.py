"""Compiled: a field that falls outside its bounds: its value at the nearest point less a slope times the distance.

So do fields of solids whose shape is known: far away is outside. The slope is value over length: 1 for a distance.
Along an axis that repeats there is no outside.
"""

import math

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def fall_outside(start, stop, jets, points, bounds, period, fall):
    """Turn jets at the nearest points of the bounds into those of the field at the points themselves, in place.

    A jet is a column: the value, d slopes and d(d + 1)/2 second derivatives, as far as there are rows. Outside, the
    distance |δ| times `fall` is taken off, with slope δ/|δ| and second derivatives (I − n nᵀ)/|δ| times the same on the
    axes that moved, along which the field itself is constant.

    Parameters
    ----------
    start, stop : int
        Columns that this call is for.
    jets : (rows, n) ndarray
    points : (n, d) ndarray
    bounds : (2, d) ndarray
    period : (d,) ndarray
        0 along axes that do not repeat.
    fall : float
        Value over length.
    """
    dimension = period.size
    for i in range(start, stop):
        distance = 0.0
        for a in range(dimension):
            # A sum of squares would vanish at distances below 1e-162, and overflow beyond 1e154.
            distance = math.hypot(distance, offset(points[i, a], bounds, period, a))
        if distance == 0.0:
            continue
        jets[0, i] -= fall * distance
        for a in range(dimension if len(jets) > 1 else 0):
            beyond = offset(points[i, a], bounds, period, a)
            if beyond != 0.0:
                jets[1 + a, i] = -fall * (beyond / distance)
        row = 1 + dimension
        for a in range(dimension if len(jets) > row else 0):
            moved = offset(points[i, a], bounds, period, a)
            for b in range(a, dimension):
                also = offset(points[i, b], bounds, period, b)
                if moved != 0.0 or also != 0.0:
                    bend = moved / distance * (also / distance) - (1.0 if a == b else 0.0)
                    jets[row, i] = fall * (bend / distance)
                row += 1


@njit(nogil=True, cache=True)
def offset(x, bounds, period, axis):
    """Return how far a coordinate lies beyond the bounds: 0 inside, and along an axis that repeats."""
    if period[axis] > 0.0:
        return 0.0
    return x - min(max(x, bounds[0, axis]), bounds[1, axis])
