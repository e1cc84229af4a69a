"""The implicit function of a texture on a blade, G(x) = F(T*(x)) (paper, section 2.6)."""

from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.parallel import blocks
from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.instancing.sets.tile_set import TilesAhead
from o3dleaf.leaf.texture.hairs.laid_hairs import LaidHairs
from o3dleaf.leaf.texture.hairs.thinned import LiddedField, ThinnedField
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.period import Period, period_of
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.wang_field import WangField, WangTorus

BATCH_SIZE = 1 << 17
"""Points evaluated together: gradients need 160 bytes each, 20 MB, and the threads of each part have enough to do."""

Texture: TypeAlias = TiledField | PatchBlend | WangField | WangTorus | LiddedField
"""A field over the plane that repeats, or that is laid of tiles, in its own unit of length."""


class TexturedBlade:
    r"""A texture F on a blade; G > 0 is leaf.

    .. math:: G(x) = F(T^*(x)), \qquad T^*(x) = (y_1,\, y_2,\, y_3 - H(y_1, y_2)), \quad y = T(x)

    In flat coordinates z = T*(x) the surface is F(z) = 0; the metric of the world comes in by the Jacobian of the
    lift X(z).

    Attributes
    ----------
    texture : TiledField, PatchBlend, WangField, WangTorus or LiddedField
    blade : Blade
    scale : float
        Factor from the blade's unit to the texture's.
    tiles : dict
        Tiles that were polygonized before there was a blade, each to be taken once.
    """

    def __init__(self, texture: Texture, blade: Blade) -> None:
        """Put the texture on the blade.

        Raises
        ------
        UnitError
            If only one of texture and blade has a unit.
        """
        self.texture, self.blade = texture, blade
        self.scale = unit_scale(blade.unit, texture.unit)
        self.tiles: TilesAhead = {}

    @property
    def unit(self) -> str | None:
        """Unit of length of world points: the scan's."""
        return self.blade.unit

    @property
    def cuts_edges(self) -> bool:
        """Whether triangles are cut along the outline; else open meshes keep whole cells, as the paper's do."""
        return self.blade.open_edges == "cut"

    def edge_curve(self, *, closed: bool) -> shapely.Polygon:
        """Return the curve in the plane (along, across) that an open or a closed surface of the leaf ends on."""
        outline = self.blade.outline
        return outline.rounded if closed or self.cuts_edges else outline.polygon

    @property
    def heights(self) -> FloatArray:
        """(2,) heights of the bottom and the top of the texture's patch, in `unit`."""
        return np.asarray(self.texture.cell[:, 2] / self.scale)

    @property
    def thickness(self) -> float:
        """Height of the texture's patch where it is highest, in `unit`: the length that all others are measured by."""
        return float(np.ptp(self.texture.cell[:, 2]) / self.scale * self.blade.most_thickness)

    @property
    def tile_rows(self) -> range:
        """Numbers of the tiles along that the outline reaches into."""
        reach = (self.blade.outline.bounds[:, 0] * self.scale - self.texture.cell[0, 0]) / self.texture.period[0]
        return range(int(np.floor(reach[0])), int(np.ceil(reach[1])) + 1)

    @property
    def is_one_tile(self) -> bool:
        """True where all tiles over the blade are alike, False where several patches are blended along it, or laid."""
        return len({self.texture.tile_key(p) for p in self.tile_rows}) == 1

    @property
    def period(self) -> Period:
        """The period of the texture, all its hairs there."""
        return period_of(self.texture.base if isinstance(self.texture, LiddedField) else self.texture)

    @property
    def periods(self) -> tuple["TexturedBlade", ...]:
        """The periods of the texture on the blade: with all its hairs and, if a map removes some, with none."""
        fields = [self.period.field, *([self.texture.bare] if isinstance(self.texture, ThinnedField) else [])]
        return tuple(TexturedBlade(field, self.blade) for field in fields)

    @cached_property
    def hairs(self) -> LaidHairs:
        """The hairs over the plane, in the texture's unit: where which of the `periods` is seen."""
        if isinstance(self.texture, ThinnedField):
            return self.texture.hairs
        period = self.period
        return LaidHairs.all_kept(period.corner, period.tile, period.kinds)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) a box of the world that contains the leaf, outline and micro-structure."""
        low, high = self.heights
        first, last = self.blade.outline.bounds
        along, across = np.linspace(first[0], last[0], 512), np.linspace(first[1], last[1], 32)
        flat = np.stack(np.meshgrid(along, across, [low, high], indexing="ij"), axis=-1).reshape(-1, 3)
        world = self.blade.lift(flat)
        slack = np.linalg.norm(np.diff(world.reshape(512, -1, 3), axis=0), axis=2).max()
        return np.array([world.min(axis=0) - slack, world.max(axis=0) + slack])

    def __call__(self, x: npt.ArrayLike) -> FloatArray:
        """Return G(x) at (n, 3) world points, in the unit of CT intensity; < 0 outside."""
        points = as_points(x, "x", dim=3)
        values = np.empty(len(points))
        for first, last in blocks(len(points), BATCH_SIZE):
            values[first:last] = self.values(self.blade.flatten(points[first:last]))
        return values

    def gradient(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) analytic gradient of G at world points, through weights, fits, tiling, H and frame."""
        points = as_points(x, "x", dim=3)
        gradients = np.empty_like(points)
        for first, last in blocks(len(points), BATCH_SIZE):
            flat = self.blade.flatten(points[first:last])
            inner = self.texture.gradient(flat * self.scale) * self.scale
            gradients[first:last] = self.blade.pull_back(flat, inner, points[first:last])
        return gradients

    def values(self, flat: FloatArray) -> FloatArray:
        """Return F at (n, 3) flat coordinates, in `unit`."""
        return self.texture(flat * self.scale)

    def jets(self, flat: FloatArray, level: int) -> tuple[FloatArray, ...]:
        """Return F and its derivatives to order `level` at (n, 3) flat coordinates, in `unit`."""
        jets = self.texture.jets(flat * self.scale, level)
        return tuple(part * self.scale**order if order else part for order, part in enumerate(jets))

    def values_and_gradients(self, flat: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return F and its gradients at (n, 3) flat coordinates, in `unit`."""
        values, gradients = self.jets(flat, 1)
        return values, gradients

    def newton_steps(self, flat: FloatArray, values: FloatArray, gradients: FloatArray, max_step: float) -> FloatArray:
        """Return Newton's steps in z towards F = 0 in the metric of the world, none longer than `max_step` there."""
        return self.blade.lift_with_jacobian(flat).newton_steps(values, gradients, max_step)
