"""The hairs of a texture: where they stand in its tiles, and the surface beneath them.

Nodes of a lattice lie over the tiles. A hair stands out of the blade and is short along it, where ridges run on. Under
a lid over the surface beneath, it is gone: the lid of a hair is low on the nodes of its zone, and so high on all others
that nothing reaches it; between them it is a cubic B-spline. Zones that are apart are removed independently of one
another.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.ndimage import binary_propagation, grey_opening, label, maximum_filter
from scipy.sparse.linalg import spsolve

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.texture.layer import LayerField
from o3dleaf.leaf.texture.period import period_of
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.corners import TORUS
from o3dleaf.leaf.texture.wang.quilt import REACH
from o3dleaf.leaf.texture.wang.wang_field import WangField

MAX_NODES = 1 << 17
"""Nodes over all tiles: with the layers that are looked at above them some millions of points."""
MIN_NODES = 8
"""Nodes along a tile."""
FINENESS = 2
"""Nodes, and layers, for each distance of the data: what is thinner is no data."""
PROMINENCE = 0.2
"""Of the blade's mean thickness: what stands out farther is a hair; pits and the land between them are shallower."""
MIN_PROMINENCE = 2.0
"""The same, of the distance of the data: what stands out less may be noise."""
MARGIN = 0.25
"""Of the distance of the data, between the surface and the lid over it: nodes do not know what lies between them."""
SHARED = REACH + 1
"""Nodes beside the border of a tile that its neighbors' lids depend on."""
MAX_COVERED = 0.5
"""Share of the nodes under hairs: where they are more there is no surface to be seen between them."""


@dataclass(frozen=True, eq=False)
class HairZones:
    """The zones of hairs in the tiles of a texture.

    Attributes
    ----------
    pieces : (t, n + 1, m + 1) ndarray of int64
        The part of a zone in each tile that each node belongs to, its far borders' too; −1: none. Zones go on in the
        neighbor where both have a node of the border in common.
    lids : (2, t, n, m) ndarray
        Heights of the floor and of the ceiling at each node where its hair is removed.
    open_lids : (2,) ndarray
        Heights of both where nothing is.
    """

    pieces: IntArray
    lids: FloatArray
    open_lids: FloatArray

    @classmethod
    def none(cls, tiles: int) -> "HairZones":
        """Return those of so many tiles without hairs."""
        return cls(np.full((tiles, 2, 2), -1), np.zeros((2, tiles, 1, 1)), np.zeros(2))

    @property
    def nodes(self) -> IntArray:
        """(2,) steps of the nodes in a tile."""
        return np.array(self.pieces.shape[1:]) - 1

    @property
    def count(self) -> int:
        """The most pieces in a tile."""
        return int(self.pieces.max()) + 1

    def pieces_at(self, tiles: IntArray, places: FloatArray) -> IntArray:
        """Return the pieces (n,) over places (n, 2) of tiles, 0 to 1 along each side, or a little beyond it."""
        # Whatever nodes a lid sees there, that on the border is of their piece.
        i, j = np.clip(np.floor(places * self.nodes).astype(np.int64), 0, self.nodes).T
        return np.asarray(self.pieces[tiles, i, j])

    @cached_property
    def low(self) -> BoolArray:
        """(t, n, m) nodes at which a lid is low where its hair is removed."""
        return np.asarray((self.lids != self.open_lids[:, np.newaxis, np.newaxis, np.newaxis]).any(axis=0))

    @cached_property
    def middles(self) -> tuple[FloatArray, FloatArray]:
        """Sums of the places of the nodes (t, k, 2) of each piece, in tiles, and their number (t, k)."""
        tiles, count = len(self.pieces), self.count
        sums, sizes = np.zeros((tiles, count, 2)), np.zeros((tiles, count))
        for tile, pieces in enumerate(self.pieces):
            places = np.argwhere(pieces >= 0)
            number = pieces[pieces >= 0]
            sizes[tile] = np.bincount(number, minlength=count)
            for axis in range(2):
                sums[tile, :, axis] = np.bincount(number, places[:, axis] / self.nodes[axis], minlength=count)
        return sums, sizes


def find_hairs(texture: TiledField | WangField, longest: float) -> HairZones:
    """Find the hairs of a texture, those that are up to `longest` long along it, in its unit.

    Raises
    ------
    InputError
        If they cover most of it.
    """
    period = period_of(texture)
    field, tiles = period.field, period.kinds.shape
    size = texture.period
    distance = field.data_distance
    step = max(distance / FINENESS, float(np.sqrt(size.prod() * tiles[0] * tiles[1] / MAX_NODES)))
    nodes = np.maximum(np.ceil(size / step), MIN_NODES).astype(np.int64)
    ticks = [texture.cell[0, axis] + size[axis] / nodes[axis] * np.arange(tiles[axis] * nodes[axis]) for axis in (0, 1)]
    plane = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1)
    low, high = texture.cell[:, 2].tolist()
    levels = np.linspace(low, high, int(np.ceil((high - low) * FINENESS / distance)) + 1)
    faces = np.stack([_first_inside(field, plane, each) for each in (levels, levels[::-1])])
    least = max(MIN_PROMINENCE * distance, PROMINENCE * float(np.mean(faces[1] - faces[0])))
    window = 2 * max(round(longest / (size[0] / nodes[0]) / 2), 1) + 1
    covered = _standing_out(-faces[0], window, least) | _standing_out(faces[1], window, least)
    covered = _widened(covered, 1)
    _share(covered, nodes, np.any)
    if covered.mean() > MAX_COVERED:
        raise InputError(
            "hairs: cover most of the patch, so that the surface between them is not seen; leave the map out"
        )
    zone = _widened(covered, REACH)
    _share(zone, nodes, np.any)
    open_lids = np.array([low - (high - low), high + (high - low)])
    lids = np.empty((2, *zone.shape))
    for side, sign in enumerate((-1.0, 1.0)):
        beneath = _filled(faces[side], covered) + sign * MARGIN * distance
        _share(beneath, nodes, np.mean)
        lids[side] = np.where(zone, beneath, open_lids[side])
    order = period.places.tolist()
    around = _widened(zone, REACH)
    pieces = (
        np.stack([label(_cut(around, nodes, place, 1), np.ones((3, 3)))[0] for place in order]).astype(np.int64) - 1
    )
    return HairZones(pieces, np.stack([np.stack([_cut(each, nodes, p, 0) for p in order]) for each in lids]), open_lids)


