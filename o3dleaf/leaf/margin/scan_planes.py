"""The planes of a line scanner: parallel and equally far apart, found by the lines in which they cut a surface."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.sample_lines import SampleLines

Lift = Callable[[FloatArray], tuple[FloatArray, ...]]
"""Places (k, 2) of a chart to points (k, 3) of the surface and its first derivatives (k, 2, 3)."""

MIN_CLEAR = 0.05
"""Share of the points that lines must show at: of independent points 0.01 to 0.03 have a direction by chance."""
STARTS = 12
"""Places from which planes are sought; one without a bend, and with all lines, is enough."""
FIRST, GROWTH = 3.0, 1.4
"""Lines to either side of a start that planes are fitted to first, and times as many in the next round: what the planes
of a round are off by at the end of the next is a small part of their distance."""
FEW, FEWEST = 3, 8
"""Planes that there are at least, as all points are near one that is far from the next; and points of each in the mean,
as of fewer some planes go through most."""
TURNS = 10
"""Rounds in which the signs of heights' slopes are found."""
MAX_FITTED = 20_000
"""Points that planes are fitted to."""
THIN = 1e-3
"""Extent of points along an axis, of their largest, below which it says nothing of planes: they are flat."""
ROUNDS = 3
"""Of least squares at each scale."""
PHASE = 0.7
"""Length of the mean of unit vectors whose angles are the heights of points above planes, in turns, from which on these
are a scanner's: 1 of points on planes, 0.8 if they are off by a tenth of the planes' distance, and 0 of others."""
SURE = 0.9
"""That from which on no other start is tried."""


@dataclass(frozen=True)
class ScanPlanes:
    """Planes g · x + c = k, k whole, in which a scanner has seen a surface.

    Attributes
    ----------
    lift : callable
        Of the chart of that surface.
    gradient : (3,) ndarray
        g, a normal of length one over the planes' distance.
    offset : float
        c.
    """

    lift: Lift
    gradient: FloatArray
    offset: float

    def heights(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return h = g · x + c (k,) at places (k, 2) of the chart, and its slope there, (k,).

        Lines are one over the slope apart: where the surface lies along the planes, far.
        """
        points, derivatives = self.lift(places)[:2]
        return points @ self.gradient + self.offset, np.hypot(*(derivatives @ self.gradient).T)


def find_scan_planes(lines: SampleLines, lift: Lift) -> ScanPlanes | None:
    """Return the planes of the lines of a sample; None where they are of no family of planes.

    Their first gradient is that of most lines (`_gradients`). From each of some starts planes are fitted by least
    squares to the points of larger and larger balls, each point at the whole number that the planes of the ball before
    say.
    """
    rows = np.flatnonzero(lines.clear)
    if len(rows) < MIN_CLEAR * len(lines.clear):
        return None
    rows = rows[:: -(-len(rows) // MAX_FITTED)]
    points, derivatives = lift(np.asarray(lines.tree.data)[rows])[:2]
    apart = lines.apart[rows]
    starts = np.linspace(0, len(rows) - 1, min(STARTS, len(rows))).astype(np.int64)
    best, most = np.zeros(4), PHASE
    for gradient in _gradients(lines.along[rows], apart, derivatives):
        for start in starts:
            planes = _grown(points, int(start), apart[start], gradient)
            heights = _heights(points, planes)
            order = _order(heights) if FEW <= np.ptp(heights) <= len(rows) / FEWEST else 0.0
            if order >= most:
                best, most = planes, order
            if most >= SURE:
                break
    return ScanPlanes(lift, best[:3], float(best[3])) if best.any() else None


def _gradients(along: FloatArray, apart: FloatArray, derivatives: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what g (3,) may be of lines along unit vectors (m, 2) of a chart with derivatives (m, 2, 3), `apart` (m,).

    Along lines S has no component of g, which gives the direction that most lines are normal to. Across them it has
    ±1/apart. Lines of a flat leaf are normal to two directions: of these, the least g with the signs of the last.
    """
    across = along @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    tangents, ways = (np.einsum("ma,mak->mk", each, derivatives) for each in (along, across))
    normals = np.linalg.eigh(tangents.T @ tangents)[1].T[:2]
    rises = np.abs(ways @ normals.T)
    bent = normals[0] * (rises[:, 0] @ (1 / apart)) / max(rises[:, 0] @ rises[:, 0], 1e-300)
    flat = normals[np.argmax(rises.sum(axis=0))]
    system = np.concatenate([tangents, ways])
    for _ in range(TURNS):
        slopes = np.sign(ways @ flat) / apart
        flat = np.linalg.lstsq(system, np.concatenate([np.zeros(len(along)), slopes]), rcond=THIN)[0]
    return bent, flat


def _grown(points: FloatArray, start: int, apart: float, gradient: FloatArray) -> FloatArray:
    """Return the planes (4,), g and c, of points (m, 3), grown from one of them where lines are so far apart."""
    away = np.linalg.norm(points - points[start], axis=1)
    radius = FIRST * apart
    phase = _phases((points[away <= radius] - points[start]) @ gradient).mean()
    planes = np.array([*gradient, -np.angle(phase) / (2 * np.pi) - points[start] @ gradient])
    while radius < GROWTH * away.max():
        near = points[away <= radius]
        for _ in range(ROUNDS):
            height = _heights(near, planes)
            planes = planes + _correction(near, np.rint(height) - height)
        radius *= GROWTH
    return planes


def _correction(points: FloatArray, change: FloatArray) -> FloatArray:
    """Return by how much planes (4,) change so that heights at points (m, 3) do by so much (m,), in the least squares.

    Along an axis in which points hardly extend, as along the normal of a flat leaf, nothing is known and it is left.
    """
    middle = points.mean(axis=0)
    system = np.column_stack([points - middle, np.full(len(points), np.ptp(points, axis=0).max())])
    *gradient, constant = np.linalg.lstsq(system, change, rcond=THIN)[0]
    return np.array([*gradient, constant * system[0, 3] - middle @ gradient])


def _heights(points: FloatArray, planes: FloatArray) -> FloatArray:
    return np.asarray(points @ planes[:3] + planes[3])


def _phases(heights: FloatArray) -> FloatArray:
    """Return the unit vectors, as complex numbers, whose angles are heights in turns."""
    return np.asarray(np.exp(2j * np.pi * heights))


def _order(heights: FloatArray) -> float:
    """Return the length of the mean of those: 1 of points on planes."""
    return float(np.abs(_phases(heights).mean()))
