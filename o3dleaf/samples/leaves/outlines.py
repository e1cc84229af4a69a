"""Outlines of leaves in the plane of (u, v), u along the leaf from its base, v across: polygons of short edges."""

import numpy as np
import numpy.typing as npt
from shapely.geometry import Point, Polygon

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError

EDGE = 0.2
"""Longest edge of a polygon, in millimeters: a circle of 5 mm is followed to 0.001 mm."""
WIDEST = 0.35
"""Where a lanceolate leaf is widest, as a share of its length."""
BASE = 0.3
"""Width of the cut base as a share of the largest."""
SHARPNESS = 2.2
"""Power p > 1 of the taper 1 − t^p towards the tip; the tip is the sharper the less it is."""
CIRCLE = 64
"""Segments of a quarter of a circle."""


def long_outline(length: float, width: float, base: float = BASE) -> Polygon:
    """Return a lanceolate outline: a straight base, widest at 0.35 of its length, a sharp tip.

    Parameters
    ----------
    length, width : float
        In millimeters.
    base : float
        Width of the base as a share of `width`.
    """
    along = np.linspace(0.0, length, 1 + int(np.ceil(1.5 * length / EDGE)))
    half = 0.5 * width * _taper(along / length, base)
    lower, upper = np.column_stack([along, -half]), np.column_stack([along, half])[::-1]
    corner = np.array([[0.0, 0.0]])
    return Polygon(_shorten(np.concatenate([lower, upper[1:], corner])))


def lobed_outline(length: float, width: float, lobes: int, depth: float) -> Polygon:
    """Return a broad outline r(φ) = 1 + depth cos(lobes φ), stretched to about length and width, tip at φ = 0."""
    angle = np.linspace(-np.pi, np.pi, 1 + int(np.ceil(5 * (length + width) / EDGE)))[:-1]
    radius = 0.5 * (1 + depth * np.cos(lobes * angle)) / (1 + depth)
    ring = radius[:, np.newaxis] * np.column_stack([length * np.cos(angle), width * np.sin(angle)])
    return Polygon(_shorten(ring - [ring[:, 0].min(), 0.0]))


def oval_outline(length: float, width: float) -> Polygon:
    """Return an ellipse from the base at (0, 0) to the tip at (length, 0)."""
    return lobed_outline(length, width, 1, 0.0)


def eat(outline: Polygon, holes: npt.ArrayLike, notches: npt.ArrayLike) -> Polygon:
    """Return an outline without discs (u, v, radius), (k, 3): those inside make holes, those at the margin notches.

    Raises
    ------
    InputError
        If what is left is in several pieces.
    """
    rest = outline
    for u, v, radius in np.concatenate([np.reshape(holes, (-1, 3)), np.reshape(notches, (-1, 3))]):
        rest = rest.difference(Point(u, v).buffer(radius, quad_segs=CIRCLE))
    if rest.geom_type != "Polygon":
        raise InputError(f"notch, hole: they cut the leaf into {len(rest.geoms)} pieces; give smaller ones")
    return rest


def _taper(share: FloatArray, base: float) -> FloatArray:
    """Return half widths as shares of the largest, at shares of the length."""
    rise = base + (1 - base) * np.sin(0.5 * np.pi * np.minimum(share / WIDEST, 1.0))
    fall = 1 - np.maximum((share - WIDEST) / (1 - WIDEST), 0.0) ** SHARPNESS
    return np.asarray(rise * fall)


def _shorten(ring: FloatArray) -> FloatArray:
    """Return a ring (k, 2), open, with points put in so that no edge is longer than `EDGE`."""
    way = np.roll(ring, -1, axis=0) - ring
    parts = np.maximum(np.ceil(np.linalg.norm(way, axis=1) / EDGE).astype(int), 1)
    row = np.repeat(np.arange(len(ring)), parts)
    number = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.asarray(ring[row] + (number / parts[row])[:, np.newaxis] * way[row])