def _cut(nodes_of_torus: npt.NDArray[Any], nodes: IntArray, place: tuple[int, int], more: int) -> npt.NDArray[Any]:
    """Return the nodes of the tile in one place of a torus, and some of the next one."""
    starts = [place[axis] * nodes[axis] for axis in (0, 1)]
    ends = ((start, start + int(nodes[axis]) + more) for axis, start in enumerate(starts))
    return np.asarray(nodes_of_torus[_rows(nodes_of_torus, *ends)])


def _rows(nodes_of_torus: npt.NDArray[Any], *ends: tuple[int, int]) -> tuple[IntArray, ...]:
    return np.ix_(*(np.arange(*each) % count for each, count in zip(ends, nodes_of_torus.shape, strict=True)))


def _share(values: npt.NDArray[Any], nodes: IntArray, combine: Callable[..., Any]) -> None:
    """Give all borders of one kind, on a torus of Wang tiles, the same values beside them, and then all corners."""
    n, m = nodes.tolist()
    if values.shape == (n, m):
        return
    ends = TORUS + 2 * np.roll(TORUS, -1, axis=1), TORUS + 2 * np.roll(TORUS, -1, axis=0), TORUS
    beside = -SHARED, SHARED + 1
    for colors, (along, across) in zip(
        ends, ((beside, (0, m + 1)), ((0, n + 1), beside), (beside, beside)), strict=True
    ):
        for color in np.unique(colors):
            alike = [
                _rows(values, (p * n + along[0], p * n + along[1]), (q * m + across[0], q * m + across[1]))
                for p, q in np.argwhere(colors == color).tolist()
            ]
            common = combine(np.stack([values[rows] for rows in alike]), axis=0)
            for rows in alike:
                values[rows] = common


def _first_inside(field: LayerField, plane: FloatArray, levels: FloatArray) -> FloatArray:
    """Return the height over each place (n, m, 2) at which a field is first positive, on the way through levels.

    Where it is nowhere, the last level.
    """
    places = plane.reshape(-1, 2)
    heights, before = np.full(len(places), levels[-1]), np.full(len(places), -np.inf)
    rows = np.arange(len(places))
    for number, level in enumerate(levels):
        values = field(np.column_stack([places[rows], np.full(len(rows), level)]))
        inside = values > 0
        met = rows[inside]
        if number == 0:
            heights[met] = level
        else:
            share = values[inside] / (values[inside] - before[met])
            heights[met] = level - share * (level - levels[number - 1])
        before[rows] = values
        rows = rows[~inside]
        if not len(rows):
            break
    return heights.reshape(plane.shape[:2])


def _standing_out(heights: FloatArray, window: int, least: float) -> BoolArray:
    """Return the nodes at which what is shorter than a window along stands out, where it does so by `least`."""
    reach = window
    around = np.pad(heights, reach, mode="wrap")
    excess = around - grey_opening(around, size=(window, 1), mode="nearest")
    out = binary_propagation(excess > least, structure=np.ones((3, 3)), mask=excess > least / 2)
    return np.asarray(out[reach:-reach, reach:-reach])


def _widened(nodes: BoolArray, reach: int) -> BoolArray:
    """Return the nodes of a torus that are so many steps or fewer from those given."""
    return np.asarray(maximum_filter(nodes, size=2 * reach + 1, mode="wrap"))


def _filled(heights: FloatArray, covered: BoolArray) -> FloatArray:
    """Return heights over a torus, those that are covered being the mean of their neighbors'."""
    filled, count = heights.copy(), int(covered.sum())
    if not count:
        return filled
    number = np.full(heights.shape, -1)
    number[covered] = np.arange(count)
    given, rows, columns = np.zeros(count), [np.arange(count)], [np.arange(count)]
    for axis, step in product(range(2), (-1, 1)):
        beside = np.roll(number, step, axis)[covered]
        known = np.roll(heights, step, axis)[covered]
        given += np.where(beside < 0, known, 0.0)
        rows.append(np.flatnonzero(beside >= 0))
        columns.append(beside[beside >= 0])
    numbers = np.concatenate([np.full(count, 4.0), np.full(sum(map(len, rows[1:])), -1.0)])
    matrix = sparse.csc_matrix((numbers, (np.concatenate(rows), np.concatenate(columns))), shape=(count, count))
    filled[covered] = spsolve(matrix, given)
    return filled
