"""The compiled loops where an outline cuts a tile: which vertices stay, the rim's own ones, the triangles between.

Cells of a window have the tile's (nx, ny) cells and one column of samples more along each axis. A
solid cut by the outline is {F > 0 and D > 0}, D the signed distance of columns: along an edge
between samples inside and outside, the first zero of F or of D is the vertex. Those of F are the
tile's own; those of D are the rim's, named in the window, whose columns have ny + 1 to a row.
"""

from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.surface.isosurface.cell_loops import (
    COUNTS,
    CUBE_EDGES,
    DIRECTIONS,
    MAX_TRIANGLES,
    MIN_FRACTION,
    cell_triangles,
)
from o3dleaf.surface.mesh.adjacency_loops import find_root, join


class TileVertices(NamedTuple):
    """Vertices of a tile and those beyond it: steps of its lattice (nx, ny, nz), edges (n,), fractions (n + h,), keys.

    A key (h,) is 4 · (edge in the neighbor's lattice) + the neighbor that it belongs to (bits: along, across), rising.
    """

    shape: tuple[int, int, int]
    edges: Any
    fractions: Any
    beyond: Any


class RimVertices(NamedTuple):
    """Vertices of a rim: names (e,) of their edges in the window, rising, and fractions (e,) along them."""

    names: Any
    fractions: Any


class CutColumns(NamedTuple):
    """Columns of a window (nx + 1, ny + 1).

    Their signed distances to the outline; the row of each column of a cut cell among those whose samples are
    labeled, −1 for others; and these labels (m, nz).
    """

    distance: Any
    row_of: Any
    labels: Any


@njit(nogil=True, cache=True)
def find(names, name):
    """Return the row of a name in rising `names`, −1 if it is not there."""
    low, high = 0, len(names) - 1
    while low <= high:
        middle = (low + high) // 2
        if names[middle] == name:
            return middle
        if names[middle] < name:
            low = middle + 1
        else:
            high = middle - 1
    return -1


@njit(nogil=True, cache=True)
def use_by_cells(edges, shape, kept, used):
    """Write which vertices lie in a kept cell; `kept` (nx + 1, ny + 1) has the row and the column before the tile."""
    _, ny, nz = shape
    for n in range(len(edges)):
        column, direction = (edges[n] >> 3) // nz, edges[n] & 7
        i, j = column // ny + 1, column % ny + 1
        used[n] = False
        for u in range(i - 1 + (direction & 1), i + 1):
            for v in range(j - 1 + (direction >> 1 & 1), j + 1):
                used[n] = used[n] or kept[u, v]


@njit(nogil=True, cache=True)
def use_by_distance(edges, fractions, upward, shape, distance, used):
    """Write which vertices are the first zero along their edges; `upward` ones have the solid at the lower end."""
    _, ny, nz = shape
    for n in range(len(edges)):
        column, direction = (edges[n] >> 3) // nz, edges[n] & 7
        i, j = column // ny, column % ny
        inner, outer = distance[i, j], distance[i + (direction & 1), j + (direction >> 1 & 1)]
        fraction = fractions[n]
        if not upward[n]:
            inner, outer, fraction = outer, inner, 1.0 - fraction
        used[n] = inner > 0.0 and (outer > 0.0 or fraction <= inner / (inner - outer))


@njit(nogil=True, cache=True)
def rim_edges(method, tile, columns, names, fractions):
    """Write the names in the window and the fractions of the rim's vertices, and return how many there are.

    Called with empty arrays it counts. `tile` are `TileVertices`, `columns` are `CutColumns`.
    """
    nx, ny, nz = tile.shape
    distance, row_of, labels = columns.distance, columns.row_of, columns.labels
    count = 0
    for i in range(nx + 1):
        for j in range(ny + 1):
            if row_of[i, j] < 0:
                continue
            for k in range(nz):
                for direction in DIRECTIONS[method]:
                    u, v, w = i + (direction & 1), j + (direction >> 1 & 1), k + (direction >> 2)
                    if direction & 3 == 0 or u > nx or v > ny or w >= nz:
                        continue
                    low, high = distance[i, j], distance[u, v]
                    if (low > 0.0) == (high > 0.0):
                        continue
                    upward = low > 0.0
                    solid = labels[row_of[i, j], k] == INSIDE, labels[row_of[u, v], w] == INSIDE
                    if not solid[0 if upward else 1]:
                        continue
                    share = low / (low - high) if upward else high / (high - low)
                    if not solid[1 if upward else 0]:
                        fraction = tile.fractions[vertex_at(i, j, k, direction, tile)]
                        if (fraction if upward else 1.0 - fraction) <= share:
                            continue
                    if len(names):
                        names[count] = ((i * (ny + 1) + j) * nz + k) * 8 + direction
                        share = min(max(share, MIN_FRACTION), 1.0 - MIN_FRACTION)
                        fractions[count] = share if upward else 1.0 - share
                    count += 1
    return count


