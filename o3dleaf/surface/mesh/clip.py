"""Clipping: triangles outside an outline are discarded, and the rim that is left is made manifold."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, drop_unused_vertices
from o3dleaf.surface.mesh.topology import EdgeTable, fans_per_vertex, label_fans


def discard_triangles(vertices: FloatArray, triangles: IntArray, keep_vertex: BoolArray) -> tuple[FloatArray, IntArray]:
    """Return the mesh without the triangles that have a vertex to be left out.

    "Triangles with vertices outside the alpha-shape are discarded" (Whebell et al. 2023, section on
    the surface at a spacing). No vertex moves; vertices that no triangle names any more are dropped.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    keep_vertex : (n,) ndarray of bool
        False for the vertices outside.

    Raises
    ------
    InputError
        If there is not one bool a vertex.
    """
    keep = np.asarray(keep_vertex)
    if keep.shape != (len(vertices),) or keep.dtype != np.bool_:
        raise InputError(
            f"keep_vertex: is {keep.dtype} of shape {keep.shape}; give one bool per vertex, ({len(vertices)},)"
        )
    return drop_unused_vertices(vertices, triangles[keep[triangles].all(axis=1)])


def trim_to_manifold(
    vertices: FloatArray, triangles: IntArray, suspect: BoolArray | None = None
) -> tuple[FloatArray, IntArray]:
    """Return the mesh without the triangles that keep it from being edge- and vertex-manifold.

    Discarding triangles can leave two parts that touch in a vertex (a bow-tie). There the fan with
    the most triangles stays (of equal ones, the first) and the triangles of the others go, until
    every vertex has one fan. Of three or more triangles on an edge the first two stay. No vertex
    moves.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    suspect : (n,) ndarray of bool, optional
        The vertices that may have more than one fan; left out, all.

    Returns
    -------
    vertices, triangles : ndarrays
        What is left, without unused vertices; the order is kept.
    """
    suspect = np.ones(len(vertices), dtype=bool) if suspect is None else suspect
    while suspect.any():
        # Whether a vertex is manifold depends on its own triangles only: look again where some went.
        near = np.flatnonzero(suspect[triangles].any(axis=1))
        edges = EdgeTable.of(triangles[near])
        bad = near[_beyond_second(edges) | _beyond_largest_fan(triangles[near], edges, suspect)]
        suspect = np.zeros(len(vertices), dtype=bool)
        suspect[triangles[bad]] = True
        triangles = np.delete(triangles, bad, axis=0)
    return drop_unused_vertices(vertices, triangles)


def _beyond_second(edges: EdgeTable) -> BoolArray:
    """Return which triangles come third or later on one of their edges."""
    order = np.argsort(edges.of_half, kind="stable")
    start = np.concatenate([[0], np.cumsum(edges.count)[:-1]])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order)) - start[edges.of_half[order]]
    return np.asarray((rank.reshape(-1, 3) > 1).any(axis=1))


def _beyond_largest_fan(triangles: IntArray, edges: EdgeTable, suspect: BoolArray) -> BoolArray:
    """Return which triangles belong, at a suspect vertex of theirs, to another fan than the largest."""
    fans = label_fans(triangles, edges)
    several = suspect & (fans_per_vertex(triangles, fans, len(suspect)) > 1)
    size = np.bincount(fans.ravel())
    owner = np.empty(len(size), dtype=np.int64)
    owner[fans.ravel()] = triangles.ravel()
    ranking = np.lexsort((np.arange(len(size)), -size, owner))
    first = np.ones(len(size), dtype=bool)
    first[1:] = owner[ranking[1:]] != owner[ranking[:-1]]
    largest = np.zeros(len(size), dtype=bool)
    largest[ranking[first]] = True
    return np.asarray((several[triangles] & ~largest[fans]).any(axis=1))
