"""Edges flipped where triangles are flat or folded over: no vertex moves, no topology changes."""

from dataclasses import dataclass, replace

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.repair.editable_mesh import EditableMesh


def folded_edges(vertices: FloatArray, edges: EdgeTable, angle: float) -> BoolArray:
    """Return which edges have two triangles that meet at less than `angle`, in degrees: 180 is flat.

    The angle is that between the triangles' heights over the edge, whichever way they are turned.
    """
    folded, of_edge = np.zeros(len(edges.ends), dtype=bool), edges.of_half[edges.order]
    first, second, third = (vertices[edges.corners[corner::3]] for corner in range(3))
    normal = np.cross(second - first, third - first)
    # What the edge, from its smaller vertex to its larger, and the corner across it span.
    forward = (edges.corners == edges.ends[edges.of_half, 0])[edges.order]
    for step in range(1, int(edges.count.max(initial=0))):
        pair = np.flatnonzero(of_edge[step:] == of_edge[:-step])
        one, other = normal[edges.order[pair] // 3], normal[edges.order[pair + step] // 3]
        cosine = np.einsum("ij,ij->i", one, other) * np.where(forward[pair] == forward[pair + step], 1.0, -1.0)
        # Not above zero where a triangle is flat, which is no fold.
        sharp = np.flatnonzero(cosine > 0)
        sine = np.linalg.norm(np.cross(one[sharp], other[sharp]), axis=1)
        folded[of_edge[pair[sharp[np.arctan2(sine, cosine[sharp]) < np.radians(angle)]]]] = True
    return folded


def _before(half: IntArray) -> IntArray:
    """Return the half-edges that come before some in the same triangles; they start at the corners across."""
    return half - half % 3 + (half + 2) % 3


@dataclass(frozen=True, eq=False)
class _Flips:
    """Edges to flip: the triangles on both sides, (k, 2) rows, and the ones that stand for them, (k, 2, 3)."""

    rows: IntArray
    instead: IntArray

    def of(self, which: BoolArray) -> "_Flips":
        """Return some of them."""
        return _Flips(self.rows[which], self.instead[which])

    def applied(self, mesh: EditableMesh) -> EditableMesh:
        """Return the mesh with these edges flipped."""
        triangles = mesh.triangles.copy()
        triangles[self.rows] = self.instead
        return replace(mesh, triangles=triangles)


@dataclass(frozen=True, eq=False)
class _Faults:
    """Faults that flips repair: degenerate and flat triangles, folded edges."""

    edges: EdgeTable
    degenerate: BoolArray
    folded: BoolArray
    flat: BoolArray
    longest: IntArray
    slimness: FloatArray

    @classmethod
    def of(cls, mesh: EditableMesh, height: float, angle: float) -> "_Faults":
        edges = EdgeTable.of(mesh.triangles)
        heights, corner, degenerate = mesh.heights()
        longest = 3 * np.arange(len(corner)) + corner
        folded = folded_edges(mesh.vertices, edges, angle)
        side = mesh.vertices[mesh.triangles.ravel()[longest]] - mesh.vertices[edges.corners[_before(_before(longest))]]
        slimness = heights / np.maximum(np.linalg.norm(side, axis=1), np.finfo(float).tiny)
        return cls(edges, degenerate, folded, degenerate | (heights <= height), longest, slimness)

    def count(self, rows: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Return the faults in each of (k, 2) pairs of triangles, an edge of both counted once."""
        around = np.sort(self.edges.of_half.reshape(-1, 3)[rows].reshape(-1, 6), axis=1)
        once = np.diff(around, axis=1, prepend=-1) != 0
        folds = (self.folded[around] & once).sum(axis=1)
        return self.degenerate[rows].sum(axis=1), folds, self.flat[rows].sum(axis=1)


def flip_edges(mesh: EditableMesh, height: float, angle: float) -> EditableMesh:
    """Flip the longest edges of flat triangles and the edges of folded ones, where that makes fewer of them.

    A flip is done if of its two triangles and their five edges not more are degenerate or folded than
    before, if fewer of them are, or else fewer flat and none slimmer, and if they cross no triangle of the mesh.

    Parameters
    ----------
    height : float
        A triangle is flat if its height over its longest edge is at most this, or it is degenerate.
    angle : float
        An edge is folded if its triangles meet at less than this, in degrees.
    """
    tried: set[tuple[int, int]] = set()
    while True:
        before = _Faults.of(mesh, height, angle)
        flips = _choose(mesh, before, tried)
        if not len(flips.rows):
            return mesh
        while len(flips.rows):
            changed = flips.applied(mesh)
            some, rows = _around(changed, flips.rows)
            good = _is_better((before, flips.rows), (_Faults.of(some, height, angle), rows))
            good &= ~find_crossings(changed.vertices, changed.triangles)[flips.rows].any(axis=1)
            if good.all():
                mesh = changed
                break
            flips = flips.of(good)


def _around(mesh: EditableMesh, rows: IntArray) -> tuple[EditableMesh, IntArray]:
    """Return the triangles that share a vertex with some, and where these are among them."""
    near = np.zeros(len(mesh.vertices), dtype=bool)
    near[mesh.triangles[rows]] = True
    kept = np.asarray(near[mesh.triangles].any(axis=1))
    return mesh.only(kept).compact(), (np.cumsum(kept) - 1)[rows]


def _is_better(before: tuple[_Faults, IntArray], after: tuple[_Faults, IntArray]) -> BoolArray:
    """Return which flips repair: not more degenerate, not more folded, and fewer of these or else fewer flat.

    For the last alone no triangle may become slimmer than the slimmer one was. Given are the faults and the
    rows, (k, 2), of the flips' triangles.
    """
    counts = (faults.count(rows) for faults, rows in (before, after))
    degenerate, folded, flat = (now - then for then, now in zip(*counts, strict=True))
    slimmest = [faults.slimness[rows].min(axis=1) for faults, rows in (before, after)]
    flatter = (flat < 0) & (slimmest[1] >= slimmest[0])
    return np.asarray((degenerate <= 0) & (folded <= 0) & ((degenerate < 0) | (folded < 0) | flatter))


def _choose(mesh: EditableMesh, faults: _Faults, tried: set[tuple[int, int]]) -> _Flips:
    """Return flips that share no vertex, of edges not tried before; these are then tried."""
    edges, wanted = faults.edges, faults.folded.copy()
    wanted[edges.of_half[faults.longest[faults.flat]]] = True
    candidates = np.flatnonzero(wanted & (edges.count == 2) & ~edges.inconsistent)
    halves = edges.order[edges.first(candidates)[:, np.newaxis] + [0, 1]].astype(np.int64)
    ahead = _before(halves)
    start, stop, apex = (edges.corners[each].astype(np.int64) for each in (halves, _before(ahead), ahead))
    base = len(mesh.vertices)
    known = edges.ends[:, 0].astype(np.int64) * base + edges.ends[:, 1]
    across = apex.min(axis=1) * base + apex.max(axis=1)
    place = np.minimum(np.searchsorted(known, across), len(known) - 1)
    free = (known[place] != across) & (apex[:, 0] != apex[:, 1])
    chosen: list[int] = []
    busy: set[int] = set()
    for k in np.flatnonzero(free).tolist():
        edge = int(start[k, 0]), int(stop[k, 0])
        corners = {*edge, *apex[k].tolist()}
        if busy.isdisjoint(corners) and (min(edge), max(edge)) not in tried:
            busy |= corners
            tried.add((min(edge), max(edge)))
            chosen.append(k)
    a, b, c, d = start[chosen, 0], stop[chosen, 0], apex[chosen, 0], apex[chosen, 1]
    instead = np.stack([np.stack([c, a, d], axis=1), np.stack([d, b, c], axis=1)], axis=1)
    return _Flips(halves[chosen] // 3, instead)
