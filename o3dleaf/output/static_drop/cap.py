"""The shape that a static drop starts from: a spherical cap, triangulated finer towards its line of contact."""

import numpy as np
from scipy.spatial import Delaunay

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray


def cap_radius(angle: float) -> float:
    """Return the radius of the sphere whose cap with this contact angle (radians) has the volume of a unit ball."""
    cosine = np.cos(angle)
    return float((4 / ((2 + cosine) * (1 - cosine) ** 2)) ** (1 / 3))


def cap_mesh(angle: float, rings: int) -> tuple[FloatArray, IntArray, int]:
    """Return vertices, triangles seen from outside, and how many vertices, the last ones, are on the line of contact.

    Rings are half-way between even steps of the polar angle and those of a stereographic projection, which are fine
    at the line of contact of a drop that hardly touches.
    """
    share = np.arange(rings + 1) / rings
    polar = (angle * share + 2 * np.arctan(np.tan(angle / 2) * share)) / 2
    counts = np.maximum(6 * np.arange(rings + 1), 1)
    ring = np.repeat(np.arange(rings + 1), counts)
    place = np.arange(len(ring)) - np.repeat(np.cumsum(counts) - counts, counts)
    turn = 2 * np.pi * (place + 0.5 * (ring % 2)) / counts[ring]
    disc = share[ring, np.newaxis] * np.column_stack([np.cos(turn), np.sin(turn)])
    triangles = Delaunay(disc).simplices.astype(np.int64)
    a, b, c = (disc[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    # Points of the outer ring that are in a row to rounding make slivers of no area.
    triangles, area = triangles[np.abs(area) > 1e-9], area[np.abs(area) > 1e-9]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    radius, out = cap_radius(angle), polar[ring]
    height = radius * (np.cos(out) - np.cos(angle))
    across = radius * np.sin(out)
    vertices = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    return vertices, triangles, int(counts[-1])
