"""Levels of detail: finer windows set into a coarser surface, one mesh without a crack.

The lattice of a window has 2ᵐ steps to one of its parent's and begins at the same point. On the curtain between
the two, the finer samples are those that the coarser ones imply: linear along the edges of the coarser lattice and
bilinear between them, or linear on two triangles where the inside corners of a face must stay apart. So the finer
surface meets the curtain in a finer copy of the curve in which the coarser one does, and each edge that the
coarser triangles have there is replaced by the finer vertices along it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray, drop_unused_vertices, triangle_areas
from o3dleaf.leaf.instancing.assembly import Assembly, faces_among
from o3dleaf.leaf.instancing.footprint import Footprint, box_footprint
from o3dleaf.leaf.instancing.parts import ABAXIAL, ADAXIAL, RIM
from o3dleaf.leaf.instancing.stream import Arrays
from o3dleaf.leaf.instancing.tile import TINY, Tile
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.surface.isosurface.polygonize import march
from o3dleaf.surface.mesh.topology import EdgeTable, label_triangles

Values = Callable[[FloatArray], FloatArray]
Labels = npt.NDArray[np.uint8]

OUTWARD = np.array([[-1, -1], [1, 1]])
"""What is added to a box of columns to make it a cell larger on every side."""
NOWHERE = 1 << 40
"""Column of what has no column."""
UNKNOWN = 255
"""Label of triangles beside a curtain, until the pieces that they belong to are known."""


@dataclass(frozen=True, eq=False)
class Level:
    """The surface at one spacing: all of it, or in a window.

    Attributes
    ----------
    tile : Tile
    footprint : Footprint
        Of the root; windows have their box.
    closed : bool
        Whether the outline cuts a solid.
    box : (2, 2) ndarray of int64
        First and last column of a window, whole columns of its parent; of the root, those looked at.
    ratio : int
        Steps to one of the parent's, along every axis: what keeps corners apart is the diagonal of a square.
    children : list of Level
    """

    tile: Tile
    footprint: Footprint
    box: IntArray
    closed: bool = False
    ratio: int = 1
    children: list["Level"] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh whose vertices are named, (i, j, k, direction), by edges of a level's lattice."""

    names: IntArray
    positions: FloatArray
    triangles: IntArray
    labels: Labels


def extract_levels(root: Level, values: Values) -> tuple[FloatArray, IntArray, Labels]:
    """Return the vertices (n, 3), flat, triangles (m, 3) and labels (m,) of a level and of all windows in it.

    Parameters
    ----------
    root : Level
    values : callable
        The field, > 0 inside, at (n, 3) flat positions.

    Raises
    ------
    InputError
        If a window reaches the edge of its parent or of the outline.
    ReconstructionError
        If it is not two sheets, or not one solid.
    """
    part = _with_children(root, values)
    labels = _resolve(part)
    piece, area = label_triangles(part.triangles), triangle_areas(part.positions, part.triangles)
    size = np.bincount(piece, area)
    looks_up = None if root.closed else np.bincount(piece, area * (labels == ADAXIAL)) > size / 2
    kept = np.isin(piece, faces_among(size, looks_up))
    vertices, triangles = drop_unused_vertices(part.positions, part.triangles[kept])
    return vertices, triangles, labels[kept]


def _with_children(level: Level, values: Values) -> Part:
    """Return the surface of a level with its windows in their places."""
    footprint = level.footprint
    for child in level.children:
        hole = child.box // child.ratio
        if not footprint.holds(hole + OUTWARD):
            raise InputError("levels: a window reaches the rim, or its parent's edge; make it smaller or move it")
        footprint = footprint.without(hole)
    assembly = Assembly(level.tile, footprint, closed=level.closed, keep_scraps=True)
    arrays = Arrays(assembly)
    with progress.silent():
        assembly.emit(arrays, lambda flat: flat)
    part = Part(assembly.names(), arrays.vertices, arrays.triangles, arrays.labels)
    for child in level.children:
        part = _stitch(part, _window(child, level.tile, values), child)
    return part


def _window(level: Level, parent: Tile, values: Values) -> Part:
    """Return the surface in a window, whose outermost columns are those of the curtain."""
    low, high = level.box
    inner = replace(level, footprint=box_footprint(level.box - OUTWARD))
    curtain = _curtain(level, parent, values)
    wide, deep = high - low
    # Along the first and the last column with the corners, across without them.
    far = np.array([wide - 1, deep - 1])
    aside, up = np.array([1, 0]), np.array([0, 1])
    strips = [(low, (wide, 1)), (low + far * up, (wide, 1))]
    strips += [(low + up, (1, deep - 2)), (low + up + far * aside, (1, deep - 2))]
    rings = [_strip(level, curtain, values, first, shape) for first, shape in strips]
    return _weld([_with_children(inner, values), *rings])


