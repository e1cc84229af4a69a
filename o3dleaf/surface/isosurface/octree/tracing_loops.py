"""The compiled loops that trace a surface around leaves: the edges that it crosses are joined to loops.

An edge of a leaf is a least one: between two nodes that count, with none between. Its name is 3 · (lower node) + axis.
On each face, or quarter of a face that smaller leaves share, the crossed edges are joined in pairs so that inside nodes
stay apart, as on the faces of a cube (`cell_loops`): both leaves of a face see it alike. The pairs chain into loops.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.isosurface.crease_edge_loops import add_planes, is_creased
from o3dleaf.surface.isosurface.octree.octree_loops import FACE_CENTERS, FACE_CYCLES, NODES

EDGES = 3 * NODES
"""Names of edges; 54 of them are on the boundary of a leaf, or halves of such."""


class Incidences(NamedTuple):
    """Leaves and crossed edges on their boundaries, (i,) each: those of a leaf one after another, loop by loop.

    Attributes
    ----------
    lower, upper : ndarrays of int32
        Rows of the edge's ends.
    axis : ndarray of int8
    quadrants : ndarray of int8
        Which of the four quadrants around the edge the leaf fills, one or two, as bits, counter-clockwise.
    loop : ndarray of int64
        Number of the loop.
    following : ndarray of int64
        The incidence of the next edge of the loop.
    """

    lower: npt.NDArray[np.int32]
    upper: npt.NDArray[np.int32]
    axis: npt.NDArray[np.int8]
    quadrants: npt.NDArray[np.int8]
    loop: npt.NDArray[np.int64]
    following: npt.NDArray[np.int64]


@njit(nogil=True, cache=True)
def edge_name(one, other):
    """Return the name of the edge between two nodes along an axis."""
    gap = abs(other - one)
    return 3 * min(one, other) + (0 if gap < 3 else 1 if gap < 9 else 2)


@njit(nogil=True, cache=True)
def join_edges(cycle, present, inside, following, ends):
    """Write which edge around one face follows each one that enters the inside, and the ends of that."""
    ring, length = np.empty(8, dtype=np.int64), 0
    for node in cycle:
        if node >= 0 and present >> node & 1:
            ring[length] = node
            length += 1
    for k in range(length):
        here, there = ring[k], ring[(k + 1) % length]
        if inside >> here & 1 or not inside >> there & 1:
            continue
        last = k + 1
        while inside >> ring[(last + 1) % length] & 1:
            last += 1
        one, other = ring[last % length], ring[(last + 1) % length]
        name = edge_name(here, there)
        following[name], ends[name, 0], ends[name, 1] = edge_name(one, other), min(one, other), max(one, other)


@njit(nogil=True, cache=True)
def trace_leaf(present, inside, following, ends):
    """Write which edge follows each crossed one of a leaf (81,), −1 for others, and the lower and upper end of that."""
    following[:] = -1
    for face in range(6):
        if present >> FACE_CENTERS[face] & 1:
            for part in range(1, 5):
                join_edges(FACE_CYCLES[face, part], present, inside, following, ends)
        else:
            join_edges(FACE_CYCLES[face, 0], present, inside, following, ends)


@njit(nogil=True, cache=True)
def count_traced(start, stop, present, inside, edges, loops):
    """Write how many crossed edges and loops leaves have."""
    following, ends = np.empty(EDGES, dtype=np.int64), np.empty((EDGES, 2), dtype=np.int64)
    for leaf in range(start, stop):
        trace_leaf(present[leaf], inside[leaf], following, ends)
        edges[leaf], loops[leaf] = 0, 0
        for first in range(EDGES):
            edge = first
            loops[leaf] += following[first] >= 0
            while following[edge] >= 0:
                before, edge = edge, following[edge]
                following[before] = -1
                edges[leaf] += 1


@njit(nogil=True, cache=True)
def list_traced(start, stop, present, inside, nodes, first_edge, first_loop, found):
    """Write the `Incidences` of leaves, from the first edge and loop of each on."""
    following, ends = np.empty(EDGES, dtype=np.int64), np.empty((EDGES, 2), dtype=np.int64)
    for leaf in range(start, stop):
        trace_leaf(present[leaf], inside[leaf], following, ends)
        row, loop = first_edge[leaf], first_loop[leaf]
        for first in range(EDGES):
            if following[first] < 0:
                continue
            begin, edge = row, first
            while following[edge] >= 0:
                write_edge(following[edge] % 3, ends[edge, 0], ends[edge, 1], nodes[leaf], row, found)
                found.loop[row], found.following[row] = loop, row + 1
                before, edge = edge, following[edge]
                following[before] = -1
                row += 1
            found.following[row - 1] = begin
            loop += 1


@njit(nogil=True, cache=True)
def write_edge(axis, low, high, nodes, row, found):
    """Write ends, axis and quadrants of the edge of a leaf between two nodes."""
    found.axis[row], found.lower[row], found.upper[row] = axis, nodes[low], nodes[high]
    place = (low % 3, low // 3 % 3, low // 9)
    one, other = place[(axis + 1) % 3], place[(axis + 2) % 3]
    bits = 0
    for quadrant in range(4):
        # The leaf lies ahead of an edge on its lower face, behind one on its upper face, and on both sides between.
        if one != (2 if quadrant in (0, 3) else 0) and other != (2 if quadrant < 2 else 0):
            bits |= 1 << quadrant
    found.quadrants[row] = bits


@njit(nogil=True, cache=True)
def add_loop_planes(start, stop, first, edge, places, feet, normals, least, planes, creased):
    """Add up the tangent planes at the crossings of loops, and write which loops are creased.

    Parameters
    ----------
    first : (v + 1,) ndarray of int64
        The first incidence of each loop.
    edge : (i,) ndarray of int64
        The edge of each incidence.
    places, feet, normals : (e, 3) ndarrays
        Where edges are crossed, and the planes tangent there.
    least : float
        A loop is creased where two of its normals have a smaller product.
    planes : TangentPlanes
        Filled, but for `of_cell`.
    creased : (v,) ndarray of bool
        Filled.
    """
    numbers = np.empty(EDGES, dtype=np.int64)
    for loop in range(start, stop):
        length = first[loop + 1] - first[loop]
        numbers[:length] = edge[first[loop] : first[loop + 1]]
        creased[loop] = is_creased(numbers, length, normals, least)
        add_planes(numbers, length, places, feet, normals, planes, loop)
