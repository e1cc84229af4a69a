"""The micro-structure laid without repetition: Wang tiles cut out of patches, their borders matching."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Whole
from o3dleaf.core.checks.arrays import FloatArray, as_floats
from o3dleaf.core.checks.attributes import require_one_column
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.units import unit_scale
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.seams import SeamEnergy
from o3dleaf.leaf.texture.wang.corners import SIDE, kinds_of, seeded, torus_color
from o3dleaf.leaf.texture.wang.quilt import FARTHEST, Quilt, QuiltedTiles
from o3dleaf.leaf.texture.wang.quilting import make_quilt


@checked
@dataclass(frozen=True, init=False, eq=False, repr=False)
class WangField(LayerField):
    r"""Sixteen tiles cut out of one patch or several, laid over the plane without repetition.

    .. math:: F(z) = \sum_k ω_k(z)\, F_{p_k}(z - s_k), \qquad ω_k(z) = \sum_{j:\, l_j = k} B(z - x_j)

    with nodes x_j of the plane, the label l_j of each, a patch p_k and a shift s_k for each label, and B the cubic
    B-spline of the nodes' lattice: a partition of unity, C² as the patches are. Nothing is copied, and nothing fitted
    again. Labels change along cuts on which the patches differ least (Kwatra et al. 2003). Tiles have a color of two at
    each corner (Lagae and Dutré 2006) and lie where the plane's corners have these; which those are follows from the
    corner's place and the seed alone.

    Attributes
    ----------
    fields : tuple of PUInterpolant
        The patches.
    seed : int
    quilt : Quilt
        What each tile shows.
    period : (2,) ndarray
        Size of a tile along and across, in the patches' unit; nothing repeats after it.
    cell : (2, 3) ndarray
        Box of the tile in place (0, 0): its lower corner is at 0 along and across.
    """

    fields: tuple[PUInterpolant, ...]
    seed: Whole
    quilt: Quilt
    period: FloatArray
    cell: FloatArray
    local: QuiltedTiles
    index: BallIndex

    def __init__(
        self,
        fields: PUInterpolant | Sequence[PUInterpolant],
        tile: npt.ArrayLike | None = None,
        *,
        seed: Whole = 0,
        quilt: Quilt | None = None,
    ) -> None:
        """Cut tiles out of `fields`.

        Parameters
        ----------
        fields : PUInterpolant or sequence of PUInterpolant
            Patches of one kind of leaf, in one unit, the blade's middle at one height.
        tile : (2,) array_like, optional
            Size of a tile along and across, in the patches' unit; by default a third to a half of the patch, the size
            at which it differs least from itself, so that ridges meet ridges.
        seed : int
            Of the places that the tiles are cut out of, and of the plane's colors.
        quilt : Quilt, optional
            The tiles of another field of these patches, which are not cut again; `tile` is theirs then.

        Raises
        ------
        InputError
            If a patch is constant or has no room for the tiles.
        UnitError
            If the patches are in different units.
        """
        given = (fields,) if isinstance(fields, PUInterpolant) else tuple(fields)
        if not given:
            raise InputError("fields: is empty; give at least one patch")
        for each in given:
            require_one_column(each, "WangField")
            if each.bounds.shape[1] != 3:
                raise InputError(f"fields: are of {each.bounds.shape[1]} dimensions; Wang tiles lie in space, give 3")
            if unit_scale(given[0].unit, each.unit) != 1.0:
                raise UnitError(f"fields: are in {given[0].unit} and {each.unit}; fit all of them in one unit")
        cut = make_quilt(given, _as_size(tile), seed) if quilt is None else quilt
        # Only heights that all patches have data of.
        low, high = max(each.bounds[0, 2] for each in given), min(each.bounds[1, 2] for each in given)
        if not low < high:
            raise InputError("fields: have no height in common; align them first")
        cell = np.array([[0.0, 0.0, low], [*cut.tile, high]])
        index = _everywhere(low, high)
        local = QuiltedTiles(given, cut, seeded(seed))
        parts = {"fields": given, "seed": int(seed), "quilt": cut, "period": cut.tile, "cell": cell, "local": local}
        for name, value in (parts | {"index": index}).items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        tile = " × ".join(f"{size:.4g}" for size in self.period)
        patches = "a patch" if len(self.fields) == 1 else f"{len(self.fields)} patches"
        return f"WangField(16 tiles of {tile} from {patches}, seed {self.seed}, unit {self.unit})"

    def state(self) -> dict[str, Any]:
        """Return what the field is made of, for `o3dleaf.io.models.model_file`."""
        return {"fields": self.fields, "seed": self.seed, "quilt": self.quilt}

    def seam_energy(self) -> SeamEnergy:
        """Return the mismatch along the cuts of all tiles, by the measure of `TiledField.seam_energy`.

        It is 0 where the patches agree and 1 where they have no more in common than any two points; along and across
        are cuts crossed on the way along and across.
        """
        return SeamEnergy(*(float(part) for part in self.quilt.energy))

    def kinds(self, places: npt.ArrayLike) -> IntArray:
        """Return the tiles (n,), 0 to 15, that lie in places (n, 2), whole numbers along and across.

        The bits of a tile's number are the colors of its corners: its lower corner, the next one along, the one across,
        and the one across from it.

        Raises
        ------
        InputError
            If the places are no whole numbers.
        """
        given = as_points(places, "places", dim=2)
        whole = np.clip(given, -FARTHEST, FARTHEST).astype(np.int64)
        if np.any(whole != given):
            raise InputError("places: are no whole numbers; give the numbers of tiles along and across")
        return kinds_of(self.local.color, whole[:, 0], whole[:, 1])

    def tile_key(self, p: int) -> Hashable:
        """Return another key for every p: no row of tiles is like another."""
        return ("wang", p)

    @cached_property
    def torus(self) -> "WangTorus":
        """The same tiles on a torus of 4 × 4, each of them once: a field that repeats, for what is done once a tile."""
        local = QuiltedTiles(self.fields, self.quilt, torus_color)
        return WangTorus(local, self.index, self.fields, self.period * SIDE, self.cell)

    @property
    def unit(self) -> str | None:
        """Unit of length of the points."""
        return self.fields[0].unit

    @property
    def patches(self) -> tuple[PUInterpolant, ...]:
        """The fitted patches that it is made of."""
        return self.fields

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) the domain: all of the plane, and the heights that all patches have."""
        return self.index.domain


