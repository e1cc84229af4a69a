"""The compiled loops of creases: the smooth sheets of a ball, how they meet, and whether splitting it is worth it."""

import math

import numpy as np
from numba import njit

from o3dleaf.pu.loops import gather
from o3dleaf.rbf.loops import radial_values, squared_distances
from o3dleaf.rbf.solve import solve_local, tail_matrix

LEAST_CALM = 8
"""Points away from any crease that a sheet begins with: more than a quadric has coefficients."""

ROUNDS = 4
"""Times that doubtful points choose their sheet and the sheets' quadrics are fitted again."""

RIDGE = 1e-3
"""Share of the points' number added to the curvatures' diagonal: planes stay planes where few points say more."""
LEAST_RIDGE = 1e-12
"""The same for the plane, so that points on a line have one."""

ONE_SHEET = (1.5, 0.005)
"""Two sheets are one if a quadric's misfit to both is below so many of the larger of their own, and so much of the
scale: a third of what planes at 30 degrees leave."""

STRAY = 3.0
"""Root mean square distances of a sheet's calm points within which a doubtful point has a say in its quadric."""

OPPOSITE = -0.5
"""Cosine below which a neighbour's normal is the other side of a thin sheet, which makes no crease here."""

MIXED = 0.2
"""Share of a sheet's points, weighed by distance, that may lie on the wrong side of another that they meet."""


HELD_OUT = 4
"""One in so many points of a ball is left out to judge by."""


MUCH = 0.3
"""Share of the squared errors of one spline below which sheets are better beyond doubt."""

ALIKE = 2.0
"""Squared errors near creases over those elsewhere which chance may make of nothing but noise."""


@njit(nogil=True, cache=True)
def average_alike(normals, near, cosine):
    """Return the (n, 3) unit means of the normals of points and of those of their neighbours that agree with them."""
    found = normals.copy()
    for i in range(len(normals)):
        for j in near[i]:
            if normals[i] @ normals[j] >= cosine:
                found[i] += normals[j]
        found[i] /= math.sqrt(found[i] @ found[i])
    return found


@njit(nogil=True, cache=True)
def find_calm(start, stop, normals, near, cosine, calm):
    """Mark the points that all neighbours agree with, those on the other side of a thin sheet aside."""
    for i in range(start, stop):
        calm[i] = True
        for j in near[i]:
            agree = normals[i] @ normals[j]
            if OPPOSITE < agree < cosine:
                calm[i] = False


@njit(nogil=True, cache=True)
def connect(rows, normals, near, calm, cosine, labels):
    """Label the calm points of rising `rows` by the pieces that neighbours join, −1 elsewhere; return how many."""
    labels[:] = -1
    stack = np.empty(rows.size, dtype=np.int64)
    count = 0
    for seed in range(rows.size):
        if labels[seed] >= 0 or not calm[rows[seed]]:
            continue
        labels[seed], stack[0], depth = count, seed, 1
        size = 0
        while depth > 0:
            depth -= 1
            here = rows[stack[depth]]
            size += 1
            for there in near[here]:
                at = np.searchsorted(rows, there)
                if at == rows.size or rows[at] != there or labels[at] != -1 or not calm[there]:
                    continue
                if normals[here] @ normals[there] >= cosine:
                    labels[at], stack[depth] = count, at
                    depth += 1
        if size >= LEAST_CALM:
            count += 1
        else:
            for at in range(rows.size):
                if labels[at] == count:
                    labels[at] = -2
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def fit_quadric(points, normals, chosen):
    """Return (centre, frame, coefficients, scale) of z = q(u, v) over the mean plane of the chosen points.

    Of none it is infinitely far from everywhere, of a single point the plane through it.
    """
    centre, up = np.zeros(3), np.zeros(3)
    count = 0
    for i in range(len(points)):
        if chosen[i]:
            count += 1
            centre += points[i]
            up += normals[i]
    if count == 0 or up @ up == 0.0:
        nowhere = np.zeros(6)
        nowhere[0] = np.inf
        return centre, np.eye(3), nowhere, 1.0
    centre /= count
    up /= math.sqrt(up @ up)
    frame = np.zeros((3, 3))
    frame[2] = up
    frame[0, np.argmin(np.abs(up))] = 1.0
    frame[0] -= (frame[0] @ up) * up
    frame[0] /= math.sqrt(frame[0] @ frame[0])
    frame[1] = np.cross(up, frame[0])
    spread = 0.0
    for i in range(len(points)):
        if chosen[i]:
            spread += np.sum((points[i] - centre) ** 2)
    scale = math.sqrt(spread / count) if spread > 0.0 else 1.0
    matrix, right, terms = np.zeros((6, 6)), np.zeros(6), np.ones(6)
    for i in range(len(points)):
        if chosen[i]:
            u, v, z = in_frame(centre, frame, scale, points[i])
            terms[1], terms[2], terms[3], terms[4], terms[5] = u, v, u * u, u * v, v * v
            for row in range(6):
                right[row] += z * terms[row]
                for column in range(6):
                    matrix[row, column] += terms[row] * terms[column]
    for k in range(6):
        matrix[k, k] += (RIDGE if k > 2 else LEAST_RIDGE) * count
    return centre, frame, np.linalg.solve(matrix, right), scale


@njit(nogil=True, cache=True)
def in_frame(centre, frame, scale, point):
    """Return the coordinates of a point in a frame."""
    x, y, z = (point[0] - centre[0]) / scale, (point[1] - centre[1]) / scale, (point[2] - centre[2]) / scale
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


