"""Surfaces of two levels stitched along a curtain: coarser edges replaced by the finer vertices along them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.topology import EdgeTable

Labels = npt.NDArray[np.uint8]

NOWHERE = 1 << 40
"""Column of what has no column."""


@dataclass(frozen=True, eq=False)
class LatticeMesh:
    """A mesh whose vertices are named, (i, j, k, direction), by edges of a level's lattice."""

    names: IntArray
    positions: FloatArray
    triangles: IntArray
    labels: Labels


def weld(parts: list[LatticeMesh]) -> LatticeMesh:
    """Return the parts of one level as one mesh, vertices of one name joined."""
    names, first, number = np.unique(
        np.concatenate([part.names for part in parts]), axis=0, return_index=True, return_inverse=True
    )
    start = np.cumsum([0, *(len(part.names) for part in parts)])
    triangles = [number.ravel()[part.triangles + begin] for part, begin in zip(parts, start, strict=False)]
    positions = np.concatenate([part.positions for part in parts])[first]
    return LatticeMesh(names, positions, np.concatenate(triangles), np.concatenate([part.labels for part in parts]))


def stitch(coarse: LatticeMesh, fine: LatticeMesh, box: IntArray, ratio: int) -> LatticeMesh:
    """Return a level's surface with that of a window in it: along the curtain, the finer vertices replace edges.

    Parameters
    ----------
    coarse, fine : LatticeMesh
    box : (2, 2) ndarray of int64
        First and last column of the window, on the finer lattice.
    ratio : int
        Finer steps to a coarser one.
    """
    following = _boundary(fine, box)
    hole = box // ratio
    edges = EdgeTable.of(coarse.triangles)
    half = np.flatnonzero(edges.count[edges.of_half] == 1)
    half = half[_on_box(coarse.names[coarse.triangles.ravel()[half]], hole)]
    ends = np.stack([coarse.triangles.ravel()[half], np.roll(coarse.triangles, -1, axis=1).ravel()[half]], axis=1)
    half, ends = (rows[_on_box(coarse.names[ends[:, 1]], hole)] for rows in (half, ends))
    shift = len(coarse.names)
    twin = _twins(coarse, fine, np.unique(ends), ratio)
    paths: dict[int, dict[int, list[int]]] = {}
    for edge, (start, stop) in zip(half.tolist(), ends.tolist(), strict=True):
        path = [twin[stop]]
        while path[-1] != twin[start]:
            path.append(following.pop(path[-1]))
        paths.setdefault(edge // 3, {})[edge % 3] = [shift + node for node in reversed(path)]
    number = np.arange(shift)
    number[list(twin)] = [shift + node for node in twin.values()]
    replaced = [(_fan(number[coarse.triangles[t]].tolist(), sides), coarse.labels[t]) for t, sides in paths.items()]
    plain = np.ones(len(coarse.triangles), dtype=bool)
    plain[list(paths)] = False
    fans = np.array([triangle for fan, _ in replaced for triangle in fan], dtype=np.int64).reshape(-1, 3)
    labels = np.repeat([label for _, label in replaced], [len(fan) for fan, _ in replaced])
    return LatticeMesh(
        # A window's vertices have no name in this lattice; theirs are apart from all that are looked for.
        np.concatenate([coarse.names, _nameless(shift, len(fine.names))]),
        np.concatenate([coarse.positions, fine.positions]),
        np.concatenate([number[coarse.triangles[plain]], fans, fine.triangles + shift]),
        np.concatenate([coarse.labels[plain], labels, fine.labels]).astype(np.uint8),
    )


def _nameless(start: int, count: int) -> IntArray:
    """Return names that no edge has, all different, for the vertices number `start`, ..."""
    names = np.full((count, 4), NOWHERE)
    names[:, 2] = start + np.arange(count)
    return names


def _boundary(mesh: LatticeMesh, box: IntArray) -> dict[int, int]:
    """Return the vertex that follows each vertex along the boundary on the sides of a box."""
    edges = EdgeTable.of(mesh.triangles)
    half = np.flatnonzero(edges.count[edges.of_half] == 1)
    start, stop = mesh.triangles.ravel()[half], np.roll(mesh.triangles, -1, axis=1).ravel()[half]
    on_sides = _on_box(mesh.names[start], box) & _on_box(mesh.names[stop], box)
    return dict(zip(start[on_sides].tolist(), stop[on_sides].tolist(), strict=True))


def _on_box(names: IntArray, box: IntArray) -> BoolArray:
    """Return which edges, (i, j, k, direction), lie in the sides of a box of columns."""
    low = names[:, :2]
    high = low + np.stack([names[:, 3] & 1, names[:, 3] >> 1 & 1], axis=1)
    within = ((low >= box[0]) & (high <= box[1])).all(axis=1)
    on_side = ((low == high) & ((low == box[0]) | (low == box[1]))).any(axis=1)
    return np.asarray(within & on_side)


def _twins(coarse: LatticeMesh, fine: LatticeMesh, nodes: IntArray, ratio: int) -> dict[int, int]:
    """Return for vertices of the coarser surface on the curtain the finer vertices on the same edges."""
    fine_nodes = {tuple(name): node for node, name in enumerate(fine.names.tolist())}
    twin = {}
    for node in nodes.tolist():
        *point, direction = coarse.names[node].tolist()
        axis = direction.bit_length() - 1
        for step in range(ratio):
            name = [place * ratio for place in point]
            name[axis] += step
            if (*name, direction) in fine_nodes:
                twin[node] = fine_nodes[*name, direction]
                break
        else:
            raise ReconstructionError("levels: the curtain of a window does not match its parent; use other spacings")
    return twin


def _fan(corners: list[int], sides: dict[int, list[int]]) -> list[list[int]]:
    """Return the triangles of one whose sides, corner k to k + 1, are replaced by paths of vertices."""
    triangles = [corners]
    for side, path in sides.items():
        ends = [corners[side], corners[(side + 1) % 3]]
        # A side replaced before leaves the others' ends in one of its triangles.
        row = next(n for n, triangle in enumerate(triangles) if set(ends) <= set(triangle))
        tip = next(corner for corner in triangles.pop(row) if corner not in ends)
        triangles += [[one, other, tip] for one, other in pairwise(path)]
    return triangles