@dataclass(frozen=True, eq=False)
class WangTorus(LayerField):
    """The tiles of a set on a torus, in the plane repeated.

    Attributes
    ----------
    local : QuiltedTiles
    index : BallIndex
    fields : tuple of PUInterpolant
    period : (2,) ndarray
        Size of the torus.
    cell : (2, 3) ndarray
        Box of the tile in place (0, 0).
    """

    local: QuiltedTiles
    index: BallIndex
    fields: tuple[PUInterpolant, ...]
    period: FloatArray
    cell: FloatArray

    @property
    def patches(self) -> tuple[PUInterpolant, ...]:
        """The fitted patches that it is made of."""
        return self.fields

    @property
    def unit(self) -> str | None:
        """Unit of length of the points."""
        return self.fields[0].unit

    def tile_key(self, p: int) -> Hashable:  # noqa: ARG002 - all periods are alike
        """Return the same key for every period p along."""
        return 0


def _everywhere(low: float, high: float) -> BallIndex:
    """Return an index without balls over all of the plane, between two heights."""
    box = np.array([[-np.inf, -np.inf, low], [np.inf, np.inf, high]])
    return BallIndex.build(np.empty((0, 3)), np.empty(0), box)


def _as_size(tile: npt.ArrayLike | None) -> FloatArray | None:
    """Return the size of a tile as (2,), None where it is to be chosen, or raise `InputError`."""
    if tile is None:
        return None
    size = as_floats(tile, "tile")
    if size.shape != (2,) or not np.all(np.isfinite(size)) or np.any(size <= 0):
        raise InputError(f"tile: is {tile!r}; give two lengths above zero, along and across")
    return size.copy()
