"""The area in the plane (along, across) that a blade covers: its outline as polygons, and which points lie in it."""

import threading
from typing import Protocol

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.blade.outline_loops import BOX, find_closest

BLOCK = 1024
"""Points that one thread looks up the closest places for at a time."""
ONE_AT_A_TIME = threading.Lock()
"""Held while GEOS is asked."""


class Outline(Protocol):
    """The edge of a blade in the (along, across) plane, such as an `AlphaShape`."""

    @property
    def bounds(self) -> FloatArray:
        """(2, 2) bounding box of the outline."""
        ...

    @property
    def polygon(self) -> shapely.Polygon:
        """The area that the blade covers."""
        ...

    @property
    def rounded(self) -> shapely.Polygon:
        """The area that a closed leaf covers: its edge is smooth where the rim needs that."""
        ...

    @property
    def area(self) -> float:
        """Area of `polygon` in the plane."""
        ...

    def contains(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return for each of the (n, 2) points whether it lies in the outline or on it."""
        ...


def in_polygon(polygon: shapely.Polygon, points: FloatArray) -> npt.NDArray[np.bool_]:
    """Return for each of the (n, 2) points whether it lies in a polygon or on it.

    GEOS builds and uses the index of a prepared polygon without a lock, and threads that ask it together corrupt the
    heap (libgeos issue 825): one asks at a time.
    """
    with ONE_AT_A_TIME:
        shapely.prepare(polygon)
        return np.asarray(shapely.intersects_xy(polygon, points[:, 0], points[:, 1]))


def distances_beyond(polygon: shapely.Polygon, points: FloatArray) -> FloatArray:
    """Return (n, 3) the distances of (n, 2) points from a polygon's rim, above 0 outside, and their derivatives."""
    sides = sides_of(polygon)
    begin = np.arange(0, len(sides), BOX)
    low, high = np.minimum(sides[:, :2], sides[:, 2:]), np.maximum(sides[:, :2], sides[:, 2:])
    boxes = np.hstack([np.minimum.reduceat(low, begin), np.maximum.reduceat(high, begin)])
    away = np.empty_like(points)
    run_blocks(lambda i, j: find_closest(points, sides, boxes, i, j, away), len(points), BLOCK)
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    sign = np.where(in_polygon(polygon, points), -1.0, 1.0)[:, np.newaxis]
    return np.hstack([sign * distance, sign * away / np.where(distance > 0, distance, 1.0)])


def places_inside(outline: Outline, count: int) -> FloatArray:
    """Return about `count` places (along, across) on a square grid inside an outline."""
    low, high = outline.bounds
    step = float(np.sqrt(outline.area / count))
    along, across = (np.arange(a + step / 2, b, step) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(grid[outline.contains(grid)])


def sides_of(area: shapely.Geometry) -> FloatArray:
    """Return the sides (s, 4) of all rings of an area.

    Raises
    ------
    ReconstructionError
        If it has none.
    """
    parts = [part for part in shapely.get_parts(area) if part.area > 0]
    if not parts:
        raise ReconstructionError("the region lies outside the outline; choose another region")
    rings = [ring.coords for part in parts for ring in (part.exterior, *part.interiors)]
    return np.concatenate([np.hstack([np.array(ring)[:-1, :2], np.array(ring)[1:, :2]]) for ring in rings])
