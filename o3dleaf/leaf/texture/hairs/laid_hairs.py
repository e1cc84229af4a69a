"""The hairs of a texture over a plane, and which of them are removed: by chance, as a map wants it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.texture.hairs.zones import HairZones
from o3dleaf.leaf.texture.wang.corners import hashed
from o3dleaf.leaf.texture.wang.quilt import spline_weights
from o3dleaf.surface.mesh.topology import label_nodes

NODES = np.arange(4) - 1
"""Nodes that a point sees along an axis, from that below it."""


@dataclass(frozen=True, eq=False)
class LaidHairs:
    """Tiles in their places, and the pieces of zones that are removed there.

    Attributes
    ----------
    zones : HairZones
    corner, tile : (2,) ndarrays
        Lower corner of the tile in place (0, 0), and size of a tile.
    first : (2,) ndarray of int64
        The first place that is known.
    kinds : (p, q) ndarray of int64
        The tile in each place from there on.
    removed : (p, q, k + 1) ndarray of bool
        Which pieces are removed in each place; the last one, −1, is none.
    repeats : bool
        Whether the plane repeats after these places; else all hairs beyond them are kept.
    counts : (int, int)
        Hairs in the box that are kept, and all of them.
    """

    zones: HairZones
    corner: FloatArray
    tile: FloatArray
    first: IntArray
    kinds: IntArray
    removed: BoolArray
    repeats: bool = False
    counts: tuple[int, int] = (0, 0)

    @classmethod
    def all_kept(cls, corner: FloatArray, tile: FloatArray, kinds: IntArray) -> "LaidHairs":
        """Return what repeats of a texture, no zones in it."""
        zones, none = HairZones.none(kinds.size), np.zeros((*kinds.shape, 1), dtype=bool)
        return cls(zones, corner, tile, np.zeros(2, dtype=np.int64), kinds, none, repeats=True)

    @classmethod
    def bare(cls, zones: HairZones, corner: FloatArray, tile: FloatArray, kinds: IntArray) -> "LaidHairs":
        """Return what repeats of a texture, all hairs removed."""
        removed = np.ones((*kinds.shape, zones.count + 1), dtype=bool)
        removed[:, :, -1] = False
        return cls(zones, corner, tile, np.zeros(2, dtype=np.int64), kinds, removed, repeats=True)

    @classmethod
    def thinned(
        cls,
        zones: HairZones,
        corner: FloatArray,
        tile: FloatArray,
        *,
        box: FloatArray,
        kind_of: Callable[[IntArray, IntArray], IntArray],
        share_at: Callable[[FloatArray], FloatArray],
        seed: int,
    ) -> "LaidHairs":
        """Draw the hairs that are kept in a box (2, 2) of the plane.

        Parameters
        ----------
        zones : HairZones
        corner, tile : (2,) ndarrays
        box : (2, 2) ndarray
        kind_of : callable
            Takes numbers of places along and across to the tiles there.
        share_at : callable
            The share of hairs to be kept around (n, 2) points.
        seed : int
            A hair is kept where the number that is drawn for it is below the share at its foot: of two maps, the
            denser one has all hairs of the other.
        """
        first, last = (np.floor((box[side] - corner) / tile).astype(np.int64) for side in range(2))
        p, q = np.meshgrid(*(np.arange(a - 1, b + 2) for a, b in zip(first, last, strict=True)), indexing="ij")
        kinds = kind_of(p, q)
        removed, counts = np.zeros((*kinds.shape, zones.count + 1), dtype=bool), (0, 0)
        if zones.count:
            group = _groups(zones, kinds)
            sums, sizes = (part[kinds.ravel()].reshape(group.size, *part.shape[2:]) for part in zones.middles)
            places = np.repeat(np.stack([p, q], axis=-1).reshape(-1, 2), zones.count, axis=0)
            count = int(group.max()) + 1
            size = np.bincount(group, sizes, count)
            middle = [np.bincount(group, sums[:, axis] + sizes * places[:, axis], count) for axis in range(2)]
            feet = corner + np.stack(middle, axis=1) / np.maximum(size, 1.0)[:, np.newaxis] * tile
            # A hair is known by the first of its pieces.
            _, member = np.unique(group, return_index=True)
            drawn = hashed(hashed(places[member, 0], places[member, 1], seed), member % zones.count, seed) / 2.0**63
            gone = drawn >= share_at(feet)
            removed[:, :, :-1] = gone[group].reshape(*kinds.shape, -1)
            within = (size > 0) & ((feet >= box[0]) & (feet <= box[1])).all(axis=1)
            counts = int(np.sum(~gone & within)), int(np.sum(within))
        return cls(zones, corner, tile, first - 1, kinds, removed, counts=counts)

    def at(self, p: IntArray, q: IntArray) -> tuple[IntArray, IntArray, BoolArray]:
        """Return rows and columns of `kinds` for places, and which of the places are known."""
        i, j = p - self.first[0], q - self.first[1]
        rows, columns = self.kinds.shape
        if self.repeats:
            return i % rows, j % columns, np.ones(np.shape(i), dtype=bool)
        known = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        return np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1), known

    def states(self, p: IntArray, q: IntArray) -> BoolArray:
        """Return which pieces (n, k + 1) are removed in places (p, q)."""
        rows, columns, known = self.at(p, q)
        return np.asarray(self.removed[rows, columns] & known[:, np.newaxis])

    def bare_at(self, plane: FloatArray) -> BoolArray:
        """Return over which points (n, 2) the field is that with no hairs; over all others it is that with all."""
        return self._cells_at(plane)[2] if self.zones.count else np.zeros(len(plane), dtype=bool)

    def _cells_at(self, plane: FloatArray) -> tuple[IntArray, FloatArray, BoolArray]:
        """Return the cells of nodes (n, 2) that points lie in, where in them, and which are of removed pieces."""
        nodes = self.zones.nodes
        share = np.clip((plane - self.corner) / (self.tile / nodes), -(2.0**52), 2.0**52)
        cell = np.floor(share).astype(np.int64)
        rows, columns, known = self.at(*(cell // nodes).T)
        i, j = (cell % nodes).T
        # Around its low nodes a zone goes on, farther than a lid sees them.
        piece = self.zones.pieces[self.kinds[rows, columns], i, j]
        return cell, share - cell, known & self.removed[rows, columns, piece]

    def lids(self, plane: FloatArray, level: int) -> tuple[IntArray, FloatArray]:
        """Return the rows of points (n, 2) over which a lid is low, and the jets there of floor and ceiling.

        Returns
        -------
        rows : (r,) ndarray
        jets : (2, 1, 3 or 6, r) ndarray
            Value, slopes along and across, and second derivatives (along twice, both, across twice).
        """
        nodes, step = self.zones.nodes, self.tile / self.zones.nodes
        cell, part, bare = self._cells_at(plane)
        chosen = np.flatnonzero(bare)
        around = cell[chosen, :, np.newaxis] + NODES
        i, j = around[:, 0, :, np.newaxis], around[:, 1, np.newaxis, :]
        rows, columns, known = self.at(i // nodes[0], j // nodes[1])
        kinds, i, j = self.kinds[rows, columns], i % nodes[0], j % nodes[1]
        low = known & self.zones.low[kinds, i, j] & self.removed[rows, columns, self.zones.pieces[kinds, i, j]]
        along, across = (spline_weights(part[chosen, axis], float(step[axis]), level) for axis in range(2))
        orders = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)][: (1, 3, 6)[level]]
        jets = np.empty((2, len(orders), len(chosen)))
        for side in range(2):
            heights = np.where(low, self.zones.lids[side, kinds, i, j], self.zones.open_lids[side])
            for row, (a, b) in enumerate(orders):
                jets[side, row] = np.einsum("rij,ir,jr->r", heights, along[a], across[b], optimize=False)
        return chosen, jets

    def low_cells(self, place: tuple[int, int], shape: tuple[int, int]) -> BoolArray:
        """Return which of `shape` cells of the tile in a place a lid reaches into."""
        n, m = self.zones.nodes.tolist()
        p, q = place
        i, j = np.meshgrid(np.arange(-1, n + 2) + p * n, np.arange(-1, m + 2) + q * m, indexing="ij")
        rows, columns, known = self.at(i // n, j // m)
        kinds, i, j = self.kinds[rows, columns], i % n, j % m
        removed = known & self.removed[rows, columns, self.zones.pieces[kinds, i, j]]
        return _cells(removed & self.zones.low[kinds, i, j], shape)


def _groups(zones: HairZones, kinds: IntArray) -> IntArray:
    """Return the zone, from 0 on, that each piece in each place is part of."""
    count, pieces = zones.count, zones.pieces
    number = np.arange(kinds.size).reshape(kinds.shape) * count
    first, second = [], []
    for one, other, far, near in (
        (np.s_[:-1, :], np.s_[1:, :], pieces[:, -1, :], pieces[:, 0, :]),
        (np.s_[:, :-1], np.s_[:, 1:], pieces[:, :, -1], pieces[:, :, 0]),
    ):
        a, b = far[kinds[one]], near[kinds[other]]
        both = (a >= 0) & (b >= 0)
        first.append((a + number[one][..., np.newaxis])[both])
        second.append((b + number[other][..., np.newaxis])[both])
    return label_nodes(np.concatenate(first), np.concatenate(second), kinds.size * count)


def _cells(low: BoolArray, shape: tuple[int, int]) -> BoolArray:
    """Return which of `shape` cells of a tile see one of its low nodes (n + 3, m + 3), one beside each border."""
    cells = low
    for axis, count in enumerate(shape):
        nodes = low.shape[axis] - 3
        ends = np.arange(count + 1) * nodes / count
        # Points of a cell see the node below their own, and two above.
        first = np.floor(ends[:-1] + 1e-9).astype(np.int64)
        last = np.ceil(ends[1:] - 1e-9).astype(np.int64) + 2
        sums = np.concatenate(
            [
                np.zeros((1, *np.delete(cells.shape, axis)), dtype=np.int64),
                np.cumsum(np.moveaxis(cells, axis, 0), axis=0),
            ]
        )
        cells = np.moveaxis(sums[last + 1] > sums[first], 0, axis)
    return cells
