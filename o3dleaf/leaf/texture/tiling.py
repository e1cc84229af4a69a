"""The tiled field: one patch of micro-structure repeated over the plane, without copying it (paper, section 2.6)."""

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, NotNegative
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import require_one_column
from o3dleaf.core.checks.scalars import as_number
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fitter import LocalFits
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.leaf.texture.crossfade import CrossFade
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.seams import Crop, SampledPatch, SeamEnergy
from o3dleaf.leaf.texture.tile_crop import TOLERANCE, Period, Placing, as_crop, as_flip, tiles_in_period


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
            denominator is at most 12 (`tile_crop.MAX_ROWS`). What repeats then shows less; across, another part of the
            face is met.

        Raises
        ------
        InputError
            If the period is not positive or larger than the patch, which would leave gaps, or the patch
            does not reach beyond the tile as far as the seams are to fade.
        """
        require_one_column(field, "TiledField")
        crop, cropped = as_crop(field, period, offset, fade, Placing(as_flip(flip), as_number(shift, "shift")))
        repeat = np.zeros(field.bounds.shape[1])
        repeat[:2] = size = crop.tile * tiles_in_period(crop.flip, crop.shift)
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
        """Return what the field is made of, for `o3dleaf.io.models.model_file`."""
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
        crop = Crop(self.offset, self.tile, self.fade, as_flip(self.flip), self.shift)
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
