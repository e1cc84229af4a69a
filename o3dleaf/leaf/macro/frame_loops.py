"""Compiled: stations of the frame and the closest point on the axis.

A spline is (breaks, coefficients): on segment s, with u = t − breaks[s], Σ_k coefficients[s, k] u^k.
Past the ends the axis goes on straight and the frame does not turn, so that world → leaf → world is
the identity there too.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.blade.vector_loops import cross3, dot3

GROUP = 16
"""Samples of the axis in a row that are ruled out together."""
MAX_STEPS = 80
"""Newton with bisection as safeguard halves the bracket at worst: 80 steps exhaust float64."""


class FrameSplines(NamedTuple):
    """The two splines of a frame.

    Attributes
    ----------
    breaks : (S + 1,) ndarray
        Arc length at the ends of the segments.
    axis, normal : (S, k + 1, 3) ndarrays
        Coefficients of the axis and of the normal.
    """

    breaks: npt.NDArray[np.float64]
    axis: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64]


class AxisSamples(NamedTuple):
    """Points of the axis at equal steps, in groups of `GROUP`.

    Attributes
    ----------
    points : (3, K) ndarray
    step : float
        In t.
    chord : float
        The longest distance between neighbors.
    reach : (groups,) ndarray
        Largest distance in each group from its middle point.
    """

    points: npt.NDArray[np.float64]
    step: float
    chord: float
    reach: npt.NDArray[np.float64]


@njit(nogil=True, cache=True)
def segment(t, breaks):
    """Return the segment that contains t, the first or last one if none does."""
    low, high = 0, len(breaks) - 2
    while low < high:
        middle = (low + high + 1) // 2
        if breaks[middle] <= t:
            low = middle
        else:
            high = middle - 1
    return low


@njit(nogil=True, cache=True)
def spline(t, breaks, coefficients, derivatives):
    """Write value, first and second derivative of a spline at t into the rows of `derivatives` (3, 3)."""
    inside = min(max(t, breaks[0]), breaks[-1])
    s = segment(inside, breaks)
    u = inside - breaks[s]
    for axis in range(3):
        value = first = second = 0.0
        for k in range(coefficients.shape[1] - 1, -1, -1):
            second = second * u + 2.0 * first
            first = first * u + value
            value = value * u + coefficients[s, k, axis]
        derivatives[0, axis], derivatives[1, axis], derivatives[2, axis] = value, first, second


@njit(nogil=True, cache=True)
def axis_at(t, splines, derivatives):
    """Write m, m′, m″ of the axis, straight past its ends."""
    breaks = splines.breaks
    spline(t, breaks, splines.axis, derivatives)
    beyond = t - min(max(t, breaks[0]), breaks[-1])
    if beyond != 0.0:
        for k in range(3):
            derivatives[0, k] += beyond * derivatives[1, k]
            derivatives[2, k] = 0.0


@njit(nogil=True, cache=True)
def station(t, splines, frame, slope, scratch):
    """Write (m, T, A, V) into `frame` (4, 3) and (m′, T′, A′, V′) into `slope` (4, 3).

    T is the unit tangent, V the normal spline made orthogonal to T by Gram-Schmidt, A = V × T: along,
    up and across, right-handed as (T, A, V). The paper's W is −A.
    """
    derivatives, normals, product = scratch[0:3], scratch[3:6], scratch[6]
    axis_at(t, splines, derivatives)
    breaks = splines.breaks
    spline(t, breaks, splines.normal, normals)
    turning = 1.0 if breaks[0] <= t <= breaks[-1] else 0.0
    speed = math.sqrt(dot3(derivatives[1], derivatives[1]))
    for k in range(3):
        frame[0, k] = derivatives[0, k]
        slope[0, k] = derivatives[1, k]
        frame[1, k] = derivatives[1, k] / speed
    along = dot3(derivatives[2], frame[1])
    for k in range(3):
        slope[1, k] = (derivatives[2, k] - along * frame[1, k]) / speed
    lean = dot3(normals[0], frame[1])
    lean_slope = turning * dot3(normals[1], frame[1]) + dot3(normals[0], slope[1])
    for k in range(3):
        frame[3, k] = normals[0, k] - lean * frame[1, k]
        slope[3, k] = turning * normals[1, k] - lean_slope * frame[1, k] - lean * slope[1, k]
    length = math.sqrt(dot3(frame[3], frame[3]))
    for k in range(3):
        frame[3, k] /= length
    growth = dot3(slope[3], frame[3])
    for k in range(3):
        slope[3, k] = (slope[3, k] - growth * frame[3, k]) / length
    cross3(frame[3], frame[1], frame[2])
    cross3(slope[3], frame[1], slope[2])
    cross3(frame[3], slope[1], product)
    for k in range(3):
        slope[2, k] += product[k]


@njit(nogil=True, cache=True)
def fill_stations(start, stop, t, splines, frames, slopes):
    """Fill frames[start:stop] and slopes[start:stop], (n, 4, 3) each."""
    scratch = np.empty((7, 3))
    for i in range(start, stop):
        station(t[i], splines, frames[i], slopes[i], scratch)


@njit(nogil=True, cache=True)
def refine(x, low, high, splines, derivatives):
    """Return the stationary point of |x − m(t)|² in [low, high] by Newton with bisection as safeguard."""
    t = 0.5 * (low + high)
    for _ in range(MAX_STEPS):
        axis_at(t, splines, derivatives)
        pull = curve = 0.0
        for k in range(3):
            gap = x[k] - derivatives[0, k]
            pull += gap * derivatives[1, k]
            curve += gap * derivatives[2, k] - derivatives[1, k] * derivatives[1, k]
        if pull > 0.0:
            low = t
        else:
            high = t
        following = t - pull / curve if curve < 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if following == t or abs(following - t) <= 1e-15 * (abs(t) + splines.breaks[-1] - splines.breaks[0]):
            return following
        t = following
    return t


@njit(nogil=True, cache=True)
def distance_to(x, t, splines, derivatives):
    """Return |x − m(t)|."""
    axis_at(t, splines, derivatives)
    total = 0.0
    for k in range(3):
        gap = x[k] - derivatives[0, k]
        total += gap * gap
    return math.sqrt(total)


@njit(nogil=True, cache=True)
def closest_past_end(x, end, outward, splines, derivatives):
    """Return the parameter of the closest point of the straight continuation past one end, in closed form."""
    axis_at(end, splines, derivatives)
    pull = square = 0.0
    for k in range(3):
        pull += (x[k] - derivatives[0, k]) * derivatives[1, k]
        square += derivatives[1, k] * derivatives[1, k]
    beyond = pull / square
    return end + (beyond if beyond * outward > 0.0 else 0.0)


@njit(nogil=True, cache=True)
def closest(x, samples, splines, distances, near, derivatives):
    """Return the parameter of the globally closest point of the extended axis.

    The samples lie `step` apart in t and at most `chord` in space. The distance to x is
    1-Lipschitz in space, so a sampled local minimum more than `chord` above the best one cannot
    lead to the global minimum; every other one is refined. For the same reason `GROUP` samples in a
    row are looked at only if the ball about their middle one, of radius `reach`, comes near enough.
    """
    points, chord, reach, breaks = samples.points, samples.chord, samples.reach, splines.breaks
    count = points.shape[1]
    smallest = np.inf
    for group in range(len(reach)):
        middle = min(GROUP * group + GROUP // 2, count - 1)
        smallest = min(smallest, squared_distance(x, points, middle))
    limit = math.sqrt(smallest) + chord
    for group in range(len(reach)):
        middle = min(GROUP * group + GROUP // 2, count - 1)
        first, last = max(GROUP * group - 1, 0), min(GROUP * (group + 1) + 1, count)
        near[group] = squared_distance(x, points, middle) <= (limit + reach[group]) ** 2
        for i in range(first, last if near[group] else first):
            distances[i] = squared_distance(x, points, i)
            smallest = min(smallest, distances[i])
    limit = (math.sqrt(smallest) + chord) ** 2
    best = closest_past_end(x, breaks[0], -1.0, splines, derivatives)
    best_distance = distance_to(x, best, splines, derivatives)
    t = closest_past_end(x, breaks[-1], 1.0, splines, derivatives)
    distance = distance_to(x, t, splines, derivatives)
    if distance < best_distance:
        best, best_distance = t, distance
    for group in range(len(reach)):
        for i in range(GROUP * group, min(GROUP * (group + 1), count) if near[group] else 0):
            before = distances[i - 1] if i > 0 else np.inf
            after = distances[i + 1] if i < count - 1 else np.inf
            if distances[i] > limit or distances[i] > before or distances[i] > after:
                continue
            middle = breaks[0] + i * samples.step
            low, high = max(middle - samples.step, breaks[0]), min(middle + samples.step, breaks[-1])
            t = refine(x, low, high, splines, derivatives)
            distance = distance_to(x, t, splines, derivatives)
            if distance < best_distance:
                best, best_distance = t, distance
    return best


@njit(nogil=True, cache=True)
def squared_distance(x, points, i):
    """Return |x − p_i|²."""
    dx, dy, dz = x[0] - points[0, i], x[1] - points[1, i], x[2] - points[2, i]
    return dx * dx + dy * dy + dz * dz


@njit(nogil=True, cache=True)
def to_leaf(start, stop, points, samples, splines, leaf):
    """Fill leaf[start:stop] with (along, across, up)."""
    distances, near = np.empty(samples.points.shape[1]), np.empty(len(samples.reach), dtype=np.bool_)
    derivatives = np.empty((3, 3))
    frame, slope, scratch = np.empty((4, 3)), np.empty((4, 3)), np.empty((7, 3))
    gap = np.empty(3)
    for i in range(start, stop):
        t = closest(points[i], samples, splines, distances, near, derivatives)
        station(t, splines, frame, slope, scratch)
        for k in range(3):
            gap[k] = points[i, k] - frame[0, k]
        leaf[i, 0], leaf[i, 1], leaf[i, 2] = t, dot3(gap, frame[2]), dot3(gap, frame[3])


@njit(nogil=True, cache=True)
def to_world(start, stop, leaf, splines, points):
    """Fill points[start:stop] with m(along) + across A + up V."""
    frame, slope, scratch = np.empty((4, 3)), np.empty((4, 3)), np.empty((7, 3))
    for i in range(start, stop):
        station(leaf[i, 0], splines, frame, slope, scratch)
        for k in range(3):
            points[i, k] = frame[0, k] + leaf[i, 1] * frame[2, k] + leaf[i, 2] * frame[3, k]
