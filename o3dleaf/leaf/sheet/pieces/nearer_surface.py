"""Points of two sheets that are both seen, one over the other, told apart by the surface that each is nearer to."""

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.pieces.nearer_loops import find_heights

NEAREST = 100
"""Points of a sheet that its surface at a place is found from: a quadric has six coefficients, and the noise of its
height is a fifth of theirs, also where they surround a place at which the sheet has none yet."""
INSIDE = 0.6
"""Distance of the mean of these points over their root mean square distance, up to which a place lies among them and
not beside them: beside half a disc it is 8/(3π√2) = 0.6."""
NEAR, REACH = 1.5, 8.0
"""Spacings from the nearer of two surfaces within which points are its own, and up to which the surfaces are apart."""
SIGMAS = 3.0
"""Deviations of the noise that points may be farther off."""
UNSURE = 2.0
"""Deviations of the noise within which two surfaces are one to a point."""
ROUNDS, SETTLED = 8, 0.002
"""Rounds at most, each with the surfaces through what the last one told, and the share of changes to end at."""
HUBER = 2.5
"""Medians of the residuals from which on a point counts less: it may be the other sheet's."""
BOTH = 0.75
"""Density of each sheet's points, over the usual one, from which on it is seen where they lie on one another. Where one
hides the other they share the points of one."""
AROUND = 2.0
"""Spacings within which points are counted for it."""
BATCH_SIZE, BLOCK = 2048, 64


class Told(NamedTuple):
    """Rows (k,) of points near two surfaces, which of them are of the first one (k,), and how many might be of both."""

    rows: IntArray
    first: BoolArray
    unsure: int


def tell_by_surface(
    points: FloatArray, normals: FloatArray, first: BoolArray, free: IntArray, spacing: float, noise: float
) -> Told | None:
    """Return which of the points `free` (m,) are of the first sheet, by heights; None where only one sheet is seen.

    Each point is compared with the quadrics through those points of either sheet that are nearest to it, where it lies
    among them; the points are those of the cloud as it was scanned, for averages over the noise mix close sheets.

    Parameters
    ----------
    points, normals : (n, 3) ndarrays
    first : (n,) ndarray of bool
        Which points are taken for the first sheet's, to begin with.
    free : (m,) ndarray of int
        Rows of the points of which that may be wrong.
    spacing, noise : float
    """
    first = first.copy()
    above = [Heights.unknown(len(free)) for _ in range(2)]
    changed = np.arange(len(points))
    for _ in range(ROUNDS):
        for own, sheet in zip((True, False), above, strict=True):
            sheet.update(points[free], normals[free], points[first == own], points[changed])
        off = np.abs(np.stack([sheet.height for sheet in above]))
        apart = np.abs(above[0].height - above[1].height)
        near = (off.min(axis=0) < NEAR * spacing + SIGMAS * noise) & (apart < REACH * spacing)
        near &= above[0].inside & above[1].inside
        rows, nearer = free[near], off[0, near] < off[1, near]
        changed = rows[first[rows] != nearer]
        first[rows] = nearer
        if len(changed) <= SETTLED * len(rows):
            break
    if not _both_seen(points, first, rows, spacing):
        return None
    return Told(rows, first[rows], int(np.count_nonzero(apart[near] < UNSURE * noise)))


class Heights(NamedTuple):
    """Heights (m,) of places over a surface, which lie among the points it is found from, and these points' reach (m,).

    The reach is the distance of the farthest one.
    """

    height: FloatArray
    inside: BoolArray
    reach: FloatArray

    @classmethod
    def unknown(cls, count: int) -> "Heights":
        """Return those of places whose points are not known yet."""
        return cls(np.empty(count), np.empty(count, bool), np.full(count, np.inf))

    def update(self, at: FloatArray, normals: FloatArray, points: FloatArray, changed: FloatArray) -> None:
        """Find them anew of places (m, 3) that one of the points `changed` (k, 3) is near to, gone or come since."""
        anew = np.flatnonzero(query(cKDTree(changed), at)[0] <= self.reach)
        tree, count = cKDTree(points), min(NEAREST, len(points))
        for i, j in blocks(len(anew), BATCH_SIZE):
            some = anew[i:j]
            distance, rows = query(tree, at[some], k=np.arange(1, count + 1))
            self.reach[some] = distance[:, -1] if count == NEAREST else np.inf
            height, spread = np.empty((2, len(some)))
            task = partial(find_heights, at[some], _frames(normals[some]), points, rows, HUBER, height, spread)
            run_blocks(task, len(some), BLOCK)
            self.height[some], self.inside[some] = height, spread < INSIDE


def _frames(normals: FloatArray) -> FloatArray:
    """Return the (n, 3, 3) axes, in rows, along two tangents and a unit normal (n, 3)."""
    one = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    one /= np.linalg.norm(one, axis=1)[:, np.newaxis]
    return np.stack([one, np.cross(normals, one), normals], axis=1)


def _both_seen(points: FloatArray, first: BoolArray, rows: IntArray, spacing: float) -> bool:
    """Return whether each of two sheets has its points around `rows` (k,) as dense as they are elsewhere."""
    elsewhere = np.setdiff1d(np.arange(len(points)), rows)
    if not len(rows) or not len(elsewhere):
        return False
    usual = count_neighbors(points, points[elsewhere], spacing)
    return all(
        count_neighbors(points[first == own], points[rows[first[rows] == own]], spacing) >= BOTH * usual
        for own in (True, False)
    )


def count_neighbors(points: FloatArray, places: FloatArray, spacing: float) -> float:
    """Return the median number of points around places, 0 of no places."""
    if not len(places):
        return 0.0
    return float(np.median(cKDTree(points).query_ball_point(places, AROUND * spacing, return_length=True)))
