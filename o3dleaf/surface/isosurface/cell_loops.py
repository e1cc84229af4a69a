"""One cell of a lattice to triangles: marching cubes by tracing the cell's faces, and marching tetrahedra.

Corner numbers are three bits (x = 1, y = 2, z = 4). An edge of a cell runs from a corner one step on
along some of the axes; its name is 8 · (lower corner) + direction, both three bits. Cubes use the twelve edges
along the axes. Tetrahedra are those of Kuhn's subdivision, one for each order of the axes: from the
lower corner along the first axis, the second, the third; all six share the main diagonal, all cells
are split alike, so that the faces of neighbours agree.

A cube's surface is traced, once for each of its 256 cases: on each face the crossed edges are joined in
pairs; where there are four, so that the inside corners stay apart, which both cells of a face see
alike: what is inside hangs together exactly where samples hang together along the axes. The pairs
chain into loops, and each loop is cut into triangles by its shortest diagonals. No diagonal lies in a
face, where the neighbour could draw the same one: every edge has its two triangles.
"""

from itertools import permutations

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit

MIN_FRACTION = 1e-6
"""A vertex keeps this part of its edge from both ends: a sample on the level itself costs no manifoldness."""

CUBES, TETRAHEDRA = 0, 1
"""The two methods, as the compiled loops know them."""

DIRECTIONS = np.array([[1, 2, 4, 0, 0, 0, 0], [1, 2, 3, 4, 5, 6, 7]])
"""Directions of the edges that carry vertices, rising, by method; 0 ends a row."""

MAX_TRIANGLES = 12
"""Triangles of one cell at most: two for each of six tetrahedra, ten for cubes."""

CUBE_EDGES = np.array([8 * low + axis for axis in (1, 2, 4) for low in range(8) if not low & axis])
"""The names of a cube's twelve edges."""

FACES = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
"""Corners of the six faces, counter-clockwise seen from outside the cell."""

TETRAHEDRON_EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
"""The six edges of a tetrahedron as pairs of its corners."""


def _face_edges() -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return (6, 4) edges from each corner of a face to the next, and (12,) the faces of each edge as six bits."""
    place = {int(name): n for n, name in enumerate(CUBE_EDGES)}
    edges, faces = np.empty((6, 4), dtype=np.int64), np.zeros(12, dtype=np.int64)
    for face, corners in enumerate(FACES):
        for k in range(4):
            one, other = int(corners[k]), int(corners[(k + 1) % 4])
            edges[face, k] = place[8 * (one & other) + (one ^ other)]
            faces[edges[face, k]] |= 1 << face
    return edges, faces


def _parity(order: tuple[int, ...]) -> int:
    """Return 0 for an even permutation and 1 for an odd one."""
    return sum(a > b for n, a in enumerate(order) for b in order[n + 1 :]) % 2


def _kuhn() -> npt.NDArray[np.int64]:
    """Return (6, 4) corners of Kuhn's tetrahedra, all right-handed."""
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
    edge = {frozenset((int(a), int(b))): n for n, (a, b) in enumerate(TETRAHEDRON_EDGES)}
    table = np.full((16, 2, 3), -1)
    for a, b, c, d in permutations(range(4)):
        if _parity((a, b, c, d)):
            continue
        ab, ac, ad, bc, bd = (edge[frozenset(pair)] for pair in ((a, b), (a, c), (a, d), (b, c), (b, d)))
        table[1 << a] = [(ab, ac, ad), (-1, -1, -1)]
        table[15 - (1 << a)] = [(ab, ad, ac), (-1, -1, -1)]
        table[1 << a | 1 << b] = [(ac, ad, bd), (ac, bd, bc)]
    return table


def _loops(code: int) -> list[list[int]]:
    """Return the loops of crossed edges around the surface in a cube whose inside corners are the bits of `code`."""
    following: dict[int, int] = {}
    for corners, edges in zip(FACES, FACE_EDGES, strict=True):
        inside = [code >> int(corner) & 1 for corner in corners]
        entries = [k for k in range(4) if inside[(k + 1) % 4] and not inside[k]]
        for k in entries:
            # The surface cuts off the inside corners from k + 1 on, up to the first edge that leaves them.
            leave = next(n for n in range(k + 1, k + 5) if inside[n % 4] and not inside[(n + 1) % 4])
            following[int(edges[k])] = int(edges[leave % 4])
    loops = []
    while following:
        edge = min(following)
        loops.append([edge])
        while (edge := following.pop(edge)) in following:
            loops[-1].append(edge)
    return loops


