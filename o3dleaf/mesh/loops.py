"""The compiled loops of the chapter: marching tetrahedra, plane by plane.

Every cell of the lattice is split into the six tetrahedra of Kuhn's subdivision, one for each order
of the axes: from the lower corner along the first axis, the second, the third. All six share the
main diagonal, and all cells are split alike, so that the faces of neighbours agree. Each edge runs
from a lattice point to the point one step on along some of the axes: seven directions, written as
three bits (x = 1, y = 2, z = 4). Edge (point, direction) is a whole number, and the crossed edges
in the order of these numbers are the vertices: equal edges are one vertex by construction, and a
plane's vertices can be numbered without its neighbours.
"""

from itertools import permutations

import numpy as np
import numpy.typing as npt
from numba import njit

from o3dleaf.checks import FloatArray

LEAST_FRACTION = 1e-6
"""A vertex keeps this part of its edge from both ends: a sample on the level itself costs no manifoldness."""

EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
"""The six edges of a tetrahedron as pairs of its corners."""


def _parity(order: tuple[int, ...]) -> int:
    """Return 0 for an even permutation and 1 for an odd one."""
    return sum(a > b for n, a in enumerate(order) for b in order[n + 1 :]) % 2


def _tetrahedra() -> npt.NDArray[np.int64]:
    """Return (6, 4) corners (three bits each) of Kuhn's tetrahedra, all right-handed."""
    paths = []
    for axes in permutations((1, 2, 4)):
        path = [0, axes[0], axes[0] | axes[1], 7]
        if _parity(axes):
            path[1], path[2] = path[2], path[1]
        paths.append(path)
    return np.array(paths)


def _cases() -> npt.NDArray[np.int64]:
    """Return (16, 2, 3) edges of the triangles, by which corners (four bits) are inside; -1 is none.

    In an even order (a, b, c, d) of a right-handed tetrahedron's corners, the triangle ab, ac, ad
    looks away from a and the quadrilateral ac, ad, bd, bc from a and b.
    """
    edge = {frozenset((int(a), int(b))): n for n, (a, b) in enumerate(EDGES)}
    table = np.full((16, 2, 3), -1)
    for a, b, c, d in permutations(range(4)):
        if _parity((a, b, c, d)):
            continue
        ab, ac, ad, bc, bd = (edge[frozenset(pair)] for pair in ((a, b), (a, c), (a, d), (b, c), (b, d)))
        table[1 << a] = [(ab, ac, ad), (-1, -1, -1)]
        table[15 - (1 << a)] = [(ab, ad, ac), (-1, -1, -1)]
        table[1 << a | 1 << b] = [(ac, ad, bd), (ac, bd, bc)]
    return table


TETRAHEDRA = _tetrahedra()
CASES = _cases()
TRIANGLES = (CASES[:, :, 0] >= 0).sum(axis=1)


@njit(nogil=True, cache=True)
def _code(inside: npt.NDArray[np.bool_], i: int, j: int, k: int, tetrahedron: int) -> int:
    """Return which corners of one tetrahedron of cell (i, j, k) are inside, as four bits."""
    code = 0
    for corner in range(4):
        step = TETRAHEDRA[tetrahedron, corner]
        if inside[i + (step & 1), j + (step >> 1 & 1), k + (step >> 2)]:
            code |= 1 << corner
    return code


@njit(nogil=True, cache=True)
def _is_crossed(inside: npt.NDArray[np.bool_], i: int, j: int, k: int, direction: int) -> bool:
    """Say whether the edge from point (i, j, k) stays on the lattice and changes sides."""
    u, v, w = i + (direction & 1), j + (direction >> 1 & 1), k + (direction >> 2)
    if u >= inside.shape[0] or v >= inside.shape[1] or w >= inside.shape[2]:
        return False
    return bool(inside[i, j, k] != inside[u, v, w])


@njit(nogil=True, cache=True)
def count_planes(
    inside: npt.NDArray[np.bool_],
    start: int,
    stop: int,
    vertices: npt.NDArray[np.int64],
    triangles: npt.NDArray[np.int64],
) -> None:
    """Count the crossed edges that start in each x-plane, and the triangles of the cells that start there.

    Parameters
    ----------
    inside : (nx, ny, nz) ndarray of bool
    start, stop : int
        The planes to count.
    vertices, triangles : (nx,) ndarray of int64
        Filled at start:stop.
    """
    _, ny, nz = inside.shape
    for i in range(start, stop):
        crossed, drawn = 0, 0
        for j in range(ny):
            for k in range(nz):
                for direction in range(1, 8):
                    crossed += _is_crossed(inside, i, j, k, direction)
                if i + 1 < inside.shape[0] and j + 1 < ny and k + 1 < nz:
                    for tetrahedron in range(6):
                        drawn += TRIANGLES[_code(inside, i, j, k, tetrahedron)]
        vertices[i], triangles[i] = crossed, drawn


