"""Normals of a cloud: found from the points, or given and then checked against their neighbours."""

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud import cloud_loops
from o3dleaf.surface.cloud.neighbors import BLOCK, IndexArray

SURE = 0.7
"""Agreement of two normals, or disagreement, from which on it counts as a vote."""
MAJORITY = 0.8
"""Share of at least `QUORUM` votes against a normal from which on it is turned round."""
QUORUM = 6
LONE = 8
"""Normals that face one another's way and against all around them, from which on they may be a sheet."""
ROUNDS = 5
"""Turning one normal may decide the next; five rounds settle patches of a few points and cannot eat into a sheet."""


def repair_normals(points: FloatArray, normals: FloatArray, rows: IndexArray) -> tuple[FloatArray, int, float]:
    """Turn normals round that their neighbours contradict, round after round, then what faces against all around it.

    Votes are mirrored between points, so that the two sides of a thin sheet do not contradict one another. A point that
    noise has lifted off its sheet looks like such a side; but fewer than eight of them are none.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
    rows : (n, k) ndarray
        Each point's neighbours, itself first.

    Returns
    -------
    normals : (n, 3) ndarray
    turned : int
        Normals that differ from those given.
    conflict : float
        Share of the votes that still contradict one another.
    """
    sign = np.ones(len(points))
    against = _votes(points, normals, rows)
    for _ in range(ROUNDS):
        total = against.sum(axis=1)
        wrong = (against[:, 1] >= MAJORITY * total) & (total >= QUORUM)
        if not wrong.any():
            break
        sign[wrong] *= -1
        against = _votes(points, sign[:, np.newaxis] * normals, rows)
    lone = cloud_loops.find_lone(sign[:, np.newaxis] * normals, rows, LONE)
    if len(lone):
        sign[lone] *= -1
        against = _votes(points, sign[:, np.newaxis] * normals, rows)
    return sign[:, np.newaxis] * normals, int(np.sum(sign < 0)), _share_against(against)


def contradicted(points: FloatArray, normals: FloatArray, rows: IndexArray) -> npt.NDArray[np.bool_]:
    """Return which normals (n,) at least one sure neighbour contradicts."""
    return np.asarray(_votes(points, normals, rows)[:, 1] > 0)


def vote_conflict(points: FloatArray, normals: FloatArray, rows: IndexArray) -> float:
    """Return the share of neighbours' votes that say that two normals contradict one another."""
    return _share_against(_votes(points, normals, rows))


def _share_against(votes: IndexArray) -> float:
    right, wrong = votes.sum(axis=0)
    return float(wrong / max(right + wrong, 1))


def _votes(points: FloatArray, normals: FloatArray, rows: IndexArray) -> IndexArray:
    votes = np.empty((len(points), 2), np.int64)
    run_blocks(lambda i, j: cloud_loops.count_votes(points, normals, rows, SURE, i, j, votes), len(points), BLOCK)
    return votes
