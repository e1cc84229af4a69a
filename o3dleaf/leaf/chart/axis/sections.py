"""Straight sections across an outline in the plane, and a curve drawn through their middles."""

from typing import Any

import numpy as np
import shapely
import shapely.ops
from scipy.spatial import Delaunay

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, drop_unused_vertices

NODES = 1500
"""Of the lattice in which distances within an outline are found: ten across a blade of 15 : 1."""


def outline_of(chart: FloatArray, rim: IntArray) -> Any:
    """Return the polygon (shapely) within the rim of a chart, its holes filled: the largest part of it."""
    shape = shapely.make_valid(shapely.Polygon(chart[rim]))
    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon"]
    parts += [p for whole in shapely.get_parts(shape) for p in shapely.get_parts(whole) if p.geom_type == "Polygon"]
    return shapely.Polygon(shapely.get_exterior_ring(max(parts, key=lambda part: float(part.area))))


def fill_bays(outline: Any) -> Any:
    """Return an outline whose bays are filled where its widest inner circle cannot enter: bites, sinuses, a notch."""
    radius = float(shapely.maximum_inscribed_circle(outline).length)
    closed = outline.buffer(radius, quad_segs=16).buffer(-radius, quad_segs=16).union(outline)
    largest = max(shapely.get_parts(closed), key=lambda part: float(part.area))
    return shapely.Polygon(largest.exterior)


def triangulate_inside(outline: Any) -> tuple[FloatArray, IntArray]:
    """Return vertices (k, 2) and triangles of some thousand triangles that fill an outline."""
    step = float(np.sqrt(outline.area / NODES))
    low, high = np.reshape(outline.bounds, (2, 2))
    across = np.arange(low[1], high[1], step * np.sqrt(3) / 2)
    rows = [np.arange(low[0], high[0], step) + (row % 2) * step / 2 for row in range(len(across))]
    lattice = np.concatenate([np.stack([x, np.full_like(x, y)], axis=1) for x, y in zip(rows, across, strict=True)])
    inner = lattice[shapely.contains_xy(outline.buffer(-0.45 * step), *lattice.T)]
    # From a corner that the shape alone tells: where a ring begins, a rounding may have chosen.
    ring = shapely.normalize(outline).exterior
    border = shapely.line_interpolate_point(ring, np.arange(0, ring.length, step))
    points = np.concatenate([shapely.get_coordinates(border), inner])
    triangles = Delaunay(points).simplices.astype(np.int64)
    inside = shapely.contains_xy(outline, *points[triangles].mean(axis=1).T)
    return drop_unused_vertices(points, triangles[inside])


def within(outline: Any, curve: FloatArray) -> FloatArray:
    """Return a curve (k, 2) without what lies outside an outline at either of its ends."""
    parts = shapely.get_parts(shapely.intersection(shapely.LineString(curve), outline))
    line = shapely.LineString(curve)
    inside = [part for part in parts if part.geom_type == "LineString" and part.length > 0.01 * line.length]
    if not inside:
        return curve
    at = [float(line.project(shapely.Point(end))) for part in inside for end in (part.coords[0], part.coords[-1])]
    return np.asarray(shapely.get_coordinates(shapely.ops.substring(line, min(at), max(at))))


def cut_across(outline: Any, points: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middles (k, 2) and lengths (k,) of the sections through points (k, 2) along unit normals (k, 2).

    Of a section in several parts the one nearest to its point counts; where there is none, the point with length 0.
    """
    start, stop, owner = _parts_along(outline, points, normals)
    whole = stop > start
    start, stop, owner = start[whole], stop[whole], owner[whole]
    order = np.lexsort((np.maximum(0.0, np.maximum(start, -stop)), owner))
    nearest = order[np.unique(owner[order], return_index=True)[1]]
    middle, length = (start + stop) / 2, stop - start
    middles, lengths, owner = points.copy(), np.zeros(len(points)), owner[nearest]
    middles[owner] += middle[nearest, np.newaxis] * normals[owner]
    lengths[owner] = length[nearest]
    return middles, lengths


def _parts_along(outline: Any, points: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return where on lines through points (k, 2) along unit normals parts inside begin and end (m,), and which line's.

    A line goes in and out where it crosses the rings in turn; a corner on it belongs to the line's left side.
    """
    across = np.stack([normals[:, 1], -normals[:, 0]])
    places, lines = [], []
    for ring in (outline.exterior, *outline.interiors):
        corners = np.asarray(ring.coords)
        side = corners @ across - np.einsum("ki,ik->k", points, across)
        edge, line = np.nonzero((side[1:] < 0) != (side[:-1] < 0))
        first, second = side[edge, line], side[edge + 1, line]
        share = (first / (first - second))[:, np.newaxis]
        met = corners[edge] + share * (corners[edge + 1] - corners[edge])
        places.append(np.einsum("ki,ki->k", met - points[line], normals[line]))
        lines.append(line)
    place, line = np.concatenate(places), np.concatenate(lines)
    order = np.lexsort((place, line))
    return place[order[::2]], place[order[1::2]], line[order[::2]]


def leave_along(outline: Any, start: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the (2,) point at which a straight way from a point leaves the outline; the point where it is outside."""
    reach = float(np.hypot(*np.ptp(np.asarray(outline.exterior.coords), axis=0)))
    way = shapely.LineString([start, start + reach * direction / np.linalg.norm(direction)])
    parts = shapely.get_parts(shapely.intersection(way, outline))
    inside = [part for part in parts if part.geom_type == "LineString" and not part.is_empty]
    if not inside:
        return np.asarray(start)
    first = min(inside, key=lambda part: float(part.distance(shapely.Point(start))))
    ends = np.asarray(first.coords)
    return np.asarray(ends[np.argmax(np.linalg.norm(ends - start, axis=1))])


def reached(curve: FloatArray) -> FloatArray:
    """Return the (k,) lengths of a polyline up to each of its points (k, 2)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])


def resample(curve: FloatArray, count: int) -> FloatArray:
    """Return (count, 2) points of a polyline at equal steps of its length."""
    at = reached(curve)
    places = np.linspace(0, at[-1], count)
    return np.stack([np.interp(places, at, curve[:, axis]) for axis in range(2)], axis=1)


def normals_of(curve: FloatArray) -> FloatArray:
    """Return the (k, 2) unit normals of a polyline, to the left of its direction."""
    tangent = np.gradient(curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def smooth_curve(points: FloatArray, weights: FloatArray, stiffness: float, order: int) -> FloatArray:
    """Return (W + μ DᵀD)⁻¹ W p, D the differences of an order: points (k, 2) on a smoother curve (Whittaker 1923)."""
    rough = np.diff(np.eye(len(points)), order, axis=0)
    weight = np.diag(weights)
    return np.asarray(np.linalg.solve(weight + stiffness * rough.T @ rough, weight @ points))
