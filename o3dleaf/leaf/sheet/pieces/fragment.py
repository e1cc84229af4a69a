"""A fragment of another sheet on a leaf, told from the leaf's own end where that is rolled up over it."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.leaf.sheet.pieces.minimum_cut import Links

OVER = 0.5
"""Share of the points of a part that lie over or under the leaf, from which on it does. Of a pass of the same leaf more
lies where the other one is not seen."""
AROUND = 4.0
"""Spacings from a seam within which the leaf's points are seen to lie on either side of it."""
BEYOND = 0.15
"""Share of them beyond the seam, from which on the leaf goes on there: all along it half of them are, beyond a rim none
but those of a next turn that comes so near."""


def is_fragment(
    points: FloatArray, normals: FloatArray, links: Links, part: BoolArray, layered: BoolArray, spacing: float
) -> bool:
    """Return whether a part of a cloud is a fragment of another sheet than the rest, on which it lies.

    It is where it hangs on nothing; or if it lies over the rest for the most part, and the rest goes on beyond the seam
    on which it hangs. The end of a leaf that is rolled up over it hangs on a rim of the rest.

    Parameters
    ----------
    points, normals : (n, 3) ndarrays
    links : Links
        Between the points.
    part, layered : (n,) ndarrays of bool
        Which points are the part's, and which lie over or under others.
    spacing : float
    """
    seam = links.kept(part[links.one] != part[links.other])
    if not len(seam.worth):
        return True
    if np.count_nonzero(part & layered) < OVER * np.count_nonzero(part):
        return False
    ends = np.where(part[seam.one], seam.one, seam.other)
    beyond = _beyond(points[ends], normals[ends], points[~part], spacing)
    return bool(np.average(beyond, weights=seam.worth) >= BEYOND)


def _beyond(at: FloatArray, normals: FloatArray, points: FloatArray, spacing: float) -> FloatArray:
    """Return what share (k,) of the points around places (k, 3) lies on the other side of each than their mean does.

    Sides are told in the planes across `normals` (k, 3).
    """
    share = np.empty(len(at))
    for row, around in enumerate(cKDTree(points).query_ball_point(at, AROUND * spacing)):
        away = points[around] - at[row]
        away -= np.outer(away @ normals[row], normals[row])
        share[row] = np.mean(away @ away.mean(axis=0) < 0)
    return share
