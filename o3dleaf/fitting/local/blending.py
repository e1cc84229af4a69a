"""The blend of balls that compiled loops evaluate, over fixed blocks of queries."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.cover.ball_loops import order_by_leaf
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local import blend_loops
from o3dleaf.fitting.rbf.evaluation_loops import jet_size

BLEND_BLOCK = 4096


def blend_balls(
    model: NamedTuple,
    index: BallIndex,
    queries: FloatArray,
    level: int,
    *,
    blend: Callable[..., Any] = blend_loops.blend,
    columns: tuple[int, ...] = (),
) -> FloatArray:
    """Return the jets (*columns, jet, n) of the compiled blend at (n, d) queries, outside the index's box too.

    Parameters
    ----------
    model : NamedTuple
        The balls, of a type that `blend_loops.ball_jets` is overloaded for.
    index : BallIndex
    queries : (n, d) ndarray
    level : {0, 1, 2}
        The highest order of the derivatives.
    blend : callable
        The compiled loop.
    columns : tuple of int
        How many columns of values it blends, if it is one of several.
    """
    folded, leaves = index.fold(queries)
    asked = queries if index.is_left(queries, folded) else queries[:0]
    order = order_by_leaf(leaves, len(index.tree.axes))
    jets = np.empty((*columns, jet_size(queries.shape[1], level), len(queries)))

    def task(start: int, stop: int) -> None:
        ways = asked, folded, index.period, leaves
        blend(start, stop, order, *ways, index.tree, index.images, model, level, jets)

    run_blocks(task, len(queries), BLEND_BLOCK)
    return jets
