"""A band of a lattice's cells that grows across the faces which a surface crosses, and its triangles."""

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as attribute
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray, require_finite
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import Progress, blocks, finish, run_blocks, share_out
from o3dleaf.surface.isosurface import band_loops as loops
from o3dleaf.surface.isosurface import crease_edge_loops as creased
from o3dleaf.surface.isosurface.cell_loops import COUNTS, CUBES
from o3dleaf.surface.isosurface.crease_edges import BESIDE, LEAST_COSINE, join_creases, meet_planes
from o3dleaf.surface.mesh.clip import trim_to_manifold

CornerArray: TypeAlias = npt.NDArray[np.int32]
CodeArray: TypeAlias = npt.NDArray[np.uint8]
Numbering: TypeAlias = tuple[IntArray, CodeArray]
"""Each point's first vertex, and the axes along which it has one."""

BATCH = 1 << 18
"""Points that a field is asked for at once."""

SHARES = (1, 2, 3)
"""About how long finding the vertices, sharpening them and joining them over creases take."""

BLOCK = 1 << 14
"""Cells or vertices that one thread works on at a time."""


def _distinct(keys: IntArray) -> IntArray:
    """Return the rising keys, each once; `np.unique` hashes, which takes longer where few recur."""
    keys = np.sort(keys)
    return keys[np.append(True, keys[1:] != keys[:-1])] if len(keys) else keys


