"""The compiled loops of footing: which data hold a vertex, and feet passed on from vertex to vertex."""

import math

import numpy as np
from numba import njit


@njit(nogil=True, cache=True)
def find_feet(start, stop, surface, data, limits, far, feet):
    """Write distance and foot of the nearest of some data that face the way of each vertex.

    A foot is the point without its noise: moved along the vertex's normal towards its tangent plane.

    Parameters
    ----------
    surface : (vertices, normals)
        (n, 3) ndarrays.
    data : (points, normals, nearest)
        (m, 3) ndarrays, or a single row of normals if all face every way, and the (n, k) rows to choose from.
    limits : (noise, facing)
        How far points are moved at most; the least cosine between normals.
    far, feet : (n,), (n, 3) ndarrays
        Filled at start:stop where there is one; `far` must be infinite.
    """
    vertices, outward = surface
    points, normals, nearest = data
    noise, facing = limits
    known = len(normals) == len(points)
    offset = np.empty(3)
    for n in range(start, stop):
        for j in nearest[n]:
            along, cosine = 0.0, 0.0
            for axis in range(3):
                offset[axis] = points[j, axis] - vertices[n, axis]
                along += offset[axis] * outward[n, axis]
                if known:
                    cosine += normals[j, axis] * outward[n, axis]
            if known and cosine < facing:
                continue
            moved, square = min(max(along, -noise), noise), 0.0
            for axis in range(3):
                offset[axis] -= moved * outward[n, axis]
                square += offset[axis] * offset[axis]
            if math.sqrt(square) < far[n]:
                far[n] = math.sqrt(square)
                for axis in range(3):
                    feet[n, axis] = vertices[n, axis] + offset[axis]


@njit(nogil=True, cache=True)
def spread_feet(vertices, begin, around, reach, feet, distance):
    """Pass feet on over a mesh: each vertex asks for the feet that its neighbours are nearest to.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    begin, around : (n + 1,), (e,) ndarrays of int64
        The neighbours of vertex v are around[begin[v] : begin[v + 1]].
    reach : (n,) ndarray
        Vertices farther than this pass nothing on.
    feet, distance : (n, 3), (n,) ndarrays
        Of the vertices that have a foot, the others' distances infinite; changed in place.
    """
    waiting = np.isfinite(distance)
    queue = [np.int64(v) for v in np.flatnonzero(waiting)]
    while len(queue) > 0:
        following = [np.int64(0)]
        following.pop()
        for vertex in queue:
            waiting[vertex] = False
            if distance[vertex] > reach[vertex]:
                continue
            for k in range(begin[vertex], begin[vertex + 1]):
                other, square = around[k], 0.0
                for axis in range(3):
                    gap = vertices[other, axis] - feet[vertex, axis]
                    square += gap * gap
                far = math.sqrt(square)
                if far < distance[other]:
                    distance[other] = far
                    feet[other] = feet[vertex]
                    if not waiting[other]:
                        waiting[other] = True
                        following.append(other)
        queue = following
