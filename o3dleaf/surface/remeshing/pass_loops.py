"""Passes over a mesh of half-edges, compiled: which edits make its triangles better, and doing them.

How good triangles are is their *score*, from 0 to 1: the least of the sines of their smallest angles,
and of half (1 + cos) of the turns between their normals and their neighbours', so that a triangle folded
back upon another is as bad as a sliver. An edit is done where all that it makes is fair, or better than
the worst of what was there. `limits` are (fair, flat, deviation, longest):

    fair       score from which a triangle is good enough
    flat       least cosine between a new triangle's normal and those it takes the place of
    deviation  how far what is taken away may lie from what is left
    longest    no edge is made longer than this
"""

import math

import numpy as np
from numba import njit

from o3dleaf.surface.remeshing.halfedge_loops import (
    CREASE,
    LOCKED,
    MOST_AROUND,
    SMOOTH,
    after,
    before,
    can_collapse,
    can_flip,
    collapse,
    fan,
    flip,
    split,
)
from o3dleaf.surface.remeshing.shape_loops import (
    dot,
    normal_of,
    roundness,
    square,
    square_to_segment,
    square_to_triangle,
)

NOTHING = -1


@njit(nogil=True, cache=True)
def triangle_roundness(mesh, place, t, normal):
    """Return the sine of the smallest angle of triangle t, and write its normal."""
    p, q, r = place[mesh[0][3 * t]], place[mesh[0][3 * t + 1]], place[mesh[0][3 * t + 2]]
    return roundness(p, q, r, normal_of(p, q, r, normal))


@njit(nogil=True, cache=True)
def cosine(u, v):
    """Return the cosine of the angle between two vectors; 1 where one of them is 0: it has no direction."""
    lengths = math.sqrt(dot(u, u) * dot(v, v))
    return dot(u, v) / lengths if lengths > 1e-300 else 1.0


@njit(nogil=True, cache=True)
def turn(u, v):
    """Return half of 1 + the cosine of the angle between two normals: 1/2 at a right angle, 0 where it folds back."""
    return (1.0 + cosine(u, v)) / 2


