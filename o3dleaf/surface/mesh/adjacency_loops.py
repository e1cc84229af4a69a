"""The compiled loops of topology: edges by counting, pieces by union and find; time grows with the mesh alone.

Half-edge 3 t + c runs from corner c of triangle t to the next corner. All loops are serial: each one reads
or writes all over its arrays, and ten million triangles take them a second.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit


@njit(nogil=True, cache=True)
def after(half):
    """Return the half-edge that follows in the same triangle."""
    return half - 2 if half % 3 == 2 else half + 1


@njit(nogil=True, cache=True)
def sort_half_edges(corners, start, buffer, order):
    """Order the half-edges by their smaller vertex, then by their larger one, then by number: two stable passes.

    Parameters
    ----------
    corners : (3 m,) ndarray of int64
    start : (n + 1,) ndarray
        Overwritten.
    buffer, order : (3 m,) ndarrays
        Filled; `order` with the result.
    """
    for larger in range(1, -1, -1):
        start[:] = 0
        for half in range(len(corners)):
            one, other = corners[half], corners[after(half)]
            start[(max(one, other) if larger else min(one, other)) + 1] += 1
        for vertex in range(1, len(start)):
            start[vertex] += start[vertex - 1]
        for k in range(len(corners)):
            half = k if larger else buffer[k]
            one, other = corners[half], corners[after(half)]
            vertex = max(one, other) if larger else min(one, other)
            if larger:
                buffer[start[vertex]] = half
            else:
                order[start[vertex]] = half
            start[vertex] += 1


@njit(nogil=True, cache=True)
def number_edges(corners, order, of_half):
    """Fill the (3 m,) edges of the half-edges, given their order, and return how many there are."""
    edge, low, high = -1, -1, -1
    for half in order:
        one, other = corners[half], corners[after(half)]
        if min(one, other) != low or max(one, other) != high:
            edge, low, high = edge + 1, min(one, other), max(one, other)
        of_half[half] = edge
    return edge + 1


@njit(nogil=True, cache=True)
def describe_edges(corners, order, of_half, ends, count, inconsistent):
    """Fill the (e, 2) ends of the edges, their (e,) numbers of triangles, and whether two run in one direction."""
    k = 0
    for edge in range(len(ends)):
        begin, forward = k, 0
        while k < len(order) and of_half[order[k]] == edge:
            one, other = corners[order[k]], corners[after(order[k])]
            forward += one < other
            ends[edge, 0], ends[edge, 1] = min(one, other), max(one, other)
            k += 1
        count[edge] = k - begin
        inconsistent[edge] = forward > 1 or k - begin - forward > 1


@njit(nogil=True, cache=True)
def find_root(parent, node):
    """Return the root of a node, halving the path to it."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@njit(nogil=True, cache=True)
def join(parent, one, other):
    """Join two nodes' trees; the root is the smallest member, so that labels follow from the graph alone."""
    one, other = find_root(parent, one), find_root(parent, other)
    if one < other:
        parent[other] = one
    else:
        parent[one] = other


@njit(nogil=True, cache=True)
def join_pairs(parent, first, second):
    """Join the trees of (k,) pairs of nodes."""
    for k in range(len(first)):
        join(parent, first[k], second[k])