@njit(nogil=True, cache=True)
def distance(quadric, point, outward):
    """Return the distance of a point from a quadric to first order, above 0 outside; write the normal there."""
    centre, frame, q, scale = quadric
    u, v, z = in_frame(centre, frame, scale, point)
    along, across = -q[1] - 2 * q[3] * u - q[4] * v, -q[2] - q[4] * u - 2 * q[5] * v
    length = math.sqrt(along * along + across * across + 1.0)
    for axis in range(3):
        outward[axis] = (frame[0, axis] * along + frame[1, axis] * across + frame[2, axis]) / length
    height = z - (q[0] + q[1] * u + q[2] * v + q[3] * u * u + q[4] * u * v + q[5] * v * v)
    return scale * height / length


@njit(nogil=True, cache=True)
def blunt_pair(labels, away, outward, count, cosine):
    """Return two sheets that turn by less than the angle where one comes nearest to the other, or −1 twice."""
    for one in range(count):
        for other in range(count):
            least, at = np.inf, -1
            for i in range(labels.size):
                if labels[i] == other and abs(away[one, i]) < least:
                    least, at = abs(away[one, i]), i
            if one != other and at >= 0 and outward[one, at] @ outward[other, at] > cosine:
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
def misfit(points, normals, chosen):
    """Return the root mean square distance of the chosen points from their quadric, and its scale."""
    quadric = fit_quadric(points, normals, chosen)
    total, outward = 0.0, np.empty(3)
    for i in range(len(points)):
        if chosen[i]:
            total += distance(quadric, points[i], outward) ** 2
    return math.sqrt(total / np.sum(chosen)), quadric[3]


@njit(nogil=True, cache=True, error_model="numpy")
def unite(points, normals, labels, count):
    """Unite sheets that one quadric fits as well as each its own; return how many are left."""
    first = 0
    while first < count - 1:
        other = first + 1
        while other < count:
            apart = max(misfit(points, normals, labels == first)[0], misfit(points, normals, labels == other)[0])
            together, scale = misfit(points, normals, (labels == first) | (labels == other))
            if together > ONE_SHEET[0] * apart + ONE_SHEET[1] * scale:
                other += 1
                continue
            count -= 1
            relabel(labels, other, first, count)
            other = first + 1
        first += 1
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def measure(points, normals, chosen, away, outward):
    """Write distances of all points from the quadric of the chosen ones, and its normals there; return its reach."""
    quadric = fit_quadric(points, normals, chosen)
    total = 0.0
    for i in range(len(points)):
        away[i] = distance(quadric, points[i], outward[i])
        total += away[i] ** 2 if chosen[i] else 0.0
    return STRAY * math.sqrt(total / np.sum(chosen)) + ONE_SHEET[1] * quadric[3]


@njit(nogil=True, cache=True, error_model="numpy")
def find_sheets(rows, points, normals, near, calm, half):
    """Return the (n,) sheet of each point, whether it lies on it, (sheets, n) distances and (sheets, n, 3) normals.

    Sheets begin as connected calm points; then a doubtful point goes to the sheet whose quadric it lies on. What
    lies on none begins one more: a sheet that has only a corner in here has no calm points. Sheets that do not turn
    where they meet are one.
    """
    labels = np.empty(rows.size, dtype=np.int64)
    # `half` is the cosine of half the angle.
    angle = 2.0 * half * half - 1.0
    count = connect(rows, normals, near, calm, half, labels)
    x, n = points[rows], normals[rows]
    count = unite(x, n, labels, count)
    away, outward = np.zeros((count + 1, rows.size)), np.zeros((count + 1, rows.size, 3))
    doubtful, lying = labels < 0, labels >= 0
    within = np.zeros(count + 1)
    more = count + 1
    for _ in range(ROUNDS if count > 1 else 0):
        for sheet in range(count):
            reach = measure(x, n, lying & (labels == sheet), away[sheet], outward[sheet])
            within[sheet] = reach if within[sheet] == 0.0 else within[sheet]
        for i in range(rows.size):
            if doubtful[i]:
                labels[i] = np.argmin(np.abs(away[:count, i]))
                lying[i] = abs(away[labels[i], i]) <= within[labels[i]]
        if count < more and np.sum(~lying) >= LEAST_CALM:
            labels[~lying] = count
            lying[:] = True
            count = more
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
        reach = STRAY * math.sqrt(np.mean(away[sheet][sure] ** 2)) + ONE_SHEET[1] * np.max(np.abs(away))
        for i in range(rows.size):
            if own[i]:
                lying[i] = abs(away[sheet, i]) <= reach
    return labels, lying, away[:count], outward[:count]


@njit(nogil=True, cache=True, error_model="numpy")
def find_sheets_of(first, rows, points, normals, near, calm, half):
    """Return what `find_sheets` says of each run rows[first[k]:first[k + 1]].

    Many at once, since between compiled calls threads wait for one another.
    """
    return [
        find_sheets(rows[first[k] : first[k + 1]], points, normals, near, calm, half) for k in range(first.size - 1)
    ]


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
def spline_values(points, weights, tail, exponents, power, queries):
    """Return the values of a spline in unit coordinates at the columns of `queries` (d, ·)."""
    found = tail_matrix(queries, exponents) @ tail
    radial, z = np.empty(weights.size), np.empty(len(points))
    for i in range(found.size):
        for axis in range(z.size):
            z[axis] = queries[axis, i]
        squared_distances(z, points, weights.size, radial)
        radial_values(power, radial, weights.size, radial)
        found[i] += radial @ weights
    return found


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
