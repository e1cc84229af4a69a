"""Closed surfaces whose neighbors do not show their sides: found from the winding number alone."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud.neighbors import fit_planes, nearest_neighbors
from o3dleaf.surface.cloud.surfels import Surfels, thinned
from o3dleaf.surface.cloud.winding.consistency import (
    QUIET,
    WIDEST_OF_DOUBTS,
    Consistent,
    make_consistent,
    tears,
    uncertain_notes,
)
from o3dleaf.surface.cloud.winding.dipole_tree import DipoleTree

SAMPLE = 4096
"""Points that a cloud is tried with first."""
ROUNDS = 10
"""Of making them consistent, where no side is known: after six, bodies a spacing apart are not told apart yet."""
BALANCED = 0.05
"""Length of the mean of normals by area up to which they may be of a closed surface, where it is zero: noisy figures
whose sides were found have 0.03, leaves 0.14 and more."""
ONE_SIDED = 0.5
"""The same, above which it is not tried: normals of a sheet with two sides agree on one direction."""
ENCLOSED = 0.2
"""Least mean winding number of a closed surface: 1/2, less what softening takes on thin parts."""
CLOSED_NOTE = "neighbors did not agree on sides: they were found by what the whole encloses"


def close_anew(
    points: FloatArray, surfels: Surfels, sides: FloatArray, normals: FloatArray, *, thin: bool = False
) -> tuple[FloatArray, tuple[str, ...]] | None:
    """Return the normals (n, 3) with which a cloud that seems to enclose nothing is closed, and notes, if there are.

    Two bodies that nearly touch, joined with contrary sides, enclose as much as they exclude; so do the two sides of
    parts that are as thin as the noise. Here no side is taken for granted, on some of the points at first.

    Parameters
    ----------
    points : (n, 3) ndarray
    surfels : Surfels
    sides : (m, 3) ndarray
        Normals of the surfels.
    normals : (n, 3) ndarray
        The same at the points.
    thin : bool
        Groups of points show two sheets: they are of both sides, and what is right at the points may tear them.
    """
    if not thin and imbalance(normals, surfels.spacing) > ONE_SIDED:
        return None
    thinning = max(1, len(points) // SAMPLE)
    some = thinned(len(points), thinning)
    with progress.silent():
        found = _all_anew(points[some], normals[some], np.sqrt(thinning) * surfels.spacing[some])
        if found is not None and thinning > 1:
            nearest = query(cKDTree(points[some]), points)[1]
            found = _all_anew(points, found.normals[nearest], surfels.spacing)
    # A sample, whose sides are not settled yet, may be less balanced: 0.12 where all the points have 0.02.
    if found is None or imbalance(found.normals, surfels.spacing) > BALANCED:
        return None
    if thin:
        sides, surfels = normals, Surfels.single(points, nearest_neighbors(cKDTree(points)).row, surfels.scale)
    if tears(surfels, sides, found.normals):
        return None
    return found.normals, (CLOSED_NOTE, *uncertain_notes(points, found))


def imbalance(normals: FloatArray, spacing: FloatArray) -> float:
    """Return the length of the mean of unit normals (n, 3) by area, spacing² (n,): zero on every closed surface."""
    area = spacing**2
    return float(np.linalg.norm(area @ normals) / area.sum())


def _all_anew(points: FloatArray, normals: FloatArray, spacing: FloatArray) -> Consistent | None:
    """Return normals with which points enclose something, all in doubt at first, or None where there are none.

    What is still in doubt then is settled by narrower dipoles, as where most sides are known.
    """
    across = np.sqrt(fit_planes(points, nearest_neighbors(cKDTree(points)).row).variance[:, 0])
    noise, everywhere = float(np.quantile(across, QUIET)), np.ones(len(points), bool)
    found = make_consistent(points, normals, spacing, noise, everywhere, rounds=ROUNDS)
    found = make_consistent(points, found.normals, spacing, noise, found.uncertain, widest=WIDEST_OF_DOUBTS)
    tree = DipoleTree(points)
    wide = spacing[tree.order]
    flux = np.ascontiguousarray(found.normals[tree.order] * wide[:, np.newaxis] ** 2)
    return found if tree.winding(flux, wide, everywhere)[:, 0].mean() >= ENCLOSED else None
