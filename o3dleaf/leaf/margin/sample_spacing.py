"""How a planar sample is spaced, place by place: the area that a point stands for, and the shape of that area."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query
from o3dleaf.fitting.rbf.tail import IntArray

BoolArray = npt.NDArray[np.bool_]

NEIGHBORS = 32
"""Points that a local spacing is averaged over: a tenth of noise, over some six spacings."""
FAR, FAR_SIDE = 3.0, 1.25
"""Edges longer than this many spacings, and than this many of the sides that are usual around, cross a gap and do not
tell how the sample is spaced. Sides of random points are 1.7 spacings long; between scan lines they are the longer the
farther the lines are apart, and neighbors of a point are all on its own line."""
JUMP, CRUDE_JUMP = 1.5, 2.5
"""Spacings that differ by more between neighbors are those of a jump in density, of more than twice: averages over 32
deep points of one density differ by a tenth. Crude ones are √2 too long at margins besides, and twice at corners."""

MIN_SHARE = 0.1
"""Share of the points that are beside a jump by `CRUDE_JUMP`, from which on they are a row along the margin and no few
places: rows nine times as dense hold 15 % of the points of a strip a hundred spacings wide."""

IN_ROW, BESIDE = 0.7, 8
"""Length of the mean of unit vectors of twice the angles to the `BESIDE` nearest neighbors from which on these are of
one row: 0.02 of independent points have it by chance, wherever they lie; of a row three times as dense as what is
beside it all."""
MAX_ROWS = 0.15
"""Share of the other points that may lie in rows, too: 0.1 of independent points beside a row do, of noisy lines 0.22
and more."""
MAX_DEGREE = 4
"""Of the polynomials in which a density is looked for that varies over the leaf: a stripe in its middle has four."""
MAX_FITTED = 10_000
"""Points that they are fitted to."""
STEPS, LARGEST, CONVERGED = 30, 1.0, 1e-6
"""Of Fisher's scoring; the change of a logarithm in one of them, at most, as few points may send it off; and that below
which it ends."""


class SampleNeighbors(NamedTuple):
    """The `NEIGHBORS` nearest of all points of a planar sample, searched once for all that asks for them.

    The points (n, 2) and their tree; the distance (n, k) and the row (n, k) of the nearest of each, itself first.
    """

    points: FloatArray
    tree: cKDTree
    distance: FloatArray
    row: IntArray

    @classmethod
    def of(cls, points: FloatArray) -> "SampleNeighbors":
        """Return those of distinct points (n, 2), of fewer than `NEIGHBORS` all."""
        tree = cKDTree(points)
        return cls(points, tree, *query(tree, points, k=np.arange(1, min(NEIGHBORS, len(points)) + 1)))


def edges_of(triangles: IntArray) -> IntArray:
    """Return the (e, 2) edges of triangles, each once, the smaller index first."""
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    count = int(sides.max(initial=0)) + 1
    # Numbers of pairs: rows are sorted ten times as slowly.
    return np.stack(np.divmod(np.unique(sides[:, 0].astype(np.int64) * count + sides[:, 1]), count), axis=1)


def crude_spacing(near: SampleNeighbors) -> FloatArray:
    """Return √(πr²/k) of the points (n,), r the distance of the k-th neighbor: up to √2 too long at a margin."""
    count = min(NEIGHBORS // 2, len(near.points) - 1)
    spacing: FloatArray = near.distance[:, count] * np.sqrt(np.pi / count)
    return spacing


def local_shape(near: SampleNeighbors, triangles: IntArray, areas: FloatArray | None = None) -> FloatArray:
    """Return for each point the metric (n, 3), as xx, xy, yy of a matrix of determinant 1, without direction.

    Scan lines are closer along than across; in their own metric they are as near as any neighbors. It is the inverse
    of the mean of e eᵀ over the Delaunay edges e about the point; each counts once, or with the `areas` (m,) of its
    triangles.
    """
    points, around, spacing = near.points, near.row, crude_spacing(near)
    if areas is None:
        edges, weight = edges_of(triangles), np.ones(1)
    else:
        edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        weight = np.tile(areas, 3)
    vectors = points[edges[:, 1]] - points[edges[:, 0]]
    usual = np.median(_usual_sides(points, triangles)[around], axis=1)
    short = np.hypot(*vectors.T) <= np.maximum(FAR * spacing, FAR_SIDE * usual)[edges].min(axis=1)
    products = np.stack([vectors[:, 0] ** 2, vectors[:, 0] * vectors[:, 1], vectors[:, 1] ** 2], axis=1)
    products *= weight[:, np.newaxis]
    ends, products = edges[short].ravel(), np.repeat(products[short], 2, axis=0)
    sums = np.stack([np.bincount(ends, column, len(points)) for column in products.T], axis=1)
    xx, xy, yy = sums[around].sum(axis=1).T
    determinant = xx * yy - xy**2
    known = determinant > 1e-6 * (xx + yy) ** 2  # else they lie on a line: no shape is known
    root = np.sqrt(np.where(known, determinant, 1.0))
    metric: FloatArray = np.where(known[:, None], np.stack([yy, -xy, xx], axis=1) / root[:, None], [1.0, 0.0, 1.0])
    return metric


def _usual_sides(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return for each point (n,) the mean over the area of its triangles of their longest side."""
    sides = points[triangles] - points[np.roll(triangles, 1, axis=1)]
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
    longest = np.sqrt((sides**2).sum(axis=2).max(axis=1))
    whole, weighted = (cells_of(points, triangles, each) for each in (area, area * longest))
    return np.divide(weighted, whole, out=np.zeros(len(points)), where=whole > 0)


