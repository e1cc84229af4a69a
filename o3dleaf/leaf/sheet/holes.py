"""Small holes of a sheet, which are none of the leaf but of its triangles, closed; flaps of other sheets cut off."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, UniqueRows, drop_unused_vertices, triangle_areas
from o3dleaf.leaf.sheet.hole_loops import triangulate_hole
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes, label_fans, label_nodes, label_triangles, trace_rings

MAX_EDGES = 48
"""Edges of a hole at most: closing costs their cube."""


def fill_small_holes(vertices: FloatArray, triangles: IntArray, perimeter: float) -> tuple[FloatArray, IntArray]:
    """Return a manifold sheet with its holes up to a perimeter closed by triangles of least area.

    Where a rim passes a place twice the two vertices become one again, and the loops on both sides of it two holes: a
    rim may be pinched without a handle, two of them may not be joined.
    """
    edges = EdgeTable.of(triangles)
    rings = trace_rings(edges, find_holes(vertices, triangles, edges))
    place = UniqueRows.of(vertices).number
    weld, loops = np.arange(len(vertices)), list[list[int]]()
    for ring in range(len(rings)):
        loops += _simple_loops(rings[ring].tolist(), place.tolist(), weld)
    while (weld[weld] != weld).any():
        weld = weld[weld]
    triangles = weld[triangles]
    ends = EdgeTable.of(triangles).ends
    known = {(int(a), int(b)) for a, b in ends}
    rim = int(np.argmax([_length(vertices[loop]) for loop in loops])) if loops else -1
    added = [triangles]
    for number, corners in enumerate(loops):
        loop = weld[corners]
        if number == rim or len(loop) > MAX_EDGES or _length(vertices[loop]) > perimeter:
            continue
        joined = np.array([[(min(a, b), max(a, b)) in known for b in loop.tolist()] for a in loop.tolist()])
        made = np.empty((len(loop) - 2, 3), np.int64)
        if triangulate_hole(np.ascontiguousarray(vertices[loop]), joined, made):
            new = loop[made]  # rims run against the edges of their triangles
            known.update((min(a, b), max(a, b)) for t in new.tolist() for a, b in zip(t, (*t[1:], t[0]), strict=True))
            added.append(new)
    return split_bow_ties(vertices, _turned(np.concatenate(added), len(triangles)))


def _length(corners: FloatArray) -> float:
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum())


def _simple_loops(ring: list[int], place: list[int], weld: IntArray) -> list[list[int]]:
    """Return the loops that a ring of vertices falls into where it passes a place twice, and weld the vertices there.

    The ring is walked once, and what lies between two passes is taken out of it as a loop of its own.
    """
    loops, walk, at = list[list[int]](), list[int](), dict[int, int]()
    for vertex in ring:
        back = at.get(place[vertex])
        if back is None:
            at[place[vertex]] = len(walk)
            walk.append(vertex)
            continue
        weld[vertex] = walk[back]
        loop = walk[back:]
        for gone in loop[1:]:
            del at[place[gone]]
        del walk[back + 1 :]
        loops.append(loop)
    return [loop for loop in [*loops, walk] if len(loop) > 2]


def _turned(triangles: IntArray, old: int) -> IntArray:
    """Return triangles (m, 3) of which those from row `old` on are turned, patch by patch, to run with the others."""
    new = triangles[old:]
    if not len(new):
        return triangles
    directed = set(
        zip(triangles[:old].ravel().tolist(), np.roll(triangles[:old], -1, axis=1).ravel().tolist(), strict=True)
    )
    against = np.array([any(side in directed for side in zip(t, (*t[1:], t[0]), strict=True)) for t in new.tolist()])
    patch = label_triangles(new)
    over = np.bincount(patch, against)[patch] > 0
    return np.concatenate([triangles[:old], np.where(over[:, np.newaxis], new[:, ::-1], new)])


def cut_off_flaps(
    vertices: FloatArray, triangles: IntArray, partner: IntArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return a sheet without the flaps of other sheets that hang on it, and the vertices (k, 3) taken off.

    Parameters
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    partner : (n,) ndarray
        The vertex above or below each in a layer that faces its way, -1 for none. Of two patches that lie over one
        another the one with more than twice the share of vertices on a rim is the flap; the other goes on around it.
    """
    flagged = partner >= 0
    if not flagged.any():
        return vertices, triangles, np.empty((0, 3))
    edges = EdgeTable.of(triangles)
    ends = edges.ends[flagged[edges.ends].all(axis=1)].astype(np.int64)
    patch = label_nodes(np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1]), len(vertices))
    rim = np.zeros(len(vertices), bool)
    rim[edges.ends[edges.count == 1]] = True
    size, on_rim = np.bincount(patch), np.bincount(patch, rim)
    share = on_rim / size - 1e-9 * size  # of two that are as open the smaller one goes
    rows = np.flatnonzero(flagged)
    is_flap = np.zeros(len(vertices), bool)
    is_flap[rows] = share[patch[rows]] > 2 * share[patch[partner[rows]]]
    mostly = np.bincount(patch, is_flap) > 0.5 * size
    gone: BoolArray = flagged & mostly[patch]
    kept = triangles[~gone[triangles].any(axis=1)]
    if not len(kept):
        return vertices, triangles, np.empty((0, 3))
    kept = _largest(vertices, kept)
    held = np.zeros(len(vertices), bool)
    held[kept] = True
    return *split_bow_ties(vertices, kept), vertices[~held]


def _largest(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Return the triangles of the largest edge-connected piece."""
    piece = label_triangles(triangles)
    return np.asarray(triangles[piece == np.bincount(piece, triangle_areas(vertices, triangles)).argmax()])


def split_bow_ties(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a mesh in which every fan of triangles has a vertex of its own."""
    fans = label_fans(triangles)
    source = np.empty(int(fans.max()) + 1, np.int64)
    source[fans.ravel()] = triangles.ravel()
    return drop_unused_vertices(vertices[source], fans)
