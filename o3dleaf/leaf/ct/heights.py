"""Planes and quadrics through the heights of a blade, without its hairs."""

import numpy as np
from scipy.ndimage import distance_transform_edt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray

HAIR = 3.0
"""Heights more than so many typical deviations off the plane belong to hairs."""
ROUNDS = 5
"""Of leaving hairs out and fitting anew."""


def fit_plane(u: FloatArray, v: FloatArray, height: FloatArray) -> tuple[FloatArray, float]:
    """Return slopes (2,) and height at (0, 0) of the plane through heights (nu, nv), without the hairs."""
    weight = hann_window(height)
    known = weight > 0
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)[known]
    z = height[known]
    plane, _ = _fit(np.column_stack([grid, np.ones(len(grid))]), z, weight[known], 1e-12 * float(np.ptp(z)))
    return plane[:2], float(plane[2])


def fit_quadric(u: FloatArray, v: FloatArray, height: FloatArray, step: float) -> tuple[FloatArray, BoolArray]:
    """Return the coefficients (6,) of 1, u, v, u², u v, v² through heights (nu, nv), and which heights are no hairs.

    All known heights count alike: a quadric that is free at the sides would bend there by itself. Heights are middles
    of voxels, whole or half steps of which most may be the same.
    """
    known = np.isfinite(height)
    x, y = (place[known] for place in np.meshgrid(u, v, indexing="ij"))
    design = np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y])
    quadric, close = _fit(design, height[known], np.ones(len(x)), step / 2)
    kept = np.zeros(height.shape, dtype=bool)
    kept[known] = close
    return quadric, kept


def _fit(design: FloatArray, z: FloatArray, weight: FloatArray, least: float) -> tuple[FloatArray, BoolArray]:
    """Return the weighted least squares of what is not far off them, and what that is.

    Far is `HAIR` typical deviations, none of them less than `least`.
    """
    w = weight
    for _ in range(ROUNDS):
        root = np.sqrt(w)[:, np.newaxis]
        # Centered and scaled by lstsq's own orthogonal factors; a few unknowns need no more.
        found = np.asarray(np.linalg.lstsq(design * root, z * root[:, 0], rcond=None)[0], dtype=np.float64)
        off = abs(z - design @ found)
        w = np.where(off <= HAIR * max(np.median(off), least), weight, 0.0)
    return found, w > 0


def hann_window(height: FloatArray) -> FloatArray:
    """Weights that fall to zero at the edge of the known heights, so that a cut ridge does not count as a slope."""
    inward = distance_transform_edt(np.pad(np.isfinite(height), 1))[1:-1, 1:-1]
    bell: FloatArray = np.sin(0.5 * np.pi * inward / inward.max()) ** 2
    return bell
