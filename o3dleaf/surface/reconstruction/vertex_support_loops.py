"""The compiled loops of proximity and support: closest points, distances from a front along a mesh, kernel sums."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit


class PointsWithNormals(NamedTuple):
    """Points (n, 3) and their normals (n, 3), or a single row of normals where they are not known."""

    points: npt.NDArray[np.float64]
    normals: npt.NDArray[np.float64]


class VoxelGrid(NamedTuple):
    """A grid of cubic voxels: lower corner (3,), voxels along each axis (3,), and their side."""

    low: npt.NDArray[np.float64]
    shape: npt.NDArray[np.int64]
    side: float


class SortedCells(NamedTuple):
    """The cells of points (m,) that are sorted by them: number (i · shape[1] + j) · shape[2] + k, corner and shape."""

    keys: npt.NDArray[np.int64]
    low: npt.NDArray[np.float64]
    shape: npt.NDArray[np.int64]


@njit(nogil=True, cache=True)
def find_closest(start, stop, surface, data, nearest, noise, facing, distance, closest):
    """Write distance and place of the closest of some data points whose normals face the way of each vertex.

    Points are taken without their noise: moved along the vertex's normal towards its tangent plane.

    Parameters
    ----------
    surface : PointsWithNormals
        The vertices.
    data : PointsWithNormals
        With a single row of normals if all face every way.
    nearest : (n, k) ndarray
        The data points to choose from, of each vertex.
    noise, facing : float
        How far points are moved at most; the least cosine between normals.
    distance, closest : (n,), (n, 3) ndarrays
        Filled at start:stop where there is one; `distance` must be infinite.
    """
    known = len(data.normals) == len(data.points)
    offset = np.empty(3)
    for n in range(start, stop):
        for j in nearest[n]:
            along, cosine = 0.0, 0.0
            for axis in range(3):
                offset[axis] = data.points[j, axis] - surface.points[n, axis]
                along += offset[axis] * surface.normals[n, axis]
                if known:
                    cosine += data.normals[j, axis] * surface.normals[n, axis]
            if known and cosine < facing:
                continue
            moved, square = min(max(along, -noise), noise), 0.0
            for axis in range(3):
                offset[axis] -= moved * surface.normals[n, axis]
                square += offset[axis] * offset[axis]
            if math.sqrt(square) < distance[n]:
                distance[n] = math.sqrt(square)
                for axis in range(3):
                    closest[n, axis] = surface.points[n, axis] + offset[axis]


@njit(nogil=True, cache=True)
def find_front(triangles, vertices, values, level, front, of_triangle):
    """Write the (f, 2, 3) lines along which triangles cross a level, and which triangles; return how many there are."""
    count = 0
    for t in range(len(triangles)):
        ends = 0
        for corner in range(3):
            one, other = triangles[t, corner], triangles[t, (corner + 1) % 3]
            a, b = values[one] - level, values[other] - level
            if (a > 0.0) != (b > 0.0):
                for axis in range(3):
                    gap = vertices[other, axis] - vertices[one, axis]
                    front[count, ends, axis] = vertices[one, axis] + a / (a - b) * gap
                ends += 1
        if ends == 2:
            of_triangle[count] = t
            count += 1
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def _to_line(point, line):
    """Return the distance of a point from a line between two."""
    square, along = 0.0, 0.0
    for axis in range(3):
        gap = line[1, axis] - line[0, axis]
        square += gap * gap
        along += gap * (point[axis] - line[0, axis])
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    total = 0.0
    for axis in range(3):
        offset = line[0, axis] + share * (line[1, axis] - line[0, axis]) - point[axis]
        total += offset * offset
    return math.sqrt(total)


@njit(nogil=True, cache=True)
def seed_front(vertices, triangles, front, of_triangle, line, distance):
    """Write which line of a front is nearest to each corner of the triangles that it crosses, and how far it is.

    Parameters
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    front, of_triangle : (f, 2, 3), (f,) ndarrays
        As `find_front` finds them.
    line, distance : (n,) ndarrays
        −1 and infinite; filled at those corners.
    """
    for f in range(len(front)):
        for corner in range(3):
            vertex = triangles[of_triangle[f], corner]
            far = _to_line(vertices[vertex], front[f])
            if far < distance[vertex]:
                distance[vertex], line[vertex] = far, f


@njit(nogil=True, cache=True)
def propagate_lines(vertices, begin, around, reach, front, line, distance):
    """Propagate lines over a mesh: each vertex takes the nearest of those that its neighbors are nearest to.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    begin, around : (n + 1,), (e,) ndarrays of int64
        The neighbors of vertex v are around[begin[v] : begin[v + 1]].
    reach : (n,) ndarray
        Vertices farther than this pass nothing on.
    front : (f, 2, 3) ndarray
        Both ends of each line; a point is a line between itself and itself.
    line, distance : (n,) ndarrays
        Of the vertices that have a line, which and how far it is; −1 and infinite of the others. Changed in place, as
        far as the reach, and one edge beyond.
    """
    waiting = line >= 0
    queue = [np.int64(v) for v in np.flatnonzero(waiting)]
    while len(queue) > 0:
        following = [np.int64(0)]
        following.pop()
        for vertex in queue:
            waiting[vertex] = False
            if distance[vertex] > reach[vertex]:
                continue
            for k in range(begin[vertex], begin[vertex + 1]):
                other = around[k]
                far = _to_line(vertices[other], front[line[vertex]])
                if far < distance[other]:
                    distance[other], line[other] = far, line[vertex]
                    if not waiting[other]:
                        waiting[other] = True
                        following.append(other)
        queue = following


@njit(nogil=True, cache=True)
def find_start(keys, key):
    """Return the first index of a sorted array of keys at which none is smaller than `key`."""
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) >> 1
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


@njit(nogil=True, cache=True)
def voxel_of(place, grid):
    """Return the number of the voxel of a `VoxelGrid` that contains a place, z running fastest, or −1 outside."""
    key = np.int64(0)
    for axis in range(3):
        steps = math.floor((place[axis] - grid.low[axis]) / grid.side)
        if not 0 <= steps < grid.shape[axis]:
            return np.int64(-1)
        key = key * grid.shape[axis] + np.int64(steps)
    return key


@njit(nogil=True, cache=True)
def number_voxels(start, stop, places, grid, keys):
    """Write the numbers of the voxels of a `VoxelGrid` that contain places."""
    for n in range(start, stop):
        keys[n] = voxel_of(places[n], grid)


@njit(nogil=True, cache=True)
def find_voxels(start, stop, places, grid, keys, inside):
    """Write which places lie in one of the voxels of sorted numbers `keys`."""
    last, occupied = np.int64(-1), False
    for n in range(start, stop):
        key = voxel_of(places[n], grid)
        if key != last:
            first = find_start(keys, key)
            last, occupied = key, first < len(keys) and keys[first] == key
        inside[n] = occupied


@njit(nogil=True, cache=True)
def sum_kernel(start, stop, vertices, points, squares, cells, radius, weight, moment):
    """Write Σ φ(|v − x_j|/radius) and Σ φ(|v − x_j|/radius) q_j over the points, φ(r) = (1 − r)⁴ (4 r + 1).

    Parameters
    ----------
    vertices : (n, 3) ndarray
    points, squares : (m, 3), (m,) ndarrays
        In the order of their cells; squares are the q_j.
    cells : SortedCells
        Of edge `radius`.
    weight, moment : (n,) ndarrays
        Filled at start:stop.
    """
    keys, low, shape = cells.keys, cells.low, cells.shape
    cell = np.empty(3, dtype=np.int64)
    for n in range(start, stop):
        total, second, inside = 0.0, 0.0, True
        for axis in range(3):
            place = math.floor((vertices[n, axis] - low[axis]) / radius)
            inside &= -1 <= place <= shape[axis]
            cell[axis] = place if inside else 0
        for i in range(cell[0] - 1, cell[0] + 2):
            for j in range(cell[1] - 1, cell[1] + 2):
                if not inside or i < 0 or j < 0 or i >= shape[0] or j >= shape[1]:
                    continue
                row = (i * shape[1] + j) * shape[2]
                place = find_start(keys, row + max(cell[2] - 1, 0))
                last = row + min(cell[2] + 1, shape[2] - 1)
                while place < len(keys) and keys[place] <= last:
                    square = 0.0
                    for axis in range(3):
                        gap = points[place, axis] - vertices[n, axis]
                        square += gap * gap
                    r = math.sqrt(square) / radius
                    if r < 1.0:
                        fade = (1.0 - r) ** 4 * (4.0 * r + 1.0)
                        total += fade
                        second += fade * squares[place]
                    place += 1
        weight[n], moment[n] = total, second
