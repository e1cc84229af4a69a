"""Scores of triangles in a mesh of half-edges, and the conditions on edits: how good, how far, which way they face.

The *score* of triangles, from 0 to 1, is the least of the sines of their smallest angles, and of half (1 + cos) of
the turns between their normals and their neighbours', so that a triangle folded back upon another is as bad as a
sliver. An edit is done where all that it makes has the quality asked for, or is better than the worst of what was
there; `o3dleaf.surface.remeshing.limits` has the limits.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.remeshing.halfedge_loops import CREASE, after, before
from o3dleaf.surface.remeshing.shape_loops import (
    dot,
    normal_of,
    roundness,
    square,
    square_to_segment,
    square_to_triangle,
)

NOTHING = -1
"""No vertex."""


@njit(nogil=True, cache=True)
def triangle_roundness(mesh, place, t, normal):
    """Return the sine of the smallest angle of triangle t, and write its normal."""
    p, q, r = place[mesh.origin[3 * t]], place[mesh.origin[3 * t + 1]], place[mesh.origin[3 * t + 2]]
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
def turn_beyond(mesh, place, normal, rim):
    """Return the turn between a normal and the triangle on the other side of half-edge `rim`; 1 on the border."""
    twin = mesh.twin
    if twin[rim] == -1:
        return 1.0
    outer = np.empty(3)
    triangle_roundness(mesh, place, twin[rim] // 3, outer)
    return turn(normal, outer)


@njit(nogil=True, cache=True)
def score_triangle(mesh, place, t, normal):
    """Return the score of a triangle."""
    least = triangle_roundness(mesh, place, t, normal)
    for rim in range(3 * t, 3 * t + 3):
        least = min(least, turn_beyond(mesh, place, normal, rim))
    return least


@njit(nogil=True, cache=True)
def score_fan(mesh, place, around, count, x, onto, normals):
    """Return the score of a fan whose middle is at x, and write the normals of its triangles.

    The triangles at vertex `onto` count as gone: a collapse joins what lies on both sides of them.
    """
    origin, twin = mesh.origin, mesh.twin
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
    origin = mesh.origin
    longest = limits.longest
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
        if cosine(new[k], total) < min(limits.min_cosine, cosine(old[k], total)):
            return False
    return True


@njit(nogil=True, cache=True)
def is_near(mesh, place, h, around, count, deviation):
    """Say whether the origin of half-edge h lies near the triangles, or the crease, that a collapse along h leaves.

    A spike of a crease, both sides of one triangle, only has to lie near triangles.
    """
    origin, twin, crease, kind = mesh.origin, mesh.twin, mesh.crease, mesh.kind
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
def between_lines(a, b, c, d):
    """Return the distance between the lines ab and cd; 0 where they are parallel."""
    normal, total, length = np.empty(3), 0.0, 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        normal[k] = (b[i] - a[i]) * (d[j] - c[j]) - (b[j] - a[j]) * (d[i] - c[i])
        total += normal[k] * (c[k] - a[k])
        length += normal[k] * normal[k]
    return abs(total) / math.sqrt(length) if length > 1e-300 else 0.0
