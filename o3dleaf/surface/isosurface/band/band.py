"""A narrow band of a lattice's cells that grows across the faces which a surface crosses."""

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as attribute
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.checks.coordinates import box_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.surface.isosurface.band import band_loops as loops
from o3dleaf.surface.isosurface.band.band_loops import CrossedEdges, Numbering
from o3dleaf.surface.isosurface.band.morton_loops import BITS, encode, fill_table, place_points

CornerArray: TypeAlias = npt.NDArray[np.int32]
CodeArray: TypeAlias = npt.NDArray[np.uint8]

BATCH_SIZE = 1 << 18
"""Points at which a field is evaluated at once."""

MARGIN = 1e-6
"""Part of a step that a point of the solid keeps from the faces of its box: a sample on one would make slivers."""

BLOCK = 1 << 14
"""Cells or vertices that one thread works on at a time."""
FARTHEST = 1e15
"""Cells from the origin beyond which double precision tells no cell from the next."""


def distinct(keys: IntArray) -> IntArray:
    """Return the rising keys, each once; `np.unique` hashes, which takes longer where few recur."""
    keys = np.sort(keys)
    return keys[np.append(True, keys[1:] != keys[:-1])] if len(keys) else keys


class Crossing(NamedTuple):
    """Crossed cells, (c, 8) rows of corners and (c,) codes, and their edges, with a vertex (v, 3) on each."""

    corners: CornerArray
    codes: CodeArray
    numbering: Numbering
    edges: CrossedEdges
    vertices: FloatArray


