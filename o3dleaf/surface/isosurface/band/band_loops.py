"""The compiled loops of the narrow band: cells by the rows of their corners, which `morton_loops` keeps."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.isosurface.band.morton_loops import ALONG, ahead, behind, coordinate, find_place
from o3dleaf.surface.isosurface.cell_loops import (
    CUBE_EDGES,
    CUBES,
    MAX_TRIANGLES,
    MIN_FRACTION,
    cell_triangles,
    crossing,
)

FACE_CORNERS = np.array([0x55, 0xAA, 0x33, 0xCC, 0x0F, 0xF0])
"""The corners of a cell's lower and upper face along each axis, as eight bits."""


class Numbering(NamedTuple):
    """Numbers of the vertices: each point's are those on the crossed edges that leave it, one after another.

    Attributes
    ----------
    first : (r,) ndarray of int64
        Number of each point's first vertex.
    marks : (r,) ndarray of uint8
        The axes along which it has one, as three bits; see `mark_edges`.
    """

    first: npt.NDArray[np.int64]
    marks: npt.NDArray[np.uint8]


class CrossedEdges(NamedTuple):
    """The edges with a vertex, in the order of the vertices; (v,) each.

    Attributes
    ----------
    lower : ndarray of int64
        Row of the edge's lower point.
    direction : ndarray of int64
        1, 2 or 4.
    fraction : ndarray
        How far along the edge the vertex lies.
    here, there : ndarrays
        Values at the lower and the other end.
    """

    lower: npt.NDArray[np.int64]
    direction: npt.NDArray[np.int64]
    fraction: npt.NDArray[np.float64]
    here: npt.NDArray[np.float64]
    there: npt.NDArray[np.float64]


@njit(nogil=True, cache=True)
def add_cells(cells, start, table, keys, known, count, corners):
    """Enter the corners of cells, from cell `start` on, until the keys are full; return (next cell, rows in use).

    Parameters
    ----------
    cells : (c,) ndarray of int64
        Keys of their lower corners, none of them known as a cell.
    table : (2ⁿ,) ndarray of int32
        Rows by place; −1 is empty. At most half of it is ever used.
    keys : (r,) ndarray of int64
        By row.
    known : (r,) ndarray of bool
        Whether the point is the lower corner of a cell that was entered.
    count : int
        Rows in use.
    corners : (c, 8) ndarray of int32
        Filled with rows.
    """
    parts = np.empty((3, 2), dtype=np.int64)
    for cell in range(start, len(cells)):
        if count + 8 > len(keys):
            return cell, count
        for axis in range(3):
            parts[axis, 0] = cells[cell] & ALONG[axis]
            parts[axis, 1] = ahead(cells[cell], axis) & ALONG[axis]
        for corner in range(8):
            key = parts[0, corner & 1] | parts[1, corner >> 1 & 1] | parts[2, corner >> 2]
            place = find_place(table, keys, key)
            if table[place] < 0:
                table[place], keys[count] = count, key
                count += 1
            corners[cell, corner] = table[place]
        known[corners[cell, 0]] = True
    return len(cells), count


@njit(nogil=True, cache=True)
def read_codes(start, stop, values, corners, codes):
    """Write which corners of each cell are inside, as eight bits."""
    for cell in range(start, stop):
        code = 0
        for corner in range(8):
            if values[corners[cell, corner]] > 0.0:
                code |= 1 << corner
        codes[cell] = code


@njit(nogil=True, cache=True)
def cross_faces(start, stop, corners, codes, table, keys, known, beyond):
    """Write the (c, 6) keys of unknown cells across the faces that the surface crosses; −1 is none."""
    for cell in range(start, stop):
        lower = keys[corners[cell, 0]]
        for face in range(6):
            axis, part = face >> 1, codes[cell] & FACE_CORNERS[face]
            beyond[cell, face] = -1
            if not 0 < part < FACE_CORNERS[face]:
                continue
            if face & 1:
                row = corners[cell, 1 << axis]
                if not known[row]:
                    beyond[cell, face] = keys[row]
            else:
                key = behind(lower, axis)
                row = table[find_place(table, keys, key)]
                if row < 0 or not known[row]:
                    beyond[cell, face] = key


@njit(nogil=True, cache=True)
def link_cells(corners, count):
    """Return the (c, 6) cells across the faces of some, whose corners are among `count` rows; −1 for none."""
    cell_at, links = np.full(count, -1, dtype=np.int32), np.full((len(corners), 6), -1, dtype=np.int32)
    for cell in range(len(corners)):
        cell_at[corners[cell, 0]] = cell
    for cell in range(len(corners)):
        for axis in range(3):
            other = cell_at[corners[cell, 1 << axis]]
            if other >= 0:
                links[cell, 2 * axis + 1], links[other, 2 * axis] = other, cell
    return links


