"""Points of two sheets that are both seen, one over the other, told apart by the surface that each is nearer to."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.trees import query

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
BATCH_SIZE = 2048


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
    for _ in range(ROUNDS):
        heights, inside = zip(
            *(_heights(points[free], normals[free], points[first == own]) for own in (True, False)), strict=True
        )
        off = np.abs(np.stack(heights))
        apart = np.abs(heights[0] - heights[1])
        near = (off.min(axis=0) < NEAR * spacing + SIGMAS * noise) & (apart < REACH * spacing)
        near &= inside[0] & inside[1]
        rows, nearer = free[near], off[0, near] < off[1, near]
        changed = np.count_nonzero(first[rows] != nearer)
        first[rows] = nearer
        if changed <= SETTLED * len(rows):
            break
    if not _both_seen(points, first, rows, spacing):
        return None
    return Told(rows, first[rows], int(np.count_nonzero(apart[near] < UNSURE * noise)))


def _heights(at: FloatArray, normals: FloatArray, points: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the heights (m,) of places over the surface through points (n, 3), and which lie among these (m,)."""
    height, inside = np.empty(len(at)), np.empty(len(at), bool)
    tree, count = cKDTree(points), min(NEAREST, len(points))
    axes = _frames(normals)
    for i, j in blocks(len(at), BATCH_SIZE):
        distance, rows = query(tree, at[i:j], k=np.arange(1, count + 1))
        size = np.maximum(distance[:, -1:], np.finfo(float).tiny)
        u, v, w = np.einsum("nka,nba->bnk", points[rows] - at[i:j, np.newaxis], axes[i:j]) / size
        mean = np.hypot(u.mean(axis=1), v.mean(axis=1))
        inside[i:j] = mean < INSIDE * np.sqrt((u**2 + v**2).mean(axis=1))
        height[i:j] = -size[:, 0] * _robust_value(np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1), w)
    return height, inside


def _robust_value(terms: FloatArray, height: FloatArray) -> FloatArray:
    """Return the first coefficients (n,) of fits of `terms` (n, k, 6) to heights (n, k), by Huber's loss."""
    weight = np.ones_like(height)
    ridge = 1e-9 * height.shape[1] * np.eye(terms.shape[2])
    for last in (False, True):
        weighted = terms * weight[:, :, np.newaxis]
        normal = np.swapaxes(weighted, 1, 2) @ terms + ridge
        fit = np.linalg.solve(normal, np.swapaxes(weighted, 1, 2) @ height[:, :, np.newaxis])
        if not last:
            off = np.abs(height - (terms @ fit)[:, :, 0])
            corner = HUBER * np.median(off, axis=1, keepdims=True) + np.finfo(float).tiny
            weight = 1 / np.maximum(1.0, off / corner)
    return np.asarray(fit[:, 0, 0])


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
