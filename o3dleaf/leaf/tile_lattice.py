"""The lattices on which the texture of a blade is sampled, which divide its period, and the tiles made on them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from o3dleaf.core.checks import FloatArray, require_positive
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.leaf.instancing.sets.mixed_tile import MixedSet
from o3dleaf.leaf.instancing.sets.tile_set import MatchingBorders, TileSet, split_torus
from o3dleaf.leaf.instancing.tile import Tile, TileLattice, extract_tile, require_columns
from o3dleaf.leaf.texture.corners import CORNERS, KINDS, TORUS, Coloring, torus_color
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.wang import WangField
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
    (nx, ny, nz), (x, y, z) = lattice.shape, lattice.origin
    along, across = (-(-MIN_CELLS // count) if together else 1 for count in (nx, ny))
    if leaf.is_one_tile:
        return TileLattice(lattice.origin, lattice.spacing, (nx * along, ny * across, nz))
    rows = leaf.tile_rows
    origin = x + rows[0] * float(lattice.period[0]), y, z
    return TileLattice(origin, lattice.spacing, (nx * len(rows), ny * across, nz))


def extract_tiles(leaf: TexturedBlade, spacing: float, method: int, *, together: bool) -> tuple[Tile, TileSet, int]:
    """Polygonize what is set down over a blade: return all of it, as tiles, and how many copies of a period that is.

    Wang tiles are polygonized on a torus on which each of them lies once, so that what hangs together hangs together
    over their borders, and then parted. Where hairs are removed by a map, all of them are in the tiles, and none in as
    many others.
    """
    texture = leaf.texture
    if isinstance(texture, ThinnedField):
        return _thinned_tiles(texture, leaf, spacing, method)
    if isinstance(texture, WangField):
        whole, tiles = _wang_tiles(texture.torus, texture, leaf.scale, spacing, method)
        return whole, tiles, 1
    lattice = leaf_lattice(leaf, spacing, together=together)
    one = tile_lattice(texture, leaf.scale, spacing) if leaf.is_one_tile else lattice
    tile = extract_tile(leaf.values, lattice, method, sharpen=one.shape[:2])
    return tile, TileSet.of(tile), lattice.shape[0] * lattice.shape[1] // (one.shape[0] * one.shape[1])


def _wang_tiles(
    torus: LayerField, texture: WangField, scale: float, spacing: float, method: int
) -> tuple[Tile, TileSet]:
    """Polygonize a torus with the tiles of a texture; return it, and the tiles as the texture lays them."""
    one = tile_lattice(texture, scale, spacing)
    (nx, ny, nz), (p, q) = one.shape, TORUS.shape
    require_columns(float(nx * ny * KINDS), spacing)
    lattice = replace(one, shape=(nx * p, ny * q, nz))
    borders = MatchingBorders((nx, ny), nz, TORUS)
    whole = extract_tile(PeriodIn(torus, scale), lattice, method, sharpen=lattice.shape[:2], alike=borders)
    parts = split_torus(whole, (nx, ny))
    on_torus = _kind_by(torus_color)
    kinds = {on_torus(place): part for place, part in parts.items()}
    return whole, TileSet(tuple(kinds[kind] for kind in range(KINDS)), _kind_by(texture.local.color))


def _thinned_tiles(
    texture: ThinnedField, leaf: TexturedBlade, spacing: float, method: int
) -> tuple[Tile, TileSet, int]:
    """Polygonize the tiles with all hairs and with none, or, where cells are larger than hairs are apart, the plane."""
    base, bare, scale = texture.texture, texture.bare, leaf.scale
    lattice = tile_lattice(base, scale, spacing)
    if np.any(np.array(lattice.spacing[:2]) * scale > texture.finest * (1 + 1e-9)):
        return _plane(leaf, lattice, method)
    if isinstance(base, WangField):
        whole, full = _wang_tiles(base.torus, base, scale, spacing, method)
        others = _wang_tiles(bare, base, scale, spacing, method)[1]
    else:
        period = lattice.shape[:2]
        whole, other = (extract_tile(PeriodIn(each, scale), lattice, method, sharpen=period) for each in (base, bare))
        full, others = TileSet.of(whole), TileSet.of(other)
    shape = lattice.shape[0], lattice.shape[1]
    # Where all hairs of a tile are removed follows from the tile, as its neighbors' lids beside its borders do.
    places = [(int(p), int(q)) for p, q in leaf.period.places]
    most = [bare.hairs.low_cells(place, shape) for place in places]

    @lru_cache(PLACES)
    def cells(place: tuple[int, int]) -> tuple[BoolArray, BoolArray]:
        return texture.hairs.low_cells(place, shape), most[full.kind(place)]

    return whole, MixedSet((*full.tiles, *others.tiles), full.kind, cells), 1


def _plane(leaf: TexturedBlade, lattice: TileLattice, method: int) -> tuple[Tile, TileSet, int]:
    """Polygonize all of the plane that the blade covers, as one tile."""
    first, last = np.floor((leaf.blade.outline.bounds - lattice.origin[:2]) / lattice.period).astype(np.int64)
    first, count = first - 1, last - first + 3
    x, y = np.array(lattice.origin[:2]) + first * lattice.period
    nx, ny, nz = lattice.shape
    whole = replace(
        lattice, origin=(float(x), float(y), lattice.origin[2]), shape=(nx * int(count[0]), ny * int(count[1]), nz)
    )
    tile = extract_tile(leaf.values, whole, method, sharpen=whole.shape[:2])
    return tile, TileSet.of(tile), 1


@dataclass(frozen=True)
class PeriodIn:
    """A field in lengths of `scale` of its unit each."""

    field: Callable[[FloatArray], FloatArray]
    scale: float

    def __call__(self, flat: FloatArray) -> FloatArray:
        """Return the (n,) values at (n, 3) points."""
        return self.field(flat * self.scale)


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