@njit(nogil=True, cache=True)
def join_triangles(parent, order, of_half):
    """Join (m,) triangles across their edges."""
    for k in range(1, len(order)):
        if of_half[order[k]] == of_half[order[k - 1]]:
            join(parent, order[k] // 3, order[k - 1] // 3)


@njit(nogil=True, cache=True)
def join_corners(parent, corners, order, of_half):
    """Join (3 m,) corners at one vertex across the edges that meet there."""
    for k in range(1, len(order)):
        one, other = order[k - 1], order[k]
        if of_half[one] == of_half[other]:
            alike = corners[one] == corners[other]
            join(parent, one, other if alike else after(other))
            join(parent, after(one), after(other) if alike else other)


@njit(nogil=True, cache=True)
def number_roots(parent):
    """Turn trees into labels 0, 1, ... by first member, in place, and return how many there are."""
    for node in range(len(parent)):
        # Roots are the smallest members, so that the parent already points at its root.
        parent[node] = parent[parent[node]]
    count = 0
    for node in range(len(parent)):
        if parent[node] == node:
            parent[node] = count
            count += 1
        else:
            parent[node] = parent[parent[node]]
    return count


@njit(nogil=True, cache=True)
def find_turns(order, of_half, count, corners, parent, turn, bad):
    """Find which triangles to turn so that those across each edge of two run alike.

    Parameters
    ----------
    parent : (m,) ndarray
        0, 1, ...; at the end the root of each triangle's patch, joined across edges of two triangles.
    turn : (m,) ndarray of bool
        False; at the end whether a triangle runs against its root.
    bad : (m,) ndarray of bool
        False; at the end whether the patch of a root cannot be oriented.
    """
    for k in range(1, len(order)):
        one, other = order[k - 1], order[k]
        if of_half[one] != of_half[other] or count[of_half[one]] != 2:
            continue
        inconsistent = (corners[one] < corners[after(one)]) == (corners[other] < corners[after(other)])
        first, turned = _root_and_turn(parent, turn, one // 3)
        second, also = _root_and_turn(parent, turn, other // 3)
        inconsistent ^= turned ^ also
        if first == second:
            bad[first] |= inconsistent
        else:
            low, high = min(first, second), max(first, second)
            parent[high], turn[high] = low, inconsistent
            bad[low] |= bad[high]
    for triangle in range(len(parent)):
        root, turned = _root_and_turn(parent, turn, triangle)
        parent[triangle], turn[triangle] = root, turned


@njit(nogil=True, cache=True)
def _root_and_turn(parent, turn, node):
    """Return the root of a triangle and whether it runs against it, halving the path."""
    turned = False
    while parent[node] != node:
        above = parent[node]
        if parent[above] != above:
            turn[node] ^= turn[above]
            parent[node] = parent[above]
        turned ^= turn[node]
        node = parent[node]
    return node, turned


@njit(nogil=True, cache=True)
def largest_across(corners, half):
    """Return the vertex across from a half-edge if it is the first largest of its triangle, else -1."""
    t, across = half - half % 3, (half + 2) % 3
    for k in range(3):
        if corners[t + k] > corners[t + across] or (corners[t + k] == corners[t + across] and k < across):
            return -1
    return corners[t + across]


@njit(nogil=True, cache=True)
def mark_duplicates(corners, order, of_half, is_duplicate):
    """Mark the (m,) triangles on the same three vertices as one before; each is looked at on one edge only."""
    stop = 0
    while stop < len(order):
        begin, edge = stop, of_half[order[stop]]
        while stop < len(order) and of_half[order[stop]] == edge:
            stop += 1
        if stop - begin == 2:
            one, other = order[begin], order[begin + 1]
            apex = largest_across(corners, one)
            is_duplicate[other // 3] |= apex >= 0 and apex == largest_across(corners, other)
        elif stop - begin > 2:
            # By the vertex across, then by number; those without come first.
            key = np.empty(stop - begin, np.int64)
            for k in range(begin, stop):
                key[k - begin] = np.int64(largest_across(corners, order[k])) * len(key) + k - begin
            key.sort()
            for n in range(1, len(key)):
                alike = key[n] >= 0 and key[n] // len(key) == key[n - 1] // len(key)
                is_duplicate[order[begin + key[n] % len(key)] // 3] |= alike


@njit(nogil=True, cache=True)
def list_ends(ends, begin, at_vertex):
    """List the edges at each vertex: of vertex v, at_vertex[begin[v] : begin[v + 1]], in the edges' order.

    Parameters
    ----------
    ends : (b, 2) ndarray
    begin : (v + 1,) ndarray
        Zeros; filled.
    at_vertex : (2 b,) ndarray
        Filled.
    """
    for edge in range(len(ends)):
        for side in range(2):
            begin[ends[edge, side]] += 1
    for vertex in range(1, len(begin)):
        begin[vertex] += begin[vertex - 1]
    for edge in range(len(ends) - 1, -1, -1):
        for side in range(1, -1, -1):
            begin[ends[edge, side]] -= 1
            at_vertex[begin[ends[edge, side]]] = edge


@njit(nogil=True, cache=True)
def walk_boundary(begin, neighbours, ends, loop, visited, walk, offsets, of_ring):
    """Walk along boundary edges from vertex to vertex, each edge once, until stuck; return the number of walks.

    Parameters
    ----------
    begin : (v + 1,) ndarray
        Where each vertex's edges begin in `neighbours`.
    neighbours : (2 b,) ndarray
        The edges at each vertex.
    ends : (b, 2) ndarray
        The vertices of each edge.
    loop : (b,) ndarray
        The loop of each edge.
    visited : (b,) ndarray of bool
        False.
    walk : (2 b,) ndarray
        Filled with the vertices of the walks; a closed one does not repeat its first.
    offsets : (b + 1,) ndarray
        Filled with where each walk begins, and the end.
    of_ring : (b,) ndarray
        Filled with the loop of each walk.
    """
    rings, size, next_edge = 0, 0, begin[:-1].copy()
    for first in range(len(ends)):
        if visited[first]:
            continue
        offsets[rings], of_ring[rings] = size, loop[first]
        edge, vertex = first, ends[first, 0]
        while edge >= 0:
            visited[edge] = True
            walk[size] = vertex
            size += 1
            vertex = ends[edge, 1] if ends[edge, 0] == vertex else ends[edge, 0]
            edge = -1
            while next_edge[vertex] < begin[vertex + 1] and edge < 0:
                if not visited[neighbours[next_edge[vertex]]]:
                    edge = neighbours[next_edge[vertex]]
                next_edge[vertex] += 1
        if vertex != ends[first, 0]:
            walk[size] = vertex
            size += 1
        rings += 1
    offsets[rings] = size
    return rings
