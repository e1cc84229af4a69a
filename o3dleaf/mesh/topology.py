"""Edges, pieces, fans and boundary loops of a triangle mesh: sorted arrays, never a pairwise test."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components as _graph_components

from o3dleaf.checks import FloatArray
from o3dleaf.mesh.arrays import BoolArray, IntArray, triangle_areas


@dataclass(frozen=True)
class EdgeTable:
    """The edges of m triangles; half-edge 3 t + c runs from corner c of triangle t to the next corner.

    Attributes
    ----------
    ends : (e, 2) ndarray of int64
        The vertices of each edge, the smaller first, in sorted order.
    of_half : (3 m,) ndarray of int64
        The edge of each half-edge.
    forward : (3 m,) ndarray of bool
        Whether the half-edge runs from the smaller vertex to the larger.
    count : (e,) ndarray of int64
        Triangles on each edge: 1 on the boundary, 2 inside a manifold surface.
    """

    ends: IntArray
    of_half: IntArray
    forward: BoolArray
    count: IntArray

    @classmethod
    def of(cls, triangles: IntArray) -> "EdgeTable":
        """Return the edges of (m, 3) `triangles`."""
        start, stop = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
        base = int(triangles.max(initial=0)) + 1
        key = np.minimum(start, stop) * base + np.maximum(start, stop)
        unique, of_half, count = np.unique(key, return_inverse=True, return_counts=True)
        return cls(np.stack([unique // base, unique % base], axis=1), of_half, start < stop, count)

    def neighbours(self) -> tuple[IntArray, IntArray]:
        """Return the half-edges that lie on one edge as pairs; k of them make a chain of k - 1 pairs."""
        order = np.argsort(self.of_half, kind="stable")
        same = self.of_half[order[1:]] == self.of_half[order[:-1]]
        return order[:-1][same], order[1:][same]

    def inconsistent(self) -> BoolArray:
        """Return which edges two triangles run along in the same direction."""
        along = np.bincount(self.of_half[self.forward], minlength=len(self.ends))
        return np.asarray((along > 1) | (self.count - along > 1))


def label_nodes(first: IntArray, second: IntArray, nodes: int) -> IntArray:
    """Return the (nodes,) labels 0, 1, ... of the connected pieces of a graph, by first member."""
    graph = coo_array((np.ones(len(first), dtype=bool), (first, second)), shape=(nodes, nodes))
    return np.asarray(_graph_components(graph, directed=False)[1], dtype=np.int64)


def label_triangles(triangles: IntArray, edges: EdgeTable | None = None) -> IntArray:
    """Return the (m,) labels of the edge-connected pieces that the triangles belong to."""
    first, second = (edges or EdgeTable.of(triangles)).neighbours()
    return label_nodes(first // 3, second // 3, len(triangles))


def label_fans(triangles: IntArray, edges: EdgeTable | None = None) -> IntArray:
    """Return the (m, 3) labels of the fans: corners at one vertex, joined across the edges that meet there.

    A vertex with one fan has a disc or a half-disc around it; one with more is a bow-tie.
    """
    first, second = (edges or EdgeTable.of(triangles)).neighbours()
    corner = triangles.ravel()
    after = np.arange(len(corner)).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    alike = corner[first] == corner[second]
    start, stop = np.where(alike, second, after[second]), np.where(alike, after[second], second)
    pairs = np.concatenate([first, after[first]]), np.concatenate([start, stop])
    return label_nodes(*pairs, len(corner)).reshape(-1, 3)


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


def find_holes(vertices: FloatArray, triangles: IntArray, edges: EdgeTable | None = None) -> BoundaryLoops:
    """Return the boundary loops of a mesh, and which of them are rims rather than holes.

    The longest loop of an edge-connected piece is its rim if perimeter^2 >= pi * area. A flat sheet
    has perimeter^2 >= 4 pi * area (the isoperimetric inequality), a sphere with a small hole almost
    nothing; between them the line is drawn where the area is four times that of the flat disc which
    the loop could bound.
    """
    edges = edges or EdgeTable.of(triangles)
    boundary = np.flatnonzero(edges.count == 1)
    names, ends = np.unique(edges.ends[boundary], return_inverse=True)
    ends = ends.reshape(-1, 2)
    of_edge = label_nodes(ends[:, 0], ends[:, 1], len(names))[ends[:, 0]]
    length = np.linalg.norm(np.diff(vertices[edges.ends[boundary]], axis=1)[:, 0], axis=1)
    perimeter = np.bincount(of_edge, weights=length).astype(np.float64)
    piece = label_triangles(triangles, edges)
    area = np.bincount(piece, weights=triangle_areas(vertices, triangles))
    beside = np.empty(len(edges.count), dtype=np.int64)
    beside[edges.of_half] = np.arange(len(edges.of_half)) // 3
    of_loop = np.empty(len(perimeter), dtype=np.int64)
    of_loop[of_edge] = piece[beside[boundary]]
    ranking = np.lexsort((-perimeter, of_loop))
    longest = np.zeros(len(perimeter), dtype=bool)
    longest[ranking[np.diff(of_loop[ranking], prepend=-1) > 0]] = True
    return BoundaryLoops(boundary, of_edge, perimeter, longest & (perimeter**2 >= np.pi * area[of_loop]))
