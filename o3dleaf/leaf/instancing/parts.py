"""What of a tile is in one place, and the pieces that it falls into there."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.leaf.instancing.placement import Nodes, Placement
from o3dleaf.leaf.instancing.reduced import Reduced
from o3dleaf.leaf.instancing.tile_loops import ABOVE

LABELS = ("adaxial", "abaxial", "rim")
"""Names of the labels of triangles, in their order."""
ADAXIAL, ABAXIAL, RIM = range(len(LABELS))


@dataclass(frozen=True, eq=False)
class Part:
    """A placement and the labels of its nodes' pieces, counted from 0 in this tile; −1: not there."""

    placement: Placement
    labels: npt.NDArray[np.int32]
    count: int

    @property
    def own(self) -> npt.NDArray[np.int32]:
        """(n + e,) labels of the own vertices."""
        tile, rim = self.placement.tile, self.placement.rim_own
        start = len(tile.edges) + len(tile.beyond)
        labels = np.concatenate([self.labels[: len(tile.edges)], self.labels[start : start + rim]])
        return np.where(self.placement.own, labels, -1)


def stand_in(placement: Placement, reduced: Reduced) -> Placement:
    """Return a whole placement of the tile that was reduced."""
    count = len(reduced.inner)
    names = np.zeros(count, dtype=np.int64), np.zeros(count)
    tile, at = placement.tile, placement.at
    cells = np.zeros(tile.lattice.shape[:2], dtype=bool)
    return Placement(tile, at, reduced.used, cells, reduced.nodes, *names, count, inner=reduced.inner, is_whole=True)


def label_part(placement: Placement) -> Part:
    """Return a placement with its pieces numbered from 0."""
    root = placement.pieces()
    own = placement.own
    tile = placement.tile
    start = len(tile.edges) + len(tile.beyond)
    there = np.zeros(len(root), dtype=bool)
    there[: len(tile.edges)] = own[: len(tile.edges)]
    there[start : start + placement.rim_own] = True
    there[placement.nodes] = True
    is_root = np.zeros(len(root), dtype=bool)
    is_root[root[there]] = True
    rank = np.cumsum(is_root, dtype=np.int32) - 1
    labels = rank[root]
    labels[~there] = -1
    return Part(placement, labels, int(is_root.sum()))


def sides_of(placement: Placement, nodes: Nodes) -> npt.NDArray[np.uint8]:
    """Return the labels of a placement's triangles."""
    tile = placement.tile
    rim = np.full(len(placement.rim_names), ABOVE, dtype=np.uint8)
    of_node = np.concatenate([tile.sides, tile.sides[tile.beyond[:, 0]], rim])
    if placement.inner is not None:
        # Inside a reduced tile a piece looks where its border looks.
        of_node = of_node[placement.pieces()]
    labels = np.where(of_node == ABOVE, ADAXIAL, ABAXIAL).astype(np.uint8)[nodes[:, 0]]
    on_rim = placement.on_rim
    if on_rim is not None:
        labels[on_rim] = RIM
    return labels
