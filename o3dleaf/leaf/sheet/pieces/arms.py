"""Leaves that cross and came out as one sheet: its rim has four corners that two straight leaves have in common."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.trees import query
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes, label_nodes, trace_rings
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

STEP = 0.5
"""Step at which a rim is looked at, in edges of the sheet, their median."""
LONG = 6.0
"""Edges of the sheet along which a rim's direction is found: it is ragged by one."""
CORNER = 12.0
"""Degrees from which on a rim turns inward at a corner, as of leaves that cross at no less."""
STRAIGHT = 35.0
"""Degrees by which a margin bends at most where it goes on behind a corner: contours that one takes for one."""
WEB = 6.5
"""Edges from a corner up to which triangles across it hide the margins that meet there."""
ARM = 1.5
"""Length of the rim around an arm over the arm's width at least."""


class LeafArms(NamedTuple):
    """Which arm each vertex (v,) is of, 0 to 3 around the rim, and -1 where they meet, and how long the shortest is.

    Arms 0 and 2 are one leaf, 1 and 3 the other. Vertices along the margins between are -1, and `halved` (v,) to either
    side of them. The length is that of the rim around an arm, over the arm's width. Of lobes one of the four may be
    `several`.
    """

    arm: IntArray
    halved: IntArray
    long: float
    several: bool


def find_arms(vertices: FloatArray, triangles: IntArray) -> LeafArms | None:
    """Return the arms of two leaves that cross, or None of a sheet whose rim is not theirs.

    Where two leaves cross the rim of both together turns inward at four corners. Of each two neighbors the margin that
    comes to one of them goes on straight from the other: it is that of the leaf that both other arms are of.

    Parameters
    ----------
    vertices : (v, 3) ndarray
    triangles : (m, 3) ndarray of int
        An oriented manifold sheet with a rim.

    References
    ----------
    Kellman and Shipley (1991), A theory of visual interpolation in object perception: margins that go on behind what
    hides them.
    """
    edges = EdgeTable.of(triangles)
    rings = trace_rings(edges, find_holes(vertices, triangles, edges))
    rows = rings[int(np.argmax(np.where(rings.is_hole, 0.0, rings.perimeter)))]
    edge = float(np.median(np.linalg.norm(vertices[edges.ends[:, 1]] - vertices[edges.ends[:, 0]], axis=1)))
    rim = _Rim.of(vertices[rows], vertex_normals(vertices, triangles)[rows], edge)
    corners = rim.corners()
    if len(corners) < 4:
        return None
    bends, out, back = rim.bends(corners)
    four = _least_cycle(bends)
    if four is None:
        return None
    after = np.roll(four, -1)
    margins = np.column_stack([out[four, after], back[four, after]])
    arms = _arms(vertices, edges, rows, rim.row[margins])
    if arms is None:
        return None
    several = any(_is_several(bends, int(one), int(other)) for one, other in zip(four, after, strict=True))
    return LeafArms(*arms, float(rim.lengths(margins).min()), several)


