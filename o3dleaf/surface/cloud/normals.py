"""Agreement of the normals of neighbors: single normals turned by it, and pieces of a cloud that agree within."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud import cloud_loops, parity_loops
from o3dleaf.surface.cloud.neighbors import BLOCK, IndexArray

SURE = 0.7
"""Agreement of two normals, or disagreement, from which on it counts."""
MAJORITY = 0.8
"""Share of at least `QUORUM` neighbors that oppose a normal from which on it is turned round."""
QUORUM = 6
"""Neighbors that say something of a normal, at least: twice as many as a plane goes through."""
PATCH = 8
"""Normals that face one another's way and against all around them, from which on they may be a sheet."""
ROUNDS = 5
"""Turning one normal may decide the next; five rounds settle patches of a few points and cannot eat into a sheet."""
SURE_EDGE = 0.98
"""Agreement of two normals, straight and mirrored, from which one edge alone joins two points."""
DECISIVE = 0.5
"""Share of the agreement between two large pieces that must be left when disagreement is taken off."""
SMALL = 0.005
"""Share of the points up to which a piece follows its neighbors, however little they agree."""
PLANE_ROUNDS = 3
"""Rounds of planes on a side; the normals of one tell the next which neighbors are on it."""
ASTRAY = 0.8
"""Cosine between a normal and that of the plane on its side below which the plane's is taken: 37°, three or four times
what noise turns the normals of planes through thirty points by."""
PLAIN = 2.0
"""Standard deviations of the noise that the points on a side may be off their plane; of curved ones it means little:
thin noisy plates have 1.3, and folds of a clean figure that sixteen points do not resolve 3.6."""
DOUBTED = 0.03
"""Share of normals astray below which all are kept: exact ones are so at rims and corners, 1 % of a thin slab's."""

SEAM = 0.3
"""Points along the longest line across which normals contradict, over the square root of all points: a strip of a
width of 1/30 of its length, turned once and closed, has 0.6, and a noisy leaf 0.2."""

SignArray = npt.NDArray[np.int8]


class Repaired(NamedTuple):
    """Normals (n, 3) of which some were turned, and the share of neighbors' normals that oppose one another.

    Attributes
    ----------
    normals : (n, 3) ndarray
    conflict, before : float
        The share with those, and with the normals as they were given.
    """

    normals: FloatArray
    conflict: float
    before: float


def repair_normals(points: FloatArray, normals: FloatArray, rows: IndexArray) -> Repaired:
    """Turn normals round that their neighbors oppose, round after round, then patches that face against all around.

    Normals are compared mirrored between their points, so that the two sides of a thin sheet do not oppose one another.
    A point that noise has lifted off its sheet looks like such a side; but fewer than eight of them are none.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
    rows : (n, k) ndarray
        Each point's neighbors, itself first.
    """
    sign = np.ones(len(points))
    counts = _agreements(points, normals, rows)
    before = _opposed(counts)
    for _ in range(ROUNDS):
        total = counts.sum(axis=1)
        wrong = (counts[:, 1] >= MAJORITY * total) & (total >= QUORUM)
        if not wrong.any():
            break
        sign[wrong] *= -1
        counts = _agreements(points, sign[:, np.newaxis] * normals, rows)
    isolated = cloud_loops.find_isolated(sign[:, np.newaxis] * normals, rows, PATCH)
    if len(isolated):
        sign[isolated] *= -1
        counts = _agreements(points, sign[:, np.newaxis] * normals, rows)
    return Repaired(sign[:, np.newaxis] * normals, _opposed(counts), before)


def opposed_share(points: FloatArray, normals: FloatArray, rows: IndexArray) -> float:
    """Return the share of neighbors' normals that oppose one another, compared as in `repair_normals`."""
    return _opposed(_agreements(points, normals, rows))


def _opposed(counts: IndexArray) -> float:
    """Return the share of neighbors that oppose, of counts (n, 2) of those that agree and oppose."""
    agreeing, opposed = counts.sum(axis=0)
    return float(opposed / max(agreeing + opposed, 1))