def _loop_table() -> npt.NDArray[np.int64]:
    """Return (256, 17) loops of every code, each as its length and its edges; length 0 ends a row."""
    table = np.zeros((256, 17), dtype=np.int64)
    for code in range(256):
        row = [number for loop in _loops(code) for number in (len(loop), *loop)]
        table[code, : len(row)] = row
    return table


def _tetrahedra_table() -> npt.NDArray[np.int64]:
    """Return (256, 12, 3) names of edges of the triangles in the six tetrahedra of every code; -1 is none."""
    table = np.full((256, MAX_TRIANGLES, 3), -1)
    for code in range(256):
        triangles = []
        for path in _kuhn():
            part = sum((code >> int(corner) & 1) << n for n, corner in enumerate(path))
            for triangle in CASES[part]:
                ends = [path[TETRAHEDRON_EDGES[edge]] for edge in triangle if edge >= 0]
                triangles += [[8 * (one & other) + (one ^ other) for one, other in ends]] if ends else []
        table[code, : len(triangles)] = np.array(triangles).reshape(-1, 3)
    return table


FACE_EDGES, FACES_OF_EDGE = _face_edges()
CASES = _cases()
LOOPS = _loop_table()
IN_TETRAHEDRA = _tetrahedra_table()
COUNTS = np.stack(
    [
        [sum(len(loop) - 2 for loop in _loops(code)) for code in range(256)],
        (IN_TETRAHEDRA[:, :, 0] >= 0).sum(axis=1),
    ]
)
"""(2, 256) triangles in a cell, by method and by which corners are inside."""


@njit(nogil=True, cache=True, error_model="numpy")
def crossing(here, there):
    """Return where a line from `here` to `there`, of opposite signs, is zero: a fraction of the edge, never an end."""
    return min(max(here / (here - there), MIN_FRACTION), 1.0 - MIN_FRACTION)


@njit(nogil=True, cache=True)
def cell_triangles(method, code, fractions, places, triangles):
    """Write the triangles of one cell as names of edges and return how many there are.

    Parameters
    ----------
    method : int
        `CUBES` or `TETRAHEDRA`.
    code : int
        Which corners are inside, as eight bits.
    fractions : (12,) ndarray
        How far along each crossed edge of `CUBE_EDGES` its vertex lies; cubes choose their diagonals by it.
    places : (12, 3) ndarray
        To work in.
    triangles : (12, 3) ndarray of int64
        Filled; counter-clockwise seen from outside.
    """
    count = COUNTS[method, code]
    if method == TETRAHEDRA:
        for n in range(count):
            for corner in range(3):
                triangles[n, corner] = IN_TETRAHEDRA[code, n, corner]
        return count
    loop = np.empty(12, dtype=np.int64)
    entry = written = 0
    while LOOPS[code, entry]:
        length = LOOPS[code, entry]
        for n in range(length):
            loop[n] = LOOPS[code, entry + 1 + n]
            low, direction = CUBE_EDGES[loop[n]] >> 3, CUBE_EDGES[loop[n]] & 7
            for axis in range(3):
                places[n, axis] = (low >> axis & 1) + (direction >> axis & 1) * fractions[loop[n]]
        written = cut_loop(loop, places, length, triangles, written)
        entry += 1 + length
    return count


@njit(nogil=True, cache=True)
def cut_loop(loop, places, length, triangles, count):
    """Cut a loop of edges, which it uses up, into triangles by its shortest diagonals; return the new count."""
    while length > 3:
        best, ear = np.inf, 0
        for k in range(length):
            before, after = k - 1 if k else length - 1, k + 1 if k + 1 < length else 0
            if FACES_OF_EDGE[loop[before]] & FACES_OF_EDGE[loop[after]]:
                continue
            square = 0.0
            for axis in range(3):
                gap = places[before, axis] - places[after, axis]
                square += gap * gap
            if square < best:
                best, ear = square, k
        before, after = ear - 1 if ear else length - 1, ear + 1 if ear + 1 < length else 0
        triangles[count, 0] = CUBE_EDGES[loop[before]]
        triangles[count, 1] = CUBE_EDGES[loop[ear]]
        triangles[count, 2] = CUBE_EDGES[loop[after]]
        count += 1
        length -= 1
        for k in range(ear, length):
            loop[k] = loop[k + 1]
            for axis in range(3):
                places[k, axis] = places[k + 1, axis]
    for corner in range(3):
        triangles[count, corner] = CUBE_EDGES[loop[corner]]
    return count + 1