@njit(nogil=True, cache=True)
def _number_plane(inside: npt.NDArray[np.bool_], i: int, first: int, numbers: npt.NDArray[np.int64]) -> None:
    """Give the crossed edges of plane i the numbers from `first` on, in `numbers` (ny, nz, 8)."""
    for j in range(inside.shape[1]):
        for k in range(inside.shape[2]):
            for direction in range(1, 8):
                if _is_crossed(inside, i, j, k, direction):
                    numbers[j, k, direction] = first
                    first += 1


@njit(nogil=True, cache=True)
def _place_plane(
    samples: FloatArray, inside: npt.NDArray[np.bool_], level: float, i: int, first: int, vertices: FloatArray
) -> None:
    """Write the positions of plane i's vertices, from row `first` on, by linear interpolation."""
    for j in range(inside.shape[1]):
        for k in range(inside.shape[2]):
            for direction in range(1, 8):
                if not _is_crossed(inside, i, j, k, direction):
                    continue
                dx, dy, dz = direction & 1, direction >> 1 & 1, direction >> 2
                here = samples[i, j, k]
                fraction = (level - here) / (samples[i + dx, j + dy, k + dz] - here)
                fraction = min(max(fraction, LEAST_FRACTION), 1 - LEAST_FRACTION)
                vertices[first, 0] = i + dx * fraction
                vertices[first, 1] = j + dy * fraction
                vertices[first, 2] = k + dz * fraction
                first += 1


@njit(nogil=True, cache=True)
def _join_cell(
    code: int,
    tetrahedron: int,
    cell: tuple[int, int],
    numbers: npt.NDArray[np.int64],
    row: int,
    triangles: npt.NDArray[np.int64],
) -> int:
    """Write the triangles of one tetrahedron from `row` on and return the row after them."""
    for part in range(TRIANGLES[code]):
        for corner in range(3):
            edge = CASES[code, part, corner]
            one, other = TETRAHEDRA[tetrahedron, EDGES[edge, 0]], TETRAHEDRA[tetrahedron, EDGES[edge, 1]]
            lower, direction = one & other, one ^ other
            j, k = cell[0] + (lower >> 1 & 1), cell[1] + (lower >> 2)
            triangles[row, corner] = numbers[lower & 1, j, k, direction]
        row += 1
    return row


@njit(nogil=True, cache=True)
def march_planes(
    samples: FloatArray,
    inside: npt.NDArray[np.bool_],
    level: float,
    planes: tuple[int, int],
    offsets: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]],
    mesh: tuple[FloatArray, npt.NDArray[np.int64]],
) -> None:
    """Write the vertices and triangles of some x-planes into their rows of the mesh.

    Parameters
    ----------
    samples, inside : (nx, ny, nz) ndarrays
        Values, and where they lie above `level`.
    level : float
        The isovalue.
    planes : (start, stop)
        The planes to march.
    offsets : two (nx + 1,) ndarrays of int64
        First row of each plane's vertices and triangles.
    mesh : (vertices, triangles)
        (n, 3) ndarrays that are filled, in lattice coordinates and vertex numbers.
    """
    nx, ny, nz = inside.shape
    start, stop = planes
    numbers = np.empty((2, ny, nz, 8), dtype=np.int64)
    _number_plane(inside, start, offsets[0][start], numbers[0])
    for i in range(start, stop):
        _place_plane(samples, inside, level, i, offsets[0][i], mesh[0])
        if i + 1 == nx:
            break
        _number_plane(inside, i + 1, offsets[0][i + 1], numbers[1])
        row = offsets[1][i]
        for j in range(ny - 1):
            for k in range(nz - 1):
                for tetrahedron in range(6):
                    code = _code(inside, i, j, k, tetrahedron)
                    row = _join_cell(code, tetrahedron, (j, k), numbers, row, mesh[1])
        numbers[0] = numbers[1]
