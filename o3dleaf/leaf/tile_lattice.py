"""The lattices on which the texture of a blade is sampled, which divide its period, and the tiles made on them."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from o3dleaf.core.checks import require_positive
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.leaf.instancing.tile import Tile, TileLattice, extract_tile, require_columns
from o3dleaf.leaf.instancing.tile_set import MatchingBorders, TileSet, split_torus
from o3dleaf.leaf.texture.corners import CORNERS, KINDS, TORUS, Coloring, torus_color
from o3dleaf.leaf.texture.wang import WangField, WangTorus
from o3dleaf.leaf.textured_blade import Texture, TexturedBlade

LAYERS = 16
"""Least number of lattice layers through the patch: a blade thinner than the spacing keeps both faces."""

PROBES = 48
"""Places along each axis at which the bottom and the top of a patch are looked at."""

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
    over their borders, and then parted.
    """
    texture = leaf.texture
    if not isinstance(texture, WangField):
        lattice = leaf_lattice(leaf, spacing, together=together)
        one = tile_lattice(texture, leaf.scale, spacing) if leaf.is_one_tile else lattice
        tile = extract_tile(leaf.values, lattice, method, sharpen=one.shape[:2])
        return tile, TileSet.of(tile), lattice.shape[0] * lattice.shape[1] // (one.shape[0] * one.shape[1])
    one = tile_lattice(texture, leaf.scale, spacing)
    (nx, ny, nz), (p, q) = one.shape, TORUS.shape
    require_columns(float(nx * ny * KINDS), spacing)
    lattice = replace(one, shape=(nx * p, ny * q, nz))
    borders, scale, torus = MatchingBorders((nx, ny), nz, TORUS), leaf.scale, texture.torus
    whole = extract_tile(lambda flat: torus(flat * scale), lattice, method, sharpen=lattice.shape[:2], alike=borders)
    parts = split_torus(whole, (nx, ny))
    on_torus = _kind_by(torus_color)
    kinds = {on_torus(place): part for place, part in parts.items()}
    return whole, TileSet(tuple(kinds[kind] for kind in range(KINDS)), _kind_by(texture.local.color)), 1


def _kind_by(color: Coloring) -> Callable[[tuple[int, int]], int]:
    """Return the function that tells which Wang tile lies in one place; the color of a corner is asked for once."""

    @cache
    def corner(i: int, j: int) -> int:
        return int(color(np.array(i), np.array(j)))

    return lambda place: sum(corner(place[0] + a, place[1] + b) << bit for bit, (a, b) in enumerate(CORNERS))


def tile_lattice(texture: Texture | WangTorus, scale: float, spacing: float) -> TileLattice:
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


def _require_air(texture: Texture | WangTorus) -> None:
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
