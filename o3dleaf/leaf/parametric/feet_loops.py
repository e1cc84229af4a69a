"""Compiled: the feet of points on a surface S(u, v), the closest of its points, by Newton's method from samples.

With r = x − S, the half square of r has the gradient −r·S_a and the second derivatives S_a·S_b − r·S_ab by u and v.
Samples lie in blocks, those in groups, each in a ball: of all that may contain something closer than what was found,
every one is looked into, so that the start lies on the sheet whose foot is the closest of all, not only on a near one.
What continues a surface beyond its margin counts as far away as it reaches beyond: r there has a fourth component.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE
from o3dleaf.leaf.parametric.spline_loops import JET
from o3dleaf.leaf.parametric.surface_loops import jets_at

MIN_EIGENVALUE = 0.1
"""Least eigenvalue of the second derivatives in the surface's metric: 0 at a focus, where steps would have no end."""
MAX_ROUNDS = 60
"""Newton's method from a sample takes three or four rounds; what takes more lies near a focus, or beyond."""
STALLED = 1e-9
"""Step, of the samples' distance, from which one that does not shrink is rounding."""
STALE = 0.1
"""Step, of the samples' distance, after which the second derivatives are found anew."""
ROUNDING = 1e-10
"""Of |r|²: less does not tell whether a step led away, but then the step is short enough to be trusted."""
SLOW = 0.1
"""Share of the last step at which they are found anew too: near a focus small changes of them matter."""
SETTLED, KEPT, RENEWED = 0, 1, 2
"""What comes after a step: nothing, another one with the second derivatives at hand, or one with new ones."""
CANDIDATES = 6
"""Blocks whose best samples are compared; sheets that touch give two or three."""
APART = 4.0
"""Distance in the chart, in the samples' distances, from which two candidates may lie on two sheets."""
BESIDE = 2.0
"""A block's nearest sample lies at most so many samples' distances farther than the foot that it leads to."""
CLOSE = 0.1
"""Difference of their distances, in those of samples, up to which both feet are found: predictions are far better."""


class Samples(NamedTuple):
    """Samples of a surface, in blocks, and these in groups.

    Attributes
    ----------
    groups, blocks : (4, G), (4, B)
        Centers and radii of balls that contain the surface about the samples.
    group_starts, block_starts : (G + 1,), (B + 1,)
        The blocks of each group, and the samples of each block.
    places : (4, m)
        In space, and how far they lie beyond the margin.
    plane : (m, 2)
    jets : (m, 6, 3)
    beyond : (m, 3)
        Distance from the margin in the chart, above 0 beyond it, and its derivatives; 0 where there is no margin.
    step : float
        Distance of samples in the chart.
    """

    groups: Any
    blocks: Any
    group_starts: Any
    block_starts: Any
    places: Any
    plane: Any
    jets: Any
    beyond: Any
    step: Any


@njit(nogil=True, cache=True)
def nearest_sample(x, y, z, start, stop, places):
    """Return the squared distance of the nearest of the samples start:stop to a point, and its number."""
    best, number = np.inf, start
    for s in range(start, stop):
        a, b, c, d = x - places[0, s], y - places[1, s], z - places[2, s], places[3, s]
        square = a * a + b * b + c * c + d * d
        if square < best:
            best, number = square, s
    return best, number


@njit(nogil=True, cache=True)
def newton_step(x, y, z, i, jets, j, bends, max_step):
    """Return Newton's step (u, v) from jet i of S towards the foot of a point, its length, |r|², and |r|² after it.

    The second derivatives are bends[j]. Where those of |r|²/2 are not safely positive they are lifted; no step is
    longer than `max_step` in space.
    """
    r = (x - jets[i, 0, 0], y - jets[i, 0, 1], z - jets[i, 0, 2])
    e = f = g = along = across = uu = uv = vv = square = 0.0
    for k in range(3):
        e += jets[i, 1, k] * jets[i, 1, k]
        f += jets[i, 1, k] * jets[i, 2, k]
        g += jets[i, 2, k] * jets[i, 2, k]
        along += r[k] * jets[i, 1, k]
        across += r[k] * jets[i, 2, k]
        uu -= r[k] * bends[j, 0, k]
        uv -= r[k] * bends[j, 1, k]
        vv -= r[k] * bends[j, 2, k]
        square += r[k] * r[k]
    area = max(e * g - f * f, 1e-300)
    uu, uv, vv = uu + e, uv + f, vv + g
    half = 0.5 * (g * uu - 2.0 * f * uv + e * vv) / area
    least = half - math.sqrt(max(half * half - (uu * vv - uv * uv) / area, 0.0))
    if least < MIN_EIGENVALUE:
        lift = MIN_EIGENVALUE - least
        uu, uv, vv = uu + lift * e, uv + lift * f, vv + lift * g
    determinant = max(uu * vv - uv * uv, 1e-300)
    p, q = (vv * along - uv * across) / determinant, (uu * across - uv * along) / determinant
    length = math.sqrt(max(e * p * p + 2.0 * f * p * q + g * q * q, 0.0))
    if length > max_step:
        p, q, length = p * max_step / length, q * max_step / length, max_step
    # What the step leaves of |r|², to second order.
    left = square - 2.0 * (along * p + across * q) + uu * p * p + 2.0 * uv * p * q + vv * q * q
    return p, q, length, square, left


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def ball_distances(x, y, z, start, stop, balls, far, near):
    """Write the distances of the centers of the balls start:stop, rows of (4, ·), to a point, and those less radii."""
    xs, ys, zs, radii = balls[0, start:stop], balls[1, start:stop], balls[2, start:stop], balls[3, start:stop]
    for b in range(xs.size):
        p, q, r = x - xs[b], y - ys[b], z - zs[b]
        far[b] = math.sqrt(p * p + q * q + r * r)
        near[b] = far[b] - radii[b]