@njit(nogil=True, cache=True)
def score_fan(mesh, place, around, count, x, onto, normals):
    """Return the score of a fan whose middle is at x, and write the normals of its triangles.

    The triangles at vertex `onto` count as gone: a collapse joins what lies on both sides of them.
    """
    origin, twin, _, _, _ = mesh
    least, outer = 1.0, np.empty(3)
    for k in range(count):
        rim = after(around[k])
        p, q = origin[rim], origin[after(rim)]
        gone = onto in (p, q)
        if not gone:
            area = normal_of(x, place[p], place[q], normals[k])
            least = min(least, roundness(x, place[p], place[q], area))
        if twin[rim] == -1:
            if gone:
                normals[k] = 0.0
        elif gone:
            triangle_roundness(mesh, place, twin[rim] // 3, normals[k])
        else:
            triangle_roundness(mesh, place, twin[rim] // 3, outer)
            least = min(least, turn(normals[k], outer))
    for k in range(count):
        spoke = around[k]
        if origin[after(spoke)] != onto:
            least = min(least, turn(normals[k], normals[k - 1 if k else count - 1]))
    return least


@njit(nogil=True, cache=True)
def keeps_shape(mesh, label, place, around, count, x, onto, old, new, limits):
    """Say whether a fan whose middle goes to x keeps within the limits on edges, and keeps facing as it did."""
    origin = mesh[0]
    _, flat, _, longest = limits
    total = np.empty(3)
    for k in range(count):
        p, q = origin[after(around[k])], origin[before(around[k])]
        if onto in (p, q):
            continue
        if max(square(x, place[p]), square(x, place[q])) > longest * longest:
            return False
        total[:] = 0.0
        for n in range(count):
            if label[around[n] // 3] == label[around[k] // 3]:
                for axis in range(3):
                    total[axis] += old[n, axis]
        if cosine(new[k], total) < min(flat, cosine(old[k], total)):
            return False
    return True


@njit(nogil=True, cache=True)
def is_near(mesh, place, h, around, count, deviation):
    """Say whether the origin of half-edge h lies near the triangles, or the crease, that a collapse along h leaves.

    A spike of a crease, both sides of one triangle, only has to lie near triangles.
    """
    origin, twin, crease, _, kind = mesh
    v, w = origin[h], origin[after(h)]
    nearest = np.inf
    for k in range(count):
        p, q = origin[after(around[k])], origin[before(around[k])]
        if w not in (p, q):
            nearest = min(nearest, square_to_triangle(place[v], place[w], place[p], place[q]))
    if nearest > deviation * deviation:
        return False
    spike = crease[before(h)] or crease[after(twin[h])]
    if kind[v] == CREASE and not spike:
        for k in range(count):
            other = origin[after(around[k])]
            if crease[around[k]] and other != w:
                return square_to_segment(place[v], place[w], place[other]) <= deviation * deviation
    return True


@njit(nogil=True, cache=True)
def try_collapse(mesh, label, place, h, limits, around, halves, normals):
    """Collapse half-edge h where that is allowed and leaves better triangles; say whether it was done."""
    count = can_collapse(mesh, h, around, halves)
    if count == 0:
        return False
    v, w = mesh[0][h], mesh[0][after(h)]
    worst = score_fan(mesh, place, around, count, place[v], NOTHING, normals[0])
    least = score_fan(mesh, place, around, count, place[w], w, normals[1])
    if least < limits[0] and least <= worst:
        return False
    if not keeps_shape(mesh, label, place, around, count, place[w], w, normals[0], normals[1], limits):
        return False
    if not is_near(mesh, place, h, around, count, limits[2]):
        return False
    collapse(mesh, h, around, count)
    return True


@njit(nogil=True, cache=True)
def turn_beyond(mesh, place, normal, rim):
    """Return the turn between a normal and the triangle on the other side of half-edge `rim`; 1 on the border."""
    twin = mesh[1]
    if twin[rim] == -1:
        return 1.0
    outer = np.empty(3)
    triangle_roundness(mesh, place, twin[rim] // 3, outer)
    return turn(normal, outer)


@njit(nogil=True, cache=True)
def try_flip(mesh, place, h, limits, halves):
    """Flip the edge of half-edge h where that is allowed and leaves better triangles; say whether it was done."""
    origin, twin, _, _, _ = mesh
    if not can_flip(mesh, h, halves):
        return False
    g = twin[h]
    bc, ca, ad, db = after(h), before(h), after(g), before(g)
    a, b, c, d = place[origin[h]], place[origin[g]], place[origin[ca]], place[origin[db]]
    if square(c, d) > limits[3] * limits[3]:
        return False
    old, new, total = np.empty((2, 3)), np.empty((2, 3)), np.empty(3)
    worst = min(triangle_roundness(mesh, place, h // 3, old[0]), triangle_roundness(mesh, place, g // 3, old[1]))
    first = roundness(a, d, c, normal_of(a, d, c, new[0]))
    least = min(first, roundness(d, b, c, normal_of(d, b, c, new[1])))
    worst = min(worst, turn(old[0], old[1]))
    worst = min(worst, turn_beyond(mesh, place, old[0], bc), turn_beyond(mesh, place, old[0], ca))
    worst = min(worst, turn_beyond(mesh, place, old[1], ad), turn_beyond(mesh, place, old[1], db))
    if least <= 1.0001 * worst:
        return False
    least = min(least, turn(new[0], new[1]))
    least = min(least, turn_beyond(mesh, place, new[0], ca), turn_beyond(mesh, place, new[0], ad))
    least = min(least, turn_beyond(mesh, place, new[1], bc), turn_beyond(mesh, place, new[1], db))
    if least <= 1.0001 * worst:
        return False
    for k in range(3):
        total[k] = old[0, k] + old[1, k]
    most = min(limits[1], cosine(old[0], total), cosine(old[1], total))
    if min(cosine(new[0], total), cosine(new[1], total)) < most or between_lines(a, b, c, d) > limits[2]:
        return False
    flip(mesh, h)
    return True


@njit(nogil=True, cache=True)
def between_lines(a, b, c, d):
    """Return the distance between the lines ab and cd; 0 where they are parallel."""
    normal, total, length = np.empty(3), 0.0, 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        normal[k] = (b[i] - a[i]) * (d[j] - c[j]) - (b[j] - a[j]) * (d[i] - c[i])
        total += normal[k] * (c[k] - a[k])
        length += normal[k] * normal[k]
    return abs(total) / math.sqrt(length) if length > 1e-300 else 0.0


@njit(nogil=True, cache=True)
def collapse_short(mesh, label, place, order, shortest, limits):
    """Collapse the half-edges in `order` that are shorter than `shortest`; return how many."""
    origin = mesh[0]
    around, halves = np.empty(MOST_AROUND, dtype=np.int64), np.empty(MOST_AROUND, dtype=np.int64)
    normals, done = np.empty((2, MOST_AROUND, 3)), 0
    for h in order:
        if origin[h] != -1 and square(place[origin[h]], place[origin[after(h)]]) < shortest * shortest:
            done += try_collapse(mesh, label, place, h, limits, around, halves, normals)
    return done


@njit(nogil=True, cache=True)
def flip_edges(mesh, place, limits, sweeps):
    """Flip edges until no flip makes the worse of two triangles better; return how many."""
    halves, done = np.empty(MOST_AROUND, dtype=np.int64), 0
    for _ in range(sweeps):
        fresh = 0
        for h in range(len(mesh[0])):
            if mesh[0][h] != -1 and mesh[1][h] > h:
                fresh += try_flip(mesh, place, h, limits, halves)
        done += fresh
        if fresh == 0:
            break
    return done


@njit(nogil=True, cache=True)
def score_triangle(mesh, place, t, normal):
    """Return the score of a triangle."""
    least = triangle_roundness(mesh, place, t, normal)
    for rim in range(3 * t, 3 * t + 3):
        least = min(least, turn_beyond(mesh, place, normal, rim))
    return least


@njit(nogil=True, cache=True)
def cure_slivers(mesh, label, place, limits, sweeps):
    """Flip or collapse an edge of every triangle that is not fair, where that makes things better; return how many."""
    origin = mesh[0]
    around, halves = np.empty(MOST_AROUND, dtype=np.int64), np.empty(MOST_AROUND, dtype=np.int64)
    normals, normal, done = np.empty((2, MOST_AROUND, 3)), np.empty(3), 0
    for _ in range(sweeps):
        fresh = 0
        for t in range(len(label)):
            for edit in range(9):
                h = 3 * t + edit % 3
                if origin[h] == -1 or score_triangle(mesh, place, t, normal) >= limits[0]:
                    break
                if edit < 3:
                    fresh += try_flip(mesh, place, h, limits, halves)
                    continue
                if edit >= 6:
                    h = mesh[1][h]
                if h != -1:
                    fresh += try_collapse(mesh, label, place, h, limits, around, halves, normals)
        done += fresh
        if fresh == 0:
            break
    return done


@njit(nogil=True, cache=True)
def mark_long(mesh, place, longest, halves):
    """Write the half-edges, one of each edge, that are longer than `longest` and the longest of both triangles."""
    origin, twin, _, _, _ = mesh
    count = 0
    for h in range(len(origin)):
        g = twin[h]
        if origin[h] == -1 or g < h:
            continue
        length, is_longest = square(place[origin[h]], place[origin[g]]), True
        if length <= longest * longest:
            continue
        for other in (after(h), before(h), after(g), before(g)):
            is_longest = is_longest and square(place[origin[other]], place[origin[after(other)]]) <= length
        # Of two equal sides of a triangle both would be marked: the one that comes first goes first.
        for other in (after(h), before(h), after(g), before(g)):
            equal = square(place[origin[other]], place[origin[after(other)]]) == length
            is_longest = is_longest and not (equal and min(other, twin[other] if twin[other] != -1 else other) < h)
        if is_longest:
            halves[count] = h
            count += 1
    return count


@njit(nogil=True, cache=True)
def split_edges(mesh, label, place, halves, points, limits, first_vertex, first_triangle):
    """Split edges at points, each into the next free vertex; those that would fold are left. Return how many."""
    origin, twin, crease, _, kind = mesh
    done, old, new = 0, np.empty((2, 3)), np.empty(3)
    for n in range(len(halves)):
        h = halves[n]
        g = twin[h]
        vertex, triangle = first_vertex + done, first_triangle + 2 * done
        worst = min(triangle_roundness(mesh, place, h // 3, old[0]), triangle_roundness(mesh, place, g // 3, old[1]))
        least, kept = 1.0, True
        for side in range(2):
            half = h if side == 0 else g
            a, b, c = origin[half], origin[after(half)], origin[before(half)]
            for part in range(2):
                u = place[a] if part == 0 else points[n]
                v = points[n] if part == 0 else place[b]
                area = normal_of(u, v, place[c], new)
                least = min(least, roundness(u, v, place[c], area))
                kept = kept and cosine(new, old[side]) >= limits[1]
        if not kept or (least < limits[0] and least < 0.5 * worst):
            continue
        for axis in range(3):
            place[vertex, axis] = points[n, axis]
        kind[vertex] = CREASE if crease[h] else SMOOTH
        label[triangle], label[triangle + 1] = label[h // 3], label[g // 3]
        split(mesh, h, vertex, triangle)
        halves[done] = n
        done += 1
    return done


@njit(nogil=True, cache=True)
def fill_shifts(mesh, place, share, shifts):
    """Write how far each vertex should move: to the middle of its triangles by area, along the surface; or crease."""
    origin, _, crease, outgoing, kind = mesh
    halves, normal, own, middle = np.empty(MOST_AROUND, dtype=np.int64), np.empty(3), np.empty(3), np.empty(3)
    for v in range(len(shifts)):
        shifts[v] = 0.0
        if outgoing[v] == -1 or kind[v] == LOCKED:
            continue
        count, total = fan(mesh, v, halves), 0.0
        normal[:], middle[:] = 0.0, 0.0
        if kind[v] == CREASE:
            for k in range(count):
                if crease[halves[k]]:
                    other = place[origin[after(halves[k])]]
                    length = math.sqrt(square(other, place[v]))
                    total += 1.0
                    for axis in range(3):
                        middle[axis] += other[axis]
                        normal[axis] += (other[axis] - place[v, axis]) * (1.0 if total == 1.0 else -1.0)
            if total != 2.0:
                continue
            along = 0.0
            for axis in range(3):
                along += (middle[axis] / 2 - place[v, axis]) * normal[axis]
            length = max(dot(normal, normal), 1e-300)
            for axis in range(3):
                shifts[v, axis] = share * along / length * normal[axis]
            continue
        for k in range(count):
            p, q = place[origin[after(halves[k])]], place[origin[before(halves[k])]]
            area = normal_of(place[v], p, q, own)
            total += area
            for axis in range(3):
                normal[axis] += own[axis]
                middle[axis] += area * (place[v, axis] + p[axis] + q[axis]) / 3
        if total <= 1e-300:
            continue
        out, length = 0.0, max(dot(normal, normal), 1e-300)
        for axis in range(3):
            middle[axis] = middle[axis] / total - place[v, axis]
            out += middle[axis] * normal[axis]
        for axis in range(3):
            shifts[v, axis] = share * (middle[axis] - out / length * normal[axis])


@njit(nogil=True, cache=True)
def move_vertices(mesh, label, place, rows, points, limits, floor, moved):
    """Move vertices to points where all triangles stay fair, or none gets worse; write which were moved.

    What is better but scores less than `floor` is not enough: of a fan with a fold anything would be better.
    """
    around, normals = np.empty(MOST_AROUND, dtype=np.int64), np.empty((2, MOST_AROUND, 3))
    for n in range(len(rows)):
        moved[n] = False
        count = fan(mesh, rows[n], around)
        if count == 0:
            continue
        worst = score_fan(mesh, place, around, count, place[rows[n]], NOTHING, normals[0])
        least = score_fan(mesh, place, around, count, points[n], NOTHING, normals[1])
        if least < limits[0] and least <= max(worst, floor):
            continue
        if keeps_shape(mesh, label, place, around, count, points[n], NOTHING, normals[0], normals[1], limits):
            moved[n] = True
            for axis in range(3):
                place[rows[n], axis] = points[n, axis]


@njit(nogil=True, cache=True)
def fill_tries(mesh, place, fair, share, rows, shifts):
    """Write ways for the corners of triangles that are not fair: a share of each edge out of them; return how many.

    Called with empty arrays it counts.
    """
    origin, _, crease, outgoing, kind = mesh
    halves, normal, count = np.empty(MOST_AROUND, dtype=np.int64), np.empty(3), 0
    seen = np.zeros(len(outgoing), dtype=np.bool_)
    for t in range(len(origin) // 3):
        if origin[3 * t] == -1 or score_triangle(mesh, place, t, normal) >= fair:
            continue
        for corner in range(3 * t, 3 * t + 3):
            v = origin[corner]
            if seen[v] or kind[v] == LOCKED:
                continue
            seen[v] = True
            for k in range(fan(mesh, v, halves)):
                if kind[v] == CREASE and not crease[halves[k]]:
                    continue
                if len(rows):
                    rows[count] = v
                    for axis in range(3):
                        shifts[count, axis] = share * (place[origin[after(halves[k])], axis] - place[v, axis])
                count += 1
    return count
