"""Repairs that move no vertex: of duplicate, flat, non-manifold, small, crossing or flipped triangles."""

from dataclasses import replace

import numpy as np

from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.topology import EdgeTable, find_flipped, label_fans, label_nodes, label_triangles
from o3dleaf.surface.repair.editable_mesh import EditableMesh


def weld(mesh: EditableMesh) -> EditableMesh:
    """Join vertices in one place, to the bit, to the first of them."""
    order = np.lexsort(mesh.vertices.T[::-1])
    ahead = np.append(True, (np.diff(mesh.vertices[order], axis=0) != 0).any(axis=1))
    target = np.empty(len(order), dtype=np.int64)
    # lexsort is stable: the first of each group is the one with the smallest number.
    target[order] = order[ahead][np.cumsum(ahead) - 1]
    return mesh.joined(target).compact()


def drop_repeated(mesh: EditableMesh) -> EditableMesh:
    """Remove triangles with a corner twice, and those on the same three vertices as one before."""
    corners = np.sort(mesh.triangles, axis=1)
    mesh = mesh.only((corners[:, 1:] != corners[:, :-1]).all(axis=1))
    return mesh.only(~EdgeTable.of(mesh.triangles).duplicates())


def drop_flat(mesh: EditableMesh) -> EditableMesh:
    """Remove triangles without an area."""
    return mesh.only(~mesh.heights()[2])


def thin_edges(mesh: EditableMesh) -> EditableMesh:
    """Take triangles away until every edge has at most two.

    First those of the smaller patch (joined across edges of two triangles), by area, then the smaller
    ones: a fin goes before what it stands on.
    """
    edges = EdgeTable.of(mesh.triangles)
    nonmanifold = edges.count > 2
    if not nonmanifold.any():
        return mesh
    area, of_triangle = triangle_areas(mesh.vertices, mesh.triangles), edges.of_half.reshape(-1, 3)
    pairs = edges.order[edges.first(np.flatnonzero(edges.count == 2))[:, np.newaxis] + [0, 1]] // 3
    patch = label_nodes(pairs[:, 0].astype(np.int64), pairs[:, 1].astype(np.int64), len(area))
    involved = np.flatnonzero(nonmanifold[of_triangle].any(axis=1))
    size = np.bincount(patch, weights=area)[patch[involved]]
    left, keep = edges.count.copy(), np.ones(len(area), dtype=bool)
    for triangle in involved[np.lexsort((area[involved], size))].tolist():
        mine = of_triangle[triangle]
        if (left[mine] > 2).any():
            keep[triangle] = False
            left[mine] -= 1
    return mesh.only(keep)


def split_bowties(mesh: EditableMesh) -> EditableMesh:
    """Give every fan of triangles a vertex of its own, in the same place; the first fan keeps the old one."""
    triangles, source = split_fans(mesh.triangles, len(mesh.vertices))
    if len(source) == len(mesh.vertices):
        return mesh
    return EditableMesh(mesh.vertices[source], triangles, mesh.vertex_origin[source], mesh.triangle_origin)


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


def turn_flipped(mesh: EditableMesh) -> EditableMesh:
    """Turn the triangles that run against the larger part, by area, of their patch; a Möbius strip stays as it is."""
    area = triangle_areas(mesh.vertices, mesh.triangles)
    flipped = find_flipped(EdgeTable.of(mesh.triangles), area)[0]
    turned = np.where(flipped[:, np.newaxis], mesh.triangles[:, ::-1], mesh.triangles)
    return replace(mesh, triangles=turned) if flipped.any() else mesh


def drop_small(mesh: EditableMesh, diameter: float, area: float, triangles: int) -> EditableMesh:
    """Remove the edge-connected pieces below a diagonal of the bounding box, an area, or a number of triangles."""
    piece = label_triangles(mesh.triangles)
    order = np.argsort(piece, kind="stable")
    start = np.flatnonzero(np.diff(piece[order], prepend=-1))
    corners = mesh.vertices[mesh.triangles[order]]
    lower, upper = np.minimum.reduceat(corners.min(axis=1), start), np.maximum.reduceat(corners.max(axis=1), start)
    small = np.linalg.norm(upper - lower, axis=1) < diameter
    small |= np.bincount(piece, weights=triangle_areas(mesh.vertices, mesh.triangles)) < area
    small |= np.bincount(piece) < triangles
    return mesh.only(~small[piece])


def drop_crossing(mesh: EditableMesh) -> EditableMesh:
    """Remove the triangles that cross others."""
    return mesh.only(~find_crossings(mesh.vertices, mesh.triangles))