@njit(nogil=True, cache=True)
def find_starts(points, samples, starts, others):
    """Write where Newton's method begins for each point of a block, and for some a second place, else NaN.

    Both (n, 3): u, v, and how far beyond the margin that is.

    The loops over samples are in one piece: whatever is handed to another function is counted, which the threads would
    wait for one another over; few samples get as far as being considered.
    """
    groups, blocks, places, step = samples.groups, samples.blocks, samples.places, samples.step
    group_starts, block_starts, plane, jets = samples.group_starts, samples.block_starts, samples.plane, samples.jets
    beyond = samples.beyond
    count, bends = groups.shape[1], jets[:, 3:]
    widest = 0
    for g in range(count):
        widest = max(widest, group_starts[g + 1] - group_starts[g])
    group_far, group_near, far, near = np.empty(count), np.empty(count), np.empty(widest), np.empty(widest)
    predicted, found = np.empty(CANDIDATES), np.empty((CANDIDATES, 3))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        ball_distances(x, y, z, 0, count, groups, group_far, group_near)
        g = int(np.argmin(group_far))
        ball_distances(x, y, z, group_starts[g], group_starts[g + 1], blocks, far, near)
        b = group_starts[g] + int(np.argmin(far[: group_starts[g + 1] - group_starts[g]]))
        best = math.sqrt(nearest_sample(x, y, z, block_starts[b], block_starts[b + 1], places)[0])
        predicted[:], found[:], nearest = np.inf, np.inf, np.inf
        for g in range(count):
            if group_near[g] > best:
                continue
            start = group_starts[g]
            ball_distances(x, y, z, start, group_starts[g + 1], blocks, far, near)
            for b in range(start, group_starts[g + 1]):
                if near[b - start] > best:
                    continue
                square, s = nearest_sample(x, y, z, block_starts[b], block_starts[b + 1], places)
                distance = math.sqrt(square)
                best = min(best, distance)
                nearest = consider(x, y, z, s, distance, nearest, plane, jets, bends, beyond, step, predicted, found)
        c = rival(predicted, found, step)
        for k in range(3):
            starts[i, k], others[i, k] = found[0, k], found[c, k] if c > 0 else np.nan


@njit(nogil=True, cache=True)
def consider(x, y, z, s, distance, nearest, plane, jets, bends, beyond, step, predicted, found):
    """Put the foot that sample s leads to into the list of candidates; return how near the best one's sample is."""
    # Beside a sample that is nearer, this one would lead to the same foot.
    beside = max(abs(plane[s, 0] - found[0, 0]), abs(plane[s, 1] - found[0, 1])) < APART * step
    if not distance < predicted[0] + BESIDE * step or (beside and distance > nearest):
        return nearest
    p, q, length, square, left = newton_step(x, y, z, s, jets, s, bends, np.inf)
    off = max(beyond[s, 0] + p * beyond[s, 1] + q * beyond[s, 2], 0.0)
    # Of a longer step a step is trusted, and what the rest would bring is not counted.
    share = min(step / length, 1.0) if length > 0.0 else 1.0
    left = math.sqrt(max(left, 0.0) + max(off * off, (1.0 - share) ** 2 * (square - left)))
    if left < predicted[0]:
        nearest = distance
    insert(left, plane[s, 0] + share * p, plane[s, 1] + share * q, off, predicted, found)
    return nearest


