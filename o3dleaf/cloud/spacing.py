"""How densely a surface is sampled: the spacing s = 1/sqrt(points per unit area), point by point."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.checks import FloatArray
from o3dleaf.cloud.neighbours import NEIGHBOURS, IndexArray, Planes, fit_planes, nearest_neighbours
from o3dleaf.errors import InputError
from o3dleaf.geometry import CloudLike, points_of

FLAT = 0.45
"""Ratio of the standard deviations across and along a neighbourhood up to which it is a piece of a surface."""
SAMPLE = 4000
"""Points whose neighbourhoods say at which scale a cloud is a surface."""
LEAST = 4 * NEIGHBOURS
"""Fewest points that a thinned cloud may have."""


class Spacing(NamedTuple):
    """The spacing of a cloud: its median, and that around `each` point (n,), in the unit of the points."""

    median: float
    each: FloatArray


def cloud_spacing(cloud: CloudLike) -> Spacing:
    """Return the spacing s = 1/sqrt(points per unit area) of a sampled surface, also under noise thicker than s.

    The k nearest points of a point cover, seen along the normal, an ellipse whose area is 4π sqrt(λ₁ λ₂), with λ
    their variances along the surface: s² = 4π sqrt(λ₁ λ₂)/(k − 1). Where noise makes the neighbourhoods of a cloud
    round, every fourth, 16th, ... point is measured, of which the surface shows; two sheets within the noise then
    count as one. Points at random come out 4 % too close, a square lattice 6 % too wide.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud

    Raises
    ------
    InputError
        If there are fewer than three points, one is not finite, or most lie on a line.
    """
    points = points_of(cloud, "cloud", least=3)
    thinning = surface_scale(points)
    few = points[thinned(len(points), thinning)]
    rows = nearest_neighbours(few).row
    each = _spacings(fit_planes(few, rows), rows.shape[1]) / np.sqrt(thinning)
    if thinning > 1:
        each = each[cKDTree(few).query(points, workers=-1)[1]]
    median = float(np.median(each))
    if not median > 0:
        raise InputError("cloud: most points lie on a line or in one place; a surface is needed")
    return Spacing(median, each)


def _spacings(planes: Planes, k: int) -> FloatArray:
    area = 4 * np.pi * np.sqrt(planes.variance[:, 1] * planes.variance[:, 2])
    return np.asarray(np.sqrt(area * k) / (k - 1))  # the centroid is the points' own: variances lack 1/k


def thinned(count: int, thinning: int) -> IndexArray:
    """Return the rows, in order, of every so many-th of `count` points, taken at random (always the same ones)."""
    if thinning == 1:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).permutation(count)[: count // thinning])


def surface_scale(points: FloatArray) -> int:
    """Return how many times a cloud (n, 3) must be thinned, a power of four, for its neighbourhoods to be flat.

    Where none are, the thinning under which they are flattest is returned.
    """
    best, scale, thinning = np.inf, 1, 1
    while thinning == 1 or len(points) >= LEAST * thinning:
        flat = flatness(points[thinned(len(points), thinning)])
        if flat <= FLAT:
            return thinning
        if flat < best:
            best, scale = flat, thinning
        thinning *= 4
    return scale


def flatness(points: FloatArray) -> float:
    """Return the median ratio of the standard deviations across and along the neighbourhoods of a cloud (n, 3)."""
    asked = thinned(len(points), max(1, len(points) // SAMPLE))
    tree = cKDTree(points)
    rows = tree.query(points[asked], k=np.arange(1, min(NEIGHBOURS, len(points)) + 1), workers=-1)[1]
    variance = fit_planes(points, rows).variance
    return float(np.median(np.sqrt(variance[:, 0] / np.maximum(variance[:, 1], np.finfo(float).tiny))))
