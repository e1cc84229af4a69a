"""Triangles of a polygon with holes whose edges are those of the polygon, and integrals over it."""

from collections.abc import Callable

import numpy as np
import shapely
from scipy.spatial import Delaunay
from shapely.geometry import Polygon

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray

TRIES = 4
COVERED = 1e-9
"""Part of the polygon's area that its triangles may lack, for rounding."""
CLEAR = 0.55
"""No point of the lattice is nearer to the margin than this share of the longest edge beside it: the circle over an
edge of the margin is empty, so that Delaunay's triangles keep the edge."""
CORNERS = np.array([0.445948490915965, 0.091576213509771])
WEIGHTS = np.array([0.223381589678011, 0.109951743655322])
"""Quadrature of degree 4 with six points on a triangle (Dunavant, 1985), two orbits of three."""


def triangulate(polygon: Polygon, step: float) -> tuple[FloatArray, IntArray]:
    """Return (n, 2) vertices and (m, 3) triangles, counter-clockwise, that cover a polygon with holes exactly.

    Inside is a lattice of equilateral triangles; the margin is divided at `step`, its corners kept.

    Raises
    ------
    ReconstructionError
        If the polygon has parts so narrow that its edges are no edges of Delaunay's triangles.
    """
    rim = step
    for _ in range(TRIES):
        edges = shapely.segmentize(polygon, rim)
        vertices = np.concatenate([shapely.get_coordinates(r)[:-1] for r in (edges.exterior, *edges.interiors)])
        vertices = np.concatenate([vertices, _lattice(polygon, step)])
        triangles = Delaunay(vertices).simplices.astype(np.int64)
        middles = vertices[triangles].mean(axis=1)
        triangles = triangles[shapely.contains_xy(polygon, middles)]
        area = _doubled(vertices, triangles) / 2
        if abs(np.abs(area).sum() - polygon.area) < COVERED * polygon.area:
            flipped = area < 0
            triangles[flipped] = triangles[flipped][:, ::-1]
            used, rows = np.unique(triangles, return_inverse=True)
            return vertices[used], rows.reshape(-1, 3)
        rim /= 4
    raise ReconstructionError(f"the outline is narrower somewhere than {rim:.2g}; give one of wider parts")


def integrate(polygon: Polygon, function: Callable[[FloatArray], FloatArray], step: float) -> float:
    """Return the integral of a function of (n, 2) places over a polygon, by quadrature of degree 4 on triangles."""
    vertices, triangles = triangulate(polygon, step)
    corners, doubled = vertices[triangles], _doubled(vertices, triangles)
    total = 0.0
    for a, weight in zip(CORNERS, WEIGHTS, strict=True):
        for corner in range(3):
            shares = np.full(3, a)
            shares[corner] = 1 - 2 * a
            total += weight * float((doubled / 2 * function(np.einsum("c,mcd->md", shares, corners))).sum())
    return total


def _lattice(polygon: Polygon, step: float) -> FloatArray:
    """Return the points of a lattice of equilateral triangles that are not near the margin of a polygon.

    Those outside keep the margin off the hull, where points on a line would make slivers as long as the leaf.
    """
    inner, outer = polygon.buffer(-CLEAR * step), polygon.buffer(CLEAR * step)
    shapely.prepare([inner, outer])
    low, high = np.reshape(polygon.bounds, (2, 2)) + 2 * step * np.array([[-1.0], [1.0]])
    rows = np.arange(low[1], high[1], step * np.sqrt(3) / 2)
    columns = np.arange(low[0], high[0], step)
    u = columns[np.newaxis] + 0.5 * step * (np.arange(len(rows)) % 2)[:, np.newaxis]
    points = np.column_stack([u.ravel(), np.repeat(rows, len(columns))])
    return np.asarray(points[shapely.contains_xy(inner, points) | ~shapely.contains_xy(outer, points)])


def _doubled(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return twice the signed areas (m,) of triangles in the plane."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    p, q = b - a, c - a
    return np.asarray(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
