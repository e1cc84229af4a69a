"""The compiled loops that clip a tile's triangles where the signed distance to the margin is zero.

The distance is linear along the edges of the lattice, from column to column, and along the edges of triangles, whose
corners lie on those. So the clipped triangles are a surface with a boundary wherever the whole ones are a surface,
and on the upright faces between cells all of them end on one upright line.

A vertex of the cut is named by the edge of a triangle that it lies on: its two ends, each 4 · (vertex of a tile) +
the neighbor that it belongs to, as the tile sees them that owns the edge: the one of the lower of both ends.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.isosurface.cell_loops import MIN_FRACTION


class CutVertices(NamedTuple):
    """Vertices of the cut: names (e,), rising in each tile; first row (5,) of those of each neighbor, the own first.

    Their places (e, 3) in the window, in steps of the lattice; the upright planes (e, 2), along and across, that the
    edges of triangles lie in, −1: none.
    """

    names: Any
    first: Any
    places: Any
    planes: Any


class MarginColumns(NamedTuple):
    """What is clipped: signed distances (nx + 1, ny + 1) of columns, and the cells (c,), i · ny + j, that are cut."""

    distance: Any
    cells: Any


@njit(nogil=True, cache=True)
def key_of(node, tile):
    """Return 4 · (vertex of the tile) + the neighbor that it belongs to, of a node."""
    inner = len(tile.edges)
    return node * 4 if node < inner else tile.beyond[node - inner]


@njit(nogil=True, cache=True)
def edge_of(key, tile):
    """Return the edge (i, j, k, direction) of the lattice that a vertex lies on, in the window."""
    nx, ny, nz = tile.shape
    point, direction = tile.edges[key >> 2] >> 3, tile.edges[key >> 2] & 7
    i, j = point // (ny * nz) + nx * (key & 1), point // nz % ny + ny * (key >> 1 & 1)
    return i, j, point % nz, direction


@njit(nogil=True, cache=True)
def distance_at(key, tile, distance):
    """Return the signed distance of a vertex: that of its column, or linear between two."""
    i, j, _, direction = edge_of(key, tile)
    low = distance[i, j]
    if direction & 3 == 0:
        return low
    return low + tile.fractions[key >> 2] * (distance[i + (direction & 1), j + (direction >> 1 & 1)] - low)


@njit(nogil=True, cache=True)
def use_by_sign(tile, distance, used):
    """Write which of the tile's own vertices lie inside the margin."""
    for n in range(len(used)):
        used[n] = distance_at(n * 4, tile, distance) > 0.0


@njit(nogil=True, cache=True)
def name_edge(a, b, tile):
    """Return the name of the edge between two keys, and the neighbor that owns it."""
    shift = a & b & 3
    a, b = a - shift, b - shift
    return min(a, b) * (4 * len(tile.edges)) + max(a, b), shift


@njit(nogil=True, cache=True)
def list_cuts(tile, nodes, first, columns, names, shifts):
    """Write the names and owners of the cut edges of all triangles of the cut cells; return how many there are.

    An edge comes once for each of its triangles. Called with empty arrays it counts.
    """
    count = 0
    for cell in columns.cells:
        for t in range(first[cell], first[cell + 1]):
            for corner in range(3):
                a, b = key_of(nodes[t, corner], tile), key_of(nodes[t, (corner + 1) % 3], tile)
                if (distance_at(a, tile, columns.distance) > 0.0) == (distance_at(b, tile, columns.distance) > 0.0):
                    continue
                if len(names):
                    names[count], shifts[count] = name_edge(a, b, tile)
                count += 1
    return count


@njit(nogil=True, cache=True)
def place_cuts(tile, distance, cut):
    """Write the places and planes of the vertices of a cut."""
    size = 4 * len(tile.edges)
    shift = 0
    start, stop = np.empty(3), np.empty(3)
    for row in range(len(cut.names)):
        while row >= cut.first[shift + 1]:
            shift += 1
        a, b = cut.names[row] // size + shift, cut.names[row] % size + shift
        low, high = edge_of(a, tile), edge_of(b, tile)
        for axis in range(3):
            start[axis] = low[axis] + tile.fractions[a >> 2] * (low[3] >> axis & 1)
            stop[axis] = high[axis] + tile.fractions[b >> 2] * (high[3] >> axis & 1)
            if axis < 2:
                upright = low[axis] == high[axis] and (low[3] | high[3]) >> axis & 1 == 0
                cut.planes[row, axis] = low[axis] if upright else -1
        inner, outer = distance_at(a, tile, distance), distance_at(b, tile, distance)
        if cut.planes[row, 0] < 0 and cut.planes[row, 1] < 0:
            inner, outer = on_chord(start, stop, distance, inner, outer)
        share = min(max(inner / (inner - outer), MIN_FRACTION), 1.0 - MIN_FRACTION)
        for axis in range(3):
            cut.places[row, axis] = start[axis] + share * (stop[axis] - start[axis])


