r"""Copies of a cropped patch, cross-faded in a band about their seams, mirrored and staggered if wanted.

A copy counts fully inside its tile and fades over a band of half width h about the tile's faces, where
both copies have data. Along one axis, with t from the tile's lower face and T its size,

.. math:: ω(t) = S\Bigl(\frac{t + h}{2h}\Bigr) - S\Bigl(\frac{t - T + h}{2h}\Bigr), \qquad S(u) = 6u^5 - 15u^4 + 10u^3,

so that the windows of all copies sum to one, and the blend is as smooth as the patch, up to C².
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray
from o3dleaf.pu.index import BallIndex
from o3dleaf.pu.jets import add_product
from o3dleaf.pu.local import LocalFits
from o3dleaf.rbf.loops import jet_size
from o3dleaf.rbf.tail import IntArray

Piece = tuple[npt.NDArray[np.intp], IntArray, FloatArray, FloatArray]
"""Rows of the queries that a copy reaches, its number, where in it they lie, and its window's derivatives (3, m)."""


def smooth_step(u: FloatArray) -> FloatArray:
    """Return S(u) = 6u⁵ − 15u⁴ + 10u³, 0 below 0 and 1 above 1, and its first two derivatives, as (3, n)."""
    s = np.clip(u, 0.0, 1.0)
    return np.stack([s**3 * (10 - 15 * s + 6 * s**2), 30 * (s * (1 - s)) ** 2, 60 * s * (1 - s) * (1 - 2 * s)])


@dataclass(frozen=True, eq=False)
class CrossFade:
    """Local fits of a patch, seen through the windows of its copies; what `o3dleaf.pu.blended.Blended` evaluates.

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
        Along which axes every second copy is mirrored.
    shift : float
        By which share of a tile each row across is moved along, against the row before.
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
        folded, _ = index.fold(queries)
        count, dimension = folded.shape
        sums, totals = (np.zeros((jet_size(dimension, level), count)) for _ in range(2))
        for rows, points, weight, signs in self._copies(folded, level):
            jets = self.local.blend(self.index, points, level=level, dtype=dtype)
            _mirror(jets, signs, dimension, level)
            add_product(weight, jets, rows, len(rows), dimension, level, sums, totals)
        return sums

    def _copies(
        self, folded: FloatArray, level: int
    ) -> Iterator[tuple[npt.NDArray[np.intp], FloatArray, FloatArray, FloatArray]]:
        """Yield, copy by copy, the rows that it reaches, their points in the patch, window jets and mirrorings."""
        every = np.arange(len(folded))
        for across, row, v, window_v in self._along(folded[:, 1], every, 1):
            staggered = folded[across, 0] - self.shift * self.tile[0] * row
            for along, column, u, window_u in self._along(staggered, across, 0):
                chosen = np.searchsorted(across, along)
                points = np.ascontiguousarray(folded[along])
                signs = np.ones((2, len(along)))
                for axis, number, z in ((0, column, u), (1, row[chosen], v[chosen])):
                    odd = self.flip[axis] & (number % 2 != 0)
                    points[:, axis] = np.where(odd, 2 * self.corner[axis] + self.tile[axis] - z, z)
                    signs[axis, odd] = -1.0
                yield along, points, _window_jets(window_u, window_v[:, chosen], folded.shape[1], level), signs

    def _along(self, x: FloatArray, rows: npt.NDArray[np.intp], axis: int) -> Iterator[Piece]:
        """Yield the pieces of one axis: the tile that each coordinate of x (m,) lies in, and its two neighbours."""
        reach, size = self.fade[axis], self.tile[axis]
        if reach == 0:
            whole = np.stack([np.ones(len(x)), np.zeros(len(x)), np.zeros(len(x))])
            yield rows, np.zeros(len(x), dtype=np.int64), x, whole
            return
        home = np.floor((x - self.corner[axis]) / size).astype(np.int64)
        for step in (0, -1, 1):
            number = home + step
            z = x - number * size
            t = z - self.corner[axis]
            kept = np.flatnonzero((t > -reach) & (t < size + reach))
            if len(kept):
                yield rows[kept], number[kept], z[kept], _window(t[kept], size, reach)


def _window(t: FloatArray, size: float, reach: float) -> FloatArray:
    """Return ω and its first two derivatives, (3, n), at distances t from the tile's lower face."""
    scale = np.array([[1.0], [0.5 / reach], [0.25 / reach**2]])
    return scale * (smooth_step(0.5 * (t + reach) / reach) - smooth_step(0.5 * (t - size + reach) / reach))


def _window_jets(u: FloatArray, v: FloatArray, dimension: int, level: int) -> FloatArray:
    """Return the jets of ω(x₁) ω(x₂) from those of the two factors, (3, n) each."""
    jets = np.zeros((jet_size(dimension, level), u.shape[1]))
    jets[0] = u[0] * v[0]
    if level > 0:
        jets[1], jets[2] = u[1] * v[0], u[0] * v[1]
    if level > 1:
        # Rows of the upper triangle: (1, 1), (1, 2), ..., (1, d), (2, 2), ...
        first = 1 + dimension
        jets[first], jets[first + 1], jets[first + dimension] = u[2] * v[0], u[1] * v[1], u[0] * v[2]
    return jets


def _mirror(jets: FloatArray, signs: FloatArray, dimension: int, level: int) -> None:
    """Turn the jets at mirrored points into those of the mirrored copy, in place."""
    if level == 0 or np.all(signs > 0):
        return
    turned = np.ones((dimension, jets.shape[1]))
    turned[:2] = signs
    jets[1 : 1 + dimension] *= turned
    if level > 1:
        a, b = np.triu_indices(dimension)
        jets[1 + dimension :] *= turned[a] * turned[b]