@dataclass
class Band:
    """The points and cells of a lattice that have been visited; `morton_loops` says how they are stored.

    Attributes
    ----------
    field, level, step
        The surface is where the field has the level; the lattice is that of the whole multiples of `step` (3,).
    center : (3,) ndarray of int64
        The lattice point in the middle of what keys can name.
    box : (2, 3) ndarray or None
        What lies outside is outside the solid, and what lies on it but for `MARGIN` of a step.
    expected : int
        Points at which the field is evaluated until the band is closed, about: for progress.
    table, keys, values, known, count
        The points: rows by place in a hash table, keys and values by row, which rows are lower corners of visited
        cells, and rows in use.
    crossed : list of (corners, codes)
        The cells that the surface crosses, wave by wave.
    before : (c, 8) ndarray
        Corners of the cells that were crossed before the field changed and are allowed, by their keys.
    edges : Crossing or None
        What all crossed cells make, once it was asked for.
    """

    field: Field
    level: float
    step: FloatArray
    center: IntArray
    box: FloatArray | None = None
    expected: int = 0
    table: npt.NDArray[np.int32] = attribute(default_factory=lambda: np.full(1 << 13, -1, dtype=np.int32))
    keys: IntArray = attribute(default_factory=lambda: np.empty(1 << 12, dtype=np.int64))
    values: FloatArray = attribute(default_factory=lambda: np.empty(1 << 12))
    known: BoolArray = attribute(default_factory=lambda: np.zeros(1 << 12, dtype=bool))
    count: int = 0
    crossed: list[tuple[CornerArray, CodeArray]] = attribute(default_factory=list)
    before: CornerArray = attribute(default_factory=lambda: np.empty((0, 8), dtype=np.int32))
    edges: "Crossing | None" = None

    @classmethod
    def around(
        cls, points: FloatArray, field: Field, level: float, step: FloatArray, box: FloatArray | None = None
    ) -> "Band":
        """Return an empty band whose keys reach far beyond the points; the same for most clouds, as is their order."""
        low, high = box_of(points) / step
        quarter = 1 << BITS - 2
        if np.any(high - low > quarter):
            raise InputError(
                f"spacing: the seeds extend over {(high - low).max():.2g} cells; coarsen it or crop the cloud"
            )
        if np.any(np.abs([low, high]) > FARTHEST):
            raise InputError("spacing: the seeds lie over 1e15 cells from the origin; coarsen it or move the cloud")
        center = (np.rint((low + high) / (4 * quarter)) * 2 * quarter).astype(np.int64)
        return cls(field, level, step, center, box)

    @property
    def base(self) -> FloatArray:
        """(3,) the lattice point with key 0."""
        return (self.center - (1 << BITS - 1)).astype(np.float64)

    def cells_of(self, points: FloatArray) -> IntArray:
        """Return the rising keys of the cells that contain points; those too far away to be named are left out."""
        indices = np.floor(points / self.step) - self.base
        near = ((indices >= 1) & (indices < (1 << BITS) - 2)).all(axis=1)
        return distinct(self.keys_of(points[near]))

    def keys_of(self, points: FloatArray) -> IntArray:
        """Return the keys (n,) of the lattice points at or below points (n, 3)."""
        keys = np.empty(len(points), dtype=np.int64)
        encode((np.floor(points / self.step) - self.base).astype(np.int64), keys)
        return keys

    def widths_at(self, points: FloatArray) -> FloatArray:
        """Return the longest sides (n,) of the cells that contain points (n, 3)."""
        return np.full(len(points), self.step.max())

    def only(self, cells: IntArray, allowed: Callable[[FloatArray], BoolArray] | None) -> IntArray:
        """Return the cells whose centers pass a test."""
        return cells if allowed is None or not len(cells) else cells[allowed(self.positions(cells, 0.5))]

    def change(self, field: Field, where: Callable[[FloatArray], BoolArray], *, passed: bool) -> None:
        """Take another field, and ask it at the points `where` it may differ; no cell is visited any more.

        `passed` says whether all that were have passed the test of cells, and need not pass it again.
        """
        corners = self.crossing().corners
        self.before = corners if passed else corners[:0]
        self.renew(field, where)
        self.crossed, self.edges = [], None

    def renew(self, field: Field, where: Callable[[FloatArray], BoolArray]) -> None:
        """Take another field, with its values at the points `where` it may differ; no point is a visited cell's."""
        self.field = field
        points = self.positions(self.keys[: self.count])
        rows = np.flatnonzero(where(points))
        self.values[rows] = self.ask(points[rows])
        self.known[:] = False

    def retrace(self, cells: IntArray) -> IntArray:
        """Visit those of the cells `before` that some cells, of rising keys, lead to; return what else they lead to.

        Of those the corners are known, and which are side by side: nothing is looked up.
        """
        if not len(self.before):
            return cells
        old = self.keys[self.before[:, 0]]
        places = np.minimum(np.searchsorted(old, cells), len(old) - 1)
        again = old[places] == cells
        codes = np.empty(len(old), dtype=np.uint8)
        run_blocks(lambda i, j: loops.read_codes(i, j, self.values, self.before, codes), len(old), BLOCK)
        reached, beyond = loops.retrace(places[again], self.before, codes, self.keys[: self.count])
        self.known[self.before[reached, 0]] = True
        crossed = reached & (codes > 0) & (codes < 255)
        if crossed.any():
            self.crossed.append((self.before[crossed], codes[crossed]))
        return distinct(np.concatenate([cells[~again], beyond]))

    def positions(self, keys: IntArray, shift: float = 0.0) -> FloatArray:
        """Return the (n, 3) positions of lattice points, a share of a cell beyond them along all axes."""
        points, beyond = np.empty((len(keys), 3)), np.full(3, shift)
        run_blocks(lambda i, j: place_points(i, j, keys, beyond, self.base, self.step, points), len(keys), BLOCK)
        return points

    def advance(self, cells: IntArray) -> IntArray:
        """Visit new cells, keep those that the surface crosses, and return the rising keys of those beyond."""
        corners, known, start = np.empty((len(cells), 8), dtype=np.int32), self.count, 0
        while start < len(cells):
            start, self.count = loops.add_cells(cells, start, self.table, self.keys, self.known, self.count, corners)
            if start < len(cells):
                self._grow()
        self.ask_new(known)
        codes = np.empty(len(cells), dtype=np.uint8)
        run_blocks(lambda i, j: loops.read_codes(i, j, self.values, corners, codes), len(cells), BLOCK)
        crossed = (codes > 0) & (codes < 255)
        if not crossed.any():
            return np.empty(0, dtype=np.int64)
        self.crossed.append((corners[crossed], codes[crossed]))
        return self._beyond(*self.crossed[-1])

    def ask_new(self, known: int) -> None:
        """Ask the field at all points but the first `known`."""
        for i, j in blocks(self.count - known, BATCH_SIZE):
            rows = slice(known + i, known + j)
            self.values[rows] = self.ask(self.positions(self.keys[rows]))
            # The next wave is about as large.
            progress.report(known + j, max(self.expected, 2 * self.count - known))

    def _beyond(self, corners: CornerArray, codes: CodeArray) -> IntArray:
        """Return the rising keys of the cells not visited across the faces of some that the surface crosses."""
        beyond = np.empty((len(codes), 6), dtype=np.int64)

        def task(start: int, stop: int) -> None:
            loops.cross_faces(start, stop, corners, codes, self.table, self.keys, self.known, beyond)

        run_blocks(task, len(codes), BLOCK)
        return distinct(beyond[beyond >= 0])

    def _grow(self) -> None:
        """Double the room for points."""
        room = 2 * len(self.keys)
        if room >= np.iinfo(np.int32).max // 2:
            raise InputError(f"spacing: the band has over {self.count:.2g} points; coarsen it, or give `within`")
        held = measured.FOLLOWED_TRIANGLE * self.count  # about as many triangles as there are points
        require_resources(held, f"spacing: over {self.count:,} lattice points near the surface", "coarsen it")
        self.keys, self.values, self.known = (
            np.concatenate([array, np.zeros_like(array)]) for array in (self.keys, self.values, self.known)
        )
        self.table = np.full(2 * room, -1, dtype=np.int32)
        fill_table(self.table, self.keys, self.count)

    @property
    def is_empty(self) -> bool:
        """Whether the surface crosses none of the cells."""
        return not self.crossed

    def vertices(self) -> FloatArray:
        """Return where the surface crosses edges (v, 3), the field being linear along them."""
        return self.crossing().vertices

    def crossing(self) -> "Crossing":
        """Return the crossed cells and edges by their keys, with vertices where the field is linear along an edge."""
        if self.edges is None:
            corners, codes = (np.concatenate(part) for part in zip(*self.crossed, strict=True))
            order = np.argsort(self.keys[corners[:, 0]])
            corners, codes = corners[order], codes[order]
            numbering, many = self._number(corners, codes)
            edges = self._cross_edges(corners, codes, numbering, many)
            self.edges = Crossing(corners, codes, numbering, edges, self.place(edges))
        return self.edges

    def _cross_edges(self, corners: CornerArray, codes: CodeArray, numbering: Numbering, many: int) -> CrossedEdges:
        """Return the edges of cells that the surface crosses, by vertex."""
        edges = CrossedEdges(*np.empty((2, many), dtype=np.int64), *np.empty((3, many)))

        def find(start: int, stop: int) -> None:
            loops.find_fractions(start, stop, corners, codes, self.values, numbering, edges)

        run_blocks(find, len(codes), BLOCK)
        return edges

    def _number(self, corners: CornerArray, codes: CodeArray) -> tuple[Numbering, int]:
        """Return each point's first vertex and the axes along which it has one, and how many vertices there are."""
        marks, first = np.zeros(self.count, dtype=np.uint8), np.zeros(self.count, dtype=np.int64)
        loops.mark_edges(corners, codes, marks)
        rows = np.flatnonzero(marks)
        rows = rows[np.argsort(self.keys[rows])]
        many = np.bitwise_count(marks[rows]).astype(np.int64)
        first[rows] = np.cumsum(many) - many
        return Numbering(first, marks), int(many.sum())

    def ask(self, points: FloatArray) -> FloatArray:
        """Return the field's values less the level; outside the box those at its nearest point, below the level."""
        if self.box is None or not (outside := self.is_outside(self.box, points)).any():
            return self.values_at(points)
        values = self.values_at(np.clip(points, *self.box))
        return np.where(outside, -np.maximum(np.abs(values), np.finfo(np.float64).tiny), values)

    def values_at(self, points: FloatArray) -> FloatArray:
        """Return the field's values less the level at points (n, 3) of the box."""
        return require_finite(np.asarray(self.field(points), dtype=np.float64), "field values") - self.level

    def is_outside(self, box: FloatArray, points: FloatArray) -> BoolArray:
        """Return which points (n, 3) are outside the box, or on it but for `MARGIN` of a step."""
        margin = MARGIN * self.step
        x, y, z = ((points < box[0] + margin) | (points > box[1] - margin)).T  # NumPy's any along rows takes ten times
        return np.asarray(x | y | z)

    def place(self, edges: CrossedEdges) -> FloatArray:
        """Return the (v, 3) positions of vertices."""
        vertices, keys = np.empty((len(edges.lower), 3)), self.keys[edges.lower]

        def task(start: int, stop: int) -> None:
            loops.place_crossings(start, stop, keys, edges.direction, edges.fraction, self.base, self.step, vertices)

        run_blocks(task, len(keys), BLOCK)
        return vertices
