"""Several patches on one leaf: base, middle and tip, adaxial and abaxial apart, blended where they meet."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray, as_row
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.core.parallel import blocks
from o3dleaf.core.units import unit_scale
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.jet_loops import add_product
from o3dleaf.fitting.pu.blend import BATCH_SIZE
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.evaluation_loops import jet_size
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.tiling import TiledField

AXES = {"along": 0, "up": 2}

STRETCH = 0.1
"""A patch is stretched by at most so much to the common period: more shows in the shape of its cells."""

HESSIAN_ROWS = np.array([[4, 5, 6], [5, 7, 8], [6, 8, 9]])
"""Row of a jet that holds the second derivative by two axes."""

FADE_SHARE = 1 / 8
"""Reach of the cross-fade on either side of a break: this share of the period, or of the thickness of the patches."""


def smooth_step(u: FloatArray) -> FloatArray:
    """Return S(u) = 6u⁵ − 15u⁴ + 10u³, 0 below 0 and 1 above 1, and its first two derivatives, as (3, n)."""
    s = np.clip(u, 0.0, 1.0)
    return np.stack([s**3 * (10 - 15 * s + 6 * s**2), 30 * (s * (1 - s)) ** 2, 60 * s * (1 - s) * (1 - 2 * s)])


@checked
@dataclass(frozen=True, init=False, eq=False, repr=False)
class PatchBlend(LayerField):
    r"""Tiled patches that pass into one another along the leaf, or from its lower to its upper side.

    .. math:: F(z) = \sum_k ω_k(z_a)\, F_k(A_k z), \qquad
              ω_k = S\Bigl(\frac{z_a - b_{k-1} + h}{2h}\Bigr) - S\Bigl(\frac{z_a - b_k + h}{2h}\Bigr)

    with breaks b between the patches, half width h and S of `smooth_step`: a partition of
    unity along one axis a, C² as the patches are. The A_k stretch the plane, a little, so that all
    patches have one period. Blends may be blended again: sides first, then along.

    Attributes
    ----------
    textures : tuple of TiledField or PatchBlend
        As they were given.
    breaks : (k - 1,) ndarray
    fade : float
        Reach of the cross-fade on either side of a break, h.
    axis : {"along", "up"}
    period : (2,) ndarray
        Size of a tile: across and, between the breaks, along the field repeats after it.
    cell : (2, 3) ndarray
        Box of the tile number 0: its lower corner is at 0 along and across.
    """

    textures: tuple["TiledField | PatchBlend", ...]
    breaks: FloatArray
    fade: Positive
    axis: str
    period: FloatArray
    cell: FloatArray
    local: "WeightedTextures"
    index: BallIndex

    def __init__(
        self,
        textures: Sequence["TiledField | PatchBlend"],
        breaks: npt.ArrayLike,
        fade: Positive | None = None,
        *,
        axis: str = "along",
        period: npt.ArrayLike | None = None,
    ) -> None:
        """Blend `textures`.

        Parameters
        ----------
        textures : sequence of TiledField or PatchBlend
            From base to tip, or from the abaxial side up; in one unit.
        breaks : (k - 1,) array_like
            Where each passes into the next, rising, in the textures' unit: positions along the leaf as
            the frame measures them, or heights above the blade's middle.
        fade : float, optional
            Reach of the cross-fade on either side of a break; by default an eighth of the period, or of
            the thickness. Unrelated patches are seen through one another there, so keep it short.
        axis : {"along", "up"}
        period : (2,) array_like, optional
            The common period, by default the mean of the textures'.

        Raises
        ------
        InputError
            If there are not as many breaks as needed, they are too close, or a period differs by more
            than `STRETCH` from the common one.
        UnitError
            If the textures are in different units.
        """
        given = tuple(textures)
        if not given:
            raise InputError("textures: is empty; give at least one")
        for each in given[1:]:
            if unit_scale(given[0].unit, each.unit) != 1.0:
                raise UnitError(f"textures: are in {given[0].unit} and {each.unit}; fit all of them in one unit")
        size = _common_period(given, period)
        depth = np.stack([each.cell[:, 2] for each in given])
        low, high = float(depth[:, 0].min()), float(depth[:, 1].max())
        along = AXES[require_choice(axis, AXES, "axis")]
        default = FADE_SHARE * (float(size[0]) if along == 0 else high - low)
        reach = require_positive(default if fade is None else fade, "fade")
        places = as_row(breaks, "breaks", count=len(given) - 1)
        if np.any(np.diff(places) < 2 * reach):
            raise InputError(
                f"breaks: {places.tolist()} do not increase by at least twice the fade, {2 * reach:.4g}; fade less"
            )
        cell = np.array([[0.0, 0.0, low], [*size, high]])
        everywhere = np.array([[-np.inf, -np.inf, low], [np.inf, np.inf, high]])
        index = BallIndex.build(np.empty((0, 3)), np.empty(0), everywhere)
        parts = tuple(each if isinstance(each, TiledField) else each.with_period(size) for each in given)
        local = WeightedTextures(parts, tuple(each.period / size for each in parts), places, reach, along)
        kept = {"textures": given, "breaks": places, "fade": reach, "axis": axis, "period": size}
        for name, value in (kept | {"cell": cell, "local": local, "index": index}).items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return f"PatchBlend({len(self.textures)} textures {self.axis}, unit {self.unit})"

    def with_period(self, period: FloatArray) -> "PatchBlend":
        """Return the same blend, breaks and all, of patches that are stretched to another period (2,)."""
        return PatchBlend(self.textures, self.breaks, self.fade, axis=self.axis, period=period)

    def state(self) -> dict[str, Any]:
        """Return what the field is made of, for `o3dleaf.io.models.model_file`."""
        return {name: getattr(self, name) for name in ("textures", "breaks", "fade", "axis", "period")}

    @property
    def unit(self) -> str | None:
        """Unit of length of the points."""
        return self.textures[0].unit

    @property
    def patches(self) -> tuple[PUInterpolant, ...]:
        """The fitted patches that it is made of."""
        return tuple(patch for each in self.textures for patch in each.patches)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) the domain: all of the plane, and the patches' own extent across it."""
        return self.index.domain

    def tile_key(self, p: int) -> Hashable:
        """Return a key of the field on tile p along: tiles of equal keys are translates of one another.

        Tile p covers ``cell[0, 0] + p * period[0]`` to one period further along. Where one patch alone is
        seen, the key is the patch's; a tile that a break's band reaches has a key of its own.
        """
        if self.axis == "up":
            return tuple(each.tile_key(p) for each in self.local.textures)
        start, stop = p * self.period[0], (p + 1) * self.period[0]
        # A band that only touches the tile counts: rounding may put a point of its face inside.
        slack = 1e-9 * self.period[0]
        if np.any((self.breaks - self.fade < stop + slack) & (self.breaks + self.fade > start - slack)):
            return ("break", p)
        patch = int(np.searchsorted(self.breaks, start))
        return (patch, self.local.textures[patch].tile_key(p))