@dataclass
class Band:
    """The points and cells of a lattice that have been looked at; `loops` says how they are kept."""

    field: Field
    level: float
    step: FloatArray
    centre: IntArray
    table: npt.NDArray[np.int32] = attribute(default_factory=lambda: np.full(1 << 13, -1, dtype=np.int32))
    keys: IntArray = attribute(default_factory=lambda: np.empty(1 << 12, dtype=np.int64))
    values: FloatArray = attribute(default_factory=lambda: np.empty(1 << 12))
    known: BoolArray = attribute(default_factory=lambda: np.zeros(1 << 12, dtype=bool))
    count: int = 0
    found: list[tuple[CornerArray, CodeArray]] = attribute(default_factory=list)

    @classmethod
    def around(cls, points: FloatArray, field: Field, level: float, step: FloatArray) -> "Band":
        """Return an empty band whose keys reach far beyond the points; the same for most clouds, as is their order."""
        low, high = points.min(axis=0) / step, points.max(axis=0) / step
        quarter = 1 << loops.BITS - 2
        if np.any(high - low > quarter):
            raise InputError(
                f"spacing: the seeds reach over {(high - low).max():.2g} cells; coarsen it or cut the cloud"
            )
        return cls(field, level, step, (np.rint((low + high) / (4 * quarter)) * 2 * quarter).astype(np.int64))

    @property
    def base(self) -> FloatArray:
        """(3,) the lattice point with key 0."""
        return (self.centre - (1 << loops.BITS - 1)).astype(np.float64)

    def cells_of(self, points: FloatArray) -> IntArray:
        """Return the rising keys of the cells that hold points; those too far away to be named are left out."""
        indices = np.floor(points / self.step) - self.base
        near = ((indices >= 1) & (indices < (1 << loops.BITS) - 2)).all(axis=1)
        keys = np.empty(np.count_nonzero(near), dtype=np.int64)
        loops.encode(indices[near].astype(np.int64), keys)
        return _distinct(keys)

    def only(self, cells: IntArray, allowed: Callable[[FloatArray], BoolArray] | None) -> IntArray:
        """Return the cells whose centres pass a test."""
        return cells if allowed is None or not len(cells) else cells[allowed(self.positions(cells, 0.5))]

    def positions(self, keys: IntArray, shift: float = 0.0) -> FloatArray:
        """Return the (n, 3) positions of lattice points, a share of a cell beyond them along all axes."""
        points, beyond = np.empty((len(keys), 3)), np.full(3, shift)
        run_blocks(lambda i, j: loops.place_points(i, j, keys, beyond, self.base, self.step, points), len(keys), BLOCK)
        return points

    def advance(self, cells: IntArray, progress: Progress | None = None) -> IntArray:
        """Look at new cells, keep those that the surface crosses, and return the rising keys of those beyond.

        `progress` is told of new points that the field was asked for.
        """
        corners, asked, start = np.empty((len(cells), 8), dtype=np.int32), self.count, 0
        while start < len(cells):
            start, self.count = loops.add_cells(cells, start, self.table, self.keys, self.known, self.count, corners)
            if start < len(cells):
                self._grow()
        for i, j in blocks(self.count - asked, BATCH):
            rows = slice(asked + i, asked + j)
            self.values[rows] = self._ask(self.positions(self.keys[rows]))
            if progress:
                progress(j, self.count - asked)
        codes = np.empty(len(cells), dtype=np.uint8)
        run_blocks(lambda i, j: loops.read_codes(i, j, self.values, corners, codes), len(cells), BLOCK)
        crossed = (codes > 0) & (codes < 255)
        if not crossed.any():
            return np.empty(0, dtype=np.int64)
        self.found.append((corners[crossed], codes[crossed]))
        return self._beyond(*self.found[-1])

    def _beyond(self, corners: CornerArray, codes: CodeArray) -> IntArray:
        """Return the rising keys of the cells not looked at across the faces of some that the surface crosses."""
        beyond = np.empty((len(codes), 6), dtype=np.int64)

        def task(start: int, stop: int) -> None:
            loops.cross_faces(start, stop, corners, codes, self.table, self.keys, self.known, beyond)

        run_blocks(task, len(codes), BLOCK)
        return _distinct(beyond[beyond >= 0])

    def _grow(self) -> None:
        """Double the room for points."""
        room = 2 * len(self.keys)
        if room >= np.iinfo(np.int32).max // 2:
            raise InputError(f"spacing: the band has over {self.count:.2g} points; coarsen it, or give `within`")
        self.keys, self.values, self.known = (
            np.concatenate([array, np.zeros_like(array)]) for array in (self.keys, self.values, self.known)
        )
        self.table = np.full(2 * room, -1, dtype=np.int32)
        loops.fill_table(self.table, self.keys, self.count)

    def draw(
        self, *, sharpen: bool, ends: bool, features: bool, progress: Progress | None = None
    ) -> tuple[FloatArray, IntArray]:
        """Return vertices and triangles by the keys of points and cells, mended where a band `ends`."""
        finding, sharpening, joining = share_out(progress, *SHARES)
        corners, codes = (np.concatenate(part) for part in zip(*self.found, strict=True))
        order = np.argsort(self.keys[corners[:, 0]])
        corners, codes = corners[order], codes[order]
        numbering, many = self._number(corners, codes)
        edges = _Edges.empty(many)

        def find(start: int, stop: int) -> None:
            loops.find_fractions(start, stop, corners, codes, self.values, numbering, edges.arrays)

        run_blocks(find, len(codes), BLOCK)
        vertices = self._place(edges)
        finish(finding)
        if sharpen:
            for i, j in blocks(many, BATCH):
                between = self._ask(vertices[i:j])
                loops.sharpen_fractions(i, j, edges.here, edges.there, between, edges.fraction)
                if sharpening:
                    sharpening(j, many)
            vertices = self._place(edges)
        if features:
            vertices, triangles = self._crease(corners, codes, numbering, edges, vertices, joining)
        else:
            triangles = _draw_smooth(corners, codes, numbering, edges.fraction)
        if not ends:
            return vertices, triangles
        # Two cells may touch along an edge alone, where the others were not allowed.
        cells = np.full(len(vertices), 4, dtype=np.uint8)
        cells[:many] = 0
        loops.count_cells(corners, codes, numbering, cells)
        return trim_to_manifold(vertices, triangles, cells < 4) if (cells < 4).any() else (vertices, triangles)

    def _crease(
        self,
        corners: CornerArray,
        codes: CodeArray,
        numbering: Numbering,
        edges: "_Edges",
        vertices: FloatArray,
        progress: Progress | None,
    ) -> tuple[FloatArray, IntArray]:
        """Return vertices and triangles with a vertex more in each loop of a cell whose normals disagree."""
        normals = np.empty_like(vertices)
        for i, j in blocks(len(vertices), BATCH):
            slope = require_finite(np.asarray(self.field.gradient(vertices[i:j]), dtype=np.float64), "field gradients")
            length = np.maximum(np.linalg.norm(slope, axis=1), np.finfo(np.float64).tiny)
            normals[i:j] = slope / length[:, np.newaxis]
            if progress:
                progress(j, len(vertices))
        creases, drawn = np.empty((2, len(codes)), dtype=np.int64)

        def count(start: int, stop: int) -> None:
            creased.count_creases(start, stop, corners, codes, numbering, normals, LEAST_COSINE, creases, drawn)

        run_blocks(count, len(codes), BLOCK)
        offsets = np.cumsum(creases) - creases, np.cumsum(drawn) - drawn
        many, triangles = int(creases.sum()), np.empty((drawn.sum(), 3), dtype=np.int64)
        planes = np.empty((many, 3, 3)), np.empty((many, 3)), np.empty((many, 3)), np.empty(many, dtype=np.int64)
        surface = vertices, normals

        def draw(start: int, stop: int) -> None:
            creased.draw_creases(
                start,
                stop,
                corners,
                codes,
                numbering,
                edges.fraction,
                surface,
                LEAST_COSINE,
                offsets,
                planes,
                triangles,
            )

        run_blocks(draw, len(codes), BLOCK)
        if not many:
            return vertices, triangles
        lower = self.positions(self.keys[corners[planes[3], 0]])
        added = np.clip(meet_planes(*planes[:3]), lower - BESIDE * self.step, lower + (1 + BESIDE) * self.step)
        return np.concatenate([vertices, added]), join_creases(triangles, len(vertices))

    def _number(self, corners: CornerArray, codes: CodeArray) -> tuple[Numbering, int]:
        """Return each point's first vertex and the axes along which it has one, and how many vertices there are."""
        marks, first = np.zeros(self.count, dtype=np.uint8), np.zeros(self.count, dtype=np.int64)
        loops.mark_edges(corners, codes, marks)
        rows = np.flatnonzero(marks)
        rows = rows[np.argsort(self.keys[rows])]
        many = np.bitwise_count(marks[rows]).astype(np.int64)
        first[rows] = np.cumsum(many) - many
        return (first, marks), int(many.sum())

    def _ask(self, points: FloatArray) -> FloatArray:
        """Return the field's values less the level."""
        return require_finite(np.asarray(self.field(points), dtype=np.float64), "field values") - self.level

    def _place(self, edges: "_Edges") -> FloatArray:
        """Return the (v, 3) positions of vertices."""
        vertices, keys = np.empty((len(edges.lower), 3)), self.keys[edges.lower]

        def task(start: int, stop: int) -> None:
            loops.place_crossings(start, stop, keys, edges.towards, edges.fraction, self.base, self.step, vertices)

        run_blocks(task, len(keys), BLOCK)
        return vertices


def _draw_smooth(corners: CornerArray, codes: CodeArray, numbering: Numbering, fraction: FloatArray) -> IntArray:
    """Return the triangles of cells by marching cubes."""
    drawn = COUNTS[CUBES, codes]
    offsets, triangles = np.cumsum(drawn) - drawn, np.empty((drawn.sum(), 3), dtype=np.int64)

    def draw(start: int, stop: int) -> None:
        loops.draw_cells(start, stop, corners, codes, numbering, fraction, offsets, triangles)

    run_blocks(draw, len(codes), BLOCK)
    return triangles


@dataclass(frozen=True, eq=False)
class _Edges:
    """The crossed edges: the row of their lower point, direction, vertex as a fraction, and values at both ends."""

    lower: IntArray
    towards: IntArray
    fraction: FloatArray
    here: FloatArray
    there: FloatArray

    @classmethod
    def empty(cls, count: int) -> "_Edges":
        return cls(*np.empty((2, count), dtype=np.int64), *np.empty((3, count)))

    @property
    def arrays(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
        """The five arrays, as the compiled loops take them."""
        return self.lower, self.towards, self.fraction, self.here, self.there
