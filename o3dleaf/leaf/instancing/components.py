"""The components that a tile falls into in one place, and the sides that its triangles face."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.leaf.instancing.placement import Nodes, Placement
from o3dleaf.leaf.instancing.tile_loops import ABOVE

UPPER, LOWER, RIM = range(3)
"""Labels of triangles: facing the air above, the air below, or on the rim of a solid."""

FACE_SHARE = 0.25
"""A component with this share of the largest one's size is a face of the surface; fragments at the rim are smaller."""


@dataclass(frozen=True, eq=False)
class PlacedTile:
    """A placement and the component of each node, numbered from 0 in this place; −1: not there.

    Where it is all of a tile that lies in other places too, `kind` tells which.
    """

    placement: Placement
    components: npt.NDArray[np.int32]
    count: int
    kind: int | None = None

    @property
    def vertex_components(self) -> npt.NDArray[np.int32]:
        """(n + e,) components of the placement's own vertices."""
        tile, rim = self.placement.tile, self.placement.rim_own
        start = len(tile.edges) + len(tile.beyond)
        components = np.concatenate([self.components[: len(tile.edges)], self.components[start : start + rim]])
        return np.where(self.placement.present, components, -1)


def find_components(placement: Placement) -> PlacedTile:
    """Return a placement with its components numbered from 0."""
    root = placement.component_roots()
    present, tile = placement.present, placement.tile
    start = len(tile.edges) + len(tile.beyond)
    used = np.zeros(len(root), dtype=bool)
    used[: len(tile.edges)] = present[: len(tile.edges)]
    used[start : start + placement.rim_own] = True
    used[placement.nodes] = True
    is_root = np.zeros(len(root), dtype=bool)
    is_root[root[used]] = True
    rank = np.cumsum(is_root, dtype=np.int32) - 1
    components = rank[root]
    components[~used] = -1
    return PlacedTile(placement, components, int(is_root.sum()))


def label_sides(placement: Placement, nodes: Nodes) -> npt.NDArray[np.uint8]:
    """Return the labels of a placement's triangles: `UPPER`, `LOWER` or `RIM`."""
    tile = placement.tile
    of_node = np.concatenate([tile.sides, tile.beyond_sides, placement.rim_sides])
    if placement.inner is not None:
        # Inside a reduced tile a component faces where its border does.
        of_node = of_node[placement.component_roots()]
    labels = np.where(of_node == ABOVE, UPPER, LOWER).astype(np.uint8)[nodes[:, 0]]
    on_rim = placement.on_rim
    if on_rim is not None:
        labels[on_rim] = RIM
    return labels


def select_faces(size: npt.NDArray[Any], faces_up: BoolArray | None) -> list[int]:
    """Return which components are the two sheets, or the one solid; the others are fragments.

    Parameters
    ----------
    size : (l,) ndarray
        Of each component.
    faces_up : (l,) ndarray of bool, optional
        Which components face the air above; None: a solid.

    Raises
    ------
    ReconstructionError
        If more than one component of a kind, or none, is as large as a face.
    """
    groups = [np.arange(len(size))] if faces_up is None else [np.flatnonzero(faces_up), np.flatnonzero(~faces_up)]
    large = [int(np.sum(size[group] > FACE_SHARE * size[group].max(initial=0.0))) for group in groups]
    if large != [1] * len(groups):
        kind = "pieces, not one solid" if faces_up is None else "sheets, not two (upper and lower side)"
        raise ReconstructionError(
            f"the surface at this spacing is in {sum(large)} {kind}; use a finer spacing or another threshold"
        )
    return [int(group[np.argmax(size[group])]) for group in groups]