@dataclass(frozen=True, eq=False)
class WeightedTextures:
    """The textures of a blend, each weighted along one axis, for `o3dleaf.fitting.pu.blend.Blended`.

    Attributes
    ----------
    textures : tuple of TiledField or PatchBlend
    stretches : tuple of (2,) ndarrays
        Factors that take the blend's plane to each texture's.
    breaks : (k - 1,) ndarray
    fade : float
    axis : int
    """

    textures: tuple[TiledField | PatchBlend, ...]
    stretches: tuple[FloatArray, ...]
    breaks: FloatArray
    fade: float
    axis: int

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, 3) queries folded into the index's box."""
        count, dimension = queries.shape
        sums = np.empty((jet_size(dimension, level), count))
        # Patches are held beside the sums: fewer points at once keep to the memory that a blend promises.
        for first, last in blocks(count, BATCH_SIZE >> (2 + level)):
            folded, _ = index.fold(queries[first:last])
            sums[:, first:last] = self._sum(folded, level, dtype)
        return sums

    def _sum(self, folded: FloatArray, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets of Σ ω_k F_k at (n, 3) points."""
        count, dimension = folded.shape
        sums, totals = (np.zeros((jet_size(dimension, level), count)) for _ in range(2))
        edges = np.concatenate([[-np.inf], self.breaks, [np.inf]])
        for number, (texture, stretch) in enumerate(zip(self.textures, self.stretches, strict=True)):
            first, last = edges[number] - self.fade, edges[number + 1] + self.fade
            rows = np.flatnonzero((folded[:, self.axis] > first) & (folded[:, self.axis] < last))
            if len(rows):
                points, factors = folded[rows], np.append(stretch, 1.0)
                jets = texture.stacked_jets(points * factors, level, dtype)
                _stretch(jets, factors, level)
                weight = self._weight(points[:, self.axis], edges[number : number + 2], level)
                add_product(weight, jets, rows, len(rows), dimension, level, sums, totals)
        return sums

    def _weight(self, x: FloatArray, edges: FloatArray, level: int) -> FloatArray:
        """Return the jets of ω_k from its two breaks, infinite ones included."""
        scale = np.array([[1.0], [0.5 / self.fade], [0.25 / self.fade**2]])
        rise, fall = (scale * smooth_step(0.5 * (x - edge + self.fade) / self.fade) for edge in edges)
        window = rise - fall
        jets = np.zeros((jet_size(3, level), len(x)))
        jets[0] = window[0]
        if level > 0:
            jets[1 + self.axis] = window[1]
        if level > 1:
            jets[HESSIAN_ROWS[self.axis, self.axis]] = window[2]
        return jets


def _stretch(jets: FloatArray, stretch: FloatArray, level: int) -> None:
    """Turn derivatives by the texture's coordinates into those by the blend's, in place."""
    if level == 0:
        return
    jets[1:4] *= stretch[:, np.newaxis]
    if level > 1:
        a, b = np.triu_indices(3)
        jets[4:] *= (stretch[a] * stretch[b])[:, np.newaxis]


def _common_period(textures: Sequence[TiledField | PatchBlend], period: npt.ArrayLike | None) -> FloatArray:
    """Return the period (2,) that all textures are stretched to, or raise `InputError`."""
    periods: FloatArray = np.stack([each.period for each in textures])
    size: FloatArray = periods[0].copy() if np.all(periods == periods[0]) else periods.mean(axis=0)
    if period is not None:
        size = as_row(period, "period", count=2)
    if np.any(size <= 0) or np.any(np.abs(periods / size - 1) > STRETCH):
        raise InputError(
            f"textures: have periods {periods.tolist()}, more than {STRETCH:.0%} from {size.tolist()}; "
            "give periods near one another"
        )
    return size