def plane_normals(points: FloatArray, normals: FloatArray, rows: IndexArray, noise: float) -> FloatArray:
    """Return outward unit normals (n, 3), those far from the plane of the points on their own side with the plane's.

    Of a thin part that noise nearly fills, neighborhoods reach across both sides, and planes through them may stand
    anywhere. By the normals that are there, however far off, the sides are known, and each has its own planes. Where
    nearly all agree, they are kept as they are.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
    rows : (n, k) ndarray
        Each point's neighbors, itself first.
    noise : float
        Standard deviation of the points across their surface.
    """
    found = normals
    for _ in range(PLANE_ROUNDS):
        result, args = np.empty_like(points), (points, found, rows, noise, QUORUM)
        run_blocks(lambda i, j: parity_loops.plane_normals(*args, i, j, result), len(points), BLOCK)  # noqa: B023
        found = result
    astray = np.einsum("ij,ij->i", found, normals) < ASTRAY
    doubted = np.flatnonzero(astray)
    around = rows[doubted]
    beside = np.einsum("ima,ia->im", found[around], found[doubted]) > 0
    off = np.einsum("ima,ia->im", points[around] - points[doubted, np.newaxis], found[doubted]) * beside
    astray[doubted] = np.sqrt((off * off).sum(axis=1) / beside.sum(axis=1)) <= PLAIN * noise
    if astray.mean() < DOUBTED:
        return normals
    return np.where(astray[:, np.newaxis], found, normals)


def find_opposed(points: FloatArray, normals: FloatArray, rows: IndexArray) -> npt.NDArray[np.bool_]:
    """Return which normals (n,) at least one neighbor's surely opposes."""
    return np.asarray(_agreements(points, normals, rows)[:, 1] > 0)


def longest_seam(
    points: FloatArray, normals: FloatArray, rows: IndexArray, among: npt.NDArray[np.bool_] | None = None
) -> float:
    """Return the most points in one stretch whose normals neighbors oppose, over the square root of all.

    Only those count that are `among` (n,), if that is given.
    """
    bad, stretch = _stretches(points, normals, rows, among)
    return float(np.bincount(stretch[bad]).max() / np.sqrt(len(points))) if bad.any() else 0.0


def on_seams(points: FloatArray, normals: FloatArray, rows: IndexArray) -> npt.NDArray[np.bool_]:
    """Return which points (n,) lie in long stretches whose normals neighbors oppose.

    Long is a quarter as many points as the longest has: shorter ones are noise.
    """
    bad, stretch = _stretches(points, normals, rows)
    size = np.bincount(stretch[bad], minlength=int(stretch.max()) + 1)
    return np.asarray(bad & (4 * size[stretch] >= size.max()))


def _stretches(
    points: FloatArray, normals: FloatArray, rows: IndexArray, among: npt.NDArray[np.bool_] | None = None
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.int32]]:
    """Return which normals (n,) neighbors oppose, and in which stretch of such points each of them lies."""
    bad = find_opposed(points, normals, rows)
    bad = bad if among is None else bad & among
    i, m = np.nonzero(bad[:, np.newaxis] & bad[rows])
    graph = coo_array((np.ones(len(i), np.int8), (i, rows[i, m])), shape=(len(points), len(points)))
    return bad, connected_components(graph, directed=False)[1]


def _agreements(points: FloatArray, normals: FloatArray, rows: IndexArray) -> IndexArray:
    """Return how many neighbors' normals surely agree with each point's, and oppose it (n, 2)."""
    counts = np.empty((len(points), 2), np.int64)
    run_blocks(lambda i, j: cloud_loops.count_agreements(points, normals, rows, SURE, i, j, counts), len(points), BLOCK)
    return counts


class OrientedPieces(NamedTuple):
    """Pieces of a cloud whose normals agree within, and how they agree with one another.

    Attributes
    ----------
    piece, sign : (n,) ndarray
        The piece of each point, numbered from the largest, and the sign of its normal within it.
    one, other : (e,) ndarray
        Pairs of neighboring pieces, the larger one first.
    agreement : (e,) ndarray
        Sum over the edges between them, given the signs within the pieces.
    """

    piece: IndexArray
    sign: FloatArray
    one: IndexArray
    other: IndexArray
    agreement: FloatArray


