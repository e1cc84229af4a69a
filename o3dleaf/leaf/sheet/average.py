"""Points averaged across their surface, so that passes of a scanner that disagree become one sheet."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.average_loops import project_onto_planes, thin_cells
from o3dleaf.surface.cloud.cells import Cells

ROUNDS = 3
"""Times that all points are moved: two sheets come together by about half their distance each time."""
BLOCK = 64


def average_across(
    points: FloatArray, width: FloatArray, least: float, planes: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return points (n, 3) moved across their surface onto it, as seen at a width, and its normals there (n, 3).

    Each point is projected onto the plane through its neighbors, those at distance r weighted by (1 - r²/R²)² with
    R twice the width, and all of them again; along the surface no point moves, so that margins and tips stay.

    Parameters
    ----------
    points : (n, 3) ndarray
    width : (n,) ndarray
        Over which each point is averaged; where it is 0 the point stays.
    least : float
        Width that is averaged over at least, and normals are found over.
    planes : (n,) ndarray, optional
        Width that the normals are found over at least, where points are farther apart in places.
    """
    radius, moves = 2 * np.maximum(width, least), width > 0
    for _ in range(ROUNDS if moves.any() else 0):
        points, _ = _project(points, radius, moves)
    wide = radius if planes is None else np.maximum(radius, 2 * planes)
    return points, _known(points, _project(points, wide, np.zeros(len(points), bool))[1], wide)


def _known(points: FloatArray, normals: FloatArray, wide: FloatArray) -> FloatArray:
    """Return normals (n, 3), that of the nearest plane where fewer than three points are in reach (n,): as at a tip.

    Through two points there are many planes, of which a rounding would choose one.
    """
    tree = cKDTree(points)
    of_few = query(tree, points, k=[3])[0][:, 0] >= wide
    if not of_few.any() or of_few.all():
        return normals
    known = np.flatnonzero(~of_few)
    normals[of_few] = normals[known[query(cKDTree(points[known]), points[of_few])[1]]]
    return normals


def _project(points: FloatArray, radius: FloatArray, moves: BoolArray) -> tuple[FloatArray, FloatArray]:
    cells = Cells.sort(points, float(radius.max()))
    order = cells.order
    sorted_points, sorted_radius, sorted_moves = np.ascontiguousarray(points[order]), radius[order], moves[order]
    moved, normal = np.empty_like(points), np.empty_like(points)
    lists = cells.number, cells.first, cells.last, cells.shape

    def task(start: int, stop: int) -> None:
        project_onto_planes(sorted_points, sorted_radius, sorted_moves, *lists, start, stop, moved, normal)

    run_blocks(task, len(cells.number), BLOCK)
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return moved[back], normal[back]


def thin(points: FloatArray, distance: FloatArray) -> IntArray:
    """Return the rows, rising, of points of which none lies nearer to an earlier one than its own `distance` (n,)."""
    cells = Cells.sort(points, float(distance.max()))
    kept = np.zeros(len(points), bool)
    order = cells.order
    thin_cells(points[order], distance[order], order, cells.number, cells.first, cells.last, cells.shape, kept)
    return np.flatnonzero(kept)
