"""The part of the plane that a sample covers: Delaunay triangles without the gaps that are more than chance."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError, cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.sample_spacing import NEIGHBORS, BoolArray, cell_sizes, cells_of, crude_spacing, local_shape

USUAL = 0.9
"""Share of the triangles within a sample that say how long sides are: 1.5 spacings in a lattice, 2.1 by chance."""
SHORT = 1.35
"""Triangles with no side longer than this many usual ones are covered."""
FIRST_SHORT = 2.8
"""The short side of a random sample, in spacings; where the sample is too small to tell its own."""
LONG = 1.7
"""Gaps with sides longer than this many short ones stay open where they are open to the outside: 4.8 spacings of a
random sample, the widest that 100,000 points have by chance."""
CHANCE = 2.4
"""A gap of more than this many squares of the short side is one of the leaf: 24 cells of a random sample, the void of
16 cells that 100,000 points have by chance (n e^(−A) have A cells) and the triangles around it."""
DEEP = 2.0
"""Spacings from the border at which cells are those of the sample."""
BRIDGE = 8.0
"""Pieces of a sample are joined over gaps of so many spacings; beyond that nothing says that they belong together."""
PIECE = 10
"""Fewer points than this are no piece of their own."""


@dataclass(frozen=True)
class SampleRegion:
    """What a planar sample covers.

    Attributes
    ----------
    points : (n, 2) ndarray
    triangles : (m, 3) int ndarray
        One piece of Delaunay triangles, counter-clockwise.
    spacing : (n,) ndarray
        Square root of the area that a point stands for.
    missing : (n,) ndarray
        Area of the leaf beyond the triangles at each point of their border; 0 for the others.
    bridged : int
        Number of pieces that were joined over gaps wider than chance.
    widest : float
        Length of the longest triangle over such a gap; 0: there was none.
    left_out : (k,) int ndarray
        The points in no triangle kept.
    """

    points: FloatArray
    triangles: IntArray
    spacing: FloatArray
    missing: FloatArray
    bridged: int
    widest: float
    left_out: IntArray


@dataclass(frozen=True)
class _Triangulation:
    points: FloatArray
    triangles: IntArray
    neighbors: IntArray
    areas: FloatArray
    reach: FloatArray
    """Longest side of each in the local metric of determinant 1: a length."""


def cover_sample(points: FloatArray) -> SampleRegion:
    """Return what (n, 2) distinct points cover.

    Raises
    ------
    InputError
        If they lie on one line.
    """
    mesh = _triangulate(points)
    spacing, short = crude_spacing(points, cKDTree(points)), FIRST_SHORT
    for _ in range(3):  # the crude spacing is too long at margins; the third pass changes it by less than a hundredth
        kept = _covered(mesh, spacing, short)
        deep = _deep(mesh, kept, spacing)
        spacing = cell_sizes(points, cells_of(points, mesh.triangles[kept], mesh.areas[kept]), deep)
        usual = (mesh.reach / spacing[mesh.triangles].mean(axis=1))[kept & deep[mesh.triangles].all(axis=1)]
        short = SHORT * float(np.quantile(usual, USUAL)) if len(usual) else FIRST_SHORT
    kept, bridged, widest = _joined(mesh, _covered(mesh, spacing, short), spacing, short)
    labels = _labels(mesh, kept)
    kept &= labels == np.argmax(np.bincount(labels[kept], mesh.areas[kept]))
    left_out = np.setdiff1d(np.arange(len(points)), mesh.triangles[kept])
    return SampleRegion(points, mesh.triangles[kept], spacing, _missing(mesh, kept, spacing), bridged, widest, left_out)


def _triangulate(points: FloatArray) -> _Triangulation:
    try:
        delaunay = Delaunay(points)
    except QhullError as cause:
        raise InputError("points: lie on one line; give points that cover an area") from cause
    triangles = delaunay.simplices.astype(np.int64)
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    shape = local_shape(points, triangles)[triangles].mean(axis=1)
    reach = np.zeros(len(triangles))
    for side in (b - a, c - b, a - c):
        square = (
            shape[:, 0] * side[:, 0] ** 2 + 2 * shape[:, 1] * side[:, 0] * side[:, 1] + shape[:, 2] * side[:, 1] ** 2
        )
        reach = np.maximum(reach, np.sqrt(square))
    clockwise = (twice < 0)[:, None]
    triangles = np.where(clockwise, triangles[:, [0, 2, 1]], triangles)
    neighbors = np.where(clockwise, delaunay.neighbors[:, [0, 2, 1]], delaunay.neighbors).astype(np.int64)
    return _Triangulation(points, triangles, neighbors, np.abs(twice) / 2, reach)


def _inner(mesh: _Triangulation, kept: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return the points of kept triangles, and those of them with kept triangles all around."""
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.triangles[kept]] = True
    inner = used.copy()
    inner[mesh.triangles[~kept]] = False
    row, side = np.nonzero(mesh.neighbors < 0)
    for turn in (1, 2):  # the side at the hull is the one opposite to its corner
        inner[mesh.triangles[row, (side + turn) % 3]] = False
    return used, inner


