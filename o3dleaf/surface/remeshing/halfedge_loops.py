"""A triangle mesh that can be edited in place: half-edges, the fan around a vertex, and the three edits.

Half-edge 3 t + c runs from corner c of triangle t to the next corner. Every vertex of the border is locked, so that
all others have a closed fan. The edits are those of Hoppe et al. 1993 (Mesh optimization): collapse, swap, split.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit

SMOOTH, CREASE, LOCKED = 0, 1, 2
MAX_VALENCE = 48
"""Triangles around a vertex that edits look at; where there would be more they are refused."""


class HalfEdges(NamedTuple):
    """A mesh of n vertices and m triangles that can be edited in place.

    Attributes
    ----------
    origin : (3 m,) ndarray of int64
        Vertex that a half-edge runs from; −1 if its triangle is gone.
    twin : (3 m,) ndarray of int64
        The half-edge that runs the other way; −1 on the border.
    crease : (3 m,) ndarray of bool
        Whether the edge is one that is not to be smoothed away; the same for both twins.
    outgoing : (n,) ndarray of int64
        Some half-edge from each vertex; −1 if the vertex is gone.
    kind : (n,) ndarray of uint8
        SMOOTH, CREASE or LOCKED.
    """

    origin: npt.NDArray[np.int64]
    twin: npt.NDArray[np.int64]
    crease: npt.NDArray[np.bool_]
    outgoing: npt.NDArray[np.int64]
    kind: npt.NDArray[np.uint8]


@njit(nogil=True, cache=True)
def after(h):
    """Return the next half-edge in the triangle."""
    return h - 2 if h % 3 == 2 else h + 1


@njit(nogil=True, cache=True)
def before(h):
    """Return the half-edge before in the triangle."""
    return h + 2 if h % 3 == 0 else h - 1


@njit(nogil=True, cache=True)
def fan(mesh, vertex, halves):
    """Write the half-edges out of a vertex with a closed fan, counter-clockwise; return how many, 0 if too many."""
    twin, outgoing = mesh.twin, mesh.outgoing
    h, count = outgoing[vertex], 0
    while count < len(halves):
        halves[count] = h
        count += 1
        h = twin[before(h)]
        if h == outgoing[vertex]:
            return count
    return 0


@njit(nogil=True, cache=True)
def may_touch(mesh, first, second, halves):
    """Say whether an edge joins two vertices; of two locked ones nobody knows what lies outside: then yes."""
    origin, kind = mesh.origin, mesh.kind
    if kind[first] == LOCKED:
        first, second = second, first
    if kind[first] == LOCKED:
        return True
    count = fan(mesh, first, halves)
    for n in range(count):
        if origin[after(halves[n])] == second:
            return True
    return count == 0


@njit(nogil=True, cache=True)
def can_collapse(mesh, h, around, halves):
    """Say whether the origin v of half-edge h may be drawn along it to its end w, and how many triangles v has.

    The link condition (Dey et al. 1999): v and w have no neighbour in common but the two opposite corners. A vertex on
    a crease may only go along it. `around` is filled with the fan of v.
    """
    origin, twin, crease, kind = mesh.origin, mesh.twin, mesh.crease, mesh.kind
    v, w = origin[h], origin[after(h)]
    if kind[v] == LOCKED or (kind[v] == CREASE and not crease[h]):
        return 0
    g = twin[h]
    if g == -1:
        return 0
    # Edges that fall together may be one crease, not two.
    if (crease[before(h)] and crease[after(h)]) or (crease[after(g)] and crease[before(g)]):
        return 0
    a, b = origin[before(h)], origin[before(g)]
    count = fan(mesh, v, around) if a != b else 0
    for k in range(count):
        other = origin[after(around[k])]
        if other not in (w, a, b) and may_touch(mesh, other, w, halves):
            return 0
    # A tetrahedron would become one triangle and its back.
    beyond = twin[after(h)]
    if count == 3 and beyond != -1 and beyond // 3 == twin[before(g)] // 3:
        return 0
    return count


@njit(nogil=True, cache=True)
def join(mesh, h, gone):
    """Make twins of half-edge h and what lies beyond half-edge `gone`, whose triangle is going."""
    twin, crease = mesh.twin, mesh.crease
    g = twin[gone]
    twin[h], crease[h] = g, crease[h] or crease[gone]
    if g != -1:
        twin[g], crease[g] = h, crease[h]


@njit(nogil=True, cache=True)
def collapse(mesh, h, around, count):
    """Draw the origin of half-edge h to its end; `around` is its fan, as `can_collapse` found it."""
    origin, twin, outgoing = mesh.origin, mesh.twin, mesh.outgoing
    g = twin[h]
    v, w, a, b = origin[h], origin[g], origin[before(h)], origin[before(g)]
    for k in range(count):
        origin[around[k]] = w
    wa, bw = twin[before(h)], twin[after(g)]
    join(mesh, wa, after(h))
    join(mesh, bw, before(g))
    outgoing[w], outgoing[a], outgoing[b], outgoing[v] = wa, after(wa), bw, -1
    for half in (h, g):
        first = half - half % 3
        for k in range(first, first + 3):
            origin[k] = -1


@njit(nogil=True, cache=True)
def can_flip(mesh, h, halves):
    """Say whether the edge of half-edge h may be swapped for that between the opposite corners."""
    origin, twin, crease, kind = mesh.origin, mesh.twin, mesh.crease, mesh.kind
    g = twin[h]
    if g == -1 or crease[h]:
        return False
    c, d = origin[before(h)], origin[before(g)]
    if c == d or may_touch(mesh, c, d, halves):
        return False
    for half in (h, g):
        vertex = origin[half]
        if kind[vertex] != LOCKED and fan(mesh, vertex, halves) <= 3:
            return False
    return True


@njit(nogil=True, cache=True)
def attach(mesh, h, vertex, g, sharp):
    """Make half-edge h run from a vertex, with twin g."""
    origin, twin, crease, outgoing = mesh.origin, mesh.twin, mesh.crease, mesh.outgoing
    origin[h], twin[h], crease[h] = vertex, g, sharp
    outgoing[vertex] = h
    if g != -1:
        twin[g] = h


@njit(nogil=True, cache=True)
def flip(mesh, h):
    """Swap the edge ab of half-edge h, with triangles abc and bad, for dc: triangles adc and dbc."""
    origin, twin, crease = mesh.origin, mesh.twin, mesh.crease
    g = twin[h]
    n, p, gn, gp = after(h), before(h), after(g), before(g)
    a, b, c, d = origin[h], origin[g], origin[p], origin[gp]
    bc, ca, ad, db = twin[n], twin[p], twin[gn], twin[gp]
    sharp_bc, sharp_ca, sharp_ad, sharp_db = crease[n], crease[p], crease[gn], crease[gp]
    attach(mesh, h, a, ad, sharp_ad)
    attach(mesh, n, d, gp, False)
    attach(mesh, p, c, ca, sharp_ca)
    attach(mesh, g, d, db, sharp_db)
    attach(mesh, gn, b, bc, sharp_bc)
    attach(mesh, gp, c, n, False)


@njit(nogil=True, cache=True)
def split(mesh, h, vertex, first):
    """Put a vertex on the edge ab of half-edge h: abc, bad become avc, bvd and vbc, vad, the triangles from `first`."""
    origin, twin, crease = mesh.origin, mesh.twin, mesh.crease
    g, sharp = twin[h], crease[h]
    n, gn = after(h), after(g)
    a, b, c, d = origin[h], origin[g], origin[before(h)], origin[before(g)]
    bc, ad, sharp_bc, sharp_ad = twin[n], twin[gn], crease[n], crease[gn]
    vb, va = 3 * first, 3 * first + 3
    attach(mesh, vb + 1, b, bc, sharp_bc)
    attach(mesh, vb + 2, c, n, False)
    attach(mesh, va + 1, a, ad, sharp_ad)
    attach(mesh, va + 2, d, gn, False)
    attach(mesh, n, vertex, vb + 2, False)
    attach(mesh, gn, vertex, va + 2, False)
    attach(mesh, h, a, va, sharp)
    attach(mesh, va, vertex, h, sharp)
    attach(mesh, g, b, vb, sharp)
    attach(mesh, vb, vertex, g, sharp)


@njit(nogil=True, cache=True)
def link_twins(triangles, order, origin, twin):
    """Fill the half-edges of (m, 3) triangles, `order` sorting them by smaller, then larger end.

    Returns False where an edge has three triangles, or two that run along it in one direction.
    """
    for h in range(len(origin)):
        origin[h], twin[h] = triangles[h // 3, h % 3], -1
    k = 0
    while k < len(order):
        h, stop = order[k], k + 1
        u, v = origin[h], origin[after(h)]
        while stop < len(order):
            p, q = origin[order[stop]], origin[after(order[stop])]
            if not ((p == u and q == v) or (p == v and q == u)):
                break
            stop += 1
        if stop - k > 2 or (stop - k == 2 and origin[order[k + 1]] == u):
            return False
        if stop - k == 2:
            twin[h], twin[order[k + 1]] = order[k + 1], h
        k = stop
    return True
