"""Vertices moved: to the middle of their triangles, or in small steps away from slivers."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.remeshing.halfedge_loops import CREASE, LOCKED, MAX_VALENCE, after, before, fan
from o3dleaf.surface.remeshing.score_loops import NOTHING, keeps_shape, score_fan, score_triangle
from o3dleaf.surface.remeshing.shape_loops import dot, normal_of, square


@njit(nogil=True, cache=True)
def fill_shifts(mesh, place, share, shifts):
    """Write how far each vertex should move: to the middle of its triangles by area, along the surface; or crease."""
    origin, crease, outgoing, kind = mesh.origin, mesh.crease, mesh.outgoing, mesh.kind
    halves, normal, own, middle = np.empty(MAX_VALENCE, dtype=np.int64), np.empty(3), np.empty(3), np.empty(3)
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
def move_vertices(mesh, label, place, rows, points, limits, moved):
    """Move vertices to points where all triangles stay good enough, or none gets worse; write which were moved.

    What is better but scores less than the floor is not enough: of a fan with a fold anything would be better.
    """
    around, normals = np.empty(MAX_VALENCE, dtype=np.int64), np.empty((2, MAX_VALENCE, 3))
    for n in range(len(rows)):
        moved[n] = False
        count = fan(mesh, rows[n], around)
        if count == 0:
            continue
        worst = score_fan(mesh, place, around, count, place[rows[n]], NOTHING, normals[0])
        least = score_fan(mesh, place, around, count, points[n], NOTHING, normals[1])
        if least < limits.quality and least <= max(worst, limits.floor):
            continue
        if keeps_shape(mesh, label, place, around, count, points[n], NOTHING, normals[0], normals[1], limits):
            moved[n] = True
            for axis in range(3):
                place[rows[n], axis] = points[n, axis]


@njit(nogil=True, cache=True)
def fill_tries(mesh, place, quality, share, rows, shifts):
    """Write ways for the corners of triangles below a quality: a share of each edge out of them; return how many.

    Called with empty arrays it counts.
    """
    origin, crease, outgoing, kind = mesh.origin, mesh.crease, mesh.outgoing, mesh.kind
    halves, normal, count = np.empty(MAX_VALENCE, dtype=np.int64), np.empty(3), 0
    seen = np.zeros(len(outgoing), dtype=np.bool_)
    for t in range(len(origin) // 3):
        if origin[3 * t] == -1 or score_triangle(mesh, place, t, normal) >= quality:
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
