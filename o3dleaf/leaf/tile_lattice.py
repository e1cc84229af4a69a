"""The lattices on which the texture of a blade is sampled, which divide its period, and the tiles made on them."""

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import O3DLeafError, ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.extraction.tile_cost import require_columns
from o3dleaf.leaf.instancing.sets.mixed_tile import MixedSet
from o3dleaf.leaf.instancing.sets.tile_set import MatchingBorders, Tiles, TilesAhead, TileSet, split_torus
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.corners import CORNERS, KINDS, TORUS, Coloring, torus_color
from o3dleaf.leaf.texture.wang.wang_field import WangField
from o3dleaf.leaf.textured_blade import Texture, TexturedBlade

LAYERS = 16
"""Least number of lattice layers through the patch: a blade thinner than the spacing keeps both faces."""

PROBES = 48
"""Places along each axis at which the bottom and the top of a patch are looked at."""

PLACES = 1 << 10
"""Places whose cells are remembered: a row of them is asked for at a time, and those beside it."""

MIN_CELLS = 64
"""Cells along each axis of what is set down together."""


def leaf_lattice(leaf: TexturedBlade, spacing: float, *, together: bool = False) -> TileLattice:
    """Return the lattice of what is set down over a blade: a tile, some of them, or one row of tiles along all of it.

    `together`, small tiles are set down as one, as each place costs time too. Where several patches are blended along
    the blade, the row repeats across only, and memory grows with its length.
    """
    lattice = tile_lattice(leaf.texture, leaf.scale, spacing)
    if leaf.is_one_tile:
        return _repeated(lattice, together=together)
    (nx, ny, nz), (x, y, z), rows = lattice.shape, lattice.origin, leaf.tile_rows
    origin = x + rows[0] * float(lattice.period[0]), y, z
    return TileLattice(origin, lattice.spacing, (nx * len(rows), ny * _copies(ny, together=together), nz))


def _repeated(lattice: TileLattice, *, together: bool) -> TileLattice:
    """Return the lattice of one period, or of some together."""
    nx, ny, nz = lattice.shape
    along, across = (_copies(count, together=together) for count in (nx, ny))
    return replace(lattice, shape=(nx * along, ny * across, nz))


