"""Sharp edges: vertices where the tangent planes of a cell's crossings meet, and the edges between them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.topology import EdgeTable

MIN_COSINE = 0.9
"""Normals 26° apart in one cell make a crease (Kobbelt et al. 2001)."""

MAX_OUTSIDE = 0.5
"""Part of a cell by which the vertex on a crease may lie outside its own: corners without a sample inside do."""

RANK_TOLERANCE = 0.02
"""Planes that differ by less than this share of the largest eigenvalue leave a direction open: along an edge, where
the vertex stays in the middle. Two normals 26° apart leave 0.05."""


def meet_planes(squares: FloatArray, right: FloatArray, middle: FloatArray) -> FloatArray:
    """Return (k, 3) points nearest to tangent planes: of least Σ (n · (x − p))², and of those nearest to the middle.

    Parameters
    ----------
    squares, right, middle : (k, 3, 3), (k, 3), (k, 3) ndarrays
        Σ n nᵀ, Σ n n · (p − middle), and the mean of the loop's vertices.
    """
    values, axes = np.linalg.eigh(squares)
    known = values > RANK_TOLERANCE * values[:, 2:]
    along = np.einsum("kij,ki->kj", axes, right) / np.where(known, values, np.inf)
    return np.asarray(middle + np.einsum("kij,kj->ki", axes, along))


def stop_at_level(middle: FloatArray, met: FloatArray, values_at: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the places (k, 3) between the middles of loops and where planes meet at which a field is zero.

    On a crease that is where they meet. Where a surface bends within a cell without one, as at the tip of a thin part,
    they meet beyond it. On the way values count as linear; where both ends have one sign it is the end nearer to zero.

    Parameters
    ----------
    middle, met : (k, 3) ndarrays
    values_at : callable
        ``values_at(places) -> (k,) ndarray``, less the level.
    """
    start, end = values_at(middle), values_at(met)
    share = np.divide(start, start - end, out=np.ones(len(start)), where=start != end)
    return np.asarray(middle + np.clip(share, 0.0, 1.0)[:, np.newaxis] * (met - middle))


def join_creases(triangles: IntArray, ordinary: int) -> IntArray:
    """Return the triangles with the edges swapped that separate two vertices from `ordinary` on.

    Where two fans meet, on the face of two cells, the edge of the face makes way for one along the crease; each
    triangle has one such edge at most. Where fans meet twice, one of the swaps is not made: no edge is there twice.
    """
    fans = np.flatnonzero((triangles >= ordinary).any(axis=1))
    part = triangles[fans]
    edges = EdgeTable.of(part)
    inner = np.flatnonzero((edges.count == 2) & (edges.ends < ordinary).all(axis=1))
    halves = edges.order[edges.first(inner)[:, np.newaxis] + [0, 1]].astype(np.int64)
    opposite = part.ravel()[halves - halves % 3 + (halves + 2) % 3]
    meets = (opposite >= ordinary).all(axis=1)
    halves, opposite = halves[meets], opposite[meets]
    once = np.unique(np.sort(opposite, axis=1), axis=0, return_index=True)[1]
    (one, other), (near, far) = halves[once].T, opposite[once].T
    begin, end = part.ravel()[one], part.ravel()[other]
    result = triangles.copy()
    result[fans[one // 3]] = np.column_stack([begin, far, near])
    result[fans[other // 3]] = np.column_stack([far, end, near])
    return result


@dataclass(frozen=True, eq=False)
class CreaseVertices:
    """Vertices on creases, one in each loop of a cell.

    Attributes
    ----------
    met, middle : (k, 3) ndarrays
        Where the tangent planes of a loop meet, if the surface is there, see `stop_at_level`, and its middle.
    low, step : (k, 3), (3,) ndarrays
        Lower corners of their cells, and the sides of cells.
    """

    met: FloatArray
    middle: FloatArray
    low: FloatArray
    step: FloatArray

    def within(self, beyond: float) -> FloatArray:
        """Return the nearest places that lie in the cells, or beyond them by a part of a step."""
        return np.clip(self.met, self.low - beyond * self.step, self.low + (1 + beyond) * self.step)

    def place(self, ordinary: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
        """Return all vertices (n, 3), ordinary ones first, and which triangles still cross others, of (m, 3).

        Only beside vertices outside their cells can they: all else of a surface stays in the cells that it was drawn
        in, where marching cubes makes no triangles that cross. Where they do vertices go back into their cells and,
        where that is not enough, to the middles of their loops.
        """
        vertices, own = np.concatenate([ordinary, self.within(MAX_OUTSIDE)]), slice(len(ordinary), None)
        rows = np.flatnonzero(self.near_strayed(vertices, triangles, vertices[own]))
        for others in (self.within(0.0), self.middle, self.middle, None):
            crossing = rows[find_crossings(vertices, triangles[rows])] if len(rows) else rows
            if not len(crossing) or others is None:
                break
            back = np.unique(triangles[crossing])
            back = back[back >= len(ordinary)] - len(ordinary)
            vertices[own][back] = others[back]
        return vertices, crossing

    def near_strayed(self, vertices: FloatArray, triangles: IntArray, placed: FloatArray) -> BoolArray:
        """Return which triangles (m,) lie in or beside a cell that a vertex on a crease has left its own for."""
        strayed = ((placed < self.low) | (placed > self.low + self.step)).any(axis=1)
        if not strayed.any():
            return np.zeros(len(triangles), dtype=bool)
        cells = np.floor(vertices / self.step).astype(np.int64)
        near = _near(cells, len(vertices) - len(placed) + np.flatnonzero(strayed))
        return np.asarray(near[triangles].any(axis=1))


def _near(cells: IntArray, rows: IntArray) -> BoolArray:
    """Return which of (n, 3) cells are one of those of some rows, or beside it."""
    width = np.ptp(cells, axis=0) + 3
    names = np.ravel_multi_index(tuple((cells - cells.min(axis=0) + 1).T), tuple(width))
    around = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3) @ [width[1] * width[2], width[2], 1]
    near = np.unique(np.unique(names[rows])[:, np.newaxis] + around)
    return np.isin(names, near)
