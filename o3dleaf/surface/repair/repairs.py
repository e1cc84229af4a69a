"""Repairs that move no vertex: what is there twice, flat, non-manifold, small or turned the wrong way."""

from dataclasses import replace

import numpy as np

from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.topology import EdgeTable, find_flipped, label_fans, label_nodes, label_triangles
from o3dleaf.surface.repair.editable_mesh import Draft


def weld(draft: Draft) -> Draft:
    """Join vertices in one place, to the bit, to the first of them."""
    order = np.lexsort(draft.vertices.T[::-1])
    ahead = np.append(True, (np.diff(draft.vertices[order], axis=0) != 0).any(axis=1))
    target = np.empty(len(order), dtype=np.int64)
    # lexsort is stable: the first of each group is the one with the smallest number.
    target[order] = order[ahead][np.cumsum(ahead) - 1]
    return draft.joined(target).compact()


def drop_repeated(draft: Draft) -> Draft:
    """Remove triangles with a corner twice, and those on the same three vertices as one before."""
    corners = np.sort(draft.triangles, axis=1)
    draft = draft.only((corners[:, 1:] != corners[:, :-1]).all(axis=1))
    return draft.only(~EdgeTable.of(draft.triangles).duplicates())


def drop_flat(draft: Draft) -> Draft:
    """Remove triangles without an area."""
    return draft.only(~draft.heights()[2])


def thin_edges(draft: Draft) -> Draft:
    """Take triangles away until every edge has at most two.

    First those of the smaller patch (joined across edges of two triangles), by area, then the smaller
    ones: a fin goes before what it stands on.
    """
    edges = EdgeTable.of(draft.triangles)
    heavy = edges.count > 2
    if not heavy.any():
        return draft
    area, of_triangle = triangle_areas(draft.vertices, draft.triangles), edges.of_half.reshape(-1, 3)
    pairs = edges.order[edges.first(np.flatnonzero(edges.count == 2))[:, np.newaxis] + [0, 1]] // 3
    patch = label_nodes(pairs[:, 0].astype(np.int64), pairs[:, 1].astype(np.int64), len(area))
    involved = np.flatnonzero(heavy[of_triangle].any(axis=1))
    size = np.bincount(patch, weights=area)[patch[involved]]
    left, keep = edges.count.copy(), np.ones(len(area), dtype=bool)
    for triangle in involved[np.lexsort((area[involved], size))].tolist():
        mine = of_triangle[triangle]
        if (left[mine] > 2).any():
            keep[triangle] = False
            left[mine] -= 1
    return draft.only(keep)


def split_bowties(draft: Draft) -> Draft:
    """Give every fan of triangles a vertex of its own, in the same place; the first fan keeps the old one."""
    triangles, source = split_fans(draft.triangles, len(draft.vertices))
    if len(source) == len(draft.vertices):
        return draft
    return Draft(draft.vertices[source], triangles, draft.vertex_origin[source], draft.triangle_origin)


def split_fans(triangles: IntArray, vertices: int) -> tuple[IntArray, IntArray]:
    """Return triangles of which no two fans share a vertex, and the old vertex of each of theirs."""
    fans = label_fans(triangles).ravel()
    label, first = np.unique(fans, return_index=True)
    vertex = triangles.ravel()[first]
    order = np.lexsort((label, vertex))
    again = np.zeros(len(label), dtype=bool)
    again[order[1:]] = vertex[order[1:]] == vertex[order[:-1]]
    number = np.where(again, vertices + np.cumsum(again) - 1, vertex)
    return number[np.searchsorted(label, fans)].reshape(-1, 3), np.append(np.arange(vertices), vertex[again])


def turn_flipped(draft: Draft) -> Draft:
    """Turn the triangles that run against the larger part, by area, of their patch; a Möbius strip stays as it is."""
    area = triangle_areas(draft.vertices, draft.triangles)
    flipped = find_flipped(EdgeTable.of(draft.triangles), area)[0]
    turned = np.where(flipped[:, np.newaxis], draft.triangles[:, ::-1], draft.triangles)
    return replace(draft, triangles=turned) if flipped.any() else draft


def drop_small(draft: Draft, diameter: float, area: float, triangles: int) -> Draft:
    """Remove the edge-connected pieces below a diagonal of the bounding box, an area, or a number of triangles."""
    piece = label_triangles(draft.triangles)
    order = np.argsort(piece, kind="stable")
    start = np.flatnonzero(np.diff(piece[order], prepend=-1))
    corners = draft.vertices[draft.triangles[order]]
    lower, upper = np.minimum.reduceat(corners.min(axis=1), start), np.maximum.reduceat(corners.max(axis=1), start)
    small = np.linalg.norm(upper - lower, axis=1) < diameter
    small |= np.bincount(piece, weights=triangle_areas(draft.vertices, draft.triangles)) < area
    small |= np.bincount(piece) < triangles
    return draft.only(~small[piece])


def drop_crossing(draft: Draft) -> Draft:
    """Remove the triangles that cross others."""
    return draft.only(~find_crossings(draft.vertices, draft.triangles))
