"""The whole surface: counted tile by tile first, then made block by block, each vertex and triangle in its place."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar, cast

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import MemoryBudgetError, ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.leaf.instancing.footprint import Footprint
from o3dleaf.leaf.instancing.parts import ADAXIAL, Part, label_part, sides_of, stand_in
from o3dleaf.leaf.instancing.placement import Numbers, place_sheets, place_solid
from o3dleaf.leaf.instancing.reduced import Reduced
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.surface.mesh.topology import label_nodes

STRIPS = 1
"""Rows of tiles that are worked on at once; they are held with the row after them, which is the memory needed."""
VERTICES = 1 << 15
"""Vertices that one thread takes to the world at once."""
MOST = 2**31 - 1
"""Vertices that the numbers of a mesh file can tell apart."""
SHARE = 0.25
"""A piece with this share of the largest one's size is a face of the blade; scraps at the rim are smaller."""

At = tuple[int, int]
T = TypeVar("T")
R = TypeVar("R")


class Sink(Protocol):
    """Where the parts of a mesh go, in any order, from any thread."""

    def put_vertices(self, start: int, vertices: FloatArray) -> None:
        """Take the (n, 3) vertices number start, start + 1, ..."""

    def put_triangles(self, start: int, triangles: npt.NDArray[np.integer[Any]], labels: npt.NDArray[np.uint8]) -> None:
        """Take the (m, 3) triangles number start, ... and their labels."""


@dataclass(frozen=True, eq=False)
class Share:
    """What one tile has of the whole: its pieces, and the numbers that its vertices and triangles begin with.

    Attributes
    ----------
    first_label : int
        Number of its first piece.
    vertices, triangles : (l,) ndarrays of int64
        Of each piece.
    above : (l,) ndarray of bool
        Which pieces look at the air above.
    """

    first_label: int
    vertices: IntArray
    triangles: IntArray
    above: BoolArray


@dataclass(frozen=True)
class Scraps:
    """Pieces that the outline cut off and that were left out.

    Attributes
    ----------
    pieces, triangles : int
    """

    pieces: int
    triangles: int