@njit(nogil=True, cache=True)
def cut_cells(method, tile, rim, columns, nodes, is_rim):
    """Write the triangles of the cells that the outline cuts and which of them are rim; return how many there are.

    Called with empty arrays it counts. `tile` are `TileVertices`, `rim` are `RimVertices`, `columns` are
    `CutColumns`. Nodes are those of `o3dleaf.leaf.instancing.placement`.
    """
    nx, ny, nz = tile.shape
    distance, row_of, labels = columns.distance, columns.row_of, columns.labels
    vertices = len(tile.fractions)
    along, places, drawn = np.empty(12), np.empty((12, 3)), np.empty((MAX_TRIANGLES, 3), dtype=np.int64)
    count = 0
    for i in range(nx):
        for j in range(ny):
            within = 0
            for corner in range(4):
                within += distance[i + (corner & 1), j + (corner >> 1)] > 0.0
            if within in (0, 4):
                continue
            for k in range(nz - 1):
                code = 0
                for corner in range(8):
                    u, v, w = i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)
                    if distance[u, v] > 0.0 and labels[row_of[u, v], w] == INSIDE:
                        code |= 1 << corner
                if COUNTS[method, code] == 0 or len(nodes) == 0:
                    count += COUNTS[method, code]
                    continue
                for n in range(12):
                    low, direction = CUBE_EDGES[n] >> 3, CUBE_EDGES[n] & 7
                    if (code >> low & 1) != (code >> (low | direction) & 1):
                        along[n] = vertex_fraction(node_at(i, j, k, low, direction, tile, rim), tile, rim)
                for n in range(cell_triangles(method, code, along, places, drawn)):
                    is_rim[count] = False
                    for corner in range(3):
                        low, direction = drawn[n, corner] >> 3, drawn[n, corner] & 7
                        node = node_at(i, j, k, low, direction, tile, rim)
                        nodes[count, corner] = node
                        is_rim[count] = is_rim[count] or node >= vertices
                    count += 1
    return count


@njit(nogil=True, cache=True)
def node_at(i, j, k, low, direction, tile, rim):
    """Return the node of the vertex on an edge of cell (i, j, k): one of the rim if it has one, else the tile's."""
    _, ny, nz = tile.shape
    u, v, w = i + (low & 1), j + (low >> 1 & 1), k + (low >> 2)
    if direction & 3:
        row = find(rim.names, ((u * (ny + 1) + v) * nz + w) * 8 + direction)
        if row >= 0:
            return len(tile.fractions) + row
    return vertex_at(u, v, w, direction, tile)


@njit(nogil=True, cache=True)
def vertex_at(i, j, k, direction, tile):
    """Return the tile's vertex, or the neighbor's, on the edge from point (i, j, k) of the window."""
    nx, ny, nz = tile.shape
    name = (((i % nx) * ny + j % ny) * nz + k) * 8 + direction
    shift = (i >= nx) + 2 * (j >= ny)
    if shift == 0:
        return find(tile.edges, name)
    return len(tile.edges) + find(tile.beyond, name * 4 + shift)


@njit(nogil=True, cache=True)
def vertex_fraction(node, tile, rim):
    """Return how far along its edge the vertex of a node lies."""
    vertices = len(tile.fractions)
    return tile.fractions[node] if node < vertices else rim.fractions[node - vertices]


@njit(nogil=True, cache=True)
def gather_cells(kept, cells, nodes, gathered):
    """Write the triangles over the kept cells (nx, ny), in their order, into `gathered`."""
    row = 0
    nx, ny = kept.shape
    for i in range(nx):
        for j in range(ny):
            if kept[i, j]:
                for t in range(cells[i * ny + j], cells[i * ny + j + 1]):
                    gathered[row] = nodes[t]
                    row += 1


@njit(nogil=True, cache=True)
def find_component_roots(nodes, count):
    """Return the (count,) first node of the component of each node, by the triangles `nodes` (m, 3)."""
    parent = np.arange(count, dtype=np.int32)
    for t in range(len(nodes)):
        join(parent, nodes[t, 0], nodes[t, 1])
        join(parent, nodes[t, 0], nodes[t, 2])
    for node in range(count):
        parent[node] = find_root(parent, node)
    return parent
