"""The compiled loops of creases: where the normals around a loop disagree, a fan about a new vertex takes its place."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.isosurface.band.band_loops import vertex_at
from o3dleaf.surface.isosurface.cell_loops import CUBE_EDGES, LOOPS, MAX_TRIANGLES, cut_loop


class FirstRows(NamedTuple):
    """The (c,) first crease and the first triangle of each cell."""

    creases: npt.NDArray[np.int64]
    triangles: npt.NDArray[np.int64]


class TangentPlanes(NamedTuple):
    """The planes tangent to the surface at the vertices of each of k creased loops, through the feet p, normals n.

    Attributes
    ----------
    squares, right, middle : (k, 3, 3), (k, 3), (k, 3) ndarrays
        Σ n nᵀ, Σ n n · (p − middle), and the mean of the vertices.
    of_cell : (k,) ndarray of int64
        The cell of each loop.
    """

    squares: npt.NDArray[np.float64]
    right: npt.NDArray[np.float64]
    middle: npt.NDArray[np.float64]
    of_cell: npt.NDArray[np.int64]


@njit(nogil=True, cache=True)
def loop_vertices(code, entry, rows, numbering, numbers):
    """Write the vertices of the loop at `entry` of a cell's row of `LOOPS`, and return how many there are."""
    length = LOOPS[code, entry]
    for n in range(length):
        edge = CUBE_EDGES[LOOPS[code, entry + 1 + n]]
        numbers[n] = vertex_at(numbering, rows[edge >> 3], edge & 7)
    return length


@njit(nogil=True, cache=True)
def is_creased(numbers, length, normals, least):
    """Say whether two of a loop's unit normals have a product below `least`."""
    for n in range(length):
        for m in range(n):
            product = 0.0
            for axis in range(3):
                product += normals[numbers[n], axis] * normals[numbers[m], axis]
            if product < least:
                return True
    return False


@njit(nogil=True, cache=True)
def count_creases(start, stop, corners, codes, numbering, normals, least, creases, triangles):
    """Write how many creased loops each cell has, and how many triangles."""
    numbers = np.empty(12, dtype=np.int64)
    for cell in range(start, stop):
        code, entry = np.int64(codes[cell]), 0
        creases[cell], triangles[cell] = 0, 0
        while LOOPS[code, entry]:
            length = loop_vertices(code, entry, corners[cell], numbering, numbers)
            creased = is_creased(numbers, length, normals, least)
            creases[cell] += creased
            triangles[cell] += length if creased else length - 2
            entry += 1 + length


@njit(nogil=True, cache=True)
def draw_creases(
    start, stop, corners, codes, numbering, fraction, vertices, feet, normals, least, offsets, planes, triangles
):
    """Write the triangles of some cells, those of creased loops about vertices of their own.

    Parameters
    ----------
    fraction : (v,) ndarray
        How far along its edge each vertex lies.
    vertices, feet, normals : (v, 3) ndarrays
        Tangent planes go through the feet.
    least : float
        A loop is creased where two of its normals have a smaller product.
    offsets : FirstRows
    planes : TangentPlanes
        Filled.
    triangles : (m, 3) ndarray of int64
        Filled; vertex v + k is that of loop k.
    """
    numbers, loop, places = np.empty(12, dtype=np.int64), np.empty(12, dtype=np.int64), np.empty((12, 3))
    drawn, number_of = np.empty((MAX_TRIANGLES, 3), dtype=np.int64), np.empty(64, dtype=np.int64)
    for cell in range(start, stop):
        code, entry, crease, row = np.int64(codes[cell]), 0, offsets.creases[cell], offsets.triangles[cell]
        while LOOPS[code, entry]:
            length = loop_vertices(code, entry, corners[cell], numbering, numbers)
            if is_creased(numbers, length, normals, least):
                add_planes(numbers, length, vertices, feet, normals, planes, crease)
                planes.of_cell[crease] = cell
                for n in range(length):
                    triangles[row, 0], triangles[row, 1] = numbers[n], numbers[(n + 1) % length]
                    triangles[row, 2] = len(vertices) + crease
                    row += 1
                crease += 1
            else:
                for n in range(length):
                    loop[n] = LOOPS[code, entry + 1 + n]
                    edge = CUBE_EDGES[loop[n]]
                    number_of[edge] = numbers[n]
                    for axis in range(3):
                        along = (edge >> axis & 1) * fraction[numbers[n]]
                        places[n, axis] = (edge >> 3 + axis & 1) + along
                for n in range(cut_loop(loop, places, length, drawn, 0)):
                    for corner in range(3):
                        triangles[row, corner] = number_of[drawn[n, corner]]
                    row += 1
            entry += 1 + length


@njit(nogil=True, cache=True)
def add_planes(numbers, length, vertices, feet, normals, planes, crease):
    """Add up the tangent planes at the vertices of a creased loop, which go through their feet."""
    square, right, middle = planes.squares[crease], planes.right[crease], planes.middle[crease]
    square[:], right[:], middle[:] = 0.0, 0.0, 0.0
    for n in range(length):
        for axis in range(3):
            middle[axis] += vertices[numbers[n], axis] / length
    for n in range(length):
        normal, height = normals[numbers[n]], 0.0
        for axis in range(3):
            height += normal[axis] * (feet[numbers[n], axis] - middle[axis])
        for axis in range(3):
            right[axis] += normal[axis] * height
            for other in range(3):
                square[axis, other] += normal[axis] * normal[other]
