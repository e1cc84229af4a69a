"""Vertices nearer to each other than a tolerance are joined, where that makes no defect."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.repair.editable_mesh import EditableMesh
from o3dleaf.surface.repair.flips import folded_edges
from o3dleaf.surface.repair.repairs import drop_repeated, turn_flipped


def merge_close(mesh: EditableMesh, distance: float, angle: float, *, orient: bool) -> EditableMesh:
    """Join each vertex to one before it that is at most `distance` away, if there is one that stays itself.

    So nothing moves by more than `distance`, however long a chain of close vertices is. Merges are
    undone where they would make a triangle cross another one, fold over (meet its neighbor at less
    than `angle`, in degrees), stand on an edge of three, or run against its neighbor; where triangles
    may be turned (`orient`), only if turning does not help.
    """
    turn = turn_flipped if orient else _as_it_is
    rows = replace(mesh, triangle_origin=np.arange(len(mesh.triangles)))
    target = _targets(mesh.vertices, distance)
    before = _faults(rows, turn(rows), angle)
    while True:
        moved = target != np.arange(len(target))
        if not moved.any():
            return mesh
        tidy = drop_repeated(rows.joined(target))
        kept = tidy.triangle_origin
        worse = kept[(_faults(tidy, turn(tidy), angle) & ~before[kept]).any(axis=1)]
        if not len(worse):
            return replace(tidy, triangle_origin=mesh.triangle_origin[kept]).compact()
        guilty = moved & np.isin(target, target[mesh.triangles[worse]])
        target = np.where(guilty if guilty.any() else moved, np.arange(len(target)), target)


def _as_it_is(mesh: EditableMesh) -> EditableMesh:
    """Return a mesh."""
    return mesh


def _targets(vertices: FloatArray, distance: float) -> IntArray:
    """Return for each vertex the first one at most `distance` away that is not joined to another itself."""
    target = np.arange(len(vertices))
    pairs = cKDTree(vertices).query_pairs(distance, output_type="ndarray")
    for first, second in pairs[np.lexsort(pairs.T[::-1])].tolist():
        if target[first] == first and target[second] == second:
            target[second] = first
    return target


def _faults(mesh: EditableMesh, turned: EditableMesh, angle: float) -> BoolArray:
    """Return what is wrong with each triangle: crossing, and of each edge folded, of three, inconsistent; (m, 10).

    Edges are inconsistent if they are so in the `turned` mesh, which has the same edges.
    """
    edges = EdgeTable.of(mesh.triangles)
    wrong = folded_edges(mesh.vertices, edges, angle), edges.count > 2, EdgeTable.of(turned.triangles).inconsistent
    return np.column_stack(
        [find_crossings(mesh.vertices, mesh.triangles), *(kind[edges.of_half.reshape(-1, 3)] for kind in wrong)]
    )