@njit(nogil=True, cache=True)
def on_chord(start, stop, distance, inner, outer):
    """Return distances of the ends of an edge within a cell from the chord of the margin there, or those given.

    The chord joins the two points in which the margin crosses the cell's sides: so the wall in a cell is plane, and
    stands where its ends do. A cell with four such points has no chord.
    """
    i, j = math.floor((start[0] + stop[0]) / 2), math.floor((start[1] + stop[1]) / 2)
    crossings, found = np.empty((2, 2)), 0
    for side in range(4):
        axis, end = side >> 1, side & 1
        u, v = i + (0 if axis else end), j + (end if axis else 0)
        low, high = distance[u, v], distance[u + axis, v + 1 - axis]
        if (low > 0.0) != (high > 0.0):
            if found == 2:
                return inner, outer
            crossings[found, 0], crossings[found, 1] = u, v
            crossings[found, 1 - axis] += low / (low - high)
            found += 1
    if found < 2:
        return inner, outer
    p, q = crossings
    one = (q[0] - p[0]) * (start[1] - p[1]) - (q[1] - p[1]) * (start[0] - p[0])
    other = (q[0] - p[0]) * (stop[1] - p[1]) - (q[1] - p[1]) * (stop[0] - p[0])
    if one * other >= 0.0:
        return inner, outer
    return one, other


@njit(nogil=True, cache=True)
def find_cut(a, b, tile, cut):
    """Return the row of the vertex on the edge between two keys."""
    name, shift = name_edge(a, b, tile)
    low, high = cut.first[shift], cut.first[shift + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if cut.names[middle] < name:
            low = middle + 1
        else:
            high = middle
    return low


@njit(nogil=True, cache=True)
def put_triangle(triangles, row, a, b, c):
    """Write a triangle into a row, and return the row after it."""
    triangles[row, 0], triangles[row, 1], triangles[row, 2] = a, b, c
    return row + 1


@njit(nogil=True, cache=True)
def clip_triangles(tile, nodes, first, columns, cut, clipped, borders, ends):
    """Write the clipped triangles (m, 3) of the cut cells and their new borders (b, 2), rows of the cut.

    Borders run as the wall beside them does, against their triangles; `ends` (c + 1,) are the first ones of each cell.
    Return how many triangles there are.
    """
    vertices = len(tile.edges) + len(tile.beyond)
    count, border = 0, 0
    for row in range(len(columns.cells)):
        ends[row] = border
        cell = columns.cells[row]
        for t in range(first[cell], first[cell + 1]):
            inside = 0
            for corner in range(3):
                positive = distance_at(key_of(nodes[t, corner], tile), tile, columns.distance) > 0.0
                inside += positive << corner
            if inside == 0:
                continue
            if inside == 7:
                count = put_triangle(clipped, count, nodes[t, 0], nodes[t, 1], nodes[t, 2])
                continue
            # The corner that is alone on its side of the margin.
            is_in = inside in (1, 2, 4)
            code = inside if is_in else 7 - inside
            lone = 0 if code == 1 else 1 if code == 2 else 2
            a, b, c = nodes[t, lone], nodes[t, (lone + 1) % 3], nodes[t, (lone + 2) % 3]
            x = find_cut(key_of(a, tile), key_of(b, tile), tile, cut)
            y = find_cut(key_of(a, tile), key_of(c, tile), tile, cut)
            if is_in:
                count = put_triangle(clipped, count, a, vertices + x, vertices + y)
                borders[border, 0], borders[border, 1] = y, x
            else:
                count = put_triangle(clipped, count, vertices + x, b, c)
                count = put_triangle(clipped, count, vertices + x, c, vertices + y)
                borders[border, 0], borders[border, 1] = x, y
            border += 1
    ends[len(columns.cells)] = border
    return count
