"""The crop of a patch that options ask for: period, offset, fade, flips and shift, checked against the patch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import lcm

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray, as_array, as_floats
from o3dleaf.core.checks.scalars import as_number, require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.leaf.texture.crop import best_crop, reach_of_fade
from o3dleaf.leaf.texture.seams import Crop

FLIPS = {"along": (True, False), "across": (False, True), "both": (True, True)}

MAX_ROWS = 12
"""Rows after which staggered tiles repeat, at most: a shift is a fraction with a denominator up to this."""

TOLERANCE = 1e-12
"""Share of the patch: lengths that differ by less are equal but for rounding."""

Period = npt.ArrayLike | str | Sequence[float | str]


@dataclass(frozen=True, eq=False)
class Placing:
    """The placing of copies: the axes that flip, and the shift of a row."""

    flip: npt.NDArray[np.bool_]
    shift: float

    @property
    def plain(self) -> bool:
        """Whether copies are moved by whole tiles alone."""
        return not self.flip.any() and self.shift == 0


def as_flip(flip: str | None) -> npt.NDArray[np.bool_]:
    """Return the axes (2,) along which every second tile is mirrored, or raise `InputError`."""
    return np.array((False, False) if flip is None else FLIPS[require_choice(flip, FLIPS, "flip")])


def as_crop(
    field: PUInterpolant,
    period: Period | None,
    offset: npt.ArrayLike | None,
    fade: npt.ArrayLike | None,
    placing: Placing,
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
    tiles_in_period(as_flip(flip), as_number(shift, "shift"))


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


def tiles_in_period(flip: npt.NDArray[np.bool_], shift: float) -> npt.NDArray[np.int64]:
    """Return how many tiles a period holds along and across, or raise `InputError`."""
    columns = 2 if flip[0] else 1
    # Rows come back into step after whole periods along.
    turns = Fraction(shift / columns).limit_denominator(MAX_ROWS * columns)
    if abs(float(turns) * columns - shift) > TOLERANCE or turns.denominator > MAX_ROWS:
        raise InputError(f"shift: is {shift}; give a fraction such as 1/2 or 1/3, of up to {MAX_ROWS} rows")
    return np.array([columns, lcm(turns.denominator, 2 if flip[1] else 1)])
