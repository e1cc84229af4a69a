"""The blend of balls that compiled loops evaluate, over fixed blocks of queries, and its rounding."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.cover.ball_loops import order_by_leaf
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local import blend_loops
from o3dleaf.fitting.rbf.evaluation_loops import jet_size
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.tail import IntArray

BLEND_BLOCK = 4096

ROUNDINGS = 16
"""Of one term in single precision, at most: of z, of z_j, of their difference, square, root and power."""


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


def single_error(
    offsets: IntArray,
    places: IntArray,
    sites: FloatArray,
    weights: FloatArray,
    kernel: Polyharmonic,
    lengths: FloatArray,
) -> float:
    """Return the most by which splines in single precision are off: n u Σ|terms|, in any order of the sum.

    u is 2⁻²⁴; a term has some roundings of its own, and those of z − z_j, which lie in unit coordinates or are
    `lengths` (M,) times as long.
    """
    power, counts = kernel.power, np.diff(offsets)
    starts, shared = np.unique(places, return_inverse=True)
    farthest = np.maximum.reduceat(np.abs(sites), starts)[shared]
    reach = lengths + np.sqrt(kernel.dimension) * farthest
    # |φ| and |φ′| at that distance; beside log r stands less than 1/p + 1/(p − 1) + ... < 2.
    factor = 1.0 if power % 2 else np.log(reach) + 2.0
    size, slope = factor * reach**power, factor * power * reach ** (power - 1)
    sums, filled = np.zeros(len(counts)), counts > 0
    sums[filled] = np.add.reduceat(np.abs(weights), offsets[:-1][filled])
    terms = (counts + ROUNDINGS) * size + 4.0 * slope
    return float(np.finfo(np.float32).eps / 2 * (terms * sums).max())
