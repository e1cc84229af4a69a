"""The part of the plane that is meshed: lattice cells inside an outline, and distances of columns to it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.instancing.plane_loops import mark_inside, mark_touched, splat_distances

HALO = 8
"""Cells beyond a window that are looked at: one less is the number of rounds that corners are thinned out in."""

ROUNDS = 4
"""So often columns are taken inside for one another; each round sees a cell farther."""
MIN_DEPTH = 1e-4
"""Steps that a column lies off the margin at least: nearer, the parts of `MIN_FRACTION` that a cut keeps from the ends
of all edges there would cross one another."""
ROUNDING = 1e-9
"""Steps inside up to which a column is on the margin, which is outside: columns along a side that runs on the lattice
are off it to either by a rounding."""

OUTSIDE, CUT, WHOLE = range(3)
"""What an outline leaves of a place: nothing, what is to be looked at, or all of it."""


EdgeThickness: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""``thickness, ratio = edge(places)``: the factor τ (n,) of heights at (n, 2) flat places of a mesh's edge, and the
ratio (n,) to it of τ on the margin, which the edge is given: its chords lie up to a step inside, where τ is greater."""


@dataclass(frozen=True, eq=False)
class Footprint:
    """An outline over a lattice of the plane.

    Attributes
    ----------
    rings : (s, 4) ndarray
        Sides of the outline, (x0, y0, x1, y1) in lattice coordinates; a point is inside if an odd number of them
        lies beyond it.
    spacing : (2,) ndarray
        Steps of the lattice, in the unit of length of `distances`.
    box : (2, 2) ndarray of int64
        First and last column that is looked at.
    holes : tuple of (2, 2) ndarrays of int64
        First and last columns of boxes that are left out.
    edge : EdgeThickness, optional
        Where the way to the world makes heights longer or shorter.
    """

    rings: FloatArray
    spacing: FloatArray
    box: IntArray
    holes: tuple[IntArray, ...] = ()
    edge: EdgeThickness | None = None

    def without(self, hole: IntArray) -> "Footprint":
        """Return the footprint less the cells of a box of columns (2, 2)."""
        return replace(self, holes=(*self.holes, hole))

    def contains(self, box: IntArray) -> bool:
        """Return whether all cells of a box of columns lie in it, whole."""
        return bool(self.cells(*box).all())

    def strip(self, first: int, last: int) -> "Footprint":
        """Return the footprint for cells of first <= i < last alone: without the sides that they do not see."""
        return replace(self, rings=self._near(first - self._sight, last + self._sight))

    def coverage(self, row: int, columns: range, shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
        """Return `OUTSIDE`, `CUT` or `WHOLE` for each place of a row, a place being so many cells of the plane.

        `CUT` are all that have a side of the outline, of its box or of a hole in sight: cells or distances tell what
        is there.
        """
        (nx, ny), count = shape, len(columns)
        near = self._near(row * nx - self._sight, (row + 1) * nx + self._sight)
        across = np.sort(near[:, [1, 3]], axis=1) + np.array([-1, 1]) * self._sight
        first, stop = (np.floor(across / ny) - columns.start + [0, 1]).clip(0, count).astype(np.int64).T
        changes = np.zeros(count + 1, dtype=np.int64)
        np.add.at(changes, first, 1)
        np.add.at(changes, stop, -1)
        inside = np.zeros((1, count * ny), dtype=bool)
        mark_inside(near, np.array([row * nx, columns.start * ny]), 0.0, inside)
        covered = np.where(inside[0, ::ny], np.uint8(WHOLE), np.uint8(OUTSIDE))
        low = np.stack([np.full(count, row * nx), np.array(columns) * ny], axis=1) - HALO - 1
        high = low + shape + 2 * (HALO + 1)
        known = ((low >= self.box[0]) & (high <= self.box[1])).all(axis=1)
        for hole in self.holes:
            known &= ~((high > hole[0]) & (low < hole[1])).all(axis=1)
        covered[(np.cumsum(changes[:-1]) > 0) | ((covered == WHOLE) & ~known)] = CUT
        return covered

    def in_holes(self, low: npt.ArrayLike, high: npt.ArrayLike) -> BoolArray:
        """Return which cells low <= (i, j) < high lie in a hole."""
        i, j = (np.arange(a, b) for a, b in zip(np.asarray(low), np.asarray(high), strict=True))
        inside = np.zeros((len(i), len(j)), dtype=bool)
        for first, last in self.holes:
            inside |= ((i >= first[0]) & (i < last[0]))[:, np.newaxis] & ((j >= first[1]) & (j < last[1]))
        return inside

    def cells(self, low: npt.ArrayLike, high: npt.ArrayLike) -> BoolArray:
        """Return which cells low <= (i, j) < high lie in the outline, whole, and touch one another along sides only.

        Where two cells would meet in a corner alone both go, so that a surface over the cells is manifold.

        Raises
        ------
        ReconstructionError
            If cells still meet in corners after `HALO` − 1 rounds.
        """
        first = np.asarray(low, dtype=np.int64) - HALO
        shape = tuple((np.asarray(high) + HALO - first).tolist())
        inside, touched = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        near = self._near(first[0], first[0] + shape[0])
        mark_inside(near, first, 0.5, inside)
        mark_touched(near, first, touched)
        kept = inside & ~touched
        for axis in range(2):
            number = first[axis] + np.arange(shape[axis])
            out = (number < self.box[0, axis]) | (number >= self.box[1, axis])
            kept[(out, slice(None)) if axis == 0 else (slice(None), out)] = False
        for _ in range(HALO - 1):
            lonely = _corners(kept)
            if not lonely.any():
                break
            corners = np.argwhere(lonely)
            for step in ((0, 0), (0, 1), (1, 0), (1, 1)):
                kept[tuple((corners + step).T)] = False
        inner = kept[HALO:-HALO, HALO:-HALO]
        if _corners(inner).any():
            raise ReconstructionError(
                "the outline is too ragged for this spacing; use a finer spacing or a larger alpha"
            )
        return np.asarray(inner & ~self.in_holes(low, high))

    def distances(self, low: npt.ArrayLike, high: npt.ArrayLike) -> FloatArray:
        """Return the signed distances of columns low <= (i, j) < high to the outline, > 0 inside, up to two steps."""
        first = np.asarray(low, dtype=np.int64)
        shape = tuple((np.asarray(high) - first).tolist())
        inside, reach = np.zeros(shape, dtype=bool), 2 * float(self.spacing.max())
        margin = reach / self.spacing[0] + 1
        near = self._near(first[0] - margin, first[0] + shape[0] + margin)
        mark_inside(near, first, 0.0, inside)
        distance = np.full(shape, reach)
        splat_distances(near, first, self.spacing, distance)
        return np.where(inside, distance, -distance)

    def single_distances(self, low: npt.ArrayLike, high: npt.ArrayLike) -> FloatArray:
        """Return what `distances` does, but for columns that are taken inside so that no cell is crossed twice.

        Where two stretches of the margin run through one cell, as at the end of a slit, its corners are inside and
        outside by turns, and the sheets above and below, each of two triangles there, would be cut in different ways.
        """
        least = MIN_DEPTH * float(self.spacing.min())
        distance = self.distances(np.asarray(low) - ROUNDS, np.asarray(high) + ROUNDS)
        inside = distance > ROUNDING * self.spacing.min()
        distance = np.where(inside, np.maximum(distance, least), np.minimum(distance, -least))
        for _ in range(ROUNDS):
            crossed = np.argwhere(_corners(distance > 0))
            if not len(crossed):
                break
            corners = tuple((crossed[:, np.newaxis] + [[0, 0], [0, 1], [1, 0], [1, 1]]).transpose(2, 0, 1))
            depth = np.where(distance[corners] > 0, -np.inf, distance[corners]).argmax(axis=1)
            i, j = (each[np.arange(len(crossed)), depth] for each in corners)
            # The sheet ends there: cut between them and columns outside, it would go on beyond the margin.
            distance[i, j] = least
        return np.ascontiguousarray(distance[ROUNDS:-ROUNDS, ROUNDS:-ROUNDS])

    @property
    def _sight(self) -> float:
        """Steps beyond a window within which a side may matter to its cells, or to the distances of its columns."""
        return HALO + 2 + 2 * float(self.spacing.max() / self.spacing.min())

    def _near(self, first: float, last: float) -> FloatArray:
        """Return the sides that reach between two rows."""
        x = self.rings[:, [0, 2]]
        near: FloatArray = self.rings[(x.min(axis=1) <= last) & (x.max(axis=1) >= first)]
        return near


def _corners(kept: BoolArray) -> BoolArray:
    """Return the inner corners in which two cells meet that have no side in common."""
    a, b, c, d = kept[:-1, :-1], kept[:-1, 1:], kept[1:, :-1], kept[1:, 1:]
    return np.asarray((a == d) & (b == c) & (a != b))


def box_footprint(box: IntArray) -> Footprint:
    """Return the footprint of all cells of a box of columns (2, 2)."""
    (x0, y0), (x1, y1) = (box + np.array([[-1, -1], [1, 1]])).astype(np.float64)
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return Footprint(np.hstack([corners, np.roll(corners, -1, axis=0)]), np.ones(2), box)


def footprint(
    sides: FloatArray,
    origin: FloatArray,
    spacing: FloatArray,
    region: FloatArray | None,
    edge: EdgeThickness | None = None,
) -> Footprint:
    """Return the footprint of an outline's sides (s, 4), in the plane's unit, over a lattice of the plane.

    Parameters
    ----------
    sides : (s, 4) ndarray
    origin, spacing : (2,) ndarrays
        Of the lattice.
    region : (2, 2) ndarray, optional
        Only cells inside this box are kept.
    edge : EdgeThickness, optional
    """
    lattice = (sides.reshape(-1, 2, 2) - origin) / spacing
    low, high = lattice.min(axis=(0, 1)), lattice.max(axis=(0, 1))
    box = np.stack([np.floor(low) - 1, np.ceil(high) + 2])
    if region is not None:
        # A corner on the lattice but for rounding must not cost a cell.
        inner = (region - origin) / spacing
        box = np.stack([np.maximum(box[0], np.ceil(inner[0] - 1e-9)), np.minimum(box[1], np.floor(inner[1] + 1e-9))])
    return Footprint(lattice.reshape(-1, 4), np.asarray(spacing), box.astype(np.int64), edge=edge)
