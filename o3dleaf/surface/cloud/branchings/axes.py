"""Lines through which the planes of neighborhoods pass: of a crease, of a branching, and of nothing else."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import box_of
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.surface.cloud.neighbors import IndexArray

AROUND = 5.0
"""Spacings around a place within which planes are looked at: some eighty neighborhoods of a sheet, half of them away
from where it meets others."""
FEWEST = 12
"""Planes that a line is found from at least: of three sheets four each."""
BENT = 0.05
"""Least eigenvalue of the planes' normals up to which they are upright to one line: 13° off it, in the mean."""
TURNED = 0.08
"""Middle eigenvalue from which on they are not those of one sheet: a third of them turned by 40°."""
NEAR = 2.0
"""Spacings from the place where it was looked for up to which a line counts: other places see a farther one better."""
OFF = 0.5
"""Spacings off the line at which a plane counts a quarter: it belongs to a sheet that does not meet the others."""
ROUNDS = 6


class Axes(NamedTuple):
    """Lines near places, each with the plane across it.

    Attributes
    ----------
    point : (m, 3) ndarray
        The point of the line in the plane across it.
    direction : (m, 3) ndarray
        Unit vectors along the lines.
    across : (m, 3, 2) ndarray
        Two unit vectors of the plane across, in columns.
    spacing : (m,) ndarray
        Of the cloud around.
    """

    point: FloatArray
    direction: FloatArray
    across: FloatArray
    spacing: FloatArray

    def __len__(self) -> int:
        return len(self.point)

    def take(self, rows: IndexArray) -> "Axes":
        """Return some of the lines."""
        return Axes(self.point[rows], self.direction[rows], self.across[rows], self.spacing[rows])


def pairs_within(points: FloatArray, places: FloatArray, reach: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return for all of the points (n, 3) within the `reach` (m,) of places (m, 3) the place's row and the point's."""
    offsets, inside = BallIndex.build(places, reach, box_of(points)).members(points)
    return np.repeat(np.arange(len(places)), np.diff(offsets)), inside


def find_axes(places: FloatArray, spacing: FloatArray, points: FloatArray, normals: FloatArray) -> Axes:
    """Return the lines near some of the places (m, 3) that the planes at points (n, 3) around them pass through.

    The line's direction t is the one that the normals n (n, 3) are all upright to, the least eigenvector of Σ n nᵀ;
    where it passes, least squares over the planes' distances say, those that pass by counting less and less.
    """
    owner, row = pairs_within(points, places, AROUND * spacing)
    normal = normals[row]
    count = np.bincount(owner, minlength=len(places))
    spread = _squares(owner, normal, normal, len(places))
    value, vector = np.linalg.eigh(spread / np.maximum(count, 1)[:, np.newaxis, np.newaxis])
    edge = (count >= FEWEST) & (value[:, 0] <= BENT) & (value[:, 1] >= TURNED)
    kept = np.flatnonzero(edge)
    number = np.full(len(places), -1)
    number[kept] = np.arange(len(kept))
    mine = edge[owner]
    normal, arm, owner = normal[mine], points[row[mine]] - places[owner[mine]], number[owner[mine]]
    across, width = np.ascontiguousarray(vector[kept, :, 1:]), spacing[kept]
    center = _meet(owner, normal, arm, across, width)
    near = np.flatnonzero(np.linalg.norm(center, axis=1) <= NEAR * width)
    point = places[kept] + np.einsum("mij,mj->mi", across, center)
    return Axes(point, np.ascontiguousarray(vector[kept, :, 0]), across, width).take(near)


def _meet(owner: IndexArray, normal: FloatArray, arm: FloatArray, across: FloatArray, width: FloatArray) -> FloatArray:
    """Return where planes meet, (m, 2) in the planes across, from the place in whose neighborhood each is."""
    flat = np.einsum("pi,pij->pj", normal, across[owner])
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-12)[:, np.newaxis]
    off = np.einsum("pj,pj->p", flat, np.einsum("pi,pij->pj", arm, across[owner]))
    near = 1 / (1 + np.einsum("pi,pi->p", arm, arm) / (NEAR * width[owner]) ** 2)
    center: FloatArray = np.zeros((len(width), 2))
    weight = near
    for _ in range(ROUNDS):
        weighted = weight[:, np.newaxis] * flat
        matrix = _squares(owner, weighted, flat, len(width))
        matrix += 1e-9 * np.trace(matrix, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(2)
        right = np.column_stack([np.bincount(owner, each * off, len(width)) for each in weighted.T])
        center = np.asarray(np.linalg.solve(matrix, right[:, :, np.newaxis])[:, :, 0], np.float64)
        miss = (off - np.einsum("pj,pj->p", flat, center[owner])) / (OFF * width[owner])
        weight = near / (1 + miss**2) ** 2
    return center


def _squares(owner: IndexArray, weighted: FloatArray, vectors: FloatArray, count: int) -> FloatArray:
    """Return the sums (count, c, c) of w v vᵀ by owner of vectors v (p, c), of which the w v are given."""
    columns, one, other = vectors.shape[1], np.ascontiguousarray(weighted.T), np.ascontiguousarray(vectors.T)
    sums = np.empty((count, columns, columns))
    for i in range(columns):
        for j in range(i + 1):
            sums[:, i, j] = sums[:, j, i] = np.bincount(owner, one[i] * other[j], count)
    return sums
