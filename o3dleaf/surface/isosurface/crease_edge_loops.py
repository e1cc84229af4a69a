"""The compiled loops of creases: where the normals around a loop disagree, a fan about a new vertex takes its place."""

import numpy as np
from numba import njit

from o3dleaf.surface.isosurface.band_loops import vertex_at
from o3dleaf.surface.isosurface.cell_loops import CUBE_EDGES, LOOPS, MOST_TRIANGLES, cut_loop


@njit(nogil=True, cache=True)
def loop_vertices(code, at, rows, numbering, numbers):
    """Write the vertices of the loop at place `at` of a cell's row of `LOOPS`, and return how many there are."""
    first, marks = numbering
    length = LOOPS[code, at]
    for n in range(length):
        edge = CUBE_EDGES[LOOPS[code, at + 1 + n]]
        numbers[n] = vertex_at(first, marks, rows[edge >> 3], edge & 7)
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
        code, at = np.int64(codes[cell]), 0
        creases[cell], triangles[cell] = 0, 0
        while LOOPS[code, at]:
            length = loop_vertices(code, at, corners[cell], numbering, numbers)
            creased = is_creased(numbers, length, normals, least)
            creases[cell] += creased
            triangles[cell] += length if creased else length - 2
            at += 1 + length


@njit(nogil=True, cache=True)
def draw_creases(start, stop, corners, codes, numbering, fraction, surface, least, offsets, planes, triangles):
    """Write the triangles of some cells, those of creased loops about vertices of their own.

    Parameters
    ----------
    fraction : (v,) ndarray
        How far along its edge each vertex lies.
    surface : (vertices, normals)
        (v, 3) each.
    offsets : (creases, triangles)
        (c,) the first crease and the first triangle of each cell.
    planes : (squares, right, middle, of_cell)
        (k, 3, 3) Σ n nᵀ, (k, 3) Σ n n·(p − middle), (k, 3) the mean of the p, and (k,) the cell, of each
        creased loop; filled.
    triangles : (m, 3) ndarray of int64
        Filled; vertex v + k is that of loop k.
    """
    vertices, normals = surface
    squares, right, middle, of_cell = planes
    numbers, loop, places = np.empty(12, dtype=np.int64), np.empty(12, dtype=np.int64), np.empty((12, 3))
    drawn, number_of = np.empty((MOST_TRIANGLES, 3), dtype=np.int64), np.empty(64, dtype=np.int64)
    for cell in range(start, stop):
        code, at, crease, row = np.int64(codes[cell]), 0, offsets[0][cell], offsets[1][cell]
        while LOOPS[code, at]:
            length = loop_vertices(code, at, corners[cell], numbering, numbers)
            if is_creased(numbers, length, normals, least):
                _add_planes(numbers, length, vertices, normals, squares[crease], right[crease], middle[crease])
                of_cell[crease] = cell
                for n in range(length):
                    triangles[row, 0], triangles[row, 1] = numbers[n], numbers[(n + 1) % length]
                    triangles[row, 2] = len(vertices) + crease
                    row += 1
                crease += 1
            else:
                for n in range(length):
                    loop[n] = LOOPS[code, at + 1 + n]
                    edge = CUBE_EDGES[loop[n]]
                    number_of[edge] = numbers[n]
                    for axis in range(3):
                        along = (edge >> axis & 1) * fraction[numbers[n]]
                        places[n, axis] = (edge >> 3 + axis & 1) + along
                for n in range(cut_loop(loop, places, length, drawn, 0)):
                    for corner in range(3):
                        triangles[row, corner] = number_of[drawn[n, corner]]
                    row += 1
            at += 1 + length


@njit(nogil=True, cache=True)
def _add_planes(numbers, length, vertices, normals, square, right, middle):
    """Add up the tangent planes at a loop's vertices."""
    square[:], right[:], middle[:] = 0.0, 0.0, 0.0
    for n in range(length):
        for axis in range(3):
            middle[axis] += vertices[numbers[n], axis] / length
    for n in range(length):
        normal, height = normals[numbers[n]], 0.0
        for axis in range(3):
            height += normal[axis] * (vertices[numbers[n], axis] - middle[axis])
        for axis in range(3):
            right[axis] += normal[axis] * height
            for other in range(3):
                square[axis, other] += normal[axis] * normal[other]
