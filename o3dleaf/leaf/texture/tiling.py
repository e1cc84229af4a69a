"""The tiled field: one patch of micro-structure repeated over the plane, without copying it (paper, section 2.6)."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import lcm
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, NotNegative
from o3dleaf.core.checks.arrays import FloatArray, as_array, as_floats
from o3dleaf.core.checks.attributes import require_one_column
from o3dleaf.core.checks.scalars import as_number, require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fitter import LocalFits
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.leaf.texture.crop import best_crop, reach_of_fade
from o3dleaf.leaf.texture.crossfade import CrossFade
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.seams import Crop, SampledPatch, SeamEnergy

FLIPS = {"along": (True, False), "across": (False, True), "both": (True, True)}

MAX_ROWS = 12
"""Rows after which staggered tiles repeat, at most: a shift is a fraction with a denominator up to this."""

TOLERANCE = 1e-12
"""Share of the patch: lengths that differ by less are equal but for rounding."""

Period = npt.ArrayLike | str | Sequence[float | str]


@checked
@dataclass(frozen=True, init=False, eq=False, repr=False)
class TiledField(LayerField):
    r"""Copies of a patch over the plane, blended where they meet.

    By default, as in the paper (the equation of G in section 2.6; its Algorithm 1 prints F_i(z),
    meaning F_i(z − s)), all balls of the patch are displaced by whole periods s^q and blended by the
    partition of unity itself,

    .. math:: F(z) = \frac{\sum_i \sum_q w(|z - s^q - c_i|/r_i)\, F_i(z - s^q)}
                          {\sum_i \sum_q w(|z - s^q - c_i|/r_i)}.

    Beyond the patch's faces that extrapolates. With a crop, given by an offset or found by
    ``period="best"``, the tile is smaller than the patch and the data beyond its faces are real:
    :math:`F(z) = \sum_q ω(z - s^q) F(z - s^q)`, with windows ω that sum to one and fade in a narrow band
    about each seam (`o3dleaf.leaf.texture.crossfade`). Nothing is copied in either case.

    Attributes
    ----------
    field : PUInterpolant
        The patch.
    tile, offset : (2,) ndarrays
        Size of a tile along the first two axes and its lower corner in the patch, in the field's unit.
    period : (2,) ndarray
        After which the field repeats exactly: a tile, or several where tiles flip or shift.
    cell : (2, d) ndarray
        Box of one period.
    fade : (2,) ndarray
        Reach of the cross-fade on either side of a seam; 0 along an axis where whole patches meet.
    flip : str or None
    shift : float
    """

    field: PUInterpolant
    local: LocalFits
    tile: FloatArray
    offset: FloatArray
    period: FloatArray
    cell: FloatArray
    fade: FloatArray
    flip: str | None
    shift: Finite
    index: BallIndex

    def __init__(
        self,
        field: PUInterpolant,
        period: Period | None = None,
        offset: npt.ArrayLike | None = None,
        *,
        fade: npt.ArrayLike | None = None,
        flip: str | None = None,
        shift: Finite = 0.0,
    ) -> None:
        """Tile `field`.

        Parameters
        ----------
        field : PUInterpolant
        period : "best" or (2,) array_like, optional
            Size of a tile along and across, in the field's unit; by default the extent of its bounds.
            "best", for both or for one of the two, is the one whose faces match best, of at least half
            the patch; see `o3dleaf.leaf.texture.crop.best_crop`. `tile` and `offset` are what was chosen.
        offset : (2,) array_like, optional
            Lower corner of the tile in the patch; the patch must reach beyond the tile. Left out, the
            best one is searched for with the best period, else whole patches overlap as in the paper, or
            the middle is cropped if the tiles are to fade, flip or shift.
        fade : float or (2,) array_like, optional
            Reach of the cross-fade on either side of a seam, in the field's unit; by default half the
            radius of a ball, if there are so much data.
        flip : {"along", "across", "both"}, optional
            Every second tile along an axis is mirrored, so that it meets its own face. Leaning hairs then lean
            the other way.
        shift : float
            Share of a tile by which each row across is moved along, like bricks at 1/2: a fraction whose
            denominator is at most `MAX_ROWS`. What repeats then shows less; across, another part of the
            face is met.

        Raises
        ------
        InputError
            If the period is not positive or larger than the patch, which would leave gaps, or the patch
            does not reach beyond the tile as far as the seams are to fade.
        """
        require_one_column(field, "TiledField")
        crop, cropped = _as_crop(field, period, offset, fade, _Placing(_as_flip(flip), as_number(shift, "shift")))
        repeat = np.zeros(field.bounds.shape[1])
        repeat[:2] = size = crop.tile * _tiles_in_period(crop.flip, crop.shift)
        cell = field.bounds.copy()
        cell[:, :2] = crop.offset, crop.offset + size
        local: LocalFits = field.local
        balls = field.cover.centers, field.cover.radii
        if cropped:
            inner = np.zeros(len(repeat))
            inner[:2] = np.where(crop.fade > 0, 0.0, crop.tile)
            around = BallIndex.periodic(*balls, field.bounds, inner)
            local = CrossFade(local, around, crop.offset, crop.tile, crop.fade, crop.flip, crop.shift)
            index = replace(BallIndex.build(balls[0][:0], balls[1][:0], cell), period=repeat)
        else:
            index = BallIndex.periodic(*balls, cell, repeat)
        placed = {"tile": crop.tile, "offset": crop.offset, "fade": crop.fade, "flip": flip, "shift": float(shift)}
        parts = {"field": field, "local": local, "period": size, "cell": cell, "index": index}
        for name, value in (parts | placed).items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        tile = " × ".join(f"{size:.4g}" for size in self.tile)
        cropped = ", cross-faded" if isinstance(self.local, CrossFade) else ""
        return f"TiledField(tiles of {tile}{cropped}, {len(self.field.cover.radii):,} balls, unit {self.unit})"

    def state(self) -> dict[str, Any]:
        """Return what the field is made of, for `o3dleaf.io.model_file`."""
        state = {"field": self.field, "period": self.tile}
        if isinstance(self.local, CrossFade):
            state |= {"offset": self.offset, "fade": self.fade, "flip": self.flip, "shift": self.shift}
        return state

    @checked
    def seam_energy(self, width: NotNegative = 0.0) -> SeamEnergy:
        r"""Measure the mismatch of the tiles at their seams: a pure number for each seam, and in total.

        .. math:: E = \frac{\langle (\bar F_A - \bar F_B)^2 \rangle}{2 \operatorname{Var} \bar F},
                  \qquad \bar F = \max(-c, \min(c, F))

        with F_A and F_B the patch as the tiles on either side of a seam show it, uncropped and not
        blended, c half the standard deviation of F in the patch, and Var over the patch. Cut off at c, the
        mismatch of surfaces counts and the noise of air and leaf does not. E is 0 where the faces agree
        and 1 where they have no more in common than any two points. It is a property of patch,
        offset, period and placing; a plain tiling and a cropped one are measured alike.

        Parameters
        ----------
        width : float
            Band on either side of a seam, in the field's unit, where both tiles are compared; 0 compares
            the two faces. A crop has data on `fade` on either side; beyond the patch nothing is known.

        Raises
        ------
        InputError
            If the band reaches beyond the patch, or the field is constant.
        """
        crop = Crop(self.offset, self.tile, self.fade, _as_flip(self.flip), self.shift)
        low, high = self.field.bounds[:, :2]
        room = float(np.min(np.minimum(crop.offset - low, high - crop.offset - crop.tile)))
        if not 0 <= width <= max(room, 0.0) * (1 + TOLERANCE):
            raise InputError(f"width: is {width}; the patch extends {room:.4g} beyond its tile, give 0 to that")
        return SampledPatch.of(self.field).energy(crop, width)

    def tile_key(self, p: int) -> Hashable:  # noqa: ARG002 - all periods are alike
        """Return the same key for every period p along: see `o3dleaf.leaf.texture.patches.PatchBlend.tile_key`."""
        return 0

    @property
    def unit(self) -> str | None:
        """Unit of length of the points."""
        return self.field.unit

    @property
    def patches(self) -> tuple[PUInterpolant, ...]:
        """The fitted patches that it is made of: one."""
        return (self.field,)

    @property
    def bounds(self) -> FloatArray:
        """(2, d) the domain: all of the plane, and the patch's own extent across it."""
        return self.index.domain


