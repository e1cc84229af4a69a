"""The period of a texture, a tile or a torus of all of a set, and which part of it lies where in the plane."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.corners import SIDE, Coloring, kinds_of, torus_color
from o3dleaf.leaf.texture.wang.wang_field import WangField, WangTorus


@dataclass(frozen=True, eq=False)
class Period:
    """One period, and the tiles in it.

    Attributes
    ----------
    field : TiledField, PatchBlend or WangTorus
    corner, tile : (2,) ndarrays
        Lower corner of the tile in place (0, 0), and size of a tile.
    kinds : (p, q) ndarray of int64
        The tile in each place of it.
    color : callable or None
        Colors of the plane's corners; None: one tile lies everywhere.
    """

    field: TiledField | PatchBlend | WangTorus
    corner: FloatArray
    tile: FloatArray
    kinds: IntArray
    color: Coloring | None

    @cached_property
    def places(self) -> IntArray:
        """(k, 2) places in it of its tiles."""
        return np.stack(np.unravel_index(np.argsort(self.kinds.ravel()), self.kinds.shape), axis=1)

    def kinds_at(self, p: IntArray, q: IntArray) -> IntArray:
        """Return the tiles that lie in places (p, q) of the plane."""
        return np.zeros(np.shape(p), dtype=np.int64) if self.color is None else kinds_of(self.color, p, q)

    def cells(self, cells: IntArray, count: IntArray) -> IntArray:
        """Return where in the period the tile's cells (n, 2) of the plane lie, `count` (2,) along each side of a tile.

        Along and across they are counted from the tile in place (0, 0) on.
        """
        place = cells // count
        return np.asarray(self.places[self.kinds_at(*place.T)] * count + cells % count)

    def points(self, plane: FloatArray) -> FloatArray:
        """Return points (n, 2) of the plane at which what repeats is what the texture is at those given."""
        if self.color is None:
            return plane
        place = np.floor((plane - self.corner) / self.tile).astype(np.int64)
        return np.asarray(plane + (self.places[self.kinds_at(*place.T)] - place) * self.tile)


def period_of(texture: TiledField | PatchBlend | WangField | WangTorus) -> Period:
    """Return the period of a texture."""
    corner, tile = texture.cell[0, :2], texture.period
    if not isinstance(texture, WangField):
        return Period(texture, corner, tile, np.zeros((1, 1), dtype=np.int64), None)
    kinds = np.empty((SIDE, SIDE), dtype=np.int64)
    for p, q in product(range(SIDE), repeat=2):
        kinds[p, q] = kinds_of(torus_color, np.array(p), np.array(q))
    return Period(texture.torus, corner, tile, kinds, texture.local.color)