def _deep(mesh: _Triangulation, kept: BoolArray, spacing: FloatArray) -> BoolArray:
    """Return the points that no border has cut: `DEEP` spacings from it, or in a narrow piece less.

    They are told by distance, not by rings of triangles: points with large cells have fewer rings to the border.
    """
    used, inner = _inner(mesh, kept)
    depth = cKDTree(mesh.points[used & ~inner]).query(mesh.points)[0]
    tries = [inner & (depth > share * DEEP * spacing) for share in (1.0, 0.5, 0.0)]
    enough = min(2 * NEIGHBORS, int(used.sum()))
    return next((found for found in tries if found.sum() >= enough), used)


def _missing(mesh: _Triangulation, kept: BoolArray, spacing: FloatArray) -> FloatArray:
    """Return for each point (n,) the area that its border leaves out.

    n points of which b lie on the border of one piece have 2 n − b − 2 triangles (Euler), two to a cell; in a lattice
    all are half a cell, and their area is n − b/2 − 1 cells (Pick). So half a cell is missing at each point of the
    border, and what a triangle there is smaller than half a cell, as flat ones are. Larger ones lie in pockets that
    were filled: their area is the leaf's.
    """
    used, inner = _inner(mesh, kept)
    border = used & ~inner
    triangles = mesh.triangles[kept]
    at_border = (~np.append(kept, False)[mesh.neighbors[kept]]).any(axis=1)
    half = 0.5 * (spacing[triangles] ** 2).mean(axis=1)
    small = np.where(at_border, np.maximum(half - mesh.areas[kept], 0.0), 0.0)
    weight = border[triangles].astype(float)
    weight *= (small / np.maximum(weight.sum(axis=1), 1.0))[:, None]
    missing: FloatArray = np.where(border, 0.5 * spacing**2, 0.0)
    return missing + np.bincount(triangles.ravel(), weight.ravel(), len(mesh.points))


def _labels(mesh: _Triangulation, chosen: BoolArray) -> IntArray:
    """Return the edge-connected component of each chosen triangle, and −1 for the others."""
    rows = np.flatnonzero(chosen)
    place = np.full(len(chosen) + 1, -1)
    place[rows] = np.arange(len(rows))
    other = place[mesh.neighbors[rows]]
    row, side = np.nonzero(other >= 0)
    graph = coo_array((np.ones(len(row), dtype=bool), (row, other[row, side])), shape=(len(rows), len(rows)))
    labels = np.full(len(chosen), -1, dtype=np.int64)
    labels[rows] = connected_components(graph, directed=False)[1]
    return labels


def _covered(mesh: _Triangulation, spacing: FloatArray, short: float) -> BoolArray:
    """Return the triangles that are covered: all with short sides, and the gaps that chance makes."""
    size = spacing[mesh.triangles].mean(axis=1)
    reach, cells = mesh.reach / size, mesh.areas / size**2
    gaps = reach > short
    pockets = _open(mesh, gaps) & (reach <= LONG * short)
    gaps &= ~_small(mesh, pockets, cells, CHANCE * short**2)
    enclosed = gaps & ~_open(mesh, gaps)
    covered: BoolArray = ~gaps | _small(mesh, enclosed, cells, CHANCE * short**2)
    return covered


def _open(mesh: _Triangulation, gaps: BoolArray) -> BoolArray:
    """Return those gaps that are open to the outside."""
    labels = _labels(mesh, gaps)
    outside = np.zeros(labels.max() + 2, dtype=bool)
    outside[labels[gaps & (mesh.neighbors < 0).any(axis=1)]] = True
    return gaps & outside[labels]


def _small(mesh: _Triangulation, chosen: BoolArray, cells: FloatArray, most: float) -> BoolArray:
    """Return those of the chosen triangles whose component has no more cells than chance explains."""
    if not chosen.any():
        return chosen
    labels = _labels(mesh, chosen)
    sums = np.bincount(labels[chosen], cells[chosen])
    small: BoolArray = np.less_equal(sums[labels], most)
    return chosen & small


def _joined(mesh: _Triangulation, kept: BoolArray, spacing: FloatArray, short: float) -> tuple[BoolArray, int, float]:
    """Return the triangles with those that bridge pieces, how many pieces of `PIECE` points these join, and how far."""
    labels = _labels(mesh, kept)
    piece = np.arange(len(mesh.points)) + labels.max() + 1  # a point alone is a piece by itself
    for corner in range(3):
        piece[mesh.triangles[kept, corner]] = labels[kept]
    piece = np.unique(piece, return_inverse=True)[1]
    large = np.bincount(piece) >= PIECE
    of = piece[mesh.triangles]
    reach = mesh.reach / spacing[mesh.triangles].mean(axis=1)
    several = (of != of[:, :1]).any(axis=1)
    limit = np.where(large[of].all(axis=1), BRIDGE, LONG * short)
    bridge = ~kept & several & (reach <= limit)
    joined = kept | bridge
    pieces = np.flatnonzero(np.bincount(labels[kept]) >= PIECE)
    after = _labels(mesh, joined)[kept & np.isin(labels, pieces)]
    bridged = len(pieces) - len(np.unique(after))
    return joined, bridged, float(mesh.reach[bridge & large[of].all(axis=1)].max(initial=0.0)) if bridged else 0.0
