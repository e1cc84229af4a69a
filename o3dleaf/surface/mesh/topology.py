"""Edges, pieces, fans and boundary loops of a triangle mesh: counted and joined, never a pairwise test."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, triangle_areas
from o3dleaf.surface.mesh.adjacency_loops import (
    describe_edges,
    find_turns,
    join_corners,
    join_pairs,
    join_triangles,
    list_ends,
    mark_duplicates,
    number_edges,
    number_roots,
    sort_half_edges,
    walk_boundary,
)
from o3dleaf.surface.mesh.measure_loops import measure_edges

IndexArray = npt.NDArray[np.signedinteger[Any]]
"""Whole numbers of four bytes where they suffice, else of eight."""


def index_type(largest: int) -> type[np.signedinteger[Any]]:
    """Return the smaller of int32 and int64 that holds a number."""
    return np.int32 if largest <= np.iinfo(np.int32).max else np.int64


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """The edges of m triangles; half-edge 3 t + c runs from corner c of triangle t to the next corner.

    Attributes
    ----------
    corners : (3 m,) ndarray
        The vertex that each half-edge leaves.
    ends : (e, 2) ndarray
        The vertices of each edge, the smaller first, in sorted order.
    of_half : (3 m,) ndarray
        The edge of each half-edge.
    order : (3 m,) ndarray
        The half-edges by their edge, then by number.
    count : (e,) ndarray
        Triangles on each edge: 1 on the boundary, 2 inside a manifold surface.
    inconsistent : (e,) ndarray of bool
        Whether two triangles run along the edge in the same direction.
    """

    corners: IndexArray
    ends: IndexArray
    of_half: IndexArray
    order: IndexArray
    count: IndexArray
    inconsistent: BoolArray

    @classmethod
    def of(cls, triangles: IntArray) -> "EdgeTable":
        """Return the edges of (m, 3) `triangles`."""
        vertices = int(triangles.max(initial=-1)) + 1
        index = index_type(max(triangles.size, vertices))
        corners = triangles.astype(index).ravel()
        order, of_half = np.empty_like(corners), np.empty_like(corners)
        sort_half_edges(corners, np.empty(vertices + 1, dtype=index), of_half, order)
        edges = number_edges(corners, order, of_half)
        ends, count, inconsistent = np.empty((edges, 2), index), np.empty(edges, index), np.empty(edges, bool)
        describe_edges(corners, order, of_half, ends, count, inconsistent)
        return cls(corners, ends, of_half, order, count, inconsistent)

    def triangles_of(self, edges: IntArray) -> IntArray:
        """Return the rising rows of the triangles on some edges."""
        wanted = np.zeros(len(self.ends), dtype=bool)
        wanted[edges] = True
        return np.unique(np.flatnonzero(wanted[self.of_half]) // 3) if len(edges) else np.empty(0, dtype=np.int64)

    def first(self, edges: IntArray) -> IndexArray:
        """Return where in `order` some edges begin."""
        begin = np.cumsum(self.count, dtype=self.order.dtype) - self.count
        return np.asarray(begin[edges])

    def first_triangle(self, edges: IntArray) -> IndexArray:
        """Return the first triangle on each of some edges."""
        return np.asarray(self.order[self.first(edges)] // 3)

    def duplicates(self) -> BoolArray:
        """Return which triangles are on the same three vertices as one before."""
        is_duplicate = np.zeros(len(self.corners) // 3, dtype=bool)
        mark_duplicates(self.corners, self.order, self.of_half, is_duplicate)
        return is_duplicate


def label_nodes(first: IntArray, second: IntArray, nodes: int) -> IntArray:
    """Return the (nodes,) labels 0, 1, ... of the connected pieces of a graph, by first member."""
    parent = np.arange(nodes, dtype=np.int64)
    join_pairs(parent, first, second)
    number_roots(parent)
    return parent


def label_triangles(triangles: IntArray, edges: EdgeTable | None = None) -> IntArray:
    """Return the (m,) labels of the edge-connected pieces that the triangles belong to, by first triangle."""
    edges, parent = edges or EdgeTable.of(triangles), np.arange(len(triangles), dtype=np.int64)
    join_triangles(parent, edges.order, edges.of_half)
    number_roots(parent)
    return parent


def label_fans(triangles: IntArray, edges: EdgeTable | None = None) -> IntArray:
    """Return the (m, 3) labels of the fans: corners at one vertex, joined across the edges that meet there.

    A vertex with one fan has a disc or a half-disc around it; one with more is a bow-tie.
    """
    edges, parent = edges or EdgeTable.of(triangles), np.arange(triangles.size, dtype=np.int64)
    join_corners(parent, edges.corners, edges.order, edges.of_half)
    number_roots(parent)
    return parent.reshape(-1, 3)


def find_flipped(edges: EdgeTable, area: FloatArray) -> tuple[BoolArray, bool]:
    """Return which (m,) triangles run against the larger part, by `area`, of their patch; and if all can run alike.

    A patch is joined across edges of two triangles. In one that has no two sides (a Möbius strip) none is flipped.
    """
    turn, bad = np.zeros(len(area), dtype=bool), np.zeros(len(area), dtype=bool)
    if not edges.inconsistent.any():
        return turn, True
    root = np.arange(len(area), dtype=np.int64)
    find_turns(edges.order, edges.of_half, edges.count, edges.corners, root, turn, bad)
    turned, whole = (np.bincount(root, weights=some, minlength=len(area)) for some in (area * turn, area))
    flipped = (turn ^ (turned > whole / 2)[root]) & ~bad[root]
    return flipped, not bad.any() and int(edges.count.max(initial=0)) <= 2


def fans_per_vertex(triangles: IntArray, fans: IntArray, vertices: int) -> IntArray:
    """Return the (vertices,) number of fans around each vertex."""
    owner = np.zeros(int(fans.max(initial=-1)) + 1, dtype=np.int64)
    owner[fans.ravel()] = triangles.ravel()
    return np.bincount(owner, minlength=vertices)


@dataclass(frozen=True)
class BoundaryLoops:
    """The boundary of a mesh as loops; loops that meet in a bow-tie count as one.

    Attributes
    ----------
    edges : (b,) ndarray of int64
        The boundary edges, as rows of an `EdgeTable`.
    of_edge : (b,) ndarray of int64
        The loop of each.
    perimeter : (l,) ndarray of float64
        Length of each loop, in the mesh's unit.
    is_rim : (l,) ndarray of bool
        Whether the loop is the rim of an open sheet; all others are holes.
    """

    edges: IntArray
    of_edge: IntArray
    perimeter: FloatArray
    is_rim: BoolArray


def find_holes(
    vertices: FloatArray,
    triangles: IntArray,
    edges: EdgeTable | None = None,
    piece: IntArray | None = None,
    area: FloatArray | None = None,
) -> BoundaryLoops:
    """Return the boundary loops of a mesh, and which of them are rims rather than holes.

    The longest loop of an edge-connected piece is its rim if perimeter^2 >= pi * area. A flat sheet
    has perimeter^2 >= 4 pi * area (the isoperimetric inequality), a sphere with a small hole almost
    nothing; between them the line is drawn where the area is four times that of the flat disc which
    the loop could bound.
    """
    edges = edges or EdgeTable.of(triangles)
    piece = label_triangles(triangles, edges) if piece is None else piece
    boundary = np.flatnonzero(edges.count == 1)
    names, ends = _renumber(edges.ends[boundary], len(vertices))
    of_edge = label_nodes(ends[:, 0], ends[:, 1], len(names))[ends[:, 0]]
    length = np.empty(len(boundary))
    measure_edges(vertices, edges.ends[boundary], 0, len(boundary), length)
    perimeter = np.bincount(of_edge, weights=length).astype(np.float64)
    whole = np.bincount(piece, weights=triangle_areas(vertices, triangles) if area is None else area)
    of_loop = np.empty(len(perimeter), dtype=np.int64)
    of_loop[of_edge] = piece[edges.first_triangle(boundary)]
    most = np.zeros(len(whole))
    np.maximum.at(most, of_loop, perimeter)
    # Of equally long loops of a piece the first is the rim: it is written last.
    candidates = np.flatnonzero(perimeter == most[of_loop])[::-1]
    rim = np.full(len(whole), -1)
    rim[of_loop[candidates]] = candidates
    longest = rim[of_loop] == np.arange(len(perimeter))
    return BoundaryLoops(boundary, of_edge, perimeter, longest & (perimeter**2 >= np.pi * whole[of_loop]))


def _renumber(ends: IndexArray, vertices: int) -> tuple[IntArray, IndexArray]:
    """Return the rising vertices that (b, 2) `ends` name, and the ends as places among them."""
    named = np.zeros(vertices, dtype=bool)
    named[ends] = True
    return np.flatnonzero(named), (np.cumsum(named) - 1)[ends]


@dataclass(frozen=True, eq=False)
class BoundaryRings:
    """The boundary as r walks from vertex to vertex, each of its edges once.

    Attributes
    ----------
    vertices : (v,) ndarray
        One walk after the other; the first vertex of a closed one is not repeated.
    offsets : (r + 1,) ndarray
        Where each walk begins in `vertices`, and the end.
    is_hole : (r,) ndarray of bool
        Whether it goes around a hole, not along the rim of an open sheet.
    perimeter : (r,) ndarray of float64
        Length of the loop that it belongs to, in the mesh's unit.
    """

    vertices: IntArray
    offsets: IntArray
    is_hole: BoolArray
    perimeter: FloatArray

    def __len__(self) -> int:
        return len(self.is_hole)

    def __getitem__(self, ring: int) -> IntArray:
        """Return the vertices of one walk."""
        return self.vertices[self.offsets[range(len(self))[ring]] : self.offsets[range(len(self))[ring] + 1]]


def trace_rings(edges: EdgeTable, loops: BoundaryLoops) -> BoundaryRings:
    """Return the boundary as walks; a loop that meets itself in a bow-tie may be several."""
    names, ends = _renumber(edges.ends[loops.edges], int(edges.ends.max(initial=-1)) + 1)
    many = len(loops.edges)
    begin, at_vertex = np.zeros(len(names) + 1, np.int64), np.empty(2 * many, np.int64)
    list_ends(ends, begin, at_vertex)
    walk, offsets, of_ring = np.empty(2 * many, np.int64), np.empty(many + 1, np.int64), np.empty(many, np.int64)
    rings = walk_boundary(begin, at_vertex, ends, loops.of_edge, np.zeros(many, bool), walk, offsets, of_ring)
    of_ring = of_ring[:rings]
    vertices = names[walk[: offsets[rings]]]
    return BoundaryRings(vertices, offsets[: rings + 1], ~loops.is_rim[of_ring], loops.perimeter[of_ring])
