"""The components that a tile falls into in one place, and the sides that its triangles face."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.instancing.placement import Nodes, Placement, VertexNumbers
from o3dleaf.leaf.instancing.tile_loops import ABOVE

UPPER, LOWER, RIM = range(3)
"""Labels of triangles: facing the air above, the air below, or on the rim of a solid."""

FACE_SHARE = 0.25
"""A component with this share of the largest one's size is a face of the surface; fragments at the rim are smaller."""


@dataclass(frozen=True, eq=False)
class TileParts:
    """The components of a tile, found when first asked for; the same wherever all of it lies.

    Attributes
    ----------
    placement : Placement
        The tile in one of these places.
    shared : bool
        Whether they are those of other places, too.
    """

    placement: Placement
    shared: bool = False

    @cached_property
    def components(self) -> npt.NDArray[np.int32]:
        """The component of each node, numbered from 0; −1: not there."""
        root = self.placement.component_roots()
        used = np.zeros(len(root), dtype=bool)
        used[self._own] = self.placement.present
        used[self.placement.nodes] = True
        is_root = np.zeros(len(root), dtype=bool)
        is_root[root[used]] = True
        rank = np.cumsum(is_root, dtype=np.int32) - 1
        components = rank[root]
        components[~used] = -1
        return components

    @cached_property
    def of_vertex(self) -> npt.NDArray[np.int32]:
        """(n + e,) components of the placement's own vertices."""
        return np.where(self.placement.present, self.components[self._own], -1)

    @cached_property
    def sizes(self) -> "PartSizes":
        """Of each component."""
        nodes, count = self.placement.nodes, int(self.components.max(initial=-1)) + 1
        of_triangle = self.components[nodes[:, 0]]
        faces_up = np.zeros(count, dtype=bool)
        faces_up[of_triangle] = self.labels == UPPER
        vertices = np.bincount(self.of_vertex[self.of_vertex >= 0], minlength=count)
        return PartSizes(vertices, np.bincount(of_triangle, minlength=count), faces_up)

    @cached_property
    def rank(self) -> npt.NDArray[np.int32]:
        """(n + e,) place of each own vertex among those that are present, −1 for the others."""
        return rank_of(self.placement.present)

    @cached_property
    def labels(self) -> npt.NDArray[np.uint8]:
        """(m,) labels of the triangles: `UPPER`, `LOWER` or `RIM`."""
        return label_sides(self.placement, self.placement.nodes)

    def meeting(self, shift: int, other: "TileParts") -> "Meeting":
        """Return what it has in common with a neighbor (bits of its shift: along, across); of shared ones once."""
        if not (self.shared and other.shared):
            return Meeting(self, other, *self.placement.common_vertices(shift, other.placement))
        if (shift, other) not in self._meetings:
            self._meetings[shift, other] = Meeting(self, other, *self.placement.common_vertices(shift, other.placement))
        return self._meetings[shift, other]

    def node_numbers(
        self, own: VertexNumbers, neighbors: dict[int, tuple["TileParts", VertexNumbers]]
    ) -> npt.NDArray[np.int32]:
        """Return a number for every node from those of vertices (n + e,), of this tile and of its neighbors, by shift.

        −1 where there is none.
        """
        numbers = np.full(self.placement.node_count, -1, dtype=np.int32)
        numbers[self._own] = own[:]
        for shift, (other, given) in neighbors.items():
            meeting = self.meeting(shift, other)
            numbers[meeting.nodes] = given[meeting.rows]
        return numbers

    @cached_property
    def _meetings(self) -> dict[tuple[int, "TileParts"], "Meeting"]:
        return {}

    @property
    def _own(self) -> IntArray:
        """(n + e,) nodes of the placement's own vertices."""
        tile, start = self.placement.tile, self.placement.node_count - len(self.placement.rim_names)
        return np.concatenate([np.arange(len(tile.edges)), np.arange(start, start + self.placement.rim_own)])


@dataclass(frozen=True, eq=False)
class Meeting:
    """Vertices that a tile has in common with a neighbor.

    Attributes
    ----------
    one, other : TileParts
    nodes : (k,) ndarray of int64
        Nodes of the tile.
    rows : (k,) ndarray of int64
        The same among the neighbor's own vertices.
    """

    one: TileParts
    other: TileParts
    nodes: IntArray
    rows: IntArray

    @cached_property
    def components(self) -> tuple[IntArray, IntArray]:
        """(l,) components of both that have a vertex in common, in pairs."""
        one, other = self.one.components[self.nodes], self.other.of_vertex[self.rows]
        linked = (one >= 0) & (other >= 0)
        pairs = np.unique(np.stack([one[linked], other[linked]]), axis=1).astype(np.int64)
        return pairs[0], pairs[1]


class PartSizes(NamedTuple):
    """Vertices and triangles (l,) of each component, and whether it faces the air above (l,)."""

    vertices: IntArray
    triangles: IntArray
    faces_up: BoolArray


class PlacedTile(NamedTuple):
    """A tile in one place, and what it falls into there."""

    placement: Placement
    parts: TileParts


def rank_of(present: BoolArray) -> npt.NDArray[np.int32]:
    """Return the place of each vertex among those that are present, −1 for the others."""
    rank = np.cumsum(present, dtype=np.int32) - 1
    rank[~present] = -1
    return rank


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
