"""Triangles between points of a sheet: the Delaunay stars in tangent planes, as far as they fit together."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.sheet.star_loops import MAX_STAR, choose_triangles, find_stars
from o3dleaf.surface.cloud.cells import Cells

SLOPE = np.sin(np.radians(45.0))
"""Sine of the angle that a neighbor may lie off the tangent planes: a curl of a radius of one edge has 30°."""
STEEP = 0.4
"""Least cosine between the normals of a triangle and of its corners."""
BLOCK = 16


def triangulate(
    points: FloatArray, normals: FloatArray, reach: FloatArray, slope: FloatArray | float = SLOPE
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return triangles (m, 3) between points (n, 3), in how many stars of their corners each is, and circumradii (m,).

    Around each point the neighbors are laid into its tangent plane, where the Delaunay triangles form its star. Those
    that are in the stars of all three corners fit together by themselves; others fill in where they overlap none.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
        Normals of either sign.
    reach : (n,) ndarray
        Largest circumradius of the triangles at each point.
    slope : float or (n,) ndarray
        Sine of the angle that neighbors may lie off the tangent plane.

    References
    ----------
    Gopi, Krishnan and Silva (2000), Surface reconstruction based on lower dimensional localized Delaunay triangulation.
    """
    corners, radius = _stars(points, normals, reach, np.broadcast_to(slope, len(points)))
    center, slot = np.nonzero(corners[:, :, 0] >= 0)
    made = np.sort(np.column_stack([center, corners[center, slot]]), axis=1)
    n = np.int64(len(points))
    key, first, votes = np.unique((made[:, 0] * n + made[:, 1]) * n + made[:, 2], return_index=True, return_counts=True)
    circumradius = np.zeros(len(key))
    np.maximum.at(
        circumradius, np.searchsorted(key, (made[:, 0] * n + made[:, 1]) * n + made[:, 2]), radius[center, slot]
    )
    triangles = made[first]
    order = np.lexsort((circumradius, -votes))
    triangles, votes, circumradius = triangles[order], votes[order], circumradius[order]
    chosen = np.empty(len(triangles), bool)
    choose_triangles(points, normals, triangles, STEEP, chosen)
    return triangles[chosen], votes[chosen], circumradius[chosen]


def _stars(
    points: FloatArray, normals: FloatArray, reach: FloatArray, slope: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the other corners (n, 24, 2) of the triangles of each point's star, -1 for none, and circumradii."""
    cells = Cells.sort(points, 2 * float(reach.max()))
    order = cells.order
    sorted_points, sorted_normals = np.ascontiguousarray(points[order]), np.ascontiguousarray(normals[order])
    sorted_reach, sorted_slope, lists = reach[order], slope[order], (cells.number, cells.first, cells.last, cells.shape)
    corners, radius = np.empty((len(points), MAX_STAR, 2), np.int64), np.zeros((len(points), MAX_STAR))

    def task(start: int, stop: int) -> None:
        find_stars(sorted_points, sorted_normals, sorted_reach, sorted_slope, *lists, start, stop, corners, radius)

    run_blocks(task, len(cells.number), BLOCK)
    named, back = np.where(corners >= 0, order[corners], -1), np.empty_like(order)
    back[order] = np.arange(len(order))
    return named[back], radius[back]