def _curtain(level: Level, parent: Tile, values: Values) -> dict[tuple[int, int], FloatArray]:
    """Return the samples (nz,) of each column around a window, implied by the parent's."""
    (i0, j0), (i1, j1) = level.box
    ratio = level.ratio
    found = {}
    for axis, at in ((0, j0), (0, j1), (1, i0), (1, i1)):
        start, stop = (i0, i1) if axis == 0 else (j0, j1)
        number = np.arange(start // ratio, stop // ratio + 1)
        fixed = np.full_like(number, at // ratio)
        coarse = signed_samples(parent, np.stack([number, fixed] if axis == 0 else [fixed, number], axis=1), values)
        fine = refine_face(coarse, level.ratio)
        for row, column in enumerate(range(start, stop + 1)):
            found[(column, at) if axis == 0 else (at, column)] = fine[row]
    return {(int(i), int(j)): samples for (i, j), samples in found.items()}


def signed_samples(tile: Tile, columns: IntArray, values: Values) -> FloatArray:
    """Return the samples (m, nz) of a tile's columns (m, 2), > 0 inside, voids filled and specks removed."""
    nx, ny, nz = tile.lattice.shape
    folded = columns % np.array([nx, ny])
    at = np.concatenate([np.repeat(folded, nz, axis=0), np.tile(np.arange(nz), len(columns))[:, np.newaxis]], axis=1)
    size = np.maximum(np.abs(values(tile.lattice.positions(at))), TINY).reshape(-1, nz)
    inside = tile.runs.expand(folded[:, 0] * ny + folded[:, 1]) == INSIDE
    return np.where(inside, size, -size)


def refine_face(coarse: FloatArray, ratio: int) -> FloatArray:
    """Return what samples (n, m) on an upright face imply on a lattice of `ratio` times as many steps.

    Bilinear in each square but for those whose inside corners lie across from one another: linear on the two
    triangles on both sides of the outside corners' diagonal, so that they stay apart as marching cubes has them.
    On the edges of squares both are the same sum of two numbers, bit for bit.
    """
    (u, s), (v, t) = (_fractions(count, ratio) for count in coarse.shape)
    s, t = s[:, np.newaxis], t[np.newaxis]
    a, b = coarse[np.ix_(u, v)], coarse[np.ix_(u + 1, v)]
    c, d = coarse[np.ix_(u + 1, v + 1)], coarse[np.ix_(u, v + 1)]
    fine = (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
    apart = (a > 0) & (c > 0) & (b <= 0) & (d <= 0)
    other = (a <= 0) & (c <= 0) & (b > 0) & (d > 0)
    inner = (s > 0) & (s < 1) & (t > 0) & (t < 1)
    split = np.where(s + t <= 1, a + s * (b - a) + t * (d - a), c + (1 - s) * (d - c) + (1 - t) * (b - c))
    fine = np.where(apart & inner, split, fine)
    split = np.where(s >= t, a + s * (b - a) + t * (c - b), a + t * (d - a) + s * (c - d))
    return np.asarray(np.where(other & inner, split, fine))


def _fractions(count: int, steps: int) -> tuple[IntArray, FloatArray]:
    """Return the square that each finer point lies in, and how far along its edge."""
    number = np.arange((count - 1) * steps + 1)
    square = np.minimum(number // steps, count - 2)
    return square, (number - square * steps) / steps


def _strip(
    level: Level, curtain: dict[tuple[int, int], FloatArray], values: Values, first: IntArray, shape: tuple[int, int]
) -> Part:
    """Return the surface over the cells first + (0, 0) to first + shape beside the curtain."""
    columns = np.argwhere(np.ones((shape[0] + 1, shape[1] + 1), dtype=bool)) + first
    samples = signed_samples(level.tile, columns, values)
    for row, (i, j) in enumerate(columns.tolist()):
        samples[row] = curtain.get((i, j), samples[row])
    grid = samples.reshape(shape[0] + 1, shape[1] + 1, -1)
    surface = march(grid, grid > 0, 0)
    _, ny, nz = surface.shape
    point = surface.edges >> 3
    names = np.stack(
        [first[0] + point // (ny * nz), first[1] + point // nz % ny, point % nz, surface.edges & 7], axis=1
    )
    positions = level.tile.lattice.positions(surface.positions((int(first[0]), int(first[1]), 0)))
    return Part(names, positions, surface.triangles, np.full(len(surface.triangles), UNKNOWN, dtype=np.uint8))


def _weld(parts: list[Part]) -> Part:
    """Return parts of one level as one, vertices of one name made one."""
    names, first, number = np.unique(
        np.concatenate([part.names for part in parts]), axis=0, return_index=True, return_inverse=True
    )
    start = np.cumsum([0, *(len(part.names) for part in parts)])
    triangles = [number.ravel()[part.triangles + begin] for part, begin in zip(parts, start, strict=False)]
    positions = np.concatenate([part.positions for part in parts])[first]
    return Part(names, positions, np.concatenate(triangles), np.concatenate([part.labels for part in parts]))


def _stitch(coarse: Part, fine: Part, child: Level) -> Part:
    """Return a level's surface with a window of it: along the curtain, edges are replaced by the finer vertices."""
    following = _boundary(fine, child.box)
    hole = child.box // child.ratio
    edges = EdgeTable.of(coarse.triangles)
    half = np.flatnonzero(edges.count[edges.of_half] == 1)
    half = half[_on_box(coarse.names[coarse.triangles.ravel()[half]], hole)]
    ends = np.stack([coarse.triangles.ravel()[half], np.roll(coarse.triangles, -1, axis=1).ravel()[half]], axis=1)
    half, ends = (rows[_on_box(coarse.names[ends[:, 1]], hole)] for rows in (half, ends))
    shift = len(coarse.names)
    twin = _twins(coarse, fine, np.unique(ends), child.ratio)
    paths: dict[int, dict[int, list[int]]] = {}
    for at, (start, stop) in zip(half.tolist(), ends.tolist(), strict=True):
        path = [twin[stop]]
        while path[-1] != twin[start]:
            path.append(following.pop(path[-1]))
        paths.setdefault(at // 3, {})[at % 3] = [shift + node for node in reversed(path)]
    number = np.arange(shift)
    number[list(twin)] = [shift + node for node in twin.values()]
    replaced = [(_fan(number[coarse.triangles[t]].tolist(), sides), coarse.labels[t]) for t, sides in paths.items()]
    plain = np.ones(len(coarse.triangles), dtype=bool)
    plain[list(paths)] = False
    fans = np.array([triangle for fan, _ in replaced for triangle in fan], dtype=np.int64).reshape(-1, 3)
    labels = np.repeat([label for _, label in replaced], [len(fan) for fan, _ in replaced])
    return Part(
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


def _boundary(part: Part, box: IntArray) -> dict[int, int]:
    """Return the vertex that follows each vertex along the boundary on the sides of a box."""
    edges = EdgeTable.of(part.triangles)
    half = np.flatnonzero(edges.count[edges.of_half] == 1)
    start, stop = part.triangles.ravel()[half], np.roll(part.triangles, -1, axis=1).ravel()[half]
    on = _on_box(part.names[start], box) & _on_box(part.names[stop], box)
    return dict(zip(start[on].tolist(), stop[on].tolist(), strict=True))


def _on_box(names: IntArray, box: IntArray) -> npt.NDArray[np.bool_]:
    """Return which edges, (i, j, k, direction), lie in the sides of a box of columns."""
    low = names[:, :2]
    high = low + np.stack([names[:, 3] & 1, names[:, 3] >> 1 & 1], axis=1)
    within = ((low >= box[0]) & (high <= box[1])).all(axis=1)
    on = ((low == high) & ((low == box[0]) | (low == box[1]))).any(axis=1)
    return np.asarray(within & on)


def _twins(coarse: Part, fine: Part, nodes: IntArray, ratio: int) -> dict[int, int]:
    """Return for vertices of the coarser surface on the curtain the finer vertices on the same edges."""
    at = {tuple(name): node for node, name in enumerate(fine.names.tolist())}
    twin = {}
    for node in nodes.tolist():
        *point, direction = coarse.names[node].tolist()
        axis = direction.bit_length() - 1
        for step in range(ratio):
            name = [place * ratio for place in point]
            name[axis] += step
            if (*name, direction) in at:
                twin[node] = at[*name, direction]
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
        at = next(n for n, triangle in enumerate(triangles) if set(ends) <= set(triangle))
        tip = next(corner for corner in triangles.pop(at) if corner not in ends)
        triangles += [[one, other, tip] for one, other in pairwise(path)]
    return triangles


def _resolve(part: Part) -> Labels:
    """Return the labels, those beside a curtain taken from the rest of their pieces, which the rim parts."""
    labels = part.labels.copy()
    rows = np.flatnonzero(labels != RIM)
    piece = label_triangles(part.triangles[rows])
    known = labels[rows] != UNKNOWN
    votes = np.bincount(piece[known], np.where(labels[rows][known] == ADAXIAL, 1.0, -1.0), piece.max(initial=0) + 1)
    unknown = rows[~known]
    labels[unknown] = np.where(votes[piece[~known]] >= 0, ADAXIAL, ABAXIAL)
    return labels