class _Between(NamedTuple):
    """Of each two neighboring pieces: their numbers, and the sum of the agreements between them and of their sizes."""

    low: IndexArray
    high: IndexArray
    total: FloatArray
    size: FloatArray


def join_neighbors(points: FloatArray, normals: FloatArray, rows: IndexArray) -> OrientedPieces:
    """Find how normals (n, 3) must be turned to agree, piece by piece, with those of their neighbors `rows` (n, k).

    The agreement on an edge is n_j · (n_i mirrored in the plane midway between the points). Sure edges join points,
    the surest first (Kruskal's algorithm, with signs); then pieces are joined whose agreement, summed up, is decisive.
    """
    comparing, joining, summing = progress.split(1, 1, 3)
    n, edges = len(points), rows.shape[1] - 1
    agreement, sure = np.empty((n, edges), np.float32), np.empty((n, edges), np.float32)

    def task(start: int, stop: int) -> None:
        parity_loops.mirrored_agreements(points, normals, rows, edges, start, stop, agreement, sure)

    with comparing:
        run_blocks(task, n, BLOCK, reports=True)
    parent, sign = np.arange(n), np.ones(n, np.int8)
    with joining:
        parity_loops.join_sure(rows, agreement, sure, SURE_EDGE, parent, sign)
        parity_loops.flatten(parent, sign)
    with summing:
        ends = np.repeat(np.arange(n), edges), rows[:, 1:].ravel()
        between = _between_pieces(*ends, agreement.ravel(), parent, sign)
        while _join_pieces(between, parent, sign):
            parity_loops.flatten(parent, sign)
            between = _between_pieces(*ends, agreement.ravel(), parent, sign)
    number, piece, size = np.unique(parent, return_inverse=True, return_counts=True)
    rank = np.empty(n, np.int64)
    rank[number[np.argsort(-size, kind="stable")]] = np.arange(len(number))
    one, other = np.minimum(rank[between.low], rank[between.high]), np.maximum(rank[between.low], rank[between.high])
    return OrientedPieces(rank[number[piece]], sign.astype(np.float64), one, other, between.total)


def _between_pieces(
    i: IndexArray, j: IndexArray, agreement: FloatArray, parent: IndexArray, sign: SignArray
) -> _Between:
    """Sum up the agreement on the edges (i, j) between each two pieces."""
    apart = np.flatnonzero(parent[i] != parent[j])
    i, j, weight = i[apart], j[apart], agreement[apart].astype(np.float64)
    low, high = np.minimum(parent[i], parent[j]), np.maximum(parent[i], parent[j])
    key, pair = np.unique(low * len(parent) + high, return_inverse=True)
    total = np.asarray(np.bincount(pair, weight * sign[i] * sign[j], len(key)), np.float64)
    size = np.asarray(np.bincount(pair, np.abs(weight), len(key)), np.float64)
    return _Between(key // len(parent), key % len(parent), total, size)


def _join_pieces(between: _Between, parent: IndexArray, sign: SignArray) -> bool:
    """Join each piece to the one that it shares most agreement with, where it decides; return whether any was."""
    low, high, total, size = between
    points = np.bincount(parent, minlength=len(parent))
    decided = np.abs(total) >= DECISIVE * size
    decided |= np.minimum(points[low], points[high]) <= SMALL * len(parent)
    chosen = np.flatnonzero(decided & (total != 0))
    order = chosen[np.argsort(np.abs(total[chosen]), kind="stable")]
    best = np.full(len(parent), -1)
    rank = np.arange(len(order))
    for end in (low, high):
        np.maximum.at(best, end[order], rank)
    joined = False
    for r in np.unique(best[best >= 0])[::-1]:
        e = order[r]
        joined |= bool(parity_loops.join(parent, sign, low[e], high[e], np.int8(1 if total[e] > 0 else -1)))
    return joined
