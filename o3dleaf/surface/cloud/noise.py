"""Noise and spacing of a cloud at some places: how its points spread across their surface, and along it."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query

CLEAN = 0.1
"""Noise in spacings up to which a cloud is clean. Of others creases are not sought: of normals that turn, some only
seem to."""
SAMPLE = 400
"""Places at which the noise is measured; their median is off by about a twentieth."""
PATCHES = tuple(16 * 2**step for step in range(13))
"""Points of a patch: the smallest patch that is wide enough for its noise counts. The largest, of 65,536, is for
noise of 32 spacings."""
MAX_POINTS = 256
"""Points that the residual of a patch is found from: of larger ones those among every second, fourth, ... of the cloud.
They tell σ at a place to 4 %; the median of all places is off by as much."""
WIDE = 4.5
"""Standard deviations of the noise that the radius of a patch must have: in narrower ones the plane follows noise."""
LEAST = 12
"""Points of a patch on the side of its middle, of fewer a larger one is taken: twice what a quadric takes."""
ROUNDS = 3
"""Rounds in which a side is found: a mean of the normals on a side, then the normals on the side of the mean."""


class Places(NamedTuple):
    """What was measured at some places of a cloud, NaN where nothing could be.

    Attributes
    ----------
    points : (m, 3) ndarray
    noise : (m,) ndarray
        Standard deviation of the points around each place across their surface.
    spacing : (m,) ndarray
        1/sqrt(points per unit area) around it, on its own side.
    """

    points: FloatArray
    noise: FloatArray
    spacing: FloatArray

    @property
    def known(self) -> bool:
        """Whether most places lie on a surface."""
        return bool(2 * np.sum(~np.isnan(self.noise)) >= len(self.noise))


def measure_places(points: FloatArray, tree: cKDTree, normals: FloatArray | None = None) -> Places:
    """Measure the noise and the spacing of `points` (n, 3), of which `tree` is one, at some hundred of them.

    Of points with outward `normals` (n, 3) only those on the side of the place count: those of another sheet, however
    near, say nothing of this one.
    """
    rows = np.unique(np.linspace(0, len(points) - 1, SAMPLE).round().astype(np.int64))
    noise, spacing = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    for count in PATCHES:
        unknown = np.flatnonzero(np.isnan(noise))
        if count > len(points) or not len(unknown):
            break
        every = max(1, count // MAX_POINTS)
        some = tree if every == 1 else cKDTree(points[::every])
        distance, used = query(some, points[rows[unknown]], k=count // every)
        used *= every
        counted = np.ones(used.shape, bool)
        if normals is not None:
            counted = _on_one_side(normals[rows[unknown]], normals[used])
            enough = counted.sum(axis=1) >= LEAST
            unknown, distance, used, counted = unknown[enough], distance[enough], used[enough], counted[enough]
        residual, area = _residuals(points[used], counted)
        wide = distance[:, -1] >= WIDE * residual
        noise[unknown[wide]] = residual[wide]
        inside = count * counted[wide].mean(axis=1)
        spacing[unknown[wide]] = np.sqrt(area[wide] * inside) / (inside - 1)
    return Places(points[rows], noise, spacing)


def _on_one_side(middle: FloatArray, around: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which of the unit normals (m, k, 3) around places are on the side of that in their middle (m, 3).

    Single normals of a noisy cloud may point anywhere into their half of space; their mean knows which it is.
    """
    for _ in range(ROUNDS):
        along = np.maximum(np.einsum("ma,mka->mk", middle, around), 0.0)
        middle = np.einsum("mk,mka->ma", along, around)
    return np.asarray(np.einsum("ma,mka->mk", middle, around) > 0)


def _residuals(patches: FloatArray, counted: npt.NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Return the (m,) standard deviations of patches (m, k, 3) off the quadrics over their own planes, and their areas.

    Only the points that are `counted` (m, k) are there; points all over an ellipse of area A have along its axes the
    variances λ₁ and λ₂ with A = 4π √(λ₁ λ₂).
    """
    weight = counted.astype(np.float64)
    total = weight.sum(axis=1)
    mean = np.einsum("mk,mka->ma", weight, patches) / total[:, np.newaxis]
    local = (patches - mean[:, np.newaxis]) * weight[:, :, np.newaxis]
    variance, axes = np.linalg.eigh(np.einsum("mka,mkb->mab", local, local) / total[:, np.newaxis, np.newaxis])
    z, u, v = np.einsum("mka,mab->bmk", local, axes)
    scale = np.sqrt(np.maximum(variance[:, 1:].sum(axis=1), np.finfo(float).tiny))[:, np.newaxis]
    u, v = u / scale, v / scale
    terms = np.stack([weight, u, v, u * u, u * v, v * v], axis=2)
    basis, _ = np.linalg.qr(terms)
    rest = z - np.einsum("mkq,mq->mk", basis, np.einsum("mkq,mk->mq", basis, z))
    noise = np.sqrt((rest * rest).sum(axis=1) / (total - terms.shape[2]))
    return noise, 4 * np.pi * np.sqrt(np.maximum(variance[:, 1] * variance[:, 2], 0.0))
