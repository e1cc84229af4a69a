"""Noise of a cloud: the standard deviation of its points across their surface."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError

SAMPLE = 400
"""Places at which the noise is measured; their median is off by about a twentieth."""
PATCHES = tuple(16 * 2**step for step in range(13))
"""Points of a patch: the smallest patch that is wide enough for its noise counts. The largest, of 65,536, is for
noise of 32 spacings."""
MAX_POINTS = 1024
"""Points that the residual of a patch is found from: of larger ones every second, fourth, ... nearest: σ to 2 %."""
WIDE = 4.5
"""Standard deviations of the noise that the radius of a patch must have: in narrower ones the plane follows noise."""


def noise_across(points: FloatArray, tree: cKDTree) -> float:
    """Return the standard deviation of points (n, 3) across their surface, see `estimate_noise`; `tree` is theirs."""
    if len(points) < PATCHES[0]:
        raise InputError(f"cloud: has {len(points)} points; at least {PATCHES[0]} are needed for its noise")
    places = points[np.unique(np.linspace(0, len(points) - 1, SAMPLE).round().astype(np.int64))]
    noise = np.full(len(places), np.nan)
    for count in PATCHES:
        unknown = np.flatnonzero(np.isnan(noise))
        if count > len(points) or not len(unknown):
            break
        distance, rows = tree.query(places[unknown], k=count, workers=-1)
        residual = _residuals(points[rows[:, :: max(1, count // MAX_POINTS)]])
        wide = distance[:, -1] >= WIDE * residual
        noise[unknown[wide]] = residual[wide]
    known = noise[~np.isnan(noise)]
    if 2 * len(known) < len(places):
        raise InputError("cloud: most neighborhoods are no piece of a surface, however large; is this a volume?")
    return float(np.median(known))


def _residuals(patches: FloatArray) -> FloatArray:
    """Return the (m,) standard deviations of patches (m, k, 3) off the quadrics over their own planes."""
    local = patches - patches.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("mka,mkb->mab", local, local))
    z, u, v = np.einsum("mka,mab->bmk", local, axes)
    scale = np.sqrt((u * u + v * v).mean(axis=1, keepdims=True))
    u, v = u / np.maximum(scale, np.finfo(float).tiny), v / np.maximum(scale, np.finfo(float).tiny)
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)
    basis, _ = np.linalg.qr(terms)
    rest = z - np.einsum("mkq,mq->mk", basis, np.einsum("mkq,mk->mq", basis, z))
    return np.asarray(np.sqrt((rest * rest).sum(axis=1) / (z.shape[1] - terms.shape[2])))
