"""A texture with fewer hairs: a map over the plane says how many of them are kept, and chance which ones."""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive, Whole
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import blocks
from o3dleaf.core.units import unit_scale
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fitter import LocalFits
from o3dleaf.fitting.pu.blend import BATCH_SIZE
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.evaluation_loops import jet_size
from o3dleaf.leaf.texture.hairs.laid_hairs import LaidHairs
from o3dleaf.leaf.texture.hairs.zones import HairZones, find_hairs
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.period import period_of
from o3dleaf.leaf.texture.table_map import TableMap, as_table
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.wang_field import WangField, WangTorus

LONGEST_MM = 0.25
"""Millimeters: what is shorter than this along the leaf and stands out of the blade is a hair; wheat's reach 0.2 along
it, and its ridges run on."""

SHARES = (0.0, 1.0)


class LiddedField(LayerField):
    r"""A layer under lids: beyond a lid h of (along, across) it falls, as it does beyond its patch.

    .. math:: F(x, y, z) = F_0(x, y, h) - s\,|z - h|

    where z is above the ceiling h or below the floor h, s being the slope at which F₀ falls beyond its patch.

    Attributes
    ----------
    base : PatchBlend, TiledField, WangField or WangTorus
        F₀.
    hairs : LaidHairs
    period, cell : (2,), (2, 3) ndarrays
        As those of F₀.
    """

    base: PatchBlend | TiledField | WangField | WangTorus
    hairs: LaidHairs
    period: FloatArray
    cell: FloatArray

    def __init__(self, base: PatchBlend | TiledField | WangField | WangTorus, hairs: LaidHairs) -> None:
        self.base, self.hairs, self.period, self.cell = base, hairs, base.period, base.cell

    @property
    def unit(self) -> str | None:
        """Unit of length of the points."""
        return self.base.unit

    def tile_key(self, p: int) -> Hashable:
        """Return another key for every p, where no row of tiles is like another."""
        return self.base.tile_key(p) if self.hairs.repeats else ("thinned", p)

    @property
    def index(self) -> BallIndex:  # type: ignore[override]
        """The balls of F₀."""
        return self.base.index

    @property
    def local(self) -> LocalFits:  # type: ignore[override]
        """The local fits of F₀."""
        return self.base.local

    @property
    def patches(self) -> tuple[PUInterpolant, ...]:
        """The fitted patches that it is made of."""
        return tuple(self.base.patches)

    def stacked_jets(self, queries: FloatArray, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, to derivatives of `level` at checked (n, 3) points."""
        jets = np.empty((jet_size(3, level), len(queries)))
        # Nodes are held beside the jets: fewer points at once keep to the memory that a blend promises.
        for first, last in blocks(len(queries), BATCH_SIZE >> (4 + level)):
            jets[:, first:last] = self._under_lids(queries[first:last], level, dtype)
        return jets

    def _under_lids(self, points: FloatArray, level: int, dtype: np.dtype[Any]) -> FloatArray:
        rows, lids = self.hairs.lids(points[:, :2], level)
        height = points[rows, 2]
        beyond = np.stack([height < lids[0, 0], height > lids[1, 0]])
        at = np.flatnonzero(beyond.any(axis=0))
        if not len(at):
            return self.base.stacked_jets(points, level, dtype)
        side = beyond[1, at].astype(np.int64)
        lid = lids[side, :, at].T
        moved = points.copy()
        moved[rows[at], 2] = lid[0]
        jets = self.base.stacked_jets(moved, level, dtype)
        slope = self.base.fall * (2.0 * side - 1.0)
        jets[:, rows[at]] = _beyond(jets[:, rows[at]], lid, height[at] - lid[0], slope, level)
        return jets


def _beyond(jets: FloatArray, lid: FloatArray, above: FloatArray, slope: FloatArray, level: int) -> FloatArray:
    """Return the jets of F(x, y, h) − slope (z − h) from those of F at z = h and of h."""
    found = np.zeros_like(jets)
    found[0] = jets[0] - slope * above
    if level > 0:
        found[1] = jets[1] + (jets[3] + slope) * lid[1]
        found[2] = jets[2] + (jets[3] + slope) * lid[2]
        found[3] = -slope
    if level > 1:
        xx, xy, xz, yy, yz, zz = jets[4:]
        found[4] = xx + 2 * xz * lid[1] + zz * lid[1] ** 2 + (jets[3] + slope) * lid[3]
        found[5] = xy + xz * lid[2] + yz * lid[1] + zz * lid[1] * lid[2] + (jets[3] + slope) * lid[4]
        found[7] = yy + 2 * yz * lid[2] + zz * lid[2] ** 2 + (jets[3] + slope) * lid[5]
    return found


@checked
@dataclass(frozen=True, init=False, eq=False, repr=False)
class ThinnedField(LiddedField):
    """A texture with fewer hairs, laid over a box of the plane; what is left is as it was.

    A hair stands out of the blade and is short along it, up to `longest`. Where one is removed, a smooth lid lies on
    the surface around it, drawn over its foot like a membrane, and a stub of less than the distance of the data is
    left. Hairs that are closer together than about five distances of the data are kept or removed together; none is
    cut in two.

    Attributes
    ----------
    texture : TiledField or WangField
    shares : (n, m) ndarray
        Shares of hairs that are kept.
    box : (2, 2) ndarray
        Lower, then upper (along, across) of the area that the table is laid over, in the texture's unit; beyond it all
        hairs are kept.
    seed : int
    zones : HairZones
    period, cell : (2,), (2, 3) ndarrays
        As the texture's.
    """

    texture: TiledField | WangField
    shares: FloatArray
    box: FloatArray
    seed: Whole
    zones: HairZones
    period: FloatArray
    cell: FloatArray

    def __init__(
        self,
        texture: TiledField | WangField,
        shares: npt.ArrayLike | str | PathLike[str],
        box: npt.ArrayLike,
        *,
        seed: Whole = 0,
        longest: Positive | None = None,
        zones: HairZones | None = None,
    ) -> None:
        """Thin out the hairs of a texture.

        Parameters
        ----------
        texture : TiledField or WangField
        shares : (n, m) array_like or path-like
            Share of the hairs that is kept, 0 to 1: a table or a CSV file of one, rows along the leaf, columns across.
            Between its numbers it is a cubic B-spline.
        box : (2, 2) array_like
            Lower, then upper (along, across) of the area that the table is laid over, in the texture's unit.
        seed : int
            Of the hairs that are kept. Of two maps with one seed, what the denser one lacks the other one lacks too.
        longest : float, optional
            What is shorter along the leaf may be a hair, in the texture's unit; 0.25 mm by default.
        zones : HairZones, optional
            The hairs of another field of this texture, which are not looked for again.

        Raises
        ------
        InputError
            If the table has other numbers, or hairs cover most of the texture.
        """
        table = as_shares(shares)
        area = as_bounds(box, 2, "box")
        if zones is None:
            zones = find_hairs(texture, unit_scale("mm", texture.unit) * LONGEST_MM if longest is None else longest)
        period = period_of(texture)
        if len(zones.pieces) != period.kinds.size:
            raise InputError(f"zones: are of {len(zones.pieces)} tiles; give those of this texture")
        corner, tile = texture.cell[0, :2], texture.period
        laid = LaidHairs.thinned(
            zones,
            corner,
            tile,
            box=area,
            kind_of=period.kinds_at,
            share_at=TableMap(table, area).values,
            seed=seed,
        )
        parts: dict[str, Any] = {"texture": texture, "shares": table, "box": area, "seed": int(seed), "zones": zones}
        parts |= {"period": texture.period, "cell": texture.cell, "base": texture, "hairs": laid}
        for name, value in parts.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        kept, hairs = self.hairs.counts
        return f"ThinnedField({kept:,} of {hairs:,} hairs of {self.texture!r})"

    def state(self) -> dict[str, Any]:
        """Return what the field is made of, for `o3dleaf.io.models.model_file`."""
        return {name: getattr(self, name) for name in ("texture", "shares", "box", "seed", "zones")}

    @cached_property
    def bare(self) -> LiddedField:
        """The period of the texture, all hairs removed."""
        period = period_of(self.texture)
        return LiddedField(period.field, LaidHairs.bare(self.zones, self.cell[0, :2], self.period, period.kinds))

    @property
    def finest(self) -> float:
        """The largest cell of a mesh that two hairs do not both reach into, in the texture's unit."""
        return 2.0 * float(np.min(self.period / self.zones.nodes))

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) the domain: all of the plane, and the heights of the patches."""
        return self.texture.bounds


def as_shares(table: npt.ArrayLike | str | PathLike[str]) -> FloatArray:
    """Return a table of shares of hairs (n, m), given or read from a CSV file, or raise `InputError`."""
    return as_table(table, "hair_density", SHARES, "the share of hairs to keep")