@dataclass(frozen=True, eq=False)
class _Placing:
    """The placing of copies: the axes that flip, and the shift of a row."""

    flip: npt.NDArray[np.bool_]
    shift: float

    @property
    def plain(self) -> bool:
        return not self.flip.any() and self.shift == 0


def _as_flip(flip: str | None) -> npt.NDArray[np.bool_]:
    return np.array((False, False) if flip is None else FLIPS[require_choice(flip, FLIPS, "flip")])


def _as_crop(
    field: PUInterpolant,
    period: Period | None,
    offset: npt.ArrayLike | None,
    fade: npt.ArrayLike | None,
    placing: _Placing,
) -> tuple[Crop, bool]:
    """Return the crop that was requested, and whether its tiles are cross-faded, or raise `InputError`."""
    extent = (field.bounds[1] - field.bounds[0])[:2]
    wished = _as_period(period, extent)
    reach = reach_of_fade(field) if fade is None else _as_pair(fade, "fade")
    if None in wished:
        if offset is not None:
            raise InputError("offset: is chosen together with the period 'best'; leave it out, or give both as lengths")
        crop = best_crop(field, wished, reach)
        return _require_room(replace(crop, flip=placing.flip, shift=placing.shift), field), True
    tile = np.array(wished, dtype=np.float64)
    if offset is None and fade is None and placing.plain:
        return Crop(field.bounds[0, :2].copy(), tile, np.zeros(2), placing.flip, 0.0), False
    low = field.bounds[0, :2]
    corner = low + (extent - tile) / 2 if offset is None else _as_pair(offset, "offset", least=-np.inf)
    whole = tile >= extent * (1 - TOLERANCE)
    room = np.minimum(np.minimum(corner - low, low + extent - corner - tile), tile / 2)
    if fade is None:
        reach = np.minimum(reach, room)
    crop = Crop(np.where(whole, low, corner), tile, np.where(whole, 0.0, reach), placing.flip, placing.shift)
    return _require_room(crop, field), True


