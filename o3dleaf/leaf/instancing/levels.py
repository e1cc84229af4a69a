"""Levels of detail: finer windows set into a coarser surface, one mesh without a crack.

The lattice of a window has 2ᵐ steps to one of its parent's and begins at the same point. On the curtain between
the two, the finer samples are those that the coarser ones imply: linear along the edges of the coarser lattice and
bilinear between them, or linear on two triangles where the inside corners of a face must stay apart. So the finer
surface meets the curtain in a finer copy of the curve in which the coarser one does, and each edge that the
coarser triangles have there is replaced by the finer vertices along it.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, drop_unused_vertices, triangle_areas
from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.leaf.instancing.assembly import Assembly
from o3dleaf.leaf.instancing.components import LOWER, RIM, UPPER, select_faces
from o3dleaf.leaf.instancing.footprint import Footprint, box_footprint
from o3dleaf.leaf.instancing.sets.tile_set import TileSet
from o3dleaf.leaf.instancing.stitch import Labels, LatticeMesh, stitch, weld
from o3dleaf.surface.isosurface.polygonize import march
from o3dleaf.surface.mesh.topology import label_triangles

OUTWARD = np.array([[-1, -1], [1, 1]])
"""What is added to a box of columns to make it a cell larger on every side."""
UNKNOWN = 255
"""Label of triangles beside a curtain, until the components that they belong to are known."""


@dataclass(frozen=True, eq=False)
class Level:
    """The surface at one spacing: all of it, or in a window.

    Attributes
    ----------
    tiles : TileSet
    footprint : Footprint
        Of the root; windows have their box.
    closed : bool
        Whether the outline cuts a solid.
    box : (2, 2) ndarray of int64
        First and last column of a window, whole columns of its parent; of the root, those looked at.
    ratio : int
        Steps to one of the parent's, along every axis: what keeps corners apart is the diagonal of a square.
    children : list of Level
    cut : bool
        Whether triangles are cut along the outline; see `Assembly`.
    """

    tiles: TileSet
    footprint: Footprint
    box: IntArray
    closed: bool = False
    ratio: int = 1
    children: list["Level"] = field(default_factory=list)
    cut: bool = False


def extract_levels(root: Level) -> tuple[FloatArray, IntArray, Labels]:
    """Return the vertices (n, 3), flat, triangles (m, 3) and labels (m,) of a level and of all windows in it.

    Raises
    ------
    InputError
        If a window reaches the edge of its parent or of the outline.
    ReconstructionError
        If it is not two sheets, or not one solid.
    """
    mesh = _with_children(root)
    labels = _label_unknown(mesh)
    component, area = label_triangles(mesh.triangles), triangle_areas(mesh.positions, mesh.triangles)
    size = np.bincount(component, area)
    faces_up = None if root.closed else np.bincount(component, area * (labels == UPPER)) > size / 2
    kept = np.isin(component, select_faces(size, faces_up))
    vertices, triangles = drop_unused_vertices(mesh.positions, mesh.triangles[kept])
    return vertices, triangles, labels[kept]


def _with_children(level: Level) -> LatticeMesh:
    """Return the surface of a level with its windows in their places."""
    footprint = level.footprint
    for child in level.children:
        hole = child.box // child.ratio
        if not footprint.contains(hole + OUTWARD):
            raise InputError("levels: a window reaches the rim, or its parent's edge; make it smaller or move it")
        footprint = footprint.without(hole)
    assembly = Assembly(level.tiles, footprint, closed=level.closed, cut=level.cut, keep_fragments=True)
    arrays = Arrays(assembly)
    with progress.silent():
        assembly.emit(arrays, lambda flat: flat)
    mesh = LatticeMesh(assembly.names(), arrays.vertices, arrays.triangles, arrays.labels)
    for child in level.children:
        mesh = stitch(mesh, _window(child, level.tiles), child.box, child.ratio)
    return mesh


def _window(level: Level, parent: TileSet) -> LatticeMesh:
    """Return the surface in a window, whose outermost columns are those of the curtain."""
    low, high = level.box
    inner = replace(level, footprint=box_footprint(level.box - OUTWARD))
    curtain = _curtain(level, parent)
    wide, deep = high - low
    # Along the first and the last column with the corners, across without them.
    far = np.array([wide - 1, deep - 1])
    aside, up = np.array([1, 0]), np.array([0, 1])
    strips = [(low, (wide, 1)), (low + far * up, (wide, 1))]
    strips += [(low + up, (1, deep - 2)), (low + up + far * aside, (1, deep - 2))]
    rings = [_strip(level, curtain, first, shape) for first, shape in strips]
    return weld([_with_children(inner), *rings])


def _curtain(level: Level, parent: TileSet) -> dict[tuple[int, int], FloatArray]:
    """Return the samples (nz,) of each column around a window, implied by the parent's."""
    (i0, j0), (i1, j1) = level.box
    ratio = level.ratio
    curtain = {}
    for axis, side in ((0, j0), (0, j1), (1, i0), (1, i1)):
        start, stop = (i0, i1) if axis == 0 else (j0, j1)
        number = np.arange(start // ratio, stop // ratio + 1)
        fixed = np.full_like(number, side // ratio)
        coarse = parent.samples(np.stack([number, fixed] if axis == 0 else [fixed, number], axis=1))
        fine = refine_face(coarse, level.ratio)
        for row, column in enumerate(range(start, stop + 1)):
            curtain[(column, side) if axis == 0 else (side, column)] = fine[row]
    return {(int(i), int(j)): samples for (i, j), samples in curtain.items()}


def refine_face(coarse: FloatArray, ratio: int) -> FloatArray:
    """Return the samples on a lattice of `ratio` times as many steps that those (n, m) on an upright face imply.

    Bilinear in each square but for those whose inside corners lie across from one another: linear on the two
    triangles on both sides of the outside corners' diagonal, so that they stay apart as marching cubes has them.
    On the edges of squares both are the same sum of two numbers, bit for bit.
    """
    (u, s), (v, t) = (_fractions(count, ratio) for count in coarse.shape)
    s, t = s[:, np.newaxis], t[np.newaxis]
    a, b = coarse[np.ix_(u, v)], coarse[np.ix_(u + 1, v)]
    c, d = coarse[np.ix_(u + 1, v + 1)], coarse[np.ix_(u, v + 1)]
    fine = (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
    rising = (a > 0) & (c > 0) & (b <= 0) & (d <= 0)
    falling = (a <= 0) & (c <= 0) & (b > 0) & (d > 0)
    inner = (s > 0) & (s < 1) & (t > 0) & (t < 1)
    split = np.where(s + t <= 1, a + s * (b - a) + t * (d - a), c + (1 - s) * (d - c) + (1 - t) * (b - c))
    fine = np.where(rising & inner, split, fine)
    split = np.where(s >= t, a + s * (b - a) + t * (c - b), a + t * (d - a) + s * (c - d))
    return np.asarray(np.where(falling & inner, split, fine))


def _fractions(count: int, steps: int) -> tuple[IntArray, FloatArray]:
    """Return the square that each finer point lies in, and how far along its edge."""
    number = np.arange((count - 1) * steps + 1)
    square = np.minimum(number // steps, count - 2)
    return square, (number - square * steps) / steps


def _strip(
    level: Level, curtain: dict[tuple[int, int], FloatArray], first: IntArray, shape: tuple[int, int]
) -> LatticeMesh:
    """Return the surface over the cells first + (0, 0) to first + shape beside the curtain."""
    columns = np.argwhere(np.ones((shape[0] + 1, shape[1] + 1), dtype=bool)) + first
    samples = level.tiles.samples(columns)
    for row, (i, j) in enumerate(columns.tolist()):
        samples[row] = curtain.get((i, j), samples[row])
    grid = samples.reshape(shape[0] + 1, shape[1] + 1, -1)
    surface = march(grid, grid > 0, 0)
    _, ny, nz = surface.shape
    point = surface.edges >> 3
    names = np.stack(
        [first[0] + point // (ny * nz), first[1] + point // nz % ny, point % nz, surface.edges & 7], axis=1
    )
    positions = level.tiles.lattice.positions(surface.positions((int(first[0]), int(first[1]), 0)))
    return LatticeMesh(names, positions, surface.triangles, np.full(len(surface.triangles), UNKNOWN, dtype=np.uint8))


def _label_unknown(mesh: LatticeMesh) -> Labels:
    """Return the labels, those beside a curtain taken from the rest of their components, which the rim separates."""
    labels = mesh.labels.copy()
    rows = np.flatnonzero(labels != RIM)
    component = label_triangles(mesh.triangles[rows])
    known = labels[rows] != UNKNOWN
    sign = np.where(labels[rows][known] == UPPER, 1.0, -1.0)
    total = np.bincount(component[known], sign, component.max(initial=0) + 1)
    unknown = rows[~known]
    labels[unknown] = np.where(total[component[~known]] >= 0, UPPER, LOWER)
    return labels