@njit(nogil=True, cache=True)
def retrace(start, corners, codes, keys):
    """Return which cells some of them, `start`, lead to across faces that the surface crosses, and the keys of others.

    Parameters
    ----------
    start : (s,) ndarray of int64
        Numbers of cells.
    corners, codes : (c, 8), (c,) ndarrays
        Of the cells among which it is looked.
    keys : (r,) ndarray of int64
        By row.

    Returns
    -------
    reached : (c,) ndarray of bool
    beyond : (b,) ndarray of int64
        Keys of cells that are not among them, some of them more than once.
    """
    links, reached = link_cells(corners, len(keys)), np.zeros(len(corners), dtype=np.bool_)
    stack, depth = np.empty(len(corners), dtype=np.int64), 0
    beyond, count = np.empty(6 * len(corners), dtype=np.int64), 0
    for first in start:
        if not reached[first]:
            reached[first], stack[depth] = True, first
            depth += 1
        while depth > 0:
            depth -= 1
            cell = stack[depth]
            for face in range(6):
                axis, part = face >> 1, codes[cell] & FACE_CORNERS[face]
                if not 0 < part < FACE_CORNERS[face]:
                    continue
                other = links[cell, face]
                if other < 0:
                    upper = keys[corners[cell, 1 << axis]]
                    beyond[count] = upper if face & 1 else behind(keys[corners[cell, 0]], axis)
                    count += 1
                elif not reached[other]:
                    reached[other], stack[depth] = True, other
                    depth += 1
    return reached, beyond[:count].copy()


@njit(nogil=True, cache=True)
def mark_edges(corners, codes, marks):
    """Mark at each point, as three bits, along which axes an edge of some cell leaves it that the surface crosses."""
    for cell in range(len(codes)):
        for n in range(12):
            low, direction = CUBE_EDGES[n] >> 3, CUBE_EDGES[n] & 7
            if (codes[cell] >> low & 1) != (codes[cell] >> (low | direction) & 1):
                marks[corners[cell, low]] |= direction


@njit(nogil=True, cache=True)
def vertex_at(numbering, row, direction):
    """Return the number of the vertex on the edge that leaves a point in a direction (1, 2 or 4)."""
    before = numbering.marks[row] & (direction - 1)
    return numbering.first[row] + (before & 1) + (before >> 1 & 1)


@njit(nogil=True, cache=True)
def find_fractions(start, stop, corners, codes, values, numbering, edges):
    """Write the crossed edges of some cells, a `CrossedEdges`; two cells of an edge write the same."""
    here, there = edges.here, edges.there
    for cell in range(start, stop):
        for n in range(12):
            low, direction = CUBE_EDGES[n] >> 3, CUBE_EDGES[n] & 7
            if (codes[cell] >> low & 1) != (codes[cell] >> (low | direction) & 1):
                row = corners[cell, low]
                vertex = vertex_at(numbering, row, direction)
                edges.lower[vertex], edges.direction[vertex] = row, direction
                here[vertex], there[vertex] = values[row], values[corners[cell, low | direction]]
                edges.fraction[vertex] = crossing(here[vertex], there[vertex])


@njit(nogil=True, cache=True)
def count_cells(corners, codes, numbering, count):
    """Add up the cells at each vertex: four, but where the band ends."""
    for cell in range(len(codes)):
        for n in range(12):
            low, direction = CUBE_EDGES[n] >> 3, CUBE_EDGES[n] & 7
            if (codes[cell] >> low & 1) != (codes[cell] >> (low | direction) & 1):
                count[vertex_at(numbering, corners[cell, low], direction)] += 1


@njit(nogil=True, cache=True)
def draw_cells(start, stop, corners, codes, numbering, fraction, offsets, triangles):
    """Write the triangles of some cells into their rows, cell c's from offsets[c] on."""
    along, places, drawn = np.empty(12), np.empty((12, 3)), np.empty((MAX_TRIANGLES, 3), dtype=np.int64)
    for cell in range(start, stop):
        code = np.int64(codes[cell])
        for n in range(12):
            low, direction = CUBE_EDGES[n] >> 3, CUBE_EDGES[n] & 7
            if (code >> low & 1) != (code >> (low | direction) & 1):
                along[n] = fraction[vertex_at(numbering, corners[cell, low], direction)]
        for n in range(cell_triangles(CUBES, code, along, places, drawn)):
            for corner in range(3):
                low, direction = drawn[n, corner] >> 3, drawn[n, corner] & 7
                triangles[offsets[cell] + n, corner] = vertex_at(numbering, corners[cell, low], direction)


@njit(nogil=True, cache=True)
def place_crossings(start, stop, keys, direction, fraction, base, step, vertices):
    """Write the (v, 3) positions of vertices on the edges that leave points `keys` in a direction.

    Whole numbers are added first, as in `o3dleaf.surface.isosurface.polygonize_loops.place_vertices`.
    """
    for n in range(start, stop):
        for axis in range(3):
            whole = base[axis] + coordinate(keys[n], axis)
            vertices[n, axis] = (whole + (direction[n] >> axis & 1) * fraction[n]) * step[axis]


@njit(nogil=True, cache=True, error_model="numpy")
def sharpen_fractions(start, stop, here, there, between, fraction):
    """Move vertices to the zero of the parabola through the values at their edge's ends and at them, `between`.

    The ends differ in sign, so that one zero lies between them, whatever the third value. The parabola is off
    by F‴ (s − 0) (s − t) (s − 1)/6: by O(h³) at most, and by O(h⁴) where the edge is not tangent to the surface.
    """
    # `between` begins at `start`.
    for n in range(start, stop):
        a, t = here[n], fraction[n]
        bend = (between[n - start] - a - t * (there[n] - a)) / (t * (t - 1.0))
        slope = there[n] - a - bend
        half = -0.5 * (slope + math.copysign(math.sqrt(max(slope * slope - 4.0 * bend * a, 0.0)), slope))
        # Both zeros without cancellation; the wanted one is between the ends.
        zero = a / half
        if not 0.0 <= zero <= 1.0:
            zero = half / bend
        fraction[n] = min(max(zero, MIN_FRACTION), 1.0 - MIN_FRACTION)
