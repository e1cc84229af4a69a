"""Leaves that cross and came out as one sheet: told by its rim, and parted by the surfaces through their arms."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.layers.widths import CLEAN, WIDEST
from o3dleaf.leaf.sheet.pieces.arms import find_arms
from o3dleaf.leaf.sheet.pieces.leaf_pair import LeafPair
from o3dleaf.leaf.sheet.pieces.nearer_surface import count_neighbors, tell_by_surface
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

LEAVES = (0, 2), (1, 3)
"""Arms of either leaf."""
AROUND = 1.5
"""Radii of the place where leaves cross within which their arms tell how they go on there."""
FITS = 0.25
"""Spacings, beside the noise, within which points there lie off the surface that they are of: what is folded is off
its arms' by more."""
APART = 1.0
"""Spacings from which on two surfaces are two, and not one that the arms of each tell a little differently."""
KNOWN = 2.0
"""Distance between two surfaces, over that by which the cubic and the quadric through the arms of a hidden leaf differ
there, from which on they are two: where an arm is a petiole, or a leaf is wavy, arms do not tell how
it goes on."""
DOUBLE = 0.5
"""Density there beyond that of the denser leaf, over that of the other one, from which on both are seen."""
LONG = 3.0
"""Length of the rim around each arm over its width, from which on the outline alone tells leaves: lobes are no longer
than wide."""


class _Crossed(NamedTuple):
    """Points where leaves cross: which are of the first leaf (m,), how many are unsure, if both leaves are seen there.

    And if their surfaces show that there are two.
    """

    first: BoolArray
    unsure: int
    both: bool
    is_sure: bool


def find_crossing(
    points: FloatArray,
    vertices: FloatArray,
    triangles: IntArray,
    spacing: float,
    rows: IntArray,
    resting: LeafPair | None,
) -> LeafPair | None:
    """Return the points of two leaves that cross on a sheet, if none do the leaves `resting` on one another there.

    The arms tell whose the points beyond the crossing are, and by cubics how both leaves go on there. Points there go
    to the surface that they are nearer to, where both leaves are seen; where one hides the other, to one of them.

    Parameters
    ----------
    points : (n, 3) ndarray
        As scanned.
    vertices, triangles : (v, 3), (m, 3) ndarrays
        The sheet.
    spacing : float
        Of the points.
    rows : (n,) ndarray of int
        Of the points, in the scan.
    resting : LeafPair or None
        Kept where nothing joins its leaves.
    """
    if resting is not None and resting.parts and resting.length == 0:
        return resting
    arms = find_arms(vertices, triangles)
    if arms is None:
        return resting
    distance, nearest = query(cKDTree(vertices), points)
    near = np.flatnonzero(distance <= WIDEST * spacing)
    arm, normals = arms.arm[nearest[near]], vertex_normals(vertices, triangles)[nearest[near]]
    free = np.flatnonzero(arm < 0)
    if not len(free) or len(np.unique(arm)) < 5:
        return resting
    noise = max(OrientedCloud.of(points).noise, CLEAN * spacing)
    height = np.einsum("ij,ij->i", points[near] - vertices[nearest[near]], normals)
    flat = points[near] - height[:, np.newaxis] * normals
    density = [count_neighbors(flat, flat[np.isin(arm, own)], spacing) for own in ((-1,), *LEAVES)]
    is_double = density[0] >= max(density[1:]) + DOUBLE * min(density[1:])
    place = _part(points[near], normals, arm, free, spacing, noise, is_double=is_double)
    if not place.is_sure and (resting is not None or arms.long < LONG or arms.several):
        return resting
    # Where heights do not tell, what lies along a margin goes to either side.
    arm = (arms.arm if place.both else arms.halved)[nearest[near]]
    first, between = np.isin(arm, LEAVES[0]), arm[free] < 0
    first[free[between]] = place.first[between]
    said = _tell(points, points[near[free[between]]], place)
    return LeafPair((rows[near[first]], rows[near[~first]]), said)


def _part(
    points: FloatArray,
    normals: FloatArray,
    arm: IntArray,
    free: IntArray,
    spacing: float,
    noise: float,
    *,
    is_double: bool,
) -> _Crossed:
    """Return whose the points `free` (m,) are, which lie on no `arm` (n,) but between."""
    first = np.isin(arm, LEAVES[0])
    heights = np.stack([_heights(points[free], points[np.isin(arm, own)], normals[free]) for own in LEAVES])
    off = np.abs(heights)
    first[free] = off[0] < off[1]
    apart = float(np.median(np.abs(heights[0] - heights[1])))
    told = tell_by_surface(points, normals, first, free, spacing, noise)
    if is_double:
        if told is not None:
            first[told.rows] = told.first
        fits = float(np.median(off.min(axis=0))) <= noise + FITS * spacing
        return _Crossed(first[free], 0 if told is None else told.unsure, True, fits)
    middle = np.median(off, axis=1)
    hidden = int(middle.argmax())
    plainer = _heights(points[free], points[np.isin(arm, LEAVES[hidden])], normals[free], degree=2)
    unknown = float(np.median(np.abs(heights[hidden] - plainer)))
    fits = middle.min() <= noise + FITS * spacing
    is_sure = bool(fits and apart >= max(APART * spacing, 2 * noise, KNOWN * unknown))
    return _Crossed(np.full(len(free), middle[0] < middle[1]), 0 if is_sure else len(free), False, is_sure)


def _tell(points: FloatArray, between: FloatArray, place: _Crossed) -> str:
    """Return what is said of points (m, 3) where leaves cross, in shares of all (n, 3), which may be a thinned scan."""
    share = f"the points there, {100 * len(between) / len(points):.3g} % of all,"
    at = tell_middle(between, points)
    if place.both:
        of_them = f", {100 * place.unsure / len(between):.3g} % of them within the noise of both"
        unsure = of_them if place.unsure else ""
        return f"two leaves cross around {at}: {share} are each taken for the leaf that they are nearer to{unsure}"
    if place.is_sure:
        return f"two leaves cross around {at}, where one hides the other: {share} are taken for the one in front"
    return f"two leaves, or lobes of one, cross around {at} by their outline alone: {share} may be of either"


def _heights(at: FloatArray, points: FloatArray, normals: FloatArray, degree: int = 3) -> FloatArray:
    """Return the heights (m,) of places, with normals (m, 3), over a polynomial through points (n, 3) on both sides."""
    middle = at.mean(axis=0)
    axes = np.linalg.svd(normals.mean(axis=0)[np.newaxis])[2][[1, 2, 0]]
    size = np.linalg.norm(at - middle, axis=1).max()
    near = points[np.linalg.norm(points - middle, axis=1) <= AROUND * size]
    u, v, w = axes @ (near - middle).T / size
    fit = np.linalg.lstsq(_terms(u, v, degree), w, rcond=None)[0]
    u, v, w = axes @ (at - middle).T / size
    return np.asarray(size * (w - _terms(u, v, degree) @ fit))


def _terms(u: FloatArray, v: FloatArray, degree: int) -> FloatArray:
    """Return the terms (n, k) of a polynomial of u and v (n,): 10 of a cubic, 6 of a quadric."""
    return np.stack([u**i * v**j for i in range(degree + 1) for j in range(degree + 1 - i)], axis=1)
