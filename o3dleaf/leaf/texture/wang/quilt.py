"""The quilt: which place of which patch each node of each Wang tile shows, and the smooth weights that follow from it.

A tile has nodes on a lattice of its own, and one around it, and each node a label: a patch and where in it the tile's
corner would lie. The weight of a label at a point is that of its nodes in a cubic B-spline, so that weights sum to
one, have two continuous derivatives, and reach two nodes far. Tiles whose labels agree on the three rows of nodes about
a border are one field across it, with its derivatives.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.jet_loops import add_product
from o3dleaf.fitting.pu.blend import BATCH_SIZE
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.evaluation_loops import jet_size
from o3dleaf.leaf.texture.wang.corners import Coloring, kinds_of

REACH = 2
"""Nodes that the weight of a label reaches beyond its own."""
FARTHEST = 2.0**52
"""Tiles from the first one, beyond which no point is known to lie in one rather than another: it stays in the last."""


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


@dataclass(frozen=True, eq=False)
class QuiltedTiles:
    """Patches weighted by the labels of tiles, for `o3dleaf.fitting.pu.blend.Blended`.

    Attributes
    ----------
    fields : tuple of PUInterpolant
    quilt : Quilt
    color : callable
        Colors of the plane's corners.
    """

    fields: tuple[PUInterpolant, ...]
    quilt: Quilt
    color: Coloring

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:  # noqa: ARG002 - there are no balls
        """Return the jets, a column each, of the blend at the (n, 3) queries."""
        sums = np.empty((jet_size(3, level), len(queries)))
        # Labels and copies are held beside the sums: fewer points at once keep to the memory that a blend promises.
        for first, last in blocks(len(queries), BATCH_SIZE >> (5 + level)):
            sums[:, first:last] = self._sum(queries[first:last], level, dtype)
        return sums

    def _sum(self, queries: FloatArray, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets of Σ ω_k F_k at (n, 3) points."""
        quilt = self.quilt
        places = np.floor(np.clip(queries[:, :2] / quilt.tile, -FARTHEST, FARTHEST)).astype(np.int64)
        within = np.clip(queries[:, :2] - places * quilt.tile, 0.0, quilt.tile)
        cells = np.clip((within / quilt.step).astype(np.int64), 0, quilt.nodes - 1)
        kinds = kinds_of(self.color, places[:, 0], places[:, 1])
        alone = quilt.alone[kinds, cells[:, 0], cells[:, 1]]
        sums, totals = (np.zeros((jet_size(3, level), len(queries))) for _ in range(2))
        rows = np.flatnonzero(alone >= 0)
        sums[:, rows] = self._shown(alone[rows], within[rows], queries[rows, 2], level, dtype)
        rows = np.flatnonzero(alone < 0)
        if not len(rows):
            return sums
        around = quilt.around(kinds[rows], cells[rows])
        share = within[rows] / quilt.step - cells[rows]
        splines = [spline_weights(share[:, axis], float(quilt.step[axis]), level) for axis in range(2)]
        for label in np.unique(around):
            seen = around == label
            some = np.flatnonzero(seen.any(axis=(1, 2)))
            weight = _weight(seen[some], [[part[:, some] for part in each] for each in splines], level)
            at = rows[some]
            jets = self._shown(np.full(len(at), label), within[at], queries[at, 2], level, dtype)
            add_product(weight, jets, at, len(at), 3, level, sums, totals)
        return sums

    def _shown(
        self, labels: IntArray, within: FloatArray, height: FloatArray, level: int, dtype: np.dtype[Any]
    ) -> FloatArray:
        """Return the jets of what labels (n,) show at places (n, 2) within their tiles."""
        points = np.column_stack([self.quilt.corners[labels] + within, height])
        jets = np.empty((jet_size(3, level), len(points)))
        for number, field in enumerate(self.fields):
            rows = np.flatnonzero(self.quilt.sources[labels] == number)
            if len(rows):
                # A node at the patch's face may lie beyond it by rounding, and is no farther.
                inner = np.clip(points[rows], *field.bounds)
                jets[:, rows] = field.stacked_jets(np.ascontiguousarray(inner), level, dtype)
        return jets


def _weight(seen: npt.NDArray[np.bool_], splines: list[list[FloatArray]], level: int) -> FloatArray:
    """Return the jets (jet, n) of the weight of a label, from the nodes (n, 4, 4) that show it."""
    along, across = splines
    weight = np.zeros((jet_size(3, level), len(seen)))
    # Rows of a jet: value, three slopes, and second derivatives by pairs of axes.
    rows = {(0, 0): 0, (1, 0): 1, (0, 1): 2, (2, 0): 4, (1, 1): 5, (0, 2): 7}
    for (a, b), row in rows.items():
        if a + b > level:
            continue
        for i in range(4):
            line = np.zeros(len(seen))
            for j in range(4):
                line += seen[:, i, j] * across[b][j]
            weight[row] += along[a][i] * line
    return weight
