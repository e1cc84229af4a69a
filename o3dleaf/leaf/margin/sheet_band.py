"""The band between a lattice and the margin as triangles that have all of its sides: Delaunay, by conforming sides."""

from dataclasses import dataclass
from functools import reduce

import numpy as np
import shapely
from scipy.spatial import Delaunay, cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray

GHOST = 0.6
"""Points outside the band, at so many lengths of each side: they keep three points of a straight margin from being a
triangle of the hull."""
CLOSE = 0.3
"""A ghost nearer than this many lengths of its side to a point of the band is left out."""


@dataclass(frozen=True)
class MarginBand:
    """Triangles between closed rings of sides.

    Attributes
    ----------
    triangles : (m, 3) int ndarray
        Counter-clockwise; those on the left of the sides, meaningless while sides are missing.
    missing : (k,) int ndarray
        Numbers of the sides that no triangle has.
    """

    triangles: IntArray
    missing: IntArray


def triangulate_band(points: FloatArray, sides: IntArray, *, conform: bool = False) -> MarginBand:
    """Return the Delaunay triangles on the left of closed rings.

    Parameters
    ----------
    points : (n, 2) ndarray
    sides : (s, 2) int ndarray
        Each from one point to the next, the band on its left; every point has one that comes and one that goes.
    conform : bool
        Whether all sides are kept, though triangles at those that are missing are not Delaunay.
    """
    ghosts = _ghosts(points, sides)
    while True:
        triangles, neighbors = _turned(Delaunay(np.concatenate([points, ghosts])))
        size = len(points) + len(ghosts)
        keys = (triangles[:, [1, 2, 0]] * size + triangles[:, [2, 0, 1]]).ravel()
        wanted = sides[:, 0] * size + sides[:, 1]
        order = np.argsort(keys)
        at = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(order) - 1)]
        there = keys[at] == wanted
        if not there.all() and conform:
            return MarginBand(_constrained(points, sides), np.empty(0, dtype=np.int64))
        if not there.all():
            return MarginBand(np.empty((0, 3), dtype=np.int64), np.flatnonzero(~there))
        band = triangles[_flooded(neighbors, at, len(triangles))]
        within = np.unique(band[band >= len(points)]) - len(points)
        if not len(within):
            return MarginBand(band, np.empty(0, dtype=np.int64))
        ghosts = np.delete(ghosts, within, axis=0)  # across a slit or a kink a ghost lies in the band


def _ghosts(points: FloatArray, sides: IntArray) -> FloatArray:
    """Return points (g, 2) on the right of sides, but for those close to a point of the band."""
    start, stop = points[sides[:, 0]], points[sides[:, 1]]
    outward = np.stack([(stop - start)[:, 1], (start - stop)[:, 0]], axis=1)
    ghosts = (start + stop) / 2 + GHOST * outward
    return np.asarray(ghosts[cKDTree(points).query(ghosts)[0] > CLOSE * np.hypot(*outward.T)])


def _turned(delaunay: Delaunay) -> tuple[IntArray, IntArray]:
    """Return the triangles counter-clockwise, and the neighbors (m, 3) opposite to each corner."""
    a, b, c = (delaunay.points[delaunay.simplices[:, corner]] for corner in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    clockwise = (twice < 0)[:, None]
    order = [0, 2, 1]
    triangles = np.where(clockwise, delaunay.simplices[:, order], delaunay.simplices)
    neighbors = np.where(clockwise, delaunay.neighbors[:, order], delaunay.neighbors)
    return triangles.astype(np.int64), neighbors.astype(np.int64)


def _flooded(neighbors: IntArray, sides: IntArray, count: int) -> IntArray:
    """Return the triangles on the left of the sides (numbers 3 · triangle + corner): all that they enclose."""
    walls = np.zeros(3 * count, dtype=bool)
    walls[sides] = True
    inside = np.zeros(count + 1, dtype=bool)
    fresh = np.unique(sides // 3)
    while len(fresh):
        inside[fresh] = True
        open_sides = ~walls.reshape(-1, 3)[fresh]
        reached = np.unique(neighbors[fresh][open_sides])
        reached = reached[reached >= 0]
        fresh = reached[~inside[reached]]
    return np.flatnonzero(inside[:count])


def _constrained(points: FloatArray, sides: IntArray) -> IntArray:
    """Return triangles (m, 3) that have all sides, as GEOS makes them of the band as a polygon."""
    following = dict(sides.tolist())
    rings = []
    while following:
        start, to = following.popitem()
        ring = [start]
        while to != start:
            ring.append(to)
            to = following.pop(to)
        rings.append(points[ring])
    area = reduce(shapely.symmetric_difference, [shapely.Polygon(ring) for ring in rings])
    corners = shapely.get_coordinates(shapely.get_parts(shapely.constrained_delaunay_triangles(area)))
    triangles = cKDTree(points).query(corners.reshape(-1, 4, 2)[:, :3])[1].astype(np.int64)
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    clockwise = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    turned: IntArray = np.where(clockwise[:, None], triangles[:, [0, 2, 1]], triangles)
    return turned