@njit(nogil=True, cache=True)
def rival(predicted, found, step):
    """Return the number of the nearest candidate on another sheet than the first that is almost as near, 0 for none."""
    for c in range(1, CANDIDATES):
        if predicted[c] > predicted[0] + CLOSE * step:
            return 0
        if max(abs(found[c, 0] - found[0, 0]), abs(found[c, 1] - found[0, 1])) > APART * step:
            return c
    return 0


@njit(nogil=True, cache=True)
def insert(distance, u, v, off, predicted, found):
    """Put a candidate into the list that is sorted by distance, if it belongs there."""
    if distance >= predicted[-1]:
        return
    c = len(predicted) - 1
    while c > 0 and predicted[c - 1] > distance:
        predicted[c] = predicted[c - 1]
        for k in range(3):
            found[c, k] = found[c - 1, k]
        c -= 1
    predicted[c], found[c, 0], found[c, 1], found[c, 2] = distance, u, v, off


@njit(nogil=True, cache=True)
def find_feet(points, starts, balls, step, max_step, feet, heights, converged):
    """Write (u, v) of the feet of a block of points, their signed heights, and which of them were reached.

    Newton's method from `starts` (n, 2), a round for all points at a time. The second derivatives of the first round
    serve as long as steps are short.
    """
    count = len(points)
    bends, moves, last = np.empty((count, 3, 3)), np.zeros((count, 2)), np.full((count, 2), np.inf)
    for i in range(count):
        feet[i, 0], feet[i, 1], converged[i] = starts[i, 0], starts[i, 1], False
    fresh, known = np.arange(count), np.empty(0, dtype=np.int64)
    for _ in range(MAX_ROUNDS):
        again, on = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
        renewed = kept = 0
        for part in range(2):
            rows = fresh if part == 0 else known
            jets = np.empty((rows.size, JET if part == 0 else 3, 3))
            jets_at(feet[rows], balls, 2 if part == 0 else 1, jets)
            for j in range(rows.size):
                i = rows[j]
                if part == 0:
                    for row in range(3):
                        for k in range(3):
                            bends[i, row, k] = jets[j, 3 + row, k]
                heights[i] = height_over(points[i, 0], points[i, 1], points[i, 2], j, jets)
                after = advance(i, points, jets, j, bends, step, max_step, feet, moves, last)
                if after == RENEWED:
                    again[renewed] = i
                    renewed += 1
                elif after == KEPT:
                    on[kept] = i
                    kept += 1
                else:
                    converged[i] = True
        fresh, known = again[:renewed], on[:kept]
        if renewed + kept == 0:
            break


@njit(nogil=True, cache=True)
def advance(i, points, jets, j, bends, step, max_step, feet, moves, last):
    """Move foot i by Newton's step from jet j, or half of the last one back if that led away; return what comes next.

    `moves` (n, 2) are the last steps in the plane; `last` (n, 2) their lengths in space, and |r|² before them.
    """
    x, y, z = points[i, 0], points[i, 1], points[i, 2]
    p, q, length, square, _ = newton_step(x, y, z, j, jets, i, bends, max_step)
    floor = 1e-14 * (abs(x) + abs(y) + abs(z)) + 1e-11 * step
    if square > last[i, 1] * (1.0 + ROUNDING) + floor * floor:
        moves[i, 0], moves[i, 1], last[i, 0] = 0.5 * moves[i, 0], 0.5 * moves[i, 1], 0.5 * last[i, 0]
        feet[i, 0], feet[i, 1] = feet[i, 0] - moves[i, 0], feet[i, 1] - moves[i, 1]
        return RENEWED
    rate = min(length / last[i, 0], 0.99) if last[i, 0] < np.inf else 0.99
    feet[i, 0], feet[i, 1] = feet[i, 0] + p, feet[i, 1] + q
    moves[i, 0], moves[i, 1], last[i, 0], last[i, 1] = p, q, length, square
    if length * rate / (1.0 - rate) <= floor or (length < STALLED * step and rate > 0.5):
        return SETTLED
    return RENEWED if length > STALE * step or SLOW < rate < 0.99 else KEPT


@njit(nogil=True, cache=True)
def height_over(x, y, z, i, jets):
    """Return (x − S)·n."""
    r = (x - jets[i, 0, 0], y - jets[i, 0, 1], z - jets[i, 0, 2])
    height = square = 0.0
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        normal = jets[i, 1, a] * jets[i, 2, b] - jets[i, 1, b] * jets[i, 2, a]
        height += r[k] * normal
        square += normal * normal
    return height / math.sqrt(max(square, 1e-300))
