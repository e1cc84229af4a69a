"""The whole surface: counted tile by tile first, then made row by row, each vertex and triangle in its place."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import MemoryBudgetError, ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.leaf.instancing.components import PartSizes, PlacedTile, rank_of, select_faces
from o3dleaf.leaf.instancing.footprint import Footprint
from o3dleaf.leaf.instancing.placement import VertexNumbers
from o3dleaf.leaf.instancing.reduced import ReducedTile
from o3dleaf.leaf.instancing.sets.tile_set import TileSet
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.leaf.instancing.windows import Place, PlacedRows, TilePlacer, map_in_threads
from o3dleaf.surface.mesh.topology import label_nodes

BATCH_SIZE = 1 << 15
"""Vertices that one thread takes to the world at once."""
MAX_VERTICES = 2**31 - 1
"""What the numbers of a mesh file can tell apart."""


class Sink(Protocol):
    """A receiver of the parts of a mesh, in any order, from any thread."""

    def put_vertices(self, start: int, vertices: FloatArray) -> None:
        """Take the (n, 3) vertices number start, start + 1, ..."""

    def put_triangles(self, start: int, triangles: npt.NDArray[np.integer[Any]], labels: npt.NDArray[np.uint8]) -> None:
        """Take the (m, 3) triangles number start, ... and their labels."""


class TileCounts(NamedTuple):
    """Sizes of the components of the tile in one place, and the number in the whole of the first of them."""

    first_component: int
    sizes: PartSizes

    @property
    def components(self) -> slice:
        """Numbers in the whole of its components."""
        return slice(self.first_component, self.first_component + len(self.sizes.vertices))


@dataclass(frozen=True)
class Fragments:
    """Components that the outline cut off and that were left out.

    Attributes
    ----------
    pieces, triangles : int
    """

    pieces: int
    triangles: int


class Assembly:
    """A tile, or those of a set, set down all over an outline, welded by index.

    Attributes
    ----------
    tiles : TileSet
    closed : bool
        Whether it is a solid with a rim, or two sheets.
    vertices, triangles : int
        Of the whole.
    fragments : Fragments
    """

    def __init__(
        self,
        tile: Tile | TileSet,
        footprint: Footprint,
        *,
        closed: bool,
        cut: bool = False,
        reduced: ReducedTile | Sequence[ReducedTile] | None = None,
        keep_fragments: bool = False,
        max_vertices: int = MAX_VERTICES,
    ) -> None:
        """Count what there will be.

        Triangles are `cut` along the outline, or open sheets keep whole cells and a solid is marched there;
        `reduced` stands for the tiles that the outline does not cut; one for each of a set.

        Raises
        ------
        ReconstructionError
            If it is not two sheets, or not one solid.
        MemoryBudgetError
            If there are more than `max_vertices`.
        """
        self.tiles, self.footprint, self.closed = TileSet.of(tile), footprint, closed
        self.reduced = (reduced,) if isinstance(reduced, ReducedTile) else reduced
        self._placer = TilePlacer(self.tiles, footprint, closed=closed, cut=cut, reduced=self.reduced)
        self._counts: dict[Place, TileCounts] = {}
        first, second = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for window in self._placer.windows():
            for place, sizes in self._sizes(window).items():
                last = next(reversed(self._counts.values()), None)
                self._counts[place] = TileCounts(0 if last is None else last.components.stop, sizes)
            for place in window.row:
                for one, other in self._links(window, place):
                    first.append(one)
                    second.append(other)
        self._select(np.concatenate(first), np.concatenate(second), keep_fragments=keep_fragments)
        self._number()
        if self.vertices > max_vertices:
            raise MemoryBudgetError(f"spacing: {self.vertices:,} vertices are more than a mesh can number; coarsen it")

    def __repr__(self) -> str:
        kind = "solid" if self.closed else "two sheets"
        return f"Assembly({kind} of {len(self._counts):,} tiles, {self.triangles:,} triangles)"

    @property
    def middle(self) -> IntArray:
        """(2,) the column in the middle of the outline's box."""
        return np.asarray(self.footprint.box.sum(axis=0) // 2)

    def emit(
        self,
        sink: Sink,
        to_world: Callable[[FloatArray], FloatArray],
        batch_size: int = BATCH_SIZE,
        *,
        first: int = 0,
        finished: Callable[[int], None] | None = None,
    ) -> None:
        """Make every vertex and triangle and hand them to a sink.

        Parameters
        ----------
        sink : Sink
        to_world : callable
            Takes (n, 3) flat positions to the world; called from several threads.
        batch_size : int
            Vertices that one thread takes there at once.
        first : int
            Rows of tiles that the sink has already.
        finished : callable, optional
            ``finished(rows)``, whenever the sink has one row more.
        """
        done = 0
        for row, window in enumerate(self._placer.windows()):
            if row < first:
                done += sum(self._kept_counts(place)[0] for place in window.row)
                continue
            numbers = {place: self._numbers(placed, place) for place, placed in window.placed.items()}
            batches = [(place, start) for place in window.row for start in range(0, len(numbers[place]), batch_size)]
            map_in_threads(partial(self._emit_vertices, sink, to_world, window, numbers, batch_size), batches)
            map_in_threads(partial(self._emit_triangles, sink, window, numbers, 2 * batch_size), window.row)
            done += sum(self._kept_counts(place)[0] for place in window.row)
            if finished is not None:
                finished(row + 1)
            progress.report(done, self.vertices)

    def names(self) -> IntArray:
        """Return the edges, (i, j, k, direction), of the lattice that the vertices lie on, in their order.

        Those on the rim and inside reduced tiles have none: −1.
        """
        nx, ny, nz = self.tiles.lattice.shape
        names = np.full((self.vertices, 4), -1)
        for window in self._placer.windows():
            for place in window.row:
                tile = window.placed[place].placement.tile
                point, direction = tile.edges >> 3, tile.edges & 7
                numbers = self._numbers(window.placed[place], place)[: len(tile.edges)]
                i, j = place[0] * nx + point // (ny * nz), place[1] * ny + point // nz % ny
                edges = np.stack([i, j, point % nz, direction], axis=1)
                names[numbers[numbers >= 0]] = edges[numbers >= 0]
        return names

    def _sizes(self, window: PlacedRows) -> dict[Place, PartSizes]:
        """Return the sizes of components in the places of a window that are not counted yet."""
        places = [place for place in window.placed if place not in self._counts]
        sizes = map_in_threads(lambda place: window.placed[place].parts.sizes, places)
        return dict(zip(places, sizes, strict=True))

    def _links(self, window: PlacedRows, place: Place) -> Iterator[tuple[IntArray, IntArray]]:
        """Yield the components of a tile and of each neighbor that have a vertex in common, as pairs of numbers."""
        for shift, neighbor in window.neighbors(place).items():
            meeting = window.placed[place].parts.meeting(shift, window.placed[neighbor].parts)
            one, other = meeting.components
            yield one + self._counts[place].first_component, other + self._counts[neighbor].first_component

    def _select(self, first: IntArray, second: IntArray, *, keep_fragments: bool) -> None:
        """Decide which components of the whole are kept, those of tiles being linked in pairs."""
        counts = list(self._counts.values())
        if not counts:
            raise ReconstructionError("no cell of this spacing fits the outline; use a finer spacing or another region")
        triangles = np.concatenate([each.sizes.triangles for each in counts])
        faces_up = np.concatenate([each.sizes.faces_up for each in counts])
        component = label_nodes(first, second, len(triangles))
        size = np.bincount(component, triangles)
        kept = np.full(len(size), keep_fragments)
        if not keep_fragments:
            up = None if self.closed else np.bincount(component, triangles * faces_up) > size / 2
            kept[select_faces(size, up)] = True
        self._kept = kept[component]
        left_out = ~kept & (size > 0)
        self.fragments = Fragments(int(left_out.sum()), int(size[left_out].sum()))

    def _number(self) -> None:
        """Give every tile the numbers that its vertices and triangles begin with."""
        counts = np.array([self._kept_counts(place) for place in self._counts])
        starts = np.concatenate([[[0, 0]], np.cumsum(counts, axis=0)])
        self._starts = {place: (int(row[0]), int(row[1])) for place, row in zip(self._counts, starts[:-1], strict=True)}
        self.vertices, self.triangles = (int(count) for count in starts[-1])

    def _kept_counts(self, place: Place) -> tuple[int, int]:
        """Return the number of vertices and triangles of a tile that are kept."""
        counts = self._counts[place]
        kept = self._kept[counts.components]
        return int(counts.sizes.vertices[kept].sum()), int(counts.sizes.triangles[kept].sum())

    def _keeps_all(self, place: Place) -> bool:
        return bool(self._kept[self._counts[place].components].all())

    def _numbers(self, placed: PlacedTile, place: Place) -> VertexNumbers:
        """Return the numbers of a tile's own vertices; whole tiles share what they can."""
        start = self._starts[place][0]
        if self._keeps_all(place):
            return VertexNumbers(placed.parts.rank, start)
        of_vertex = placed.parts.of_vertex
        present = of_vertex >= 0
        present[present] = self._kept[of_vertex[present] + self._counts[place].first_component]
        return VertexNumbers(rank_of(present), start)

    def _emit_vertices(
        self,
        sink: Sink,
        to_world: Callable[[FloatArray], FloatArray],
        window: PlacedRows,
        numbers: dict[Place, VertexNumbers],
        batch_size: int,
        batch: tuple[Place, int],
    ) -> None:
        """Put a batch of a tile's own vertices, from one row on."""
        place, start = batch
        rank = numbers[place].rank
        rows = start + np.flatnonzero(rank[start : start + batch_size] >= 0)
        if len(rows):
            positions = window.placed[place].placement.positions(rows)
            sink.put_vertices(numbers[place].start + int(rank[rows[0]]), to_world(positions))

    def _emit_triangles(
        self, sink: Sink, window: PlacedRows, numbers: dict[Place, VertexNumbers], batch_size: int, place: Place
    ) -> None:
        """Put the triangles of one tile."""
        placed = window.placed[place]
        neighbors = {
            shift: (window.placed[neighbor].parts, numbers[neighbor])
            for shift, neighbor in window.neighbors(place).items()
        }
        number = placed.parts.node_numbers(numbers[place], neighbors)
        nodes, labels = placed.placement.nodes, placed.parts.labels
        if not self._keeps_all(place):
            kept = self._kept[placed.parts.components[nodes[:, 0]] + self._counts[place].first_component]
            nodes, labels = nodes[kept], labels[kept]
        first = self._starts[place][1]
        for start, stop in blocks(len(nodes), batch_size):
            sink.put_triangles(first + start, number[nodes[start:stop]], labels[start:stop])
