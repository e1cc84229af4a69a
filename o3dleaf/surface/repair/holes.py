"""Holes closed between their own vertices, where that makes no new defect."""

from dataclasses import replace

import numpy as np

from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes, label_triangles
from o3dleaf.surface.repair.editable_mesh import NEW, EditableMesh
from o3dleaf.surface.repair.flips import flip_edges, folded_edges
from o3dleaf.surface.repair.meshlab import cut_ears
from o3dleaf.surface.repair.repairs import drop_repeated, split_fans


def close_holes(mesh: EditableMesh, largest: float, height: float, angle: float) -> EditableMesh:
    """Close the holes with a perimeter up to `largest`, but for those where that would make a defect.

    A crack between an edge and the vertices that stand on it is closed by flat triangles, which are
    flipped away, with the surface beside them if need be; `height` and `angle` are those of `flip_edges`.
    """
    new = _fill(mesh, largest)
    if not len(new):
        return mesh
    fill = drop_repeated(EditableMesh(mesh.vertices, new, mesh.vertex_origin, np.full(len(new), NEW)))
    # Three vertices in one line make MeshLab's ears flat.
    fill = flip_edges(fill, 0.0, angle)
    origin = np.concatenate([mesh.triangle_origin, fill.triangle_origin])
    filled = replace(mesh, triangles=np.concatenate([mesh.triangles, fill.triangles]), triangle_origin=origin)
    flipped, old = flip_edges(filled, height, angle), len(mesh.triangles)
    changed = (flipped.triangles != filled.triangles).any(axis=1)
    changed[old:] = True
    if not _is_defective(flipped, angle)[changed].any():
        return flipped
    patch = label_triangles(fill.triangles)
    spoilt = np.bincount(patch, weights=_is_defective(filled, angle)[old:]) > 0
    return filled.only(np.append(np.ones(old, dtype=bool), ~spoilt[patch]))


def _fill(mesh: EditableMesh, largest: float) -> IntArray:
    """Return triangles in the holes with a perimeter up to `largest`."""
    # MeshLab needs fans that are apart; where two holes touch in a vertex, they are then one, and so are its
    # triangles between the copies of that vertex, which vanish as these become one again.
    triangles, source = split_fans(mesh.triangles, len(mesh.vertices))
    vertices, edges = mesh.vertices[source], EdgeTable.of(triangles)
    holes = find_holes(vertices, triangles, edges)
    small = ~holes.is_rim & (holes.perimeter <= largest)
    if not small.any():
        return np.empty((0, 3), dtype=np.int64)
    beside = np.zeros(len(triangles), dtype=bool)
    beside[edges.triangles_of(holes.edges[small[holes.of_edge]])] = True
    return source[cut_ears(vertices, triangles, beside, int(np.bincount(holes.of_edge)[small].max()))]


def _is_defective(mesh: EditableMesh, angle: float) -> BoolArray:
    """Return which triangles have any defect that `clean_mesh` counts and does not repair afterwards."""
    edges = EdgeTable.of(mesh.triangles)
    bad_edge = (edges.count > 2) | edges.inconsistent | folded_edges(mesh.vertices, edges, angle)
    bad = find_crossings(mesh.vertices, mesh.triangles) | mesh.heights()[2]
    return np.asarray(bad | bad_edge[edges.of_half.reshape(-1, 3)].any(axis=1))
