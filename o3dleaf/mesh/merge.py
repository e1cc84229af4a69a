"""Vertices nearer to each other than a tolerance are joined, where that breaks nothing."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.checks import FloatArray
from o3dleaf.mesh.arrays import BoolArray, IntArray
from o3dleaf.mesh.draft import Draft
from o3dleaf.mesh.flips import folded_edges
from o3dleaf.mesh.repair import FindCrossings, drop_repeated
from o3dleaf.mesh.topology import EdgeTable


def merge_close(draft: Draft, distance: float, angle: float, crossings: FindCrossings) -> Draft:
    """Join each vertex to one before it that is at most `distance` away, if there is one that stays itself.

    So nothing moves by more than `distance`, however long a chain of close vertices is. Merges are
    undone where they would make a triangle cross another one, fold over (meet its neighbour at less
    than `angle`, in degrees), or stand on an edge of three.
    """
    target = _targets(draft.vertices, distance)
    broken = _broken(draft, angle, crossings)
    while True:
        moved = target != np.arange(len(target))
        if not moved.any():
            return draft
        merged = draft.joined(target)
        tidy = drop_repeated(merged)
        worse = np.zeros(len(broken), dtype=bool)
        at = np.searchsorted(draft.triangle_origin, tidy.triangle_origin)
        worse[at] = _broken(tidy, angle, crossings) & ~broken[at]
        if not worse.any():
            return tidy.compact()
        guilty = np.isin(target, merged.triangles[worse]) & moved
        target = np.where(guilty if guilty.any() else moved, np.arange(len(target)), target)


def _targets(vertices: FloatArray, distance: float) -> IntArray:
    """Return for each vertex the first one at most `distance` away that is not joined to another itself."""
    target = np.arange(len(vertices))
    pairs = cKDTree(vertices).query_pairs(distance, output_type="ndarray")
    for first, second in pairs[np.lexsort(pairs.T[::-1])].tolist():
        if target[first] == first and target[second] == second:
            target[second] = first
    return target


def _broken(draft: Draft, angle: float, crossings: FindCrossings) -> BoolArray:
    """Return which triangles cross others, are folded over, or stand on an edge of three or more."""
    edges = EdgeTable.of(draft.triangles)
    bad = folded_edges(draft.vertices, edges, angle) | (edges.count > 2)
    return np.asarray(crossings(draft.vertices, draft.triangles) | bad[edges.of_half.reshape(-1, 3)].any(axis=1))
