"""The quilt: which place of which patch each node of each Wang tile shows, and the smooth weights that follow from it.

A tile has nodes on a lattice of its own, and one around it, and each node a label: a patch and where in it the tile's
corner would lie. The weight of a label at a point is that of its nodes in a cubic B-spline, so that weights sum to
one, have two continuous derivatives, and reach two nodes far. Tiles whose labels agree on the three rows of nodes about
a border are one field across it, with its derivatives.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray

REACH = 2
"""Nodes that the weight of a label reaches beyond its own."""


@dataclass(frozen=True, eq=False)
class Quilt:
    """The labels of a set of Wang tiles.

    Attributes
    ----------
    tile : (2,) ndarray
        Size along and across.
    labels : (16, n + 3, m + 3) ndarray of int64
        Of each tile's nodes, from the one before its corner to the one beyond the corner across from it.
    sources : (k,) ndarray of int64
        The patch of each label.
    corners : (k, 2) ndarray
        Where in its patch the tile's lower corner would lie.
    energy : (3,) ndarray
        Mean mismatch at seams crossed along, at those crossed across, and at all, over that of any two points.
    """

    tile: FloatArray
    labels: IntArray
    sources: IntArray
    corners: FloatArray
    energy: FloatArray

    @property
    def nodes(self) -> IntArray:
        """(2,) steps of the nodes in a tile, along and across."""
        return np.array(self.labels.shape[1:]) - 3

    @property
    def step(self) -> FloatArray:
        """(2,) distances between nodes."""
        return np.asarray(self.tile / self.nodes)

    @cached_property
    def alone(self) -> IntArray:
        """(16, n, m) the label that a cell of nodes shows alone, −1 where there are several."""
        n, m = self.nodes
        first = self.labels[:, :n, :m]
        parts = [self.labels[:, a : a + n, b : b + m] == first for a in range(4) for b in range(4)]
        return np.where(np.all(parts, axis=0), first, -1)

    def around(self, kinds: IntArray, cells: IntArray) -> IntArray:
        """Return the labels (n, 4, 4) of the nodes that the points of cells (n, 2) of tiles see."""
        i, j = (cells[:, axis, np.newaxis] + np.arange(4) for axis in range(2))
        return np.asarray(self.labels[kinds[:, np.newaxis, np.newaxis], i[:, :, np.newaxis], j[:, np.newaxis]])


def spline_weights(f: FloatArray, step: float, level: int) -> list[FloatArray]:
    """Return the weights (4, n) of the nodes around points at shares f of a cell, and derivatives to order `level`."""
    g = 1 - f
    weights = [np.stack([g**3, (3 * f - 6) * f**2 + 4, (3 * g - 6) * g**2 + 4, f**3]) / 6]
    if level > 0:
        slope = np.stack([-(g**2), (3 * f - 4) * f, (4 - 3 * g) * g, f**2])
        weights.append(slope / (2 * step))
    if level > 1:
        weights.append(np.stack([g, 3 * f - 2, 3 * g - 2, f]) / step**2)
    return weights
