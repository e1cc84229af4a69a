"""A band of an octree's leaves that grows across the faces which a surface crosses."""

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as attribute

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.isosurface.band.band import BLOCK, Band, distinct
from o3dleaf.surface.isosurface.band.morton_loops import BITS
from o3dleaf.surface.isosurface.octree import octree_loops as loops
from o3dleaf.surface.isosurface.octree.octree import Octree, OctreeLeaves
from o3dleaf.surface.isosurface.octree.traced import TracedLoops

SEED_LEVELS = 2
"""One seed is used of those in a cell so many levels above a leaf: in a block of four leaves a side."""


MAX_CELLS = 1 << BITS - 3
"""Least leaves that points may extend over: shorter steps are not taken, keys reach twice as far."""


@dataclass
class OctreeBand(Band):
    """A band whose cells are the leaves of an octree, and whose points are their nodes on the lattice of the finest.

    Attributes
    ----------
    octree : Octree
    leaves : list of OctreeLeaves
        Those that the surface crosses, wave by wave.
    loops : TracedLoops or None
        What all of them make, once it was asked for.
    """

    octree: Octree = attribute(kw_only=True)
    leaves: list[OctreeLeaves] = attribute(default_factory=list)
    loops: TracedLoops | None = None

    @classmethod
    def on_steps(
        cls, points: FloatArray, steps: FloatArray, field: Field, level: float, box: FloatArray | None = None
    ) -> "OctreeBand":
        """Return an empty band whose leaves are as wide as the steps (n,) of points (n, 3), within a factor of √2."""
        middle, shortest = float(np.median(steps)), float(np.ptp(points, axis=0).max()) / MAX_CELLS
        octave = np.rint(np.log2(np.maximum(steps, shortest) / middle)).astype(np.int64)
        finest = middle * 2.0 ** int(octave.min())
        plain = Band.around(points, field, level, np.full(3, finest), box)
        octree = Octree.of(plain.keys_of(points), octave - octave.min())
        return cls(field, level, plain.step, plain.center, box, octree=octree)

    @property
    def widths(self) -> tuple[float, float]:
        """Sides of the narrowest leaves and of the widest."""
        return float(self.step[0]), float(self.step[0]) * 2**self.octree.split.top

    @property
    def is_empty(self) -> bool:
        """Whether the surface crosses none of the leaves."""
        return not self.leaves

    def thinned(self, seeds: FloatArray) -> FloatArray:
        """Return the first seed (n, 3) of each block of leaves."""
        keys = self.keys_of(seeds)
        levels = self.octree.leaves_at(keys)[1]
        block = np.column_stack([keys >> 3 * (levels + SEED_LEVELS), levels])
        return np.asarray(seeds[np.sort(np.unique(block, axis=0, return_index=True)[1])])

    def widths_at(self, points: FloatArray) -> FloatArray:
        """Return the sides (n,) of the leaves that contain points (n, 3)."""
        return float(self.step[0]) * np.exp2(self.octree.leaves_at(self.keys_of(points))[1])

    def cells_of(self, points: FloatArray) -> IntArray:
        """Return the rising keys of the leaves that contain points; those too far away to be named are left out."""
        return distinct(self.octree.leaves_at(super().cells_of(points))[0])

    def only(self, cells: IntArray, allowed: Callable[[FloatArray], BoolArray] | None) -> IntArray:
        """Return the leaves whose centers pass a test."""
        if allowed is None or not len(cells):
            return cells
        return cells[allowed(self.place_in(*self.octree.leaves_at(cells), 0.5))]

    def place_in(self, keys: IntArray, levels: IntArray, share: float) -> FloatArray:
        """Return the (n, 3) positions in leaves, a share of their sides from their lower corners along all axes."""
        points = np.empty((len(keys), 3))

        def task(start: int, stop: int) -> None:
            loops.place_in_leaves(start, stop, keys, levels, share, self.base, self.step, points)

        run_blocks(task, len(keys), BLOCK)
        return points

    def change(self, field: Field, where: Callable[[FloatArray], BoolArray], *, passed: bool) -> None:
        """Take another field, and ask it at the nodes `where` it may differ; no leaf is visited any more.

        `passed` is for bands that know which cells are side by side; leaves are found again.
        """
        del passed
        self.renew(field, where)
        self.leaves, self.loops = [], None

    def retrace(self, cells: IntArray) -> IntArray:
        """Return what some leaves lead to of those that were not visited: all, with the values that are known."""
        return cells

    def advance(self, cells: IntArray) -> IntArray:
        """Visit new leaves, keep those that the surface crosses, and return the rising keys of those beyond."""
        leaves = self._enter(cells)
        crossed = (leaves.inside > 0) & (leaves.inside < leaves.present)
        if not crossed.any():
            return np.empty(0, dtype=np.int64)
        self.leaves.append(leaves.take(crossed))
        return self._across(self.leaves[-1])

    def _enter(self, cells: IntArray) -> OctreeLeaves:
        """Return leaves by their keys, the field having been asked at their nodes."""
        split, (keys, levels) = self.octree.split, self.octree.leaves_at(cells)
        present, inside = np.empty((2, len(cells)), dtype=np.int64)
        nodes, known, start = np.empty((len(cells), loops.NODES), dtype=np.int32), self.count, 0
        run_blocks(lambda i, j: loops.find_nodes(i, j, split, keys, levels, present), len(cells), BLOCK)
        while start < len(cells):
            named, points = (keys, levels, present, start), (self.table, self.keys, self.known, self.count)
            start, self.count = loops.add_leaves(*named, *points, nodes)
            if start < len(cells):
                self._grow()
        self.ask_new(known)
        run_blocks(lambda i, j: loops.read_insides(i, j, self.values, nodes, inside), len(cells), BLOCK)
        return OctreeLeaves(keys, levels, present, inside, nodes)

    def _across(self, leaves: OctreeLeaves) -> IntArray:
        """Return the rising keys of the leaves not visited across the faces of some that the surface crosses."""
        split, beyond = self.octree.split, np.empty((len(leaves.keys), 24), dtype=np.int64)

        def task(start: int, stop: int) -> None:
            loops.cross_leaf_faces(start, stop, split, *leaves[:4], self.table, self.keys, self.known, beyond)

        run_blocks(task, len(beyond), BLOCK)
        return distinct(beyond[beyond >= 0])

    def traced(self) -> TracedLoops:
        """Return the loops of crossed edges of all leaves, by the leaves' keys."""
        if self.loops is None:
            leaves = OctreeLeaves(*(np.concatenate(part) for part in zip(*self.leaves, strict=True)))
            self.loops = TracedLoops.of(self, leaves.take(np.argsort(leaves.keys)))
        return self.loops

    def vertices(self) -> FloatArray:
        """Return the middles (v, 3) of the crossings of each loop."""
        return self.traced().middles()
