"""Edits of a mesh of half-edges that make its triangles better, and passes of them over the mesh."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.remeshing.halfedge_loops import (
    CREASE,
    MAX_VALENCE,
    SMOOTH,
    after,
    before,
    can_collapse,
    can_flip,
    collapse,
    flip,
    split,
)
from o3dleaf.surface.remeshing.score_loops import (
    NOTHING,
    between_lines,
    cosine,
    is_near,
    keeps_shape,
    score_fan,
    score_triangle,
    triangle_roundness,
    turn,
    turn_beyond,
)
from o3dleaf.surface.remeshing.shape_loops import normal_of, roundness, square


@njit(nogil=True, cache=True)
def try_collapse(mesh, label, place, h, limits, around, halves, normals):
    """Collapse half-edge h where that is allowed and leaves better triangles; say whether it was done."""
    count = can_collapse(mesh, h, around, halves)
    if count == 0:
        return False
    v, w = mesh.origin[h], mesh.origin[after(h)]
    worst = score_fan(mesh, place, around, count, place[v], NOTHING, normals[0])
    least = score_fan(mesh, place, around, count, place[w], w, normals[1])
    if least < limits.quality and least <= worst:
        return False
    if not keeps_shape(mesh, label, place, around, count, place[w], w, normals[0], normals[1], limits):
        return False
    if not is_near(mesh, place, h, around, count, limits.deviation):
        return False
    collapse(mesh, h, around, count)
    return True


@njit(nogil=True, cache=True)
def try_flip(mesh, place, h, limits, halves):
    """Flip the edge of half-edge h where that is allowed and leaves better triangles; say whether it was done."""
    origin, twin = mesh.origin, mesh.twin
    if not can_flip(mesh, h, halves):
        return False
    g = twin[h]
    bc, ca, ad, db = after(h), before(h), after(g), before(g)
    a, b, c, d = place[origin[h]], place[origin[g]], place[origin[ca]], place[origin[db]]
    if square(c, d) > limits.longest * limits.longest:
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
    most = min(limits.min_cosine, cosine(old[0], total), cosine(old[1], total))
    if min(cosine(new[0], total), cosine(new[1], total)) < most or between_lines(a, b, c, d) > limits.deviation:
        return False
    flip(mesh, h)
    return True


@njit(nogil=True, cache=True)
def collapse_short(mesh, label, place, order, limits):
    """Collapse the half-edges in `order` that are shorter than the shortest allowed; return how many."""
    origin = mesh.origin
    around, halves = np.empty(MAX_VALENCE, dtype=np.int64), np.empty(MAX_VALENCE, dtype=np.int64)
    normals, done = np.empty((2, MAX_VALENCE, 3)), 0
    for h in order:
        if origin[h] != -1 and square(place[origin[h]], place[origin[after(h)]]) < limits.shortest * limits.shortest:
            done += try_collapse(mesh, label, place, h, limits, around, halves, normals)
    return done


@njit(nogil=True, cache=True)
def flip_edges(mesh, place, limits, sweeps):
    """Flip edges until no flip makes the worse of two triangles better; return how many."""
    halves, done = np.empty(MAX_VALENCE, dtype=np.int64), 0
    for _ in range(sweeps):
        fresh = 0
        for h in range(len(mesh.origin)):
            if mesh.origin[h] != -1 and mesh.twin[h] > h:
                fresh += try_flip(mesh, place, h, limits, halves)
        done += fresh
        if fresh == 0:
            break
    return done


@njit(nogil=True, cache=True)
def improve_slivers(mesh, label, place, limits, sweeps):
    """Flip or collapse an edge of every triangle below the quality threshold, where that is better; return how many."""
    origin = mesh.origin
    around, halves = np.empty(MAX_VALENCE, dtype=np.int64), np.empty(MAX_VALENCE, dtype=np.int64)
    normals, normal, done = np.empty((2, MAX_VALENCE, 3)), np.empty(3), 0
    for _ in range(sweeps):
        fresh = 0
        for t in range(len(label)):
            for edit in range(9):
                h = 3 * t + edit % 3
                if origin[h] == -1 or score_triangle(mesh, place, t, normal) >= limits.quality:
                    break
                if edit < 3:
                    fresh += try_flip(mesh, place, h, limits, halves)
                    continue
                if edit >= 6:
                    h = mesh.twin[h]
                if h != -1:
                    fresh += try_collapse(mesh, label, place, h, limits, around, halves, normals)
        done += fresh
        if fresh == 0:
            break
    return done


@njit(nogil=True, cache=True)
def mark_long(mesh, place, longest, halves):
    """Write the half-edges, one of each edge, that are longer than `longest` and the longest of both triangles."""
    origin, twin = mesh.origin, mesh.twin
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
    origin, twin, crease, kind = mesh.origin, mesh.twin, mesh.crease, mesh.kind
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
                kept = kept and cosine(new, old[side]) >= limits.min_cosine
        if not kept or (least < limits.quality and least < 0.5 * worst):
            continue
        for axis in range(3):
            place[vertex, axis] = points[n, axis]
        kind[vertex] = CREASE if crease[h] else SMOOTH
        label[triangle], label[triangle + 1] = label[h // 3], label[g // 3]
        split(mesh, h, vertex, triangle)
        halves[done] = n
        done += 1
    return done
