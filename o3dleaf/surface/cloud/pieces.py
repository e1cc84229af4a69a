"""Pieces of a cloud whose normals agree, from what neighbours tell one another."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import Progress, finish, run_blocks, share_out
from o3dleaf.surface.cloud import parity_loops
from o3dleaf.surface.cloud.neighbors import BLOCK, IndexArray

SURE = 0.98
"""Agreement of two normals, straight and mirrored, from which one edge alone joins two points."""
DECISIVE = 0.5
"""Share of the votes between two large pieces that must be left when they are added up."""
SMALL = 0.005
"""Share of the points up to which a piece follows whatever its neighbours say."""

SignArray = npt.NDArray[np.int8]


class Pieces(NamedTuple):
    """Pieces whose points agree, and what they say about one another.

    Attributes
    ----------
    piece, sign : (n,) ndarray
        The piece of each point, numbered from the largest, and the sign of its normal within it.
    one, other : (e,) ndarray
        Pairs of pieces with votes between them, the larger piece first.
    votes : (e,) ndarray
        Their sum, given the signs within the pieces.
    """

    piece: IndexArray
    sign: FloatArray
    one: IndexArray
    other: IndexArray
    votes: FloatArray


class _Votes(NamedTuple):
    low: IndexArray
    high: IndexArray
    total: FloatArray
    every: FloatArray


def join_neighbours(
    points: FloatArray, normals: FloatArray, rows: IndexArray, progress: Progress | None = None
) -> Pieces:
    """Find how normals (n, 3) must be turned to agree, piece by piece, with those of their neighbours `rows` (n, k).

    The vote on an edge is n_j · (n_i mirrored in the plane midway between the points). Sure edges join points, the
    surest first (Kruskal's algorithm, with signs); then pieces are joined whose votes, added up, decide.
    """
    voting, joining, adding = share_out(progress, 1, 1, 3)
    n, edges = len(points), rows.shape[1] - 1
    vote, sure = np.empty((n, edges), np.float32), np.empty((n, edges), np.float32)
    run_blocks(lambda i, j: parity_loops.agreements(points, normals, rows, edges, i, j, vote, sure), n, BLOCK, voting)
    parent, sign = np.arange(n), np.ones(n, np.int8)
    parity_loops.join_sure(rows, vote, sure, SURE, parent, sign)
    parity_loops.flatten(parent, sign)
    finish(joining)
    ends = np.repeat(np.arange(n), edges), rows[:, 1:].ravel()
    between = _votes_between(*ends, vote.ravel(), parent, sign)
    while _join_pieces(between, parent, sign):
        parity_loops.flatten(parent, sign)
        between = _votes_between(*ends, vote.ravel(), parent, sign)
    finish(adding)
    number, piece, size = np.unique(parent, return_inverse=True, return_counts=True)
    rank = np.empty(n, np.int64)
    rank[number[np.argsort(-size, kind="stable")]] = np.arange(len(number))
    one, other = np.minimum(rank[between.low], rank[between.high]), np.maximum(rank[between.low], rank[between.high])
    return Pieces(rank[number[piece]], sign.astype(np.float64), one, other, between.total)


def _votes_between(i: IndexArray, j: IndexArray, vote: FloatArray, parent: IndexArray, sign: SignArray) -> _Votes:
    """Add up the votes of the edges (i, j) between each two pieces."""
    apart = np.flatnonzero(parent[i] != parent[j])
    i, j, weight = i[apart], j[apart], vote[apart].astype(np.float64)
    low, high = np.minimum(parent[i], parent[j]), np.maximum(parent[i], parent[j])
    key, pair = np.unique(low * len(parent) + high, return_inverse=True)
    total = np.bincount(pair, weight * sign[i] * sign[j], len(key))
    every = np.bincount(pair, np.abs(weight), len(key))
    return _Votes(key // len(parent), key % len(parent), np.asarray(total, np.float64), np.asarray(every, np.float64))


def _join_pieces(between: _Votes, parent: IndexArray, sign: SignArray) -> bool:
    """Join each piece to the one that it exchanges most votes with, where they decide; say whether any was joined."""
    low, high, total, every = between
    size = np.bincount(parent, minlength=len(parent))
    decided = np.abs(total) >= DECISIVE * every
    decided |= np.minimum(size[low], size[high]) <= SMALL * len(parent)
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
