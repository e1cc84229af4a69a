"""Flipped triangles of a chart, put right by moving single corners; and charts that wind around a vertex."""

import numpy as np
from scipy.optimize import linprog

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.chart.flattening.stretch import chart_areas
from o3dleaf.surface.mesh.topology import EdgeTable

SWEEPS = 12
"""Over the corners of flipped triangles: each sweep can free the next ring around a knot."""
MAX_FLIPPED = 0.02
"""Share of the triangles that may be flipped for it to be tried: more is no matter of single corners."""
FLAT = 1e-12
"""Area of a triangle over the square of its longest side up to which it has none but for rounding: its corners, lifted
to a surface, may be one point, of which no angle is known."""


def untangle(chart: FloatArray, triangles: IntArray) -> FloatArray | None:
    """Return a chart (n, 2) that is one to one around each place, few of its vertices moved; None without success.

    The areas of the triangles around a vertex are linear in its place: the place where the least distance from
    the lines through their other edges is largest is a linear program of three unknowns. A chart that winds twice
    around a vertex, as that of a ruffled sheet may, has no flipped triangle, and is not put right by moving it.
    """
    chart = chart.copy()
    for _ in range(SWEEPS):
        flipped = np.flatnonzero(_is_flipped(chart, triangles))
        if not len(flipped):
            return None if winds_twice(chart, triangles) else chart
        if len(flipped) > max(2, MAX_FLIPPED * len(triangles)):
            return None
        for vertex in np.unique(triangles[flipped]):
            around = triangles[(triangles == vertex).any(axis=1)]
            if _is_flipped(chart, around).any():
                chart[vertex] = _most_inside(chart, around, int(vertex))
    return None


def _is_flipped(chart: FloatArray, triangles: IntArray) -> BoolArray:
    """Return which triangles (m,) are flipped, or flat."""
    corners = chart[triangles]
    longest = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2).max(axis=1)
    return np.asarray(~(chart_areas(chart, triangles) > FLAT * longest))


def winds_twice(chart: FloatArray, triangles: IntArray) -> bool:
    """Return whether the triangles around some inner vertex, none of them flipped, turn by more than once around it."""
    turn = np.zeros(len(chart))
    for corner in range(3):
        at, after, before = (chart[triangles[:, (corner + k) % 3]] for k in range(3))
        a, b = after - at, before - at
        angle = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
        turn += np.bincount(triangles[:, corner], angle, len(chart))
    edges = EdgeTable.of(triangles)
    turn[edges.ends[edges.count == 1]] = 0.0
    return bool(turn.max(initial=0.0) > 3 * np.pi)  # 2π or a multiple of it


def _most_inside(chart: FloatArray, around: IntArray, vertex: int) -> FloatArray:
    """Return the place for a vertex that is farthest inside all lines through the opposite edges, not far away."""
    corner = np.argmax(around == vertex, axis=1)
    rows = np.arange(len(around))
    start, end = chart[around[rows, (corner + 1) % 3]], chart[around[rows, (corner + 2) % 3]]
    edge = end - start
    length = np.linalg.norm(edge, axis=1)
    keep = length > 0
    inward = np.stack([-edge[keep, 1], edge[keep, 0]], axis=1) / length[keep, np.newaxis]
    middle = (start + end).mean(axis=0) / 2
    reach = float(length.max())
    # Unknowns: the place, from the middle of the ring, and the least distance inside all lines.
    offset = np.einsum("ij,ij->i", inward, (start[keep] - middle))
    found = linprog(
        [0.0, 0.0, -1.0],
        A_ub=np.column_stack([-inward, np.ones(len(inward))]),
        b_ub=-offset,
        bounds=[(-reach, reach), (-reach, reach), (None, reach / 2)],
        method="highs-ds",
    )
    return np.asarray(middle + found.x[:2] if found.status == 0 else chart[vertex])
