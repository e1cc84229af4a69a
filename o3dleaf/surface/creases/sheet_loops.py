"""The compiled loops of sheets: the smooth ones that the measured points of a ball fall into."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.creases.quadric_loops import OUTLIER, SLACK, measure, misfit, product

MIN_SMOOTH = 8
"""Points away from any crease that a sheet begins with: more than a quadric has coefficients."""

ROUNDS = 4
"""Times that doubtful points choose their sheet and the sheets' quadrics are fitted again."""

ONE_SHEET = 1.5
"""Two sheets are one if a quadric's misfit to both is below so many of the larger of their own, and `SLACK`."""

OPPOSITE = -0.5
"""Cosine below which a neighbor's normal is the other side of a thin sheet, which makes no crease here."""

SPREAD = 0x9E3779B1
"""Odd number by which rows are spread over a hash table: 2³² over the golden ratio, as Knuth has it."""


@njit(nogil=True, cache=True)
def agreement(normals, i, j):
    """Return the product of two of the normals (n, 3), by numbers: to take a row of an array is to count its users."""
    return normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]


@njit(nogil=True, cache=True)
def average_alike(start, stop, normals, neighbors, cosine, averaged):
    """Write the (n, 3) unit means of the normals of points and of those of their neighbors that agree with them."""
    for i in range(start, stop):
        mean = averaged[i]
        mean[:] = normals[i]
        for j in neighbors[i]:
            if agreement(normals, i, j) >= cosine:
                for axis in range(3):
                    mean[axis] += normals[j, axis]
        mean /= math.sqrt(product(mean, mean))


@njit(nogil=True, cache=True)
def find_smooth(start, stop, normals, neighbors, cosine, smooth):
    """Mark the points that all neighbors agree with, those on the other side of a thin sheet aside."""
    for i in range(start, stop):
        smooth[i] = True
        for j in neighbors[i]:
            if OPPOSITE < agreement(normals, i, j) < cosine:
                smooth[i] = False


@njit(nogil=True, cache=True)
def join_alike(start, stop, normals, smooth, cosine, neighbors):
    """Write −1 in place of those neighbors that belong to no sheet with a point: once for all balls it is in."""
    for i in range(start, stop):
        for k in range(neighbors.shape[1]):
            j = neighbors[i, k]
            if not (smooth[i] and smooth[j] and agreement(normals, i, j) >= cosine):
                neighbors[i, k] = -1


