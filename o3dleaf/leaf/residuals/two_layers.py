"""Points on both sides of a blade that runs midway between them, and what they are off their own side."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.trees import query
from o3dleaf.core.units import measure_in_words, tell_share

SEEN = 40
"""Points nearest to a place along the sheet, by which layers are told: six times as many as a quadric has
coefficients."""
BETWEEN = 0.15
"""Residual variance about two parallel layers over that about one, up to which points lie on two: it is
σ²/(σ² + d²/4) of layers d apart under noise σ, and of a single layer 1 - 2/π = 0.36 of normal noise, 0.25 of points
that fill a slab evenly."""
APART = 1.5
"""Spacings of both layers together that these are apart at least; nearer ones are noise of one sheet."""
LESSER = 0.075
"""Share of the points on the lesser layer at least, three of forty: fewer are stragglers."""
MOST = 0.5
"""Share of the places that have two layers from which on a scan is one of both sides."""
BATCH_SIZE = 4_096


@dataclass(frozen=True, eq=False)
class TwoLayers:
    """The two layers of points that a blade runs midway between, as the sides of a thick leaf are.

    Attributes
    ----------
    height : (n,) ndarray
        Signed, of each point's layer over the blade; 0 where there is one layer, at the blade.
    apart : float
        Distance of the layers, the median.
    share : float
        Share of the points where there are two.
    """

    height: FloatArray
    apart: float
    share: float

    def tell(self, unit: str | None) -> str:
        """Return a line on them, with lengths in words."""
        return (
            f"{tell_share(self.share)} of the points lie on two layers, {measure_in_words(self.apart, unit, digits=2)} "
            "apart, and the blade runs midway between: the sides of a leaf, or passes that disagree; each point is "
            "judged by its own layer"
        )

    def onto_blade(self, points: FloatArray, feet: FloatArray, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points (n, 3) moved by their layers' heights to their feet, and how far off the blade they are."""
        rest = distance - self.height
        kept = np.divide(rest, distance, out=np.ones_like(rest), where=distance != 0)
        return feet + kept[:, np.newaxis] * (points - feet), rest


def find_two_layers(
    plane: FloatArray, feet: FloatArray, distance: FloatArray, once: IntArray, spacing: float
) -> TwoLayers | None:
    r"""Return the two layers of a scan that a blade runs midway between, if most of its points lie on such.

    Around each point a plane is fitted to what its neighbors are off the blade,

    .. math:: |d| ≈ h(u, v), \qquad \operatorname{E}(|d| - h)^2 ≤ 0.15 \operatorname{E} d^2

    where there are two layers h above and below: of one layer of normal noise the ratio is :math:`1 - 2/π`.

    Parameters
    ----------
    plane : (n, 2) ndarray
        (along, across) of the points.
    feet : (n, 3) ndarray
        On the blade, in the world.
    distance : (n,) ndarray
        Signed, of the points from the blade.
    once : (k,) ndarray
        Rows of the points that repeat no others.
    spacing : float
    """
    if len(once) < 2 * SEEN:
        return None
    tree, height, two_sided = cKDTree(feet[once]), np.zeros(len(plane)), np.zeros(len(plane), dtype=bool)
    for start, stop in blocks(len(plane), BATCH_SIZE):
        near = once[query(tree, feet[start:stop], k=[*range(1, SEEN + 1)])[1]]
        rows = slice(start, stop)
        height[rows], two_sided[rows] = _layers(plane[near] - plane[rows, np.newaxis], distance[near])
    # Nearer ones are noise of one sheet; where the sides of a leaf meet at its rim they are as near.
    apart = two_sided & (2 * height >= APART * spacing)
    if np.mean(apart[once]) < MOST:
        return None
    height = np.where(two_sided, np.copysign(height, distance), 0.0)
    return TwoLayers(height, 2 * float(np.median(np.abs(height[apart]))), float(np.mean(two_sided[once])))


def _layers(beside: FloatArray, distance: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the heights (m,) of layers over places, and at which there are two, by neighbors (m, k, 2) and (m, k)."""
    size = np.maximum(np.abs(beside).max(axis=(1, 2), keepdims=True), 1e-300)
    terms = np.concatenate([np.ones((*distance.shape, 1)), beside / size], axis=2)
    off = np.abs(distance)
    normal = np.einsum("mki,mkj->mij", terms, terms)
    plane = np.einsum("mij,mj->mi", np.linalg.pinv(normal, hermitian=True), np.einsum("mki,mk->mi", terms, off))
    left = off - np.einsum("mki,mi->mk", terms, plane)
    lesser = np.minimum(np.mean(distance > 0, axis=1), np.mean(distance < 0, axis=1))
    is_double = (left**2).mean(axis=1) <= BETWEEN * (off**2).mean(axis=1)
    return plane[:, 0], is_double & (lesser >= LESSER) & (plane[:, 0] > 0)