def cells_of(points: FloatArray, triangles: IntArray, areas: FloatArray) -> FloatArray:
    """Return for each point (n,) a third of the areas of its triangles: the cell that it stands for."""
    cells: FloatArray = np.bincount(triangles.ravel(), np.repeat(areas, 3), len(points)) / 3
    return cells


def cell_sizes(near: SampleNeighbors, cells: FloatArray, deep: BoolArray) -> FloatArray:
    """Return for each point the square root (n,) of the area that a point stands for there.

    Cells are averaged over the deep points next to it, whose cells no border has cut, and all scaled so that they
    sum to the area of the deep points: a neighborhood found about a point is denser than the sample, for the point.

    Parameters
    ----------
    near : SampleNeighbors
        Of n points.
    cells : (n,) ndarray
    deep : (n,) bool ndarray
    """
    inner = np.flatnonzero(deep)
    beside = ~deep[near.row].all(axis=1)  # those nearest to others are all deep
    deepest = near.row[:, : len(inner)].copy()
    count = np.arange(1, deepest.shape[1] + 1)
    deepest[beside] = inner[query(cKDTree(near.points[inner]), near.points[beside], k=count)[1]]
    square = cells[deepest].mean(axis=1)
    size: FloatArray = np.sqrt(square * (cells[inner].sum() / square[inner].sum()))
    return size