class Assembly:
    """A tile set down all over an outline, welded by index.

    Attributes
    ----------
    tile : Tile
    closed : bool
        Whether it is a solid with a rim, or two sheets.
    vertices, triangles : int
        Of the whole.
    scraps : Scraps
    """

    def __init__(
        self,
        tile: Tile,
        footprint: Footprint,
        *,
        closed: bool,
        reduced: Reduced | None = None,
        keep_scraps: bool = False,
    ) -> None:
        """Count what there will be; `reduced` stands for the tiles that the outline does not cut.

        Raises
        ------
        ReconstructionError
            If it is not two sheets, or not one solid.
        """
        self.tile, self.footprint, self.closed, self.reduced = tile, footprint, closed, reduced
        shape = np.array(tile.lattice.shape[:2])
        # Vertices in the last column belong to the tile that begins there.
        self._low, self._high = footprint.box[0] // shape, footprint.box[1] // shape + 1
        self._whole: Part | None = None
        self._whole_rank: npt.NDArray[np.int32] | None = None
        self._shares: dict[At, Share] = {}
        first, second = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for parts, rows in self._windows():
            for at in rows:
                here, there = self._links(parts, at)
                first.append(here)
                second.append(there)
        self._keep(np.concatenate(first), np.concatenate(second), keep_scraps=keep_scraps)

    @property
    def middle(self) -> IntArray:
        """(2,) the column in the middle of the outline's box."""
        return np.asarray(self.footprint.box.sum(axis=0) // 2)

    def emit(self, sink: Sink, to_world: Callable[[FloatArray], FloatArray]) -> None:
        """Make every vertex and triangle and hand them to a sink.

        Parameters
        ----------
        sink : Sink
        to_world : callable
            Takes (n, 3) flat positions to the world; called from several threads.
        """
        done = 0
        for parts, rows in self._windows():
            numbers = {at: self._numbers(parts[at], at) for at in parts}
            pieces = [(at, start) for at in rows for start in range(0, len(numbers[at]), VERTICES)]
            _side_by_side(partial(self._emit_vertices, sink, to_world, parts, numbers), pieces)
            _side_by_side(partial(self._emit_triangles, sink, parts, numbers), rows)
            done += sum(int(self._kept_counts(at)[0]) for at in rows)
            progress.report(done, self.vertices)

    def names(self) -> IntArray:
        """Return the edges, (i, j, k, direction), of the lattice that the vertices lie on, in their order.

        Those on the rim and inside reduced tiles have none: −1.
        """
        nx, ny, nz = self.tile.lattice.shape
        found = np.full((self.vertices, 4), -1)
        for parts, rows in self._windows():
            for at in rows:
                numbers = self._numbers(parts[at], at)[: len(self.tile.edges)]
                point, direction = self.tile.edges >> 3, self.tile.edges & 7
                i, j = at[0] * nx + point // (ny * nz), at[1] * ny + point // nz % ny
                names = np.stack([i, j, point % nz, direction], axis=1)
                found[numbers[numbers >= 0]] = names[numbers >= 0]
        return found

    def _windows(self) -> Iterator[tuple[dict[At, Part], list[At]]]:
        """Yield the parts of a few rows of tiles and of the row after them, and which of them are to be done."""
        parts: dict[At, Part] = {}
        low, high = self._low, self._high
        for start, stop in blocks(int(high[0] - low[0]), STRIPS):
            rows = range(int(low[0]) + start, int(low[0]) + stop + 1)
            wanted = [(p, q) for p in rows for q in range(int(low[1]), int(high[1])) if (p, q) not in parts]
            found = _side_by_side(self._part, wanted)
            parts = {at: part for at, part in parts.items() if at[0] in rows}
            parts |= {at: part for at, part in zip(wanted, found, strict=True) if part is not None}
            for at in sorted(parts):
                if at not in self._shares:
                    self._shares[at] = self._share(parts[at])
            yield parts, [at for at in sorted(parts) if at[0] < rows[-1]]

    def _part(self, at: At) -> Part | None:
        """Return what of the tile is in one place, and its pieces; the whole tile's are found once."""
        placement = (place_solid if self.closed else place_sheets)(self.tile, self.footprint, at)
        if placement is None:
            return None
        if not placement.is_whole:
            return label_part(placement)
        if self.reduced is not None:
            placement = stand_in(placement, self.reduced)
        if self._whole is None:
            self._whole = label_part(placement)
        return Part(placement, self._whole.labels, self._whole.count)

    def _share(self, part: Part) -> Share:
        """Return the counts of a part, its labels following on those given before."""
        last = next(reversed(self._shares.values()), None)
        placement, own = part.placement, part.own
        nodes = placement.nodes
        corner = part.labels[nodes[:, 0]]
        above = np.zeros(part.count, dtype=bool)
        above[corner] = sides_of(placement, nodes) == ADAXIAL
        return Share(
            0 if last is None else last.first_label + len(last.vertices),
            np.bincount(own[own >= 0], minlength=part.count),
            np.bincount(corner, minlength=part.count),
            above,
        )

    def _links(self, parts: dict[At, Part], at: At) -> tuple[IntArray, IntArray]:
        """Return the pieces of a tile and of its neighbors that have a vertex in common, as pairs of numbers."""
        part, base = parts[at], self._shares[at].first_label
        around = {
            shift: (parts[there].placement, Numbers(parts[there].own, self._shares[there].first_label))
            for shift, there in self._around(parts, at).items()
        }
        there = part.placement.node_numbers(None, around)
        linked = (there >= 0) & (part.labels >= 0)
        pairs = np.unique(np.stack([part.labels[linked] + base, there[linked]]), axis=1)
        return pairs[0], pairs[1]

    @staticmethod
    def _around(parts: dict[At, Part], at: At) -> dict[int, At]:
        """Return the neighbors that a tile's triangles lean on, by shift."""
        places = {shift: (at[0] + (shift & 1), at[1] + (shift >> 1)) for shift in (1, 2, 3)}
        return {shift: there for shift, there in places.items() if there in parts}

    def _keep(self, first: IntArray, second: IntArray, *, keep_scraps: bool) -> None:
        """Decide which pieces of the whole are kept, and give every tile its numbers."""
        shares = list(self._shares.values())
        if not shares:
            raise ReconstructionError("no cell of this spacing fits the outline; use a finer spacing or another region")
        triangles = np.concatenate([share.triangles for share in shares])
        above = np.concatenate([share.above for share in shares])
        piece = label_nodes(first, second, len(triangles))
        size = np.bincount(piece, triangles)
        kept = np.full(len(size), keep_scraps)
        if not keep_scraps:
            kept[faces_among(size, None if self.closed else np.bincount(piece, triangles * above) > size / 2)] = True
        self._kept = kept[piece]
        gone = ~kept & (size > 0)
        self.scraps = Scraps(int(gone.sum()), int(size[gone].sum()))
        counts = np.array([self._kept_counts(at) for at in self._shares])
        starts = np.concatenate([[[0, 0]], np.cumsum(counts, axis=0)])
        self._starts = {at: (int(row[0]), int(row[1])) for at, row in zip(self._shares, starts[:-1], strict=True)}
        self.vertices, self.triangles = (int(count) for count in starts[-1])
        if self.vertices > MOST:
            raise MemoryBudgetError(f"spacing: {self.vertices:,} vertices are more than a mesh can number; coarsen it")

    def _kept_counts(self, at: At) -> tuple[int, int]:
        """Return the number of vertices and triangles of a tile that are kept."""
        share = self._shares[at]
        kept = self._kept[share.first_label : share.first_label + len(share.vertices)]
        return int(share.vertices[kept].sum()), int(share.triangles[kept].sum())

    def _keeps_all(self, at: At) -> bool:
        share = self._shares[at]
        return bool(self._kept[share.first_label : share.first_label + len(share.vertices)].all())

    def _numbers(self, part: Part, at: At) -> Numbers:
        """Return the numbers of a tile's own vertices; whole tiles share what they can."""
        keeps_all = self._keeps_all(at)
        if part.placement.is_whole and keeps_all:
            if self._whole_rank is None:
                self._whole_rank = _rank(part.own >= 0)
            return Numbers(self._whole_rank, self._starts[at][0])
        own = part.own
        there = own >= 0
        if not keeps_all:
            there[there] = self._kept[own[there] + self._shares[at].first_label]
        return Numbers(_rank(there), self._starts[at][0])

    def _emit_vertices(
        self,
        sink: Sink,
        to_world: Callable[[FloatArray], FloatArray],
        parts: dict[At, Part],
        numbers: dict[At, Numbers],
        piece: tuple[At, int],
    ) -> None:
        """Put a tile's own vertices from one row on."""
        at, start = piece
        rows = start + np.flatnonzero(numbers[at][start : start + VERTICES] >= 0)
        if len(rows):
            sink.put_vertices(int(numbers[at][rows[:1]][0]), to_world(parts[at].placement.positions(rows)))

    def _emit_triangles(self, sink: Sink, parts: dict[At, Part], numbers: dict[At, Numbers], at: At) -> None:
        """Put the triangles of one tile."""
        part = parts[at]
        around = {shift: (parts[there].placement, numbers[there]) for shift, there in self._around(parts, at).items()}
        name = part.placement.node_numbers(numbers[at], around)
        nodes = part.placement.nodes
        labels = sides_of(part.placement, nodes)
        if not self._keeps_all(at):
            kept = self._kept[part.labels[nodes[:, 0]] + self._shares[at].first_label]
            nodes, labels = nodes[kept], labels[kept]
        first = self._starts[at][1]
        for start, stop in blocks(len(nodes), 2 * VERTICES):
            sink.put_triangles(first + start, name[nodes[start:stop]], labels[start:stop])


def faces_among(size: npt.NDArray[Any], looks_up: BoolArray | None) -> list[int]:
    """Return which pieces are the two sheets, or the one solid; the others are scraps.

    Parameters
    ----------
    size : (l,) ndarray
        Of each piece.
    looks_up : (l,) ndarray of bool, optional
        Which pieces look at the air above; None: a solid.

    Raises
    ------
    ReconstructionError
        If more than one piece of a kind, or none, is as large as a face.
    """
    groups = [np.arange(len(size))] if looks_up is None else [np.flatnonzero(looks_up), np.flatnonzero(~looks_up)]
    large = [int(np.sum(size[group] > SHARE * size[group].max(initial=0.0))) for group in groups]
    if large != [1] * len(groups):
        what = "pieces, not one solid" if looks_up is None else "sheets, not two (adaxial, abaxial)"
        raise ReconstructionError(
            f"the surface at this spacing is in {sum(large)} {what}; use a finer spacing or another threshold"
        )
    return [int(group[np.argmax(size[group])]) for group in groups]


def _rank(there: BoolArray) -> npt.NDArray[np.int32]:
    """Return the place of each vertex among those that are there, −1 for the others."""
    rank = np.cumsum(there, dtype=np.int32) - 1
    rank[~there] = -1
    return rank


def _side_by_side(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Return what a function makes of each item, on all threads."""
    found: list[R | None] = [None] * len(items)

    def work(first: int, _: int) -> None:
        found[first] = function(items[first])

    run_blocks(work, len(items), 1)
    return cast("list[R]", found)
