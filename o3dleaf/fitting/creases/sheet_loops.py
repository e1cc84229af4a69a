"""The compiled loops of sheets: the smooth ones that the measured points of a ball fall into."""

import math

import numpy as np
from numba import njit

from o3dleaf.fitting.creases.quadric_loops import SLACK, STRAY, measure, misfit, product

LEAST_CALM = 8
"""Points away from any crease that a sheet begins with: more than a quadric has coefficients."""

ROUNDS = 4
"""Times that doubtful points choose their sheet and the sheets' quadrics are fitted again."""

ONE_SHEET = 1.5
"""Two sheets are one if a quadric's misfit to both is below so many of the larger of their own, and `SLACK`."""

OPPOSITE = -0.5
"""Cosine below which a neighbour's normal is the other side of a thin sheet, which makes no crease here."""


@njit(nogil=True, cache=True)
def average_alike(start, stop, normals, near, cosine, found):
    """Write the (n, 3) unit means of the normals of points and of those of their neighbours that agree with them."""
    for i in range(start, stop):
        mean, own = found[i], normals[i]
        mean[:] = own
        for j in near[i]:
            if product(own, normals[j]) >= cosine:
                for axis in range(3):
                    mean[axis] += normals[j, axis]
        mean /= math.sqrt(product(mean, mean))


@njit(nogil=True, cache=True)
def find_calm(start, stop, normals, near, cosine, calm):
    """Mark the points that all neighbours agree with, those on the other side of a thin sheet aside."""
    for i in range(start, stop):
        calm[i] = True
        for j in near[i]:
            agree = product(normals[i], normals[j])
            if OPPOSITE < agree < cosine:
                calm[i] = False


@njit(nogil=True, cache=True)
def squared_distance(one, other):
    """Return the square of the distance of two points of three coordinates."""
    return (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2 + (one[2] - other[2]) ** 2


@njit(nogil=True, cache=True)
def place_of(rows, row):
    """Return the place of a row among rising rows, or −1."""
    at = np.searchsorted(rows, row)
    return at if at < rows.size and rows[at] == row else -1


@njit(nogil=True, cache=True)
def connect(rows, cloud, labels):
    """Label the calm points of rising `rows` by the pieces that neighbours join, −1 elsewhere; return how many."""
    normals, near, calm = cloud.normals, cloud.near, cloud.calm
    labels[:] = -1
    stack = np.empty(rows.size, dtype=np.int64)
    count = 0
    for seed in range(rows.size):
        if labels[seed] != -1 or not calm[rows[seed]]:
            continue
        labels[seed], stack[0], depth = count, seed, 1
        size = 0
        while depth > 0:
            depth -= 1
            here = rows[stack[depth]]
            size += 1
            for there in near[here]:
                if calm[there] and product(normals[here], normals[there]) >= cloud.half:
                    at = place_of(rows, there)
                    if at >= 0 and labels[at] == -1:
                        labels[at], stack[depth] = count, at
                        depth += 1
        if size >= LEAST_CALM:
            count += 1
        else:
            labels[labels == count] = -2
    return count


@njit(nogil=True, cache=True)
def blunt_pair(labels, away, outward, count, cosine):
    """Return two sheets that turn by less than the angle where one comes nearest to the other, or −1 twice."""
    for one in range(count):
        for other in range(count):
            least, at = np.inf, -1
            for i in range(labels.size):
                if labels[i] == other and abs(away[one, i]) < least:
                    least, at = abs(away[one, i]), i
            if one != other and at >= 0 and product(outward[one, at], outward[other, at]) > cosine:
                return one, other
    return -1, -1


@njit(nogil=True, cache=True)
def relabel(labels, gone, into, last):
    """Give the points of one sheet to another, and its number to the last one."""
    for i in range(labels.size):
        if labels[i] == gone:
            labels[i] = into
    for i in range(labels.size):
        if labels[i] == last:
            labels[i] = gone


@njit(nogil=True, cache=True, error_model="numpy")
def unite(points, normals, labels, count):
    """Unite sheets that one quadric fits as well as each its own; return how many are left."""
    own = np.array([misfit(points, normals, labels == sheet)[0] for sheet in range(count)])
    first = 0
    while first < count - 1:
        other = first + 1
        while other < count:
            together, scale = misfit(points, normals, (labels == first) | (labels == other))
            if together > ONE_SHEET * max(own[first], own[other]) + SLACK * scale:
                other += 1
                continue
            count -= 1
            relabel(labels, other, first, count)
            own[other], own[first] = own[count], together
            other = first + 1
        first += 1
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def find_sheets(rows, cloud):
    """Return the (n,) sheet of each point, whether it lies on it, (sheets, n) distances and (sheets, n, 3) normals.

    Sheets begin as connected calm points; then a doubtful point goes to the sheet whose quadric it lies on. What
    lies on none begins one more: a sheet that has only a corner in here has no calm points. Sheets that do not turn
    where they meet are one. Where calm points make one sheet at most there is none to be told from it, and no more
    is found out.
    """
    labels = np.empty(rows.size, dtype=np.int64)
    # `half` is the cosine of half the angle.
    angle = 2.0 * cloud.half * cloud.half - 1.0
    count = connect(rows, cloud, labels)
    x, n = cloud.points[rows], cloud.normals[rows]
    count = unite(x, n, labels, count) if count > 1 else count
    away, outward = np.zeros((count + 1, rows.size)), np.zeros((count + 1, rows.size, 3))
    doubtful, lying = labels < 0, labels >= 0
    if count < 2:
        return labels, lying, away[:count], outward[:count]
    count = place_doubtful(x, n, labels, lying, away, outward, count)
    one, other = blunt_pair(labels, away, outward, count, angle)
    while one >= 0:
        one, other = min(one, other), max(one, other)
        count -= 1
        relabel(labels, other, one, count)
        for sheet in range(count):
            measure(x, n, lying & (labels == sheet), away[sheet], outward[sheet])
        one, other = blunt_pair(labels, away, outward, count, angle)
    for sheet in range(count):
        own = labels == sheet
        sure = own & ~doubtful
        if not np.any(sure):
            continue
        within = STRAY * math.sqrt(np.mean(away[sheet][sure] ** 2)) + SLACK * np.max(np.abs(away))
        for i in range(rows.size):
            if own[i]:
                lying[i] = abs(away[sheet, i]) <= within
    return labels, lying, away[:count], outward[:count]


@njit(nogil=True, cache=True, error_model="numpy")
def place_doubtful(points, normals, labels, lying, away, outward, count):
    """Give the points that lie on no sheet yet to the nearest one or, once, to one more; return how many there are."""
    doubtful = ~lying
    within, more = np.zeros(count + 1), count + 1
    for _ in range(ROUNDS):
        for sheet in range(count):
            stray = measure(points, normals, lying & (labels == sheet), away[sheet], outward[sheet])
            within[sheet] = stray if within[sheet] == 0.0 else within[sheet]
        for i in range(labels.size):
            if doubtful[i]:
                labels[i] = 0
                for sheet in range(1, count):
                    if abs(away[sheet, i]) < abs(away[labels[i], i]):
                        labels[i] = sheet
                lying[i] = abs(away[labels[i], i]) <= within[labels[i]]
        if count < more and np.sum(~lying) >= LEAST_CALM:
            labels[~lying] = count
            lying[:] = True
            count = more
    return count
