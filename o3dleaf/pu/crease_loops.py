"""The compiled loops of creases: the smooth sheets of a ball, how they meet, and whether splitting it is worth it."""

import math

import numpy as np
from numba import njit

from o3dleaf.pu.loops import ball_held_out, gather
from o3dleaf.rbf.loops import radial_values, squared_distances
from o3dleaf.rbf.solve import solve_local, tail_matrix

LEAST_CALM = 8
"""Points away from any crease that a sheet begins with: more than a quadric has coefficients."""

ROUNDS = 3
"""Times that doubtful points choose their sheet and the sheets' quadrics are fitted again."""

RIDGE = 1e-3
"""Share of the points' number added to the curvatures' diagonal: planes stay planes where few points say more."""

OPPOSITE = -0.5
"""Cosine below which a neighbour's normal is the other side of a thin sheet, which makes no crease here."""

MIXED = 0.2
"""Share of a sheet's points, weighed by distance, that may lie on the wrong side of another that they meet."""


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
    """Return (centre, frame, coefficients, scale) of z = q(u, v) over the mean plane of the chosen points."""
    centre, up = np.zeros(3), np.zeros(3)
    count = 0
    for i in range(len(points)):
        if chosen[i]:
            count += 1
            centre += points[i]
            up += normals[i]
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
    scale = math.sqrt(spread / count)
    matrix, right = np.zeros((6, 6)), np.zeros(6)
    for i in range(len(points)):
        if chosen[i]:
            u, v, z = frame @ (points[i] - centre) / scale
            terms = np.array([1.0, u, v, u * u, u * v, v * v])
            matrix += np.outer(terms, terms)
            right += z * terms
    for k in range(3, 6):
        matrix[k, k] += RIDGE * count
    return centre, frame, np.linalg.solve(matrix, right), scale


@njit(nogil=True, cache=True)
def distance(quadric, point):
    """Return the distance of a point from a quadric to first order, above 0 outside, and the outward normal there."""
    centre, frame, q, scale = quadric
    u, v, z = frame @ (point - centre) / scale
    slope = np.array([-q[1] - 2 * q[3] * u - q[4] * v, -q[2] - q[4] * u - 2 * q[5] * v, 1.0])
    length = math.sqrt(slope @ slope)
    height = z - (q[0] + q[1] * u + q[2] * v + q[3] * u * u + q[4] * u * v + q[5] * v * v)
    return scale * height / length, frame.T @ slope / length


@njit(nogil=True, cache=True)
def find_sheets(rows, points, normals, near, calm, cosine):
    """Return the (n,) sheet of each point, the (sheets, n) signed distances, and the cosine of its normal to the sheet's.

    Sheets begin as connected calm points; then a doubtful point goes to the sheet whose quadric it lies on.
    """
    labels = np.empty(rows.size, dtype=np.int64)
    count = connect(rows, normals, near, calm, cosine, labels)
    x, n = points[rows], normals[rows]
    away, facing = np.empty((count, rows.size)), np.empty((count, rows.size))
    doubtful = labels < 0
    agreeing = np.ones(rows.size)
    for _ in range(ROUNDS if count > 1 else 0):
        for sheet in range(count):
            quadric = fit_quadric(x, n, labels == sheet)
            for i in range(rows.size):
                away[sheet, i], outward = distance(quadric, x[i])
                facing[sheet, i] = outward @ n[i]
        for i in range(rows.size):
            if doubtful[i]:
                labels[i] = np.argmin(np.abs(away[:, i]))
    for i in range(rows.size if count > 1 else 0):
        agreeing[i] = facing[labels[i], i]
    return labels, away, agreeing


@njit(nogil=True, cache=True)
def order_sheets(labels, away, sheets, joins):
    """Order the sheets so that each is joined to those before it by the minimum (−1) or maximum (1); return the worst share.

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
def judge(whole, data, cover, split, exponents, power, diagonals):
    """Return the sums of squared held-out errors of a ball's one spline, and of the sheets that it is split into.

    Points are left out with all their constraints and judged by their own; of the sheets it is the error of
    their combination, of which each point belongs to one.
    """
    points, values, trust, owners = data
    pieces, piece_cover, joins = split
    of_whole = ball_held_out(whole, points, values, trust, cover, exponents, power, diagonals[0], owners)
    rows = cover[3][cover[2][whole] : cover[2][whole + 1]]
    centre, radius = cover[0][whole], cover[1][whole]
    own = owners[rows] == rows
    rows, of_whole = rows[own], of_whole[own]
    local, _ = gather(points, values, rows, centre, radius)
    combined = np.zeros(rows.size)
    for piece in range(pieces[0], pieces[1]):
        members = piece_cover[3][piece_cover[2][piece] : piece_cover[2][piece + 1]]
        sites, data_there = gather(points, values, members, centre, radius)
        diagonal = diagonals[1][piece] / radius**power / trust[members]
        lam, tail, _, _ = solve_local(sites, data_there, exponents, power, diagonal)
        found = spline_values(sites, lam, tail, exponents, power, local)
        errors = ball_held_out(piece, points, values, trust, piece_cover, exponents, power, diagonals[1], owners)
        for j in range(members.size):
            at = np.searchsorted(rows, members[j])
            if at < rows.size and rows[at] == members[j]:
                found[at] = values[members[j]] - errors[j]
        if joins[piece] == 0:
            combined[:] = found
        elif joins[piece] < 0:
            combined = np.minimum(combined, found)
        else:
            combined = np.maximum(combined, found)
    one, many = 0.0, 0.0
    for i in range(rows.size):
        if not (math.isnan(of_whole[i]) or math.isnan(combined[i])):
            one += of_whole[i] ** 2
            many += (values[rows[i]] - combined[i]) ** 2
    return one, many