def _copies(steps: int, *, together: bool) -> int:
    return -(-MIN_CELLS // steps) if together else 1


@dataclass(frozen=True)
class ScaledField:
    """A field in lengths of `scale` of its unit each: its values at z are those at `scale` z."""

    field: Callable[[FloatArray], FloatArray]
    scale: float

    def __call__(self, flat: FloatArray) -> FloatArray:
        """Return the (n,) values at (n, 3) points."""
        return self.field(flat * self.scale)


@dataclass(frozen=True)
class PeriodOf:
    """A texture in lengths of `scale` of its unit each; of Wang tiles the torus on which each of them lies once.

    All hairs are there, whatever a map says.

    Attributes
    ----------
    texture : TiledField, PatchBlend, WangField, ThinnedField, or a function that returns one
    scale : float
    """

    texture: Texture | Callable[[], Texture]
    scale: float

    @property
    def periodic(self) -> Texture:
        """The periodic part of the texture."""
        texture = self.texture if isinstance(self.texture, Texture) else self.texture()
        if isinstance(texture, ThinnedField):
            texture = texture.texture
        return texture.torus if isinstance(texture, WangField) else texture

    def __call__(self, flat: FloatArray) -> FloatArray:
        """Return the (n,) values at (n, 3) points."""
        return ScaledField(self.periodic, self.scale)(flat)


def extract_tiles(leaf: TexturedBlade, spacing: float, method: int, *, together: bool) -> Tiles:
    """Polygonize what is set down over a blade, or take what was made ahead of it.

    Where hairs are removed by a map, all of them are in the tiles, and none in as many others.
    """
    if isinstance(leaf.texture, ThinnedField):
        lattice = tile_lattice(leaf.texture, leaf.scale, spacing)
        return _thinned_tiles(leaf.texture, leaf, lattice, method, together=together)
    tiles = leaf.tiles.pop((spacing, method, together), None)
    tiles = tiles or _tiles_of(leaf.texture, leaf.scale, spacing, method, together=together)
    if tiles is None:
        lattice = leaf_lattice(leaf, spacing, together=together)
        one = tile_lattice(leaf.texture, leaf.scale, spacing) if leaf.is_one_tile else lattice
        tiles = _tiles_on(leaf.values, lattice, one, method)
    return tiles


def refine_tiles(leaf: TexturedBlade, tiles: TileSet, ratio: int, box: IntArray) -> TileSet:
    """Polygonize again what `extract_tiles` did, on a lattice of `ratio` times as many steps along every axis.

    They are for the columns of a `box` (2, 2) of it: where the plane is polygonized at once, all of it is not.
    """
    (nx, ny, nz), steps = tiles.lattice.shape, np.array(tiles.lattice.spacing) / ratio
    shape = nx * ratio, ny * ratio, (nz - 1) * ratio + 1
    lattice, method = TileLattice(tiles.lattice.origin, tuple(steps.tolist()), shape), tiles.tiles[0].method
    if isinstance(leaf.texture, ThinnedField):
        bounds = np.array(lattice.origin[:2]) + box * np.array(lattice.spacing[:2])
        return _thinned_tiles(leaf.texture, leaf, lattice, method, together=False, bounds=bounds).parts
    if isinstance(leaf.texture, WangField):
        return _wang_tiles(leaf.texture.torus, leaf.texture, leaf.scale, lattice, method).parts
    return _tiles_on(leaf.values, lattice, lattice, method).parts


def extract_tiles_ahead(texture: Texture, unit: str | None, wanted: Iterable[tuple[float, int, bool]]) -> TilesAhead:
    """Polygonize what will be set down over a blade in a unit, as far as it does not depend on the blade.

    What is refused is left out: who asks for it later hears why.
    """
    made: TilesAhead = {}
    for spacing, method, together in wanted:
        with suppress(O3DLeafError):
            tiles = _tiles_of(texture, unit_scale(unit, texture.unit), spacing, method, together=together)
            if tiles is not None:
                made[spacing, method, together] = tiles
    return made


def _tiles_of(texture: Texture, scale: float, spacing: float, method: int, *, together: bool) -> Tiles | None:
    """Return the tiles of a texture that is the same over every blade, else None."""
    if isinstance(texture, TiledField):
        one = tile_lattice(texture, scale, spacing)
        return _tiles_on(ScaledField(texture, scale), _repeated(one, together=together), one, method)
    if isinstance(texture, WangField):
        return _wang_tiles(texture.torus, texture, scale, tile_lattice(texture, scale, spacing), method)
    return None


def _tiles_on(values: Callable[[FloatArray], FloatArray], lattice: TileLattice, one: TileLattice, method: int) -> Tiles:
    """Return the tile on a lattice, of a field that repeats after the steps of another one."""
    tile = extract_tile(values, lattice, method, sharpen=one.shape[:2])
    return Tiles(tile, TileSet.of(tile), lattice.shape[0] * lattice.shape[1] // (one.shape[0] * one.shape[1]))


def _wang_tiles(torus: LayerField, texture: WangField, scale: float, one: TileLattice, method: int) -> Tiles:
    """Polygonize a torus with the tiles of a texture, and part it into them.

    On it each of them lies once, so that what hangs together hangs together over their borders.
    """
    (nx, ny, nz), (p, q) = one.shape, TORUS.shape
    require_columns(float(nx * ny * KINDS), max(one.spacing[:2]))
    lattice = replace(one, shape=(nx * p, ny * q, nz))
    borders = MatchingBorders((nx, ny), nz, TORUS)
    whole = extract_tile(ScaledField(torus, scale), lattice, method, sharpen=lattice.shape[:2], alike=borders)
    parts = split_torus(whole, (nx, ny))
    on_torus = _kind_by(torus_color)
    kinds = {on_torus(place): part for place, part in parts.items()}
    return Tiles(whole, TileSet(tuple(kinds[kind] for kind in range(KINDS)), _kind_by(texture.local.color)), 1)


def _thinned_tiles(
    texture: ThinnedField,
    leaf: TexturedBlade,
    lattice: TileLattice,
    method: int,
    *,
    together: bool,
    bounds: FloatArray | None = None,
) -> Tiles:
    """Polygonize the tiles with all hairs and with none, or, where cells are larger than hairs are apart, the plane."""
    base, bare, scale = texture.texture, texture.bare, leaf.scale
    if np.any(np.array(lattice.spacing[:2]) * scale > texture.finest * (1 + 1e-9)):
        return extract_plane(leaf, lattice, method, together=together, bounds=bounds)
    if isinstance(base, WangField):
        full, others = (_wang_tiles(each, base, scale, lattice, method) for each in (base.torus, bare))
    else:
        full, others = (_tiles_on(ScaledField(each, scale), lattice, lattice, method) for each in (base, bare))
    shape = lattice.shape[0], lattice.shape[1]
    # Where all hairs of a tile are removed follows from the tile, as its neighbors' lids beside its borders do.
    places = [(int(p), int(q)) for p, q in leaf.period.places]
    most = [bare.hairs.low_cells(place, shape) for place in places]

    @lru_cache(PLACES)
    def cells(place: tuple[int, int]) -> tuple[BoolArray, BoolArray]:
        return texture.hairs.low_cells(place, shape), most[full.parts.kind(place)]

    mixed = MixedSet((*full.parts.tiles, *others.parts.tiles), full.parts.kind, cells)
    return Tiles(full.whole, mixed, 1, others.whole)


def extract_plane(
    leaf: TexturedBlade,
    lattice: TileLattice,
    method: int,
    *,
    together: bool = True,
    bounds: FloatArray | None = None,
) -> Tiles:
    """Polygonize the plane within `bounds` (2, 2), by default those of the blade, and a tile around them.

    It is set down as one tile, or as one for each place.
    """
    area = leaf.blade.outline.bounds if bounds is None else bounds
    first, last = np.floor((area - lattice.origin[:2]) / lattice.period).astype(np.int64)
    first, count = first - 1, last - first + 3
    x, y = np.array(lattice.origin[:2]) + first * lattice.period
    nx, ny, nz = lattice.shape
    whole = replace(
        lattice, origin=(float(x), float(y), lattice.origin[2]), shape=(nx * int(count[0]), ny * int(count[1]), nz)
    )
    tile = extract_tile(leaf.values, whole, method, sharpen=whole.shape[:2])
    if together:
        return Tiles(tile, TileSet.of(tile), 1)
    parts = {place: replace(part, lattice=lattice) for place, part in split_torus(tile, (nx, ny)).items()}
    number = {place: row for row, place in enumerate(parts)}

    def kind(place: tuple[int, int]) -> int:
        # What lies beyond the plane is outside of every outline.
        p, q = ((np.array(place) - first) % count).tolist()
        return number[p, q]

    return Tiles(tile, TileSet(tuple(parts.values()), kind), 1)


def _kind_by(color: Coloring) -> Callable[[tuple[int, int]], int]:
    """Return the function that tells which Wang tile lies in one place; the color of a corner is asked for once."""

    @cache
    def corner(i: int, j: int) -> int:
        return int(color(np.array(i), np.array(j)))

    return lambda place: sum(corner(place[0] + a, place[1] + b) << bit for bit, (a, b) in enumerate(CORNERS))


def tile_lattice(texture: Texture, scale: float, spacing: float) -> TileLattice:
    """Return the lattice of one period: steps in the plane divide it, layers are a whole fraction of the step.

    The texture lies within the layers but for the first and the last one.

    Raises
    ------
    ReconstructionError
        If the bottom or the top of the patch is solid for the most part: a hair may be cut there, the blade may not.
    MemoryBudgetError
        If the spacing is so small that one tile does not fit into memory.
    """
    step = require_positive(spacing, "spacing")
    with np.errstate(over="ignore", divide="ignore"):
        require_columns(float(np.prod(texture.period / scale / step)), step)
    _require_air(texture)
    low, high = texture.cell[:, 2] / scale
    layer = step / np.ceil(step * LAYERS / (high - low))
    first, last = np.floor(low / layer + 1e-9) - 1, np.ceil(high / layer - 1e-9) + 1
    period = texture.period / scale
    count = np.maximum(np.round(period / step), 1).astype(int)
    origin = *(texture.cell[0, :2] / scale).tolist(), float(first * layer)
    return TileLattice(origin, (*(period / count).tolist(), float(layer)), (*count.tolist(), int(last - first) + 1))


def _require_air(texture: Texture) -> None:
    """Raise `ReconstructionError` where the blade itself is cut by the bottom or the top of its patch."""
    places = (np.arange(PROBES) + 0.5) / PROBES
    plane = np.stack(np.meshgrid(places, places, indexing="ij"), axis=-1).reshape(-1, 2) * texture.period
    for height in texture.cell[:, 2]:
        points = np.column_stack([texture.cell[0, :2] + plane, np.full(len(plane), height)])
        if np.mean(texture(points) > 0) > 0.5:
            raise ReconstructionError(
                "the surface is not two sheets (upper and lower side): the texture has no air above or below; "
                "use another threshold or a taller patch"
            )
