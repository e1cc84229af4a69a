"""The compiled loops of a whole lattice: samples to triangles, plane by plane.

An edge of the lattice is 8 · (number of its lower point) + direction, a whole number; the crossed
edges in the order of these numbers are the vertices. Equal edges are one vertex by construction, and
a plane's vertices can be numbered without its neighbours.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.isosurface.cell_loops import (
    COUNTS,
    CUBE_EDGES,
    DIRECTIONS,
    MAX_TRIANGLES,
    cell_triangles,
    crossing,
)


class NamedMesh(NamedTuple):
    """A surface on a lattice.

    Attributes
    ----------
    edges : (n,) ndarray of int64
        Names of the crossed edges.
    fractions : (n,) ndarray
        How far along its edge each vertex lies.
    triangles : (m, 3) ndarray of int64
        Numbers of vertices.
    """

    edges: npt.NDArray[np.int64]
    fractions: npt.NDArray[np.float64]
    triangles: npt.NDArray[np.int64]


class FirstOfPlane(NamedTuple):
    """The (nx + 1,) rows of a mesh at which each x-plane's vertices and triangles begin, and the ends."""

    vertices: npt.NDArray[np.int64]
    triangles: npt.NDArray[np.int64]


@njit(nogil=True, cache=True)
def corner_code(inside, i, j, k):
    """Return which corners of cell (i, j, k) are inside, as eight bits."""
    code = 0
    for corner in range(8):
        if inside[i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)]:
            code |= 1 << corner
    return code


@njit(nogil=True, cache=True)
def is_crossed(inside, i, j, k, direction):
    """Say whether the edge from point (i, j, k) stays on the lattice and changes sides."""
    u, v, w = i + (direction & 1), j + (direction >> 1 & 1), k + (direction >> 2)
    if u >= inside.shape[0] or v >= inside.shape[1] or w >= inside.shape[2]:
        return False
    return inside[i, j, k] != inside[u, v, w]


@njit(nogil=True, cache=True)
def count_planes(method, inside, start, stop, vertices, triangles):
    """Count the crossed edges that start in each x-plane, and the triangles of the cells that start there.

    Parameters
    ----------
    method : int
        `CUBES` or `TETRAHEDRA` of `o3dleaf.surface.isosurface.cell_loops`.
    inside : (nx, ny, nz) ndarray of bool
    start, stop : int
        The planes to count.
    vertices, triangles : (nx,) ndarrays of int64
        Filled at start:stop.
    """
    nx, ny, nz = inside.shape
    for i in range(start, stop):
        vertices[i], triangles[i] = 0, 0
        for j in range(ny):
            for k in range(nz):
                for direction in DIRECTIONS[method]:
                    vertices[i] += direction > 0 and is_crossed(inside, i, j, k, direction)
                if i + 1 == nx or j + 1 == ny or k + 1 == nz:
                    continue
                triangles[i] += COUNTS[method, corner_code(inside, i, j, k)]


@njit(nogil=True, cache=True)
def _number_plane(method, values, inside, i, first, numbers, edges, fractions):
    """Give the crossed edges of plane i the numbers from `first` on, in `numbers` (ny, nz, 8), and note them."""
    _, ny, nz = inside.shape
    for j in range(ny):
        for k in range(nz):
            for direction in DIRECTIONS[method]:
                if direction == 0 or not is_crossed(inside, i, j, k, direction):
                    continue
                there = values[i + (direction & 1), j + (direction >> 1 & 1), k + (direction >> 2)]
                numbers[j, k, direction] = first
                edges[first] = ((i * ny + j) * nz + k) * 8 + direction
                fractions[first] = crossing(values[i, j, k], there)
                first += 1


@njit(nogil=True, cache=True)
def march_planes(method, values, inside, start, stop, offsets, mesh):
    """Write the vertices of some x-planes and the triangles of their cells into their rows of the mesh.

    Parameters
    ----------
    method, inside
        As in `count_planes`.
    values : (nx, ny, nz) ndarray
        Samples less the level.
    start, stop : int
        The planes to march.
    offsets : FirstOfPlane
    mesh : NamedMesh
        Filled.
    """
    nx, ny, nz = inside.shape
    edges, fractions, triangles = mesh
    along, places, drawn = np.empty(12), np.empty((12, 3)), np.empty((MAX_TRIANGLES, 3), dtype=np.int64)
    numbers = np.empty((2, ny, nz, 8), dtype=np.int64)
    _number_plane(method, values, inside, start, offsets.vertices[start], numbers[0], edges, fractions)
    for i in range(start, stop):
        if i + 1 == nx:
            break
        # The next block writes the same names and fractions into the same rows.
        _number_plane(method, values, inside, i + 1, offsets.vertices[i + 1], numbers[1], edges, fractions)
        row = offsets.triangles[i]
        for j in range(ny - 1):
            for k in range(nz - 1):
                code = corner_code(inside, i, j, k)
                if not 0 < code < 255:
                    continue
                for n in range(12):
                    low, direction = CUBE_EDGES[n] >> 3, CUBE_EDGES[n] & 7
                    if (code >> low & 1) != (code >> (low | direction) & 1):
                        vertex = numbers[low & 1, j + (low >> 1 & 1), k + (low >> 2), direction]
                        along[n] = fractions[vertex]
                for n in range(cell_triangles(method, code, along, places, drawn)):
                    for corner in range(3):
                        low, direction = drawn[n, corner] >> 3, drawn[n, corner] & 7
                        triangles[row, corner] = numbers[low & 1, j + (low >> 1 & 1), k + (low >> 2), direction]
                    row += 1
        below, above = numbers[0].reshape(-1), numbers[1].reshape(-1)
        for n in range(below.size):
            below[n] = above[n]


@njit(nogil=True, cache=True)
def place_vertices(edges, fractions, shape, start, vertices):
    """Write the (n, 3) lattice coordinates of vertices on edges of a lattice of `shape` that begins at `start`.

    Whole numbers are added first: where a vertex lies does not depend, to the last bit, on the lattice that it was
    named in.
    """
    _, ny, nz = shape
    for n in range(len(edges)):
        point, direction = edges[n] >> 3, edges[n] & 7
        vertices[n, 0] = (start[0] + point // (ny * nz)) + (direction & 1) * fractions[n]
        vertices[n, 1] = (start[1] + point // nz % ny) + (direction >> 1 & 1) * fractions[n]
        vertices[n, 2] = (start[2] + point % nz) + (direction >> 2) * fractions[n]
