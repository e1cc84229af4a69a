"""Contacts: an end of the blade that would pass through another part of it stops before that."""

from typing import NamedTuple

import numpy as np
import scipy.sparse
import shapely
from scipy.sparse.csgraph import connected_components

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.places import tell_place
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.margin.margin import Margin, cut_margin
from o3dleaf.leaf.margin.margin_curve import largest
from o3dleaf.leaf.margin.sheet_mesh import triangulate
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.surface.mesh.crossings import find_crossings

STEP = 0.5
"""Side of the triangles that are looked at, in spacings; at the margin they are as small as the blade is narrow."""
MAX_TRIANGLES = 200_000
"""Of them, about: of a scan of more than 20,000 points the side is longer."""
CLEARANCE = 0.5
"""Spacings that the margin keeps from a crossing: no scan tells better where a leaf ends."""
MAX_CUT = 16.0
"""Spacings squared that an end has at most: so few points may be those of the other part."""
MAX_CUTS = 8
"""Ends of one leaf, of which the wheat leaf has one: each costs as much as looking for the next."""


class End(NamedTuple):
    """An end that passes through the blade: the polygon without it, its area, and its place in space."""

    left: shapely.Polygon
    area: float
    place: FloatArray


def end_before_contacts(surface: ChartSurface, margin: Margin, spacing: float) -> tuple[Margin, tuple[str, ...]]:
    """Return the margin without ends of the blade that pass through another part of it, and a line on each of them.

    Where two parts of a leaf touch, a few points may be either's, and the surface through them crosses the other part
    or not by a rounding. No leaf passes through itself: of the two that part ends there, a little before, that loses
    less by it. What would lose more than `MAX_CUT` spacings squared, or get a hole, stays as it is.

    Parameters
    ----------
    surface : ChartSurface
    margin : Margin
    spacing : float
        Of the points that the surface was fitted to.
    """
    polygon, notes = margin.polygon, []
    for _ in range(MAX_CUTS):
        ends = _crossing_ends(surface, polygon, spacing)
        if not ends:
            break
        end = min(ends, key=lambda each: each.area)
        polygon = end.left
        at, size = tell_place(end.place, surface.jet(margin.ring, 0)[0]), tell_length(end.area, 2)
        notes.append(f"touches itself at {at}: an end of the blade, {size}, would pass through another part: cut off")
    return (cut_margin(margin, polygon) if notes else margin), tuple(notes)


def _crossing_ends(surface: ChartSurface, polygon: shapely.Polygon, spacing: float) -> list[End]:
    """Return all ends within a polygon that may be cut off, those of both parts where two cross."""
    plane, space, triangles, crosses = triangulated(surface, polygon, spacing)
    ends = []
    for crossing in _connected(triangles[crosses], len(plane)):
        beside = shapely.union_all(shapely.polygons(plane[crossing])).buffer(CLEARANCE * spacing)
        left = largest(polygon.difference(beside))
        area = polygon.area - left.area
        if area <= MAX_CUT * spacing**2 and len(left.interiors) <= len(polygon.interiors):
            ends.append(End(left, area, space[crossing].mean(axis=(0, 1))))
    return ends


def triangulated(
    surface: ChartSurface, polygon: shapely.Polygon, spacing: float
) -> tuple[FloatArray, FloatArray, IntArray, BoolArray]:
    """Return a mesh of a surface within a polygon, of half the spacing: its vertices in the chart (n, 2) and in space.

    And its triangles (m, 3), and which of them cross others.
    """
    least = float(np.sqrt(4 / np.sqrt(3) * polygon.area / MAX_TRIANGLES))
    plane, triangles = triangulate(polygon, max(STEP * spacing, least))
    space = surface.jet(plane, 0)[0]
    return plane, space, triangles, find_crossings(space, triangles)


def _connected(triangles: IntArray, count: int) -> list[IntArray]:
    """Return triangles (m, 3) of `count` vertices in groups that hang together by corners."""
    ends = triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = scipy.sparse.coo_array((np.ones(len(ends)), tuple(ends.T)), shape=(count, count))
    group = connected_components(graph, directed=False)[1][triangles[:, 0]]
    return [triangles[group == each] for each in np.unique(group)]