@njit(nogil=True, cache=True)
def squared_distance(one, other):
    """Return the square of the distance of two points of three coordinates."""
    return (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2 + (one[2] - other[2]) ** 2


@njit(nogil=True, cache=True)
def place_of(rows, row):
    """Return the place of a row among rising rows, or −1."""
    place, count = 0, rows.size
    while count > 1:
        # Without a branch, which would be guessed wrongly half of the time.
        half = count >> 1
        place += half * (rows[place + half] <= row)
        count -= half
    return place if count > 0 and rows[place] == row else -1


@njit(nogil=True, cache=True)
def enter(rows):
    """Return a hash table of the places (2^k,) of some rows, at least half of it −1, by which `look_up` finds them."""
    size = 16
    while size < 2 * rows.size:
        size *= 2
    table = np.full(size, -1, dtype=np.int64)
    for i in range(rows.size):
        slot = rows[i] * SPREAD >> 16 & (size - 1)
        while table[slot] >= 0:
            slot = slot + 1 & (size - 1)
        table[slot] = i
    return table


@njit(nogil=True, cache=True)
def look_up(row, rows, table):
    """Return the place of a row among those of a table, or −1."""
    slot = row * SPREAD >> 16 & (table.size - 1)
    while table[slot] >= 0 and rows[table[slot]] != row:
        slot = slot + 1 & (table.size - 1)
    return table[slot]


@njit(nogil=True, cache=True)
def connect(rows, measured, labels):
    """Label the smooth points of rising `rows` by the components that neighbors join, −1 elsewhere; return how many."""
    joined, smooth, table = measured.joined, measured.smooth, enter(rows)
    labels[:] = -1
    stack = np.empty(rows.size, dtype=np.int64)
    count = 0
    for seed in range(rows.size):
        if labels[seed] != -1 or not smooth[rows[seed]]:
            continue
        labels[seed], stack[0], depth = count, seed, 1
        size = 0
        while depth > 0:
            depth -= 1
            point = rows[stack[depth]]
            size += 1
            for k in range(joined.shape[1]):
                place = look_up(joined[point, k], rows, table) if joined[point, k] >= 0 else -1
                if place >= 0 and labels[place] == -1:
                    labels[place], stack[depth] = count, place
                    depth += 1
        if size >= MIN_SMOOTH:
            count += 1
        else:
            labels[labels == count] = -2
    return count


@njit(nogil=True, cache=True)
def blunt_pair(labels, distances, outward, count, cosine):
    """Return two sheets that turn by less than the angle where one comes nearest to the other, or −1 twice."""
    least, nearest = np.empty(count + 1), np.empty(count + 1, dtype=np.int64)
    for one in range(count):
        least[:], nearest[:] = np.inf, -1
        for i in range(labels.size):
            distance, other = abs(distances[one, i]), labels[i]  # −1 is the last
            if distance < least[other]:
                least[other], nearest[other] = distance, i
        for other in range(count):
            i = nearest[other]
            if one != other and i >= 0 and product(outward[one, i], outward[other, i]) > cosine:
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
def find_sheets(rows, measured):
    """Return the (n,) sheet of each point, whether it lies on it, (sheets, n) distances and (sheets, n, 3) normals.

    Sheets begin as connected smooth points; then a doubtful point goes to the sheet whose quadric it lies on. What
    lies on none begins one more: a sheet that has only a corner in here has no smooth points. Sheets that do not turn
    where they meet are one. Where smooth points make one sheet at most there is no other, and no more is found out.
    """
    labels = np.empty(rows.size, dtype=np.int64)
    cosine = 2.0 * measured.cosine * measured.cosine - 1.0  # of the whole angle
    count = connect(rows, measured, labels)
    x, n = measured.points[rows], measured.normals[rows]
    count = unite(x, n, labels, count) if count > 1 else count
    distances, outward = np.zeros((count + 1, rows.size)), np.zeros((count + 1, rows.size, 3))
    doubtful, lying = labels < 0, labels >= 0
    if count < 2:
        return labels, lying, distances[:count], outward[:count]
    count = place_doubtful(x, n, labels, lying, distances, outward, count)
    one, other = blunt_pair(labels, distances, outward, count, cosine)
    while one >= 0:
        one, other = min(one, other), max(one, other)
        count -= 1
        relabel(labels, other, one, count)
        for sheet in range(count):
            measure(x, n, lying & (labels == sheet), distances[sheet], outward[sheet])
        one, other = blunt_pair(labels, distances, outward, count, cosine)
    for sheet in range(count):
        own = labels == sheet
        sure = own & ~doubtful
        if not np.any(sure):
            continue
        within = OUTLIER * math.sqrt(np.mean(distances[sheet][sure] ** 2)) + SLACK * np.max(np.abs(distances))
        for i in range(rows.size):
            if own[i]:
                lying[i] = abs(distances[sheet, i]) <= within
    return labels, lying, distances[:count], outward[:count]


@njit(nogil=True, cache=True)
def has_changed(sheet, labels, lying, before):
    """Return whether other points lie on a sheet than `before`, the sheets that points lay on."""
    for i in range(labels.size):
        if (lying[i] and labels[i] == sheet) != (before[i] == sheet):
            return True
    return False


@njit(nogil=True, cache=True, error_model="numpy")
def place_doubtful(points, normals, labels, lying, distances, outward, count):
    """Give the points that lie on no sheet yet to the nearest one or, once, to one more; return how many there are."""
    doubtful, before = ~lying, np.full(labels.size, -1)
    within, more = np.zeros(count + 1), count + 1
    for round_ in range(ROUNDS):
        for sheet in range(count):
            last = round_ == ROUNDS - 1
            if not last and not has_changed(sheet, labels, lying, before):
                continue
            facing = outward[sheet] if last else outward[sheet, :0]
            within_reach = measure(points, normals, lying & (labels == sheet), distances[sheet], facing)
            within[sheet] = within_reach if within[sheet] == 0.0 else within[sheet]
        for i in range(labels.size):
            before[i] = labels[i] if lying[i] else -1
            if doubtful[i]:
                labels[i] = 0
                for sheet in range(1, count):
                    if abs(distances[sheet, i]) < abs(distances[labels[i], i]):
                        labels[i] = sheet
                lying[i] = abs(distances[labels[i], i]) <= within[labels[i]]
        if count < more and np.sum(~lying) >= MIN_SMOOTH:
            labels[~lying] = count
            lying[:] = True
            count = more
    return count
