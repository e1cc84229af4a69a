"""Points against a blade: their feet on it, those outside its margin, and how they are spaced over it."""

import numpy as np
import shapely
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.surface.cloud.usable_points import MIN_POINTS, REPEATED

MAX_UNEVENNESS = 3.0
"""Times the mean spacing that the median one is at most: of a scan that lies elsewhere it would be anything."""
NEIGHBORS = 8
"""Points in the disc whose area tells the spacing around a place; their number's median is a third less in it."""


def points_on(blade: Blade, plane: FloatArray) -> FloatArray:
    """Return the points of a blade (n, 3) at (n, 2) places."""
    return blade.lift(np.column_stack([plane, np.zeros(len(plane))]))


def rows_of_piece(blade: Blade, points: FloatArray) -> IntArray:
    """Return the rows of the points that the blade does not know as other pieces' of its scan: all if it knows none."""
    if blade.other_pieces is None:
        return np.arange(len(points))
    tree = cKDTree(blade.other_pieces)
    apart = float(np.median(query(tree, blade.other_pieces, k=[2])[0]))
    rows = np.flatnonzero(query(tree, points)[0] > REPEATED * apart)
    if len(rows) < MIN_POINTS:
        raise InputError(
            f"scan: {len(rows)} of its {len(points):,} points are of the piece that the blade was made of; give the "
            "whole scan, or that piece"
        )
    return rows


def find_feet(
    blade: Blade, points: FloatArray, world: FloatArray, slack: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the (along, across) of points, their signed distances from the blade, and their feet in the world.

    A height along a direction D is that far off along the normal N: times D · N, where the blade is straight. It is no
    nearer than the nearest of the blade's points `world`, less `slack`.
    """
    flat = blade.flatten(points)
    plane = flat[:, :2]
    lifted = blade.lift_with_jacobian(np.column_stack([plane, np.zeros(len(plane))]))
    first, second, direction = (lifted.columns[:, k] for k in range(3))
    cross = np.cross(first, second)
    size = np.linalg.norm(cross, axis=1)
    known = size > 0
    upright = np.ones(len(points))
    upright[known] = np.abs(np.einsum("ni,ni->n", direction[known], cross[known])) / size[known]
    nearest = query(cKDTree(world), points)[0] - slack
    return plane, np.copysign(np.maximum(np.abs(flat[:, 2] * upright), nearest), flat[:, 2]), lifted.world


def find_outside(blade: Blade, plane: FloatArray, slack: float) -> BoolArray:
    """Return which of the (n, 2) places lie beside the blade by more than `slack`."""
    outside = ~blade.outline.contains(plane)
    polygon = blade.outline.polygon
    shapely.prepare(polygon)
    outside[outside] = ~shapely.dwithin(polygon, shapely.points(plane[outside]), slack)
    return outside


def measure_spacing(feet: FloatArray, world: FloatArray, area: FloatArray) -> float:
    """Return 1/√(points per area), the median over a blade with points `world` that stand for an `area` each."""
    count = min(NEIGHBORS, len(feet))
    radius = query(cKDTree(feet), world, k=[count])[0][:, 0]
    order = np.argsort(radius, kind="stable")
    share = np.cumsum(area[order])
    middle = radius[order[np.searchsorted(share, share[-1] / 2)]]
    mean = np.sqrt(share[-1] / len(feet))
    return float(min(middle * np.sqrt(np.pi / (count - 1 / 3)), MAX_UNEVENNESS * mean))
