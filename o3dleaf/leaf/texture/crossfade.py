r"""Copies of a cropped patch, cross-faded in a band about their seams, mirrored and staggered if wanted.

A copy counts fully inside its tile and fades over a band of half width h about the tile's faces, where
both copies have data. Along one axis, with t from the tile's lower face and T its size,

.. math:: ω(t) = S\Bigl(\frac{t + h}{2h}\Bigr) - S\Bigl(\frac{t - T + h}{2h}\Bigr), \qquad S(u) = 6u^5 - 15u^4 + 10u^3,

so that the windows of all copies sum to one, and the blend is as smooth as the patch, up to C².
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fitter import LocalFits
from o3dleaf.fitting.pu.blend import BATCH_SIZE
from o3dleaf.fitting.rbf.evaluation_loops import jet_size
from o3dleaf.leaf.texture import copy_loops

BLOCK = 1 << 12
"""Queries whose copies one thread finds."""


@dataclass(frozen=True, eq=False)
class CrossFade:
    """Local fits of a patch, weighted by the windows of its copies, for `o3dleaf.fitting.pu.blend.Blended`.

    Attributes
    ----------
    local : LocalFits
        The patch's own.
    index : BallIndex
        Over the patch, which repeats along the axes whose copies do not overlap.
    corner, tile : (2,) ndarrays
        Lower corner of the first tile, and size of a tile.
    fade : (2,) ndarray
        Half width h of the band along each axis; 0 where the index repeats instead.
    flip : (2,) ndarray of bool
        Axes along which every second copy is mirrored.
    shift : float
        Share of a tile by which each row across is moved along, against the row before.
    """

    local: LocalFits
    index: BallIndex
    corner: FloatArray
    tile: FloatArray
    fade: FloatArray
    flip: npt.NDArray[np.bool_]
    shift: float

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box."""
        layout = copy_loops.Layout(self.corner, self.tile, self.fade, self.flip, self.shift)
        count, dimension = queries.shape
        sums = np.empty((jet_size(dimension, level), count))
        # Copies are held beside the sums: fewer points at once keep to the memory that a blend promises.
        size = 1 + int(BATCH_SIZE / (2 ** (1 + level) * np.prod(1 + 2 * self.fade / self.tile)))
        for first, last in blocks(count, size):
            folded, _ = index.fold(queries[first:last])
            heads = np.zeros(len(folded) + 1, dtype=np.int64)
            _run(copy_loops.count_copies, folded, layout, heads)
            np.cumsum(heads, out=heads)
            points = np.empty((int(heads[-1]), dimension))
            _run(copy_loops.place_copies, folded, layout, heads, points)
            # A copy at the patch's face may lie beyond it by rounding, and is no farther.
            np.clip(points, *self.index.domain, out=points)
            jets = self.local.blend(self.index, points, level=level, dtype=dtype)
            _run(copy_loops.sum_copies, folded, layout, heads, jets, level, sums, first)
        return sums


def _run(loop: Callable[..., None], folded: FloatArray, *arguments: Any) -> None:
    """Run a compiled loop over the rows of `folded`, on all threads."""
    run_blocks(lambda start, stop: loop(start, stop, folded, *arguments), len(folded), BLOCK)
