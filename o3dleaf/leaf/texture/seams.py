r"""Seams of tiles: the mismatch of the faces that meet.

The field is cut off at ±c, a share of its spread, so that the surface counts and the noise of air and
leaf does not: :math:`\bar F = \max(-c, \min(c, F))`. Over a seam between two tiles, A and B,

.. math:: E = \frac{\langle (\bar F_A - \bar F_B)^2 \rangle}{2 \operatorname{Var} \bar F},

a pure number: 0 where the tiles agree, 1 where they have no more in common than any two points of the patch.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.pu.interpolant import PUInterpolant

CUT_OFF = 0.5
"""c over the standard deviation of F in the patch: far above the noise, far below the step from air to leaf."""

FINENESS = 4.0
"""Sections in the radius of a ball, below which the fit has no detail to compare."""

MIN_SECTIONS, MAX_SECTIONS = 16, 128
"""Sections along an axis: half a million values are sampled at most, with `LAYERS` through the patch."""

LAYERS = 32


@dataclass(frozen=True)
class SeamEnergy:
    """Mean square mismatch at the seams of a tiling over twice the variance of the field; a pure number.

    Attributes
    ----------
    along : float
        At the seams that are crossed on the way along the leaf, where a tile ends and the next begins.
    across : float
        At those crossed on the way across.
    total : float
        Over all seams, weighted by their lengths.
    """

    along: float
    across: float
    total: float


@dataclass(frozen=True, eq=False)
class Crop:
    """A tile cut out of a patch, and the layout of its copies: all that the seams depend on.

    Attributes
    ----------
    offset, tile : (2,) ndarrays
        Lower corner and size.
    fade : (2,) ndarray
        Reach of the cross-fade on either side of a seam; 0 along an axis whose tile is as long as the patch.
    flip : (2,) ndarray of bool
    shift : float
    """

    offset: FloatArray
    tile: FloatArray
    fade: FloatArray
    flip: npt.NDArray[np.bool_]
    shift: float

    def in_patch(self, x: FloatArray, axis: int) -> FloatArray:
        """Return the coordinates in the patch of points at distances x from the first tile's corner."""
        number, t = np.divmod(x, self.tile[axis])
        mirrored = self.flip[axis] & (number % 2 != 0)
        return np.asarray(self.offset[axis] + np.where(mirrored, self.tile[axis] - t, t))


@dataclass(frozen=True, eq=False)
class SampledPatch:
    """A fitted patch sampled on sections of a fixed fineness, its values cut off near the surface.

    Attributes
    ----------
    field : PUInterpolant
    step : (2,) ndarray
        Distance between sections along the first two axes.
    rest : (m, d - 2) ndarray
        Positions through the patch.
    cut_off, variance : float
        c, and the variance of F cut off, over the patch.
    """

    field: PUInterpolant
    step: FloatArray
    rest: FloatArray
    cut_off: float
    variance: float

    @classmethod
    def of(cls, field: PUInterpolant) -> "SampledPatch":
        """Sample the patch at the midpoints of its cells, for its spread.

        Raises
        ------
        InputError
            If the field is constant, so that nothing can mismatch.
        """
        low, high = field.bounds
        fine = field.cover.typical[0] / FINENESS
        limits = [MAX_SECTIONS, MAX_SECTIONS, *[LAYERS] * (len(low) - 2)]
        counts = np.clip(np.round((high - low) / fine), MIN_SECTIONS, limits).astype(int)
        middles = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, counts, strict=True)]
        rest = np.array(list(product(*middles[2:])), dtype=np.float64)
        patch = cls(field, (high - low)[:2] / counts[:2], rest, np.inf, 1.0)
        values = patch.sections(middles[0], middles[1], 0)
        cut_off = CUT_OFF * float(values.std())
        if not cut_off > 0:
            raise InputError("field: is constant over the patch; there is no surface to tile")
        return replace(patch, cut_off=cut_off, variance=float(np.clip(values, -cut_off, cut_off).var()))

    def points(self, normal: FloatArray, beside: FloatArray, axis: int) -> FloatArray:
        """Return the (k, n, m, d) points of sections: `normal` (k,) along an axis, `beside` (n,) along the other."""
        points = np.empty((len(normal), len(beside), len(self.rest), 2 + self.rest.shape[1]))
        points[..., axis], points[..., 1 - axis] = normal[:, np.newaxis, np.newaxis], beside[:, np.newaxis]
        points[..., 2:] = self.rest
        return points

    def sections(
        self, normal: FloatArray, beside: FloatArray, axis: int, dtype: npt.DTypeLike = np.float64
    ) -> npt.NDArray[Any]:
        """Return F, cut off, on sections: (k, n, m)."""
        points = self.points(normal, beside, axis)
        values = self.field(points.reshape(-1, points.shape[-1]), dtype=dtype).reshape(points.shape[:-1])
        return values.clip(-self.cut_off, self.cut_off)

    def derivatives(self, normal: FloatArray, beside: FloatArray, axis: int) -> FloatArray:
        """Return the derivative of F across sections: (k, n, m)."""
        points = self.points(normal, beside, axis)
        derivatives: FloatArray = self.field.gradient(points.reshape(-1, points.shape[-1]))[:, axis]
        return derivatives.reshape(points.shape[:-1])

    def energy(self, crop: Crop, width: float) -> SeamEnergy:
        """Return the energy of a crop's seams, over a band of `width` on either side."""
        along, across = (self._seam(crop, axis, width) / (2 * self.variance) for axis in range(2))
        total = (along * crop.tile[1] + across * crop.tile[0]) / crop.tile.sum()
        return SeamEnergy(along, across, float(total))

    def _seam(self, crop: Crop, axis: int, width: float) -> float:
        """Return the mean square mismatch of two tiles over the seam between them, over both kinds where they flip."""
        other = 1 - axis
        stations = self.stations(width, axis)
        unrolled = crop.tile[other] * (2 if crop.flip[other] else 1)
        count = max(int(np.ceil(unrolled / self.step[other])), 1)
        beside = (np.arange(count) + 0.5) * unrolled / count
        beside_next = beside - (crop.shift * crop.tile[0] if axis == 1 else 0.0)
        squares = []
        for ending, beginning in _faces(stations, crop.tile[axis], flipped=bool(crop.flip[axis])):
            tiles = (
                self.sections(crop.offset[axis] + normal, crop.in_patch(position, other), axis)
                for normal, position in ((ending, beside), (beginning, beside_next))
            )
            squares.append(np.mean(np.subtract(*tiles) ** 2))
        return float(np.mean(squares))

    def stations(self, width: float, axis: int) -> FloatArray:
        """Return distances from a seam, a section apart at most, over a band of `width` on either side."""
        reach = int(np.ceil(width / self.step[axis] - 1e-9))
        return width * np.arange(-reach, reach + 1) / max(reach, 1)


def _faces(t: FloatArray, size: float, *, flipped: bool) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the coordinates of two tiles that meet, at distances t beyond their seam: one continued, one begun."""
    if not flipped:
        yield size + t, t
        return
    yield size + t, size - t
    yield -t, t
