"""How far the points of a cloud lie off their surface."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError

SAMPLE = 400
"""Places at which the noise is measured; their median is off by about a twentieth."""
PATCHES = tuple(16 * 2**step for step in range(13))
"""Points of a patch: the smallest patch that is wide enough for its noise is believed. The largest, of 65,536, is for
noise of 32 spacings."""
MOST = 1024
"""Points that a patch is judged by: of larger ones every second, fourth, ... nearest, which tell σ to 2 %."""
WIDE = 4.5
"""Standard deviations of the noise that the radius of a patch must have: in narrower ones the plane follows noise."""


def estimate_noise(cloud: CloudLike, tree: cKDTree | None = None) -> float:
    r"""Return the standard deviation of a cloud's points across the surface, in their unit.

    At each of some hundred places a quadric :math:`z(u, v)` over the plane of the nearest k points leaves residuals
    of standard deviation :math:`σ_k`, six degrees of freedom taken off; the smallest k whose patch has a radius of
    at least 4.5 σ_k says σ there, and the median over the places is returned: creases and rims do not count.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
    tree : scipy.spatial.cKDTree, optional
        Of its points, where there is one.

    Raises
    ------
    InputError
        If there are fewer than sixteen points or one is not finite.
    """
    points = points_of(cloud, "cloud", least=PATCHES[0])
    tree = cKDTree(points) if tree is None else tree
    asked = points[np.unique(np.linspace(0, len(points) - 1, SAMPLE).round().astype(np.int64))]
    found = np.full(len(asked), np.nan)
    for count in PATCHES:
        open_ = np.flatnonzero(np.isnan(found))
        if count > len(points) or not len(open_):
            break
        distance, rows = tree.query(asked[open_], k=count, workers=-1)
        residual = _residual(points[rows[:, :: max(1, count // MOST)]])
        wide = distance[:, -1] >= WIDE * residual
        found[open_[wide]] = residual[wide]
    known = found[~np.isnan(found)]
    if 2 * len(known) < len(asked):
        raise InputError("cloud: most neighbourhoods are no piece of a surface, however large; is this a volume?")
    return float(np.median(known))


def _residual(patches: FloatArray) -> FloatArray:
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