def uneven_sizes(points: FloatArray, cells: FloatArray, counts: FloatArray, spacing: FloatArray) -> FloatArray:
    """Return for each point the square root (n,) of the area that a point stands for there, where density varies.

    Points at a margin have their deep neighbors all on one side, some spacings away, whose density theirs is not. So
    cells are averaged over all points next to it, those at the border as the parts of a point that their cells are.

    Parameters
    ----------
    points : (n, 2) ndarray
    cells : (n,) ndarray
        0 for points that are left out.
    counts : (n,) ndarray
        Of points: 1, and less at a border, by the area beyond it.
    spacing : (n,) ndarray
        What they have where too few points are whole, as at tips.
    """
    used = np.flatnonzero(cells > 0)
    near = used[query(cKDTree(points[used]), points, k=min(NEIGHBORS // 2, len(used)))[1].reshape(len(points), -1)]
    whole = counts[near].sum(axis=1)
    square = np.where(whole >= near.shape[1] / 2, cells[near].sum(axis=1) / np.maximum(whole, 1.0), spacing**2)
    size: FloatArray = np.sqrt(square * (cells.sum() / (square * counts)[used].sum()))
    return size


def is_uneven(points: FloatArray, cells: FloatArray) -> bool:
    r"""Return whether the cells (n,) of deep points (n, 2) differ over a leaf by more than chance.

    Whether a polynomial describes the density λ better than a number does, by Schwarz's criterion: of the likelihood

    .. math:: \sum_i \log λ(x_i) - c_i λ(x_i), \qquad \log λ \text{ a polynomial},

    twice the logarithm gains more than log n for each of its factors.

    References
    ----------
    Schwarz, G. (1978): Estimating the dimension of a model. Ann. Statist. 6, 461-464.
    """
    some = slice(None, None, -(-len(points) // MAX_FITTED))
    places, cells = points[some], cells[some]
    return any(_gain(_terms(places, degree), cells) > 0 for degree in range(1, MAX_DEGREE + 1))


def _gain(terms: FloatArray, cells: FloatArray) -> float:
    """Return what twice the log likelihood gains by (n, p) terms beyond what they cost."""
    if len(cells) <= 2 * terms.shape[1]:
        return 0.0
    orthogonal = np.linalg.qr(terms)[0]
    share = cells / cells.mean()
    log = np.zeros(len(cells))
    for _ in range(STEPS):
        step = np.clip(orthogonal @ (orthogonal.T @ (share / np.exp(log) - 1)), -LARGEST, LARGEST)
        log += step
        if np.abs(step).max() < CONVERGED:
            break
    gain = 2 * (share - log - share / np.exp(log)).sum()
    return float(gain - (terms.shape[1] - 1) * np.log(len(cells)))


def _terms(places: FloatArray, degree: int) -> FloatArray:
    """Return the products (n, p) of Legendre's polynomials over the box around places (n, 2), up to a degree."""
    low, high = places.min(axis=0), places.max(axis=0)
    u, v = (2 * (places - low) / np.maximum(high - low, 1e-300) - 1).T
    along, across = (np.polynomial.legendre.legvander(x, degree) for x in (u, v))
    return np.stack([along[:, i] * across[:, j] for i in range(degree + 1) for j in range(degree + 1 - i)], axis=1)


def handed_on(near: IntArray, spacing: FloatArray) -> FloatArray:
    """Return for each point (n,) the widest spacing of the points that it is `near` (n, k) to."""
    widest = spacing.copy()
    np.maximum.at(widest, near.ravel(), np.repeat(spacing, near.shape[1]))
    return widest


def even_points(near: SampleNeighbors) -> IntArray:
    """Return the rows (e,) of points that are left where those beside a jump in density are as far apart as beyond it.

    The nearest neighbors of a dense row along a margin, as a mesh's vertices are, are all of the row: what is beside it
    is not seen, and what lies across a bay is as near as any. Where no density jumps all points are left.
    """
    points, spacing = near.points, crude_spacing(near)
    widest = handed_on(near.row, spacing)
    dense = widest > JUMP * spacing  # along one row density falls by less in some places than in others
    in_row = _in_rows(near)
    if in_row[~dense].mean() > MAX_ROWS:
        in_row[:] = False  # lines, of which some are denser than others
    if (dense & ((widest > CRUDE_JUMP * spacing) | in_row)).mean() < MIN_SHARE:
        return np.arange(len(points))
    kept = ~dense
    for row in np.flatnonzero(dense):
        around = np.asarray(near.tree.query_ball_point(points[row], widest[row]), dtype=np.int64)
        kept[row] = not kept[around].any()
    return np.flatnonzero(kept)


def _in_rows(near: SampleNeighbors) -> BoolArray:
    """Return which of the points (n,) lie in a row with their nearest neighbors."""
    return np.asarray(np.abs(axes_to(near.row[:, 1 : BESIDE + 1], near.points).mean(axis=1)) > IN_ROW)


def axes_to(near: IntArray, points: FloatArray) -> npt.NDArray[np.complex128]:
    """Return the directions (n, k) from points (n, 2) to others in the rows `near`, as axes: of twice the angle."""
    way = points[near] - points[:, np.newaxis]
    along = way[..., 0] + 1j * way[..., 1]
    return np.asarray((along / np.abs(along)) ** 2)


def spacing_between(near: IntArray, triangles: IntArray, spacing: FloatArray, jump: float) -> FloatArray:
    """Return the spacing (m,) by which gaps among points are judged: the mean of a triangle's three corners.

    Where the density of a sample jumps it is the wider one. Beside dense points the neighbors of a sparse point are
    nearly all dense, and an average over them says that it is, too, up to some three of its spacings from the jump:
    the triangles of sparse points there passed for gaps. So each point hands its spacing on to all its neighbors, and a
    triangle is as sparse as the sparsest that any of its corners was handed, if that is `jump` times the densest. Of
    each point `near` (n, k) are the rows of its neighbors.
    """
    widest = handed_on(near, spacing)
    own, handed = spacing[triangles], widest[triangles].max(axis=1)
    between: FloatArray = np.where(handed > jump * own.min(axis=1), handed, own.mean(axis=1))
    return between
