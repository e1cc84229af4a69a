"""The compiled loops that glue triangles along their edges into surfaces without handles."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.cloud.parity_loops import join


@njit(nogil=True, cache=True)
def orient_triangles(pair, turned, order, parent, sign, in_tree):
    """Join triangles over pairs of half-edges (e, 2) in some order; write signs (m,) and which pairs joined.

    `turned` (e,) says whether the two half-edges run the same way: then one of the triangles is to be turned over.
    """
    for k in order:
        one, other = pair[k, 0] // 3, pair[k, 1] // 3
        in_tree[k] = join(parent, sign, one, other, np.int8(-1 if turned[k] else 1))


@njit(nogil=True, cache=True)
def next_on_rim(half, opposite):
    """Return the half-edge without an opposite that follows `half` along the rim."""
    h = half - 2 if half % 3 == 2 else half + 1
    while opposite[h] >= 0:
        h = opposite[h]
        h = h - 2 if h % 3 == 2 else h + 1
    return h


@njit(nogil=True, cache=True)
def previous_on_rim(half, opposite):
    """Return the half-edge without an opposite that precedes `half` along the rim."""
    h = half + 2 if half % 3 == 0 else half - 1
    while opposite[h] >= 0:
        h = opposite[h]
        h = h + 2 if h % 3 == 0 else h - 1
    return h


@njit(nogil=True, cache=True)
def zip_from(half, mate, opposite, stack):
    """Glue a half-edge to its mate where they meet in a vertex, then those that meet because of that, and so on."""
    stack[0] = half
    top = 1
    while top > 0:
        top -= 1
        h = stack[top]
        m = mate[h]
        if m < 0 or opposite[h] >= 0:
            continue
        for swap in range(2):
            a, b = (h, m) if swap == 0 else (m, h)
            if opposite[a] < 0 and next_on_rim(a, opposite) == b:
                p, q = previous_on_rim(a, opposite), next_on_rim(b, opposite)
                opposite[a], opposite[b] = b, a
                if p not in (a, b) and mate[p] == q:
                    stack[top] = p
                    top += 1
                break


@njit(nogil=True, cache=True)
def glue(pair, order, in_tree, mate, opposite):
    """Write each half-edge's opposite, so that no handle comes about; the first pairs in order are glued first.

    Pairs of the tree join pieces. Two edges that meet on a rim close a vertex; of others those are glued that lie on
    one rim, which becomes two: only to glue two rims of one piece would make a handle, and they stay apart.
    """
    stack = np.empty(len(mate) + 2, np.int64)
    for k in order:
        if in_tree[k]:
            opposite[pair[k, 0]], opposite[pair[k, 1]] = pair[k, 1], pair[k, 0]
    for k in order:
        if mate[pair[k, 0]] >= 0 and opposite[pair[k, 0]] < 0:
            zip_from(pair[k, 0], mate, opposite, stack)
    for k in order:
        h, m = pair[k, 0], pair[k, 1]
        if mate[h] < 0 or opposite[h] >= 0:
            continue
        w = next_on_rim(h, opposite)
        while w not in (h, m):
            w = next_on_rim(w, opposite)
        if w != m:
            continue
        ends = previous_on_rim(h, opposite), next_on_rim(h, opposite)
        opposite[h], opposite[m] = m, h
        for e in ends:
            if opposite[e] < 0 and mate[e] >= 0:
                zip_from(e, mate, opposite, stack)
