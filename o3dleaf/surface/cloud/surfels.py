"""Surfels of a cloud at the scale at which it is a surface: its points, or under noise the means of groups of them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud import cloud_loops
from o3dleaf.surface.cloud.neighbors import BLOCK, NEIGHBORS, IndexArray, Planes, fit_planes, nearest_neighbors

FLAT = 0.2
"""Ratio of the standard deviations across and along a neighborhood up to which it is a clean piece of a surface."""
ROUGH = 0.3
"""The same, above which normals of neighbors are averaged before they are compared."""
DROWNED = 0.5
"""The same, above which noise hides the surface, and a coarser scale is tried whatever it gives."""
LINE = 0.25
"""Ratio of the standard deviations along a neighborhood up to which it is a line."""
FLATTER = 1.25
"""Factor by which a coarser scale must be flatter to be taken: of a thin sheet it is not, both its sides come in."""
THICKER = 1.05
"""Flatness over the least of finer scales above which a cloud is thicker: five standard errors of the median of 500."""
FULL = 0.7
"""Flatness at every scale from which on points fill a volume: balls and boxes have 0.70 to 0.75, thin parts under noise
up to 0.69."""
FEW = 12
"""Neighbors of planes where sheets lie so close that sixteen reach others; ten turn too far by their noise."""
FEW_OF_A_VOLUME = 0.93
"""Flatness of so few neighbors over that of sixteen, below which the other four lie on other sheets: where points or
noise fill neighborhoods it is 0.936 to 0.955, in a fold of 2.3 spacings under noise of 0.43 it is 0.907 to 0.920
(`scripts/measure_sides.py`)."""
FULL_OF_FEW = 0.69
"""`FULL` of so few neighbors: balls and boxes have 0.69 to 0.73, folds and fins under noise 0.62 to 0.66."""
FULL_ERROR = 0.8
"""Of that median, times the square root of the number of neighborhoods: five standard errors."""
SAMPLE = 4000
"""Points whose neighborhoods show at which scale a cloud is a surface."""
MIN_POINTS = 8 * NEIGHBORS
"""Fewest points that a thinned cloud may have."""


class Scale(NamedTuple):
    """The scale at which a cloud is a surface.

    Attributes
    ----------
    thinning : int
        How many points one stands for.
    flatness : float
        Median ratio of the standard deviations across and along a neighborhood.
    flattest : int
        How many times the cloud is thinned where that is least.
    full : bool
        True where it is that of points that fill a volume, however much they are thinned.
    neighbors : int
        How many points of a neighborhood its plane goes through.
    """

    thinning: int
    flatness: float
    flattest: int
    full: bool
    neighbors: int = NEIGHBORS


@dataclass(frozen=True, eq=False)
class Surfels:
    """Pieces of surface, each standing for one point of the cloud or for a group.

    Attributes
    ----------
    points : (m, 3) ndarray
        The points, or the means of their groups.
    rows : (m, k) ndarray
        The nearest surfels of each, itself first.
    planes : Planes
        Through the points of the neighborhoods: normals (m, 3), of either sign, and variances (m, 3).
    group : (n,) ndarray
        The surfel of each point of the cloud.
    spacing : (n,) ndarray
        1/sqrt(points per unit area) around each point of the cloud.
    scale : Scale
    """

    points: FloatArray
    rows: IndexArray
    planes: Planes
    group: IndexArray
    spacing: FloatArray
    scale: Scale

    @classmethod
    def of(cls, points: FloatArray, rows: IndexArray) -> "Surfels":
        """Find the scale at which `points` (n, 3) with neighbors `rows` (n, k) are a surface, and the surfels there."""
        scaling, fitting = progress.split(2, 7)
        with scaling:
            scale = surface_scale(points, rows)
        with fitting:
            return cls.single(points, rows, scale) if scale.thinning == 1 else cls.grouped(points, scale)

    @classmethod
    def single(cls, points: FloatArray, rows: IndexArray, scale: Scale) -> "Surfels":
        """Return a surfel for each point, whatever the scale at which they are a surface."""
        near = np.ascontiguousarray(rows[:, : scale.neighbors])
        planes = fit_planes(points, near)
        return cls(points, rows, planes, np.arange(len(points)), spacings(planes, near.shape[1]), scale)

    @classmethod
    def grouped(cls, points: FloatArray, scale: Scale) -> "Surfels":
        """Return the means of groups of so many points each, those nearest to one of every so many points."""
        thinning = scale.thinning
        finding, grouping, fitting = progress.split(1, 3, 3)
        few = points[thinned(len(points), thinning)]
        with finding:
            near = nearest_neighbors(cKDTree(few)).row
        with grouping:
            spacing = spacings(fit_planes(few, near), near.shape[1]) / np.sqrt(thinning)
            group = query(cKDTree(few), points)[1]
        with fitting:
            count = np.bincount(group, minlength=len(few))  # no group is empty: each few point is in its own
            sums = [np.bincount(group, points[:, a], len(few)) for a in range(3)]
            means = np.column_stack(sums) / count[:, np.newaxis]
            near = nearest_neighbors(cKDTree(means)).row
            planes = _group_planes(points - means[group], group, means, count, near)
        return cls(means, near, planes, group, spacing[group], scale)

    def total(self, values: FloatArray) -> FloatArray:
        """Return the sums (m,) over each surfel of `values` (n,) at the cloud's points."""
        return np.asarray(np.bincount(self.group, values, len(self.points)), dtype=np.float64)

    def coarser(self, points: FloatArray) -> "Surfels | None":
        """Return surfels of twice as many of the `points` (n, 3), or None where few would be left."""
        thinning = 2 * round(len(points) / len(self.points))
        if 2 * len(points) < MIN_POINTS * thinning:
            return None
        flatness = flatness_of(points[thinned(len(points), thinning)])
        return Surfels.grouped(points, self.scale._replace(thinning=thinning, flatness=flatness))

    def blend(self, points: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return unit normals at the cloud's `points` (n, 3), and the points' heights (n,), between surfels.

        `normals` (m, 3) are those of the surfels; a height is measured over the surfels' planes.
        """
        if len(self.points) == len(points):
            return normals, np.zeros(len(points))
        blended, height = np.empty_like(points), np.empty(len(points))
        args = points, self.group, self.points, normals, self.rows
        run_blocks(lambda i, j: cloud_loops.blend_planes(*args, i, j, blended, height), len(points), BLOCK)
        return blended, height


def spacings(planes: Planes, k: int) -> FloatArray:
    """Return the spacing (m,) of neighborhoods of k points, the middle one among them, with variances (m, 3)."""
    area = 4 * np.pi * np.sqrt(planes.variance[:, 1] * planes.variance[:, 2])
    return np.asarray(np.sqrt(area * k) / (k - 1))  # the centroid is the points' own: variances lack 1/k


def thinned(count: int, thinning: int) -> IndexArray:
    """Return the rows, in order, of every so many-th of `count` points, taken at random (always the same ones)."""
    if thinning == 1:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).permutation(count)[: count // thinning])


def surface_scale(points: FloatArray, rows: IndexArray) -> Scale:
    """Return the finest scale at which a cloud (n, 3) is nearly as flat as where thinning it ends.

    It is thinned twice, four times, ... as long as that makes it flatter; where noise fills the neighborhoods of
    several such steps, until they become thicker again, as the other sides of thin parts come in. `rows` (n, k) are the
    neighbors of the points.
    """
    flat = [flatness_of(points, rows)]
    while flat[-1] > FLAT and len(points) >= MIN_POINTS * 2 ** len(flat):
        thinning = 2 ** len(flat)
        coarser = flatness_of(points[thinned(len(points), thinning)])
        if coarser > (THICKER * min(flat) if flat[-1] > DROWNED else flat[-1] / FLATTER):
            break
        flat.append(coarser)
        progress.report(thinning // 2, thinning)  # each scale has half as many points as the one before
    counts = (min(len(points) >> step, SAMPLE) for step in range(len(flat)))
    full = all(each >= FULL - FULL_ERROR / np.sqrt(count) for each, count in zip(flat, counts, strict=True))
    finest = next(step for step, each in enumerate(flat) if each <= FLATTER * min(flat))
    found = Scale(2**finest, flat[finest], 2 ** int(np.argmin(flat)), full)
    return _with_few(found, points, rows) if finest == 0 and flat[0] > DROWNED else found


def _with_few(scale: Scale, points: FloatArray, rows: IndexArray) -> Scale:
    """Return the scale with planes of fewer neighbors where others lie on other sheets, as in folds under noise."""
    few = flatness_of(points, np.ascontiguousarray(rows[:, :FEW]))
    full = scale.full and few >= FULL_OF_FEW - FULL_ERROR / np.sqrt(min(len(points), SAMPLE))
    if few >= FEW_OF_A_VOLUME * scale.flatness:
        return scale._replace(full=full)
    return scale._replace(full=full, flatness=few, neighbors=FEW)


def flatness_of(points: FloatArray, rows: IndexArray | None = None) -> float:
    """Return the median ratio of the standard deviations across and along the neighborhoods of a cloud (n, 3).

    Of neighborhoods that are lines, as between two far lines of a scanner, it is 1: they show no surface either.
    """
    sample = thinned(len(points), max(1, len(points) // SAMPLE))
    if rows is None:
        near = query(cKDTree(points), points[sample], k=np.arange(1, min(NEIGHBORS, len(points)) + 1))[1]
    else:
        near = rows[sample]
    with progress.silent():
        variance = fit_planes(points, near).variance
    across, along, most = np.sqrt(variance).T
    line = along <= LINE * most
    return float(np.median(np.where(line, 1.0, across / np.where(line, 1.0, along))))


def _group_planes(off: FloatArray, group: IndexArray, means: FloatArray, count: IndexArray, rows: IndexArray) -> Planes:
    """Return the planes through all points of the groups `rows` (m, k), from the groups' moments."""
    pairs = [(a, b) for a in range(3) for b in range(3)]
    within = np.column_stack([np.bincount(group, off[:, a] * off[:, b], len(means)) for a, b in pairs])
    weight = count[rows].astype(np.float64)
    whole = weight.sum(axis=1)
    arm = means[rows] - means[:, np.newaxis]
    center = np.einsum("mk,mka->ma", weight, arm) / whole[:, np.newaxis]
    scatter = within[rows].sum(axis=1).reshape(-1, 3, 3) + np.einsum("mk,mka,mkb->mab", weight, arm, arm)
    value, axes = np.linalg.eigh(scatter / whole[:, np.newaxis, np.newaxis] - center[:, :, None] * center[:, None])
    return Planes(np.ascontiguousarray(axes[:, :, 0]), np.maximum(value, 0.0))