def _require_room(crop: Crop, field: PUInterpolant) -> Crop:
    """Return the crop if the patch reaches beyond its tile as far as its seams fade, else raise `InputError`."""
    low, high = field.bounds[:, :2]
    whole = crop.tile >= (high - low) * (1 - TOLERANCE)
    room = np.minimum(np.minimum(crop.offset - low, high - crop.offset - crop.tile), crop.tile / 2)
    if np.any(~whole & ((crop.fade <= 0) | (crop.fade > room + TOLERANCE * (high - low)))):
        raise InputError(
            f"offset: a tile of {crop.tile.tolist()} at {crop.offset.tolist()} leaves {room.tolist()} of patch beyond "
            f"it to fade over {crop.fade.tolist()}; move the tile inwards, or make it or its fade smaller"
        )
    if np.any(whole & (crop.flip | np.array([False, crop.shift != 0]))):
        raise InputError("flip, shift: need patch beyond the tile to fade over; give a smaller period, or 'best'")
    return crop


def require_tiling(period: Period | None, flip: str | None, shift: float) -> None:
    """Raise `InputError` for a period, flips or a shift that tiles of no patch can have."""
    _as_period(period, np.full(2, np.inf))
    _tiles_in_period(_as_flip(flip), as_number(shift, "shift"))


def _as_period(period: Period | None, extent: FloatArray) -> tuple[float | None, float | None]:
    """Return the period along each axis, None where the best is wanted, or raise `InputError`."""
    if period is None:
        return float(extent[0]), float(extent[1])
    as_array(period, "period")
    wished = [period, period] if isinstance(period, str) else list(np.atleast_1d(np.array(period, dtype=object)))
    text = [wish for wish in wished if isinstance(wish, str)]
    if len(wished) != 2 or any(wish != "best" for wish in text):
        raise InputError(f"period: is {period!r}; give two lengths above zero, along and across, or 'best'")
    given = [None if isinstance(wish, str) else require_positive(wish, "period") for wish in wished]
    if any(size is not None and not size > 0 for size in given):
        raise InputError(f"period: is {period!r}; give two lengths above zero, along and across")
    if any(size is not None and size > most * (1 + TOLERANCE) for size, most in zip(given, extent, strict=True)):
        raise InputError(f"period: {given} is larger than the patch, {extent.tolist()}; give one that fits into it")
    return given[0], given[1]


def _as_pair(value: npt.ArrayLike, name: str, *, least: float = 0.0) -> FloatArray:
    """Return one number for both axes, or one each, as (2,), or raise `InputError`."""
    pair = as_floats(value, name)
    if pair.shape not in {(), (2,)} or not np.all(np.isfinite(pair)) or np.any(pair < least):
        raise InputError(f"{name}: is {value!r}; give two lengths, along and across")
    return np.broadcast_to(pair, 2).copy()


def _tiles_in_period(flip: npt.NDArray[np.bool_], shift: float) -> npt.NDArray[np.int64]:
    """Return how many tiles a period holds along and across, or raise `InputError`."""
    columns = 2 if flip[0] else 1
    # Rows come back into step after whole periods along.
    turns = Fraction(shift / columns).limit_denominator(MAX_ROWS * columns)
    if abs(float(turns) * columns - shift) > TOLERANCE or turns.denominator > MAX_ROWS:
        raise InputError(f"shift: is {shift}; give a fraction such as 1/2 or 1/3, of up to {MAX_ROWS} rows")
    return np.array([columns, lcm(turns.denominator, 2 if flip[1] else 1)])