class _Rim(NamedTuple):
    """A closed rim at equal steps: places (n, 3), normals (n, 3) of the sheet, directions (n, 3) to and from each.

    Also the vertex of the rim (n,) at each step or before it, and the length of a step.
    """

    path: FloatArray
    normals: FloatArray
    before: FloatArray
    after: FloatArray
    row: IntArray
    step: float

    @classmethod
    def of(cls, rim: FloatArray, normals: FloatArray, edge: float) -> "_Rim":
        """Return the rim through vertices (k, 3) with some normals, at steps of half an edge."""
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)))
        count = max(4, int(along[-1] / (STEP * edge)))
        at = np.linspace(0, along[-1], count, endpoint=False)
        row = np.searchsorted(along, at, side="right") - 1
        path = np.column_stack([np.interp(at, along, np.append(axis, axis[0])) for axis in rim.T])
        upright = normals[row]
        before, after = (_flat(way * _direction(path, way), upright) for way in (-1, 1))
        return cls(path, upright, before, after, row.astype(np.int64), float(along[-1] / count))

    def corners(self) -> IntArray:
        """Return the places (k,) where the rim turns inward, by more than it does around."""
        across = np.einsum("ij,ij->i", np.cross(self.before, self.after), self.normals)
        turn = np.degrees(np.arctan2(across, np.einsum("ij,ij->i", self.before, self.after)))
        inward = -turn * np.sign(turn.sum())
        reach = round(WEB / STEP)
        most = np.max([np.roll(inward, by) for by in range(-reach, reach + 1)], axis=0)
        return np.flatnonzero((inward == most) & (inward >= CORNER))

    def bends(self, corners: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
        """Return by how many degrees a margin bends that goes on from one corner at another, inf if none does, (k, k).

        And where (k, k) it leaves the rim, and comes back to it: at either end of what triangles fill of a corner.
        """
        count, web = len(corners), np.arange(0, round(WEB / STEP) + 1, round(1 / STEP))
        out, back = ((corners[:, np.newaxis] + way * web).ravel() % len(self.path) for way in (-1, 1))
        chord = self.path[back][np.newaxis] - self.path[out][:, np.newaxis]
        wide = np.linalg.norm(chord, axis=2)
        middle = _unit(self.normals[out][:, np.newaxis] + self.normals[back][np.newaxis])
        chord = _flat(chord, middle)
        ways = (self.before[out][:, np.newaxis], self.after[back])
        cosine = [(chord * _flat(np.broadcast_to(way, chord.shape), middle)).sum(axis=2) for way in ways]
        bend = np.degrees(np.arccos(np.clip(np.minimum(*cosine), -1, 1)))
        around = (back[np.newaxis] - out[:, np.newaxis]) % len(self.path) * self.step
        is_arm = (around >= ARM * wide) & (wide >= LONG / 2 * self.step / STEP)
        bend = np.where(is_arm & (bend <= STRAIGHT), bend, np.inf).reshape(count, len(web), count, len(web))
        each = np.moveaxis(bend, 2, 1).reshape(count, count, -1)
        best = np.divmod(each.argmin(axis=2), len(web))
        one, other = np.indices((count, count))
        out, back = out.reshape(count, -1)[one, best[0]], back.reshape(count, -1)[other, best[1]]
        return each.min(axis=2), out, back

    def lengths(self, margins: IntArray) -> FloatArray:
        """Return the length of the rim around each arm, between the ends of margins (4, 2), over its width."""
        first, last = margins.T
        around = (last - first) % len(self.path) * self.step
        return np.asarray(around / np.linalg.norm(self.path[last] - self.path[first], axis=1))


def _direction(path: FloatArray, way: int) -> FloatArray:
    """Return the directions (n, 3) of lines through the points of a closed path (n, 3) on one way from each."""
    steps = np.arange(int(LONG / STEP) + 1)
    lever = steps - steps.mean()
    return np.asarray(sum(by * np.roll(path, -way * int(step), axis=0) for by, step in zip(lever, steps, strict=True)))


def _unit(directions: FloatArray) -> FloatArray:
    """Return directions (..., 3) of unit length."""
    size: FloatArray = np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.asarray(directions / np.maximum(size, np.finfo(float).tiny))


def _flat(directions: FloatArray, normals: FloatArray) -> FloatArray:
    """Return directions (..., 3) in the planes with some normals, of unit length."""
    return _unit(directions - (directions * normals).sum(axis=-1, keepdims=True) * normals)


def _least_cycle(bends: FloatArray) -> IntArray | None:
    """Return four corners (4,) in their order of which each next two have bends (k, k), the largest the least."""
    count = len(bends)
    every = np.arange(count)
    least, between = np.full((count, count), np.inf), np.zeros((count, count), np.int64)
    for one in range(count):
        way = (every - one) % count
        both = np.maximum(bends[one][:, np.newaxis], bends)
        both[way[:, np.newaxis] >= way] = np.inf
        between[one] = both.argmin(axis=0)
        least[one] = both[between[one], every]
    worst = np.maximum(least, least.T)
    one, other = divmod(int(worst.argmin()), count)
    if not np.isfinite(worst[one, other]):
        return None
    return np.array([one, between[one, other], other, between[other, one]])


def _is_several(bends: FloatArray, one: int, other: int) -> bool:
    """Return whether there are two arms or more, by bends (k, k), on the rim from one corner to another."""
    between = (one + np.arange(1, (other - one) % len(bends))) % len(bends)
    return bool((np.isfinite(bends[one, between]) & np.isfinite(bends[between, other])).any())


def _arms(vertices: FloatArray, edges: EdgeTable, rim: IntArray, margins: IntArray) -> tuple[IntArray, IntArray] | None:
    """Return the arms beyond margins (4, 2) that go on across a sheet, also halved, or None if it has no five parts."""
    count, ends = len(vertices), edges.ends.astype(np.int64)
    length = np.maximum(np.linalg.norm(vertices[ends[:, 1]] - vertices[ends[:, 0]], axis=1), np.finfo(float).tiny)
    graph = coo_array((length, (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()
    came = dijkstra(graph, directed=False, indices=rim[margins[:, 0]], return_predecessors=True)[1]
    cut = np.zeros(count, bool)
    for before, last in zip(came, rim[margins[:, 1]], strict=True):
        vertex = int(last)
        while vertex >= 0:
            cut[vertex] = True
            vertex = int(before[vertex])
    kept = ~cut[ends].any(axis=1)
    part = label_nodes(np.ascontiguousarray(ends[kept, 0]), np.ascontiguousarray(ends[kept, 1]), count)
    arm = np.full(count, -1)
    for number, (first, last) in enumerate(margins):
        beyond = rim[np.arange(first, first + (last - first) % len(rim) + 1) % len(rim)]
        beyond = beyond[~cut[beyond]]
        if len(beyond):
            arm[part == np.bincount(part[beyond]).argmax()] = number
    halved = arm.copy()
    halved[cut] = arm[~cut][query(cKDTree(vertices[~cut]), vertices[cut])[1]]
    return (arm, halved) if len(np.unique(arm)) == 5 else None
