"""A set of Wang tiles cut out of patches: corners first, edges between corners, then what lies inside.

Every part is laid where what is there already differs least from it, and cut out along a least cut. A corner of the
plane has one of two colors, and each color a place of a patch; an edge has a place for each pair of corners; each tile
has an inside of its own. So what two tiles of a border have in common is a strip about it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.leaf.texture.crop import reach_of_fade
from o3dleaf.leaf.texture.seams import SampledPatch
from o3dleaf.leaf.texture.wang.corners import CORNERS, KINDS, corners_of
from o3dleaf.leaf.texture.wang.least_cut import least_cut
from o3dleaf.leaf.texture.wang.quilt import REACH, Quilt
from o3dleaf.leaf.texture.wang.spots import Spot, SpotSearch, sums_under

FINENESS = 3.0
"""Nodes in the reach of a cross-fade: weights reach two of them, the better half of it, and cuts find their way."""
MIN_NODES = 24
"""Nodes in a tile at least, of which strips about its borders take three on either side."""
MAX_NODES = 1 << 18
"""Nodes in a patch, some hundred megabytes with their spectra: 512 along either side, 170 and more in a tile."""
SHARE = 1 / 8
"""Of a tile, that the strip of a border reaches into it: wide enough for a cut, and all that tiles have in common."""
SIZES = (1 / 3, 1 / 2)
"""Least and largest tile, of its patch: sixteen insides need room to lie apart."""
INSIDE = 24
"""Label of the inside of tile 0; before it come those of corners (2 × 4) and of edges along and across (4 × 2 each)."""


@dataclass(eq=False)
class Quilting:
    """Patches sampled at nodes, and the tiles that are made of them so far.

    Attributes
    ----------
    patches : tuple of (n, m, l) ndarrays
        Values cut off near the surface, at nodes and heights.
    nodes : (2,) tuple of int
        In a tile, along and across.
    width : (2,) tuple of int
        Of a border's strip, in nodes on either side.
    variance : float
    random : numpy.random.Generator
        Draws the places that may be taken, so that seeds differ.
    spots : dict of Spot
        Node of a patch that lies at the tile's lower corner, by label.
    """

    patches: tuple[FloatArray, ...]
    nodes: tuple[int, int]
    width: tuple[int, int]
    variance: float
    random: np.random.Generator
    spots: dict[int, Spot] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._search = SpotSearch(self.patches, self.random)

    def run(self) -> IntArray:
        """Choose and cut all parts, and return the labels (16, n + 3, m + 3)."""
        self._choose_corners()
        strips = {axis: self._cut_edges(axis) for axis in range(2)}
        return self._cut_insides(strips)

    def content(self, label: int, i: IntArray, j: IntArray) -> FloatArray:
        """Return the values (..., l) that a label shows at nodes of its tile."""
        patch, i0, j0 = self.spots[label]
        values = self.patches[patch]
        # What a strip shows beyond its patch is never seen.
        return values[np.clip(i0 + i, 0, values.shape[0] - 1), np.clip(j0 + j, 0, values.shape[1] - 1)]

    def mismatch(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Return the mismatch at nodes of values (..., l) over that of any two points."""
        return np.asarray(((one - other) ** 2).mean(axis=-1) / (2 * self.variance))

    def _choose_corners(self) -> None:
        """Choose the places of both colors: where least differs from a mean section, and where the least from that."""
        reach = [2 * width + REACH for width in self.width]
        size = (2 * reach[0] + 1, 2 * reach[1] + 1)
        box = np.ones((*size, 1))
        plain = [
            sums_under(((patch - patch.mean(axis=0)) ** 2).sum(axis=2, keepdims=True), box) for patch in self.patches
        ]
        first = self._search.least(plain, [], 2)[0]
        values = self.patches[first.patch][first.i : first.i + size[0], first.j : first.j + size[1]]
        second = self._search.least(self._search.mismatches(values, np.ones(size, dtype=bool)), [first], 2)[0]
        for color, spot in enumerate((first, second)):
            for number, (a, b) in enumerate(CORNERS):
                i, j = spot.i + reach[0] - a * self.nodes[0], spot.j + reach[1] - b * self.nodes[1]
                self.spots[4 * color + number] = Spot(spot.patch, i, j)

    def _cut_edges(self, axis: int) -> dict[int, BoolArray]:
        """Choose and cut the strips of the four edges along an axis; return where they show the edge, not a corner.

        A strip has nodes from one corner to the other, and `width` on either side.
        """
        length, width, beside = self.nodes[axis], self.width[axis], self.width[1 - axis]
        u, v = np.meshgrid(np.arange(length + 1), np.arange(-beside - REACH, beside + REACH + 1), indexing="ij")
        near = np.minimum(u, length - u)
        in_strip = np.abs(v) <= beside
        overlap = in_strip & (near >= width) & (near <= 2 * width)
        keeps, takes = in_strip & (near <= width), in_strip & (near >= 2 * width)
        strips, taken = {}, list[Spot]()
        for pair in range(4):
            ends = [4 * color + (0, 1 + axis)[end] for end, color in enumerate((pair & 1, pair >> 1))]
            i, j = (u, v) if axis == 0 else (v, u)
            old = np.where(
                (u <= length // 2)[..., np.newaxis], self.content(ends[0], i, j), self.content(ends[1], i, j)
            )
            _, spot, shown = self._best(old, overlap, (keeps, takes, in_strip), taken, 4, axis)
            taken.append(spot)
            for side in range(2):
                at = [spot.i, spot.j]
                at[1 - axis] += beside + REACH - side * self.nodes[1 - axis]
                self.spots[8 + 8 * axis + 2 * pair + side] = Spot(spot.patch, *at)
            strips[pair] = shown[:, REACH:-REACH]
        return strips

    def _cut_insides(self, strips: dict[int, dict[int, BoolArray]]) -> IntArray:
        """Choose and cut the insides of all tiles, and return the labels of their nodes."""
        n, m = self.nodes
        i, j = np.meshgrid(np.arange(-1, n + 2), np.arange(-1, m + 2), indexing="ij")
        far = [np.minimum(i, n - i), np.minimum(j, m - j)]
        keeps = (far[0] <= 1) | (far[1] <= 1)
        takes = (far[0] > self.width[0]) & (far[1] > self.width[1])
        labels, taken = np.empty((KINDS, n + 3, m + 3), dtype=np.int64), list[Spot]()
        for kind in range(KINDS):
            frame = self._frame(kind, strips, i, j)
            old = np.zeros((*frame.shape, self.patches[0].shape[2]))
            for label in np.unique(frame[~takes]):
                at = (frame == label) & ~takes
                old[at] = self.content(int(label), i[at], j[at])
            # The rows of nodes around the tile are its neighbors'.
            core = np.s_[1:-1, 1:-1]
            masks = keeps[core], takes[core], np.ones((n + 1, m + 1), dtype=bool)
            _, spot, shown = self._best(old[core], ~takes[core], masks, taken, KINDS, 0)
            taken.append(spot)
            self.spots[INSIDE + kind] = spot
            labels[kind] = frame
            labels[kind][core][shown] = INSIDE + kind
        return labels

    def _frame(self, kind: int, strips: dict[int, dict[int, BoolArray]], i: IntArray, j: IntArray) -> IntArray:
        """Return the labels of corners and edges at the nodes of a tile and around it."""
        colors, at = corners_of(kind), (i, j)
        labels = np.full(i.shape, INSIDE + kind)
        for axis, side in product(range(2), range(2)):
            ends = [(end, side) if axis == 0 else (side, end) for end in range(2)]
            pair = colors[ends[0]] + 2 * colors[ends[1]]
            length, beside = self.nodes[axis], self.width[1 - axis]
            u, v = at[axis], at[1 - axis] - side * self.nodes[1 - axis]
            shown = strips[axis][pair][np.clip(u, 0, length), np.clip(v + beside, 0, 2 * beside)]
            corner = [4 * colors[end] + CORNERS.index(end) for end in ends]
            strip = np.where(u <= length // 2, *corner)
            strip[shown] = 8 + 8 * axis + 2 * pair + side
            labels = np.where(np.abs(v) <= beside, strip, labels)
        return labels

    def _best(
        self,
        old: FloatArray,
        overlap: BoolArray,
        masks: tuple[BoolArray, BoolArray, BoolArray],
        taken: Sequence[Spot],
        count: int,
        axis: int,
    ) -> tuple[float, Spot, BoolArray]:
        """Return cost, place and nodes of the part that is cut best into `old`, apart from those `taken` of `count`.

        `masks` are the nodes that keep what is there, those that take the part, and those where there is either.
        """
        turned = axis == 1
        values, mask = (old.swapaxes(0, 1), overlap.T) if turned else (old, overlap)
        keeps, takes, either = masks
        tries = []
        for spot in self._search.least(self._search.mismatches(values, mask), taken, count):
            size = mask.shape
            new = self.patches[spot.patch][spot.i : spot.i + size[0], spot.j : spot.j + size[1]]
            new = new.swapaxes(0, 1) if turned else new
            rows, columns = (slice(at.min(), at.max() + 1) for at in np.nonzero(either))
            part = (rows, columns)
            shown = np.zeros(either.shape, dtype=bool)
            cost = self.mismatch(old, new)
            shown[part], flow = least_cut(cost[part], keeps[part], takes[part])
            tries.append((flow, spot, shown))
        return min(tries, key=lambda each: each[:2])

    def energy(self, labels: IntArray) -> FloatArray:
        """Return the mean mismatch at links crossed along, at those crossed across, and at all."""
        n, m = self.nodes
        sums, counts = np.zeros(2), np.zeros(2)
        for kind, axis in product(range(KINDS), range(2)):
            one = labels[kind, 1 : n + 1, 1 : m + 1]
            other = labels[kind, 1 + (axis == 0) :, 1 + (axis == 1) :][:n, :m]
            i, j = np.nonzero(one != other)
            a, b = one[i, j], other[i, j]
            for pair in np.unique(np.stack([a, b], axis=1), axis=0):
                at = (a == pair[0]) & (b == pair[1])
                for step in range(2):
                    place = i[at] + step * (axis == 0), j[at] + step * (axis == 1)
                    contents = (self.content(int(label), *place) for label in pair)
                    sums[axis] += self.mismatch(*contents).sum() / 2
                counts[axis] += at.sum()
        along, across = sums / np.maximum(counts, 1)
        return np.array([along, across, sums.sum() / max(counts.sum(), 1)])


def make_quilt(fields: Sequence[PUInterpolant], tile: FloatArray | None, seed: int) -> Quilt:
    """Cut a set of tiles out of fitted patches; a tile that is not given has the size at which they match best.

    Raises
    ------
    InputError
        If a patch is constant, or has no room for the tiles.
    """
    first = SampledPatch.of(fields[0])
    extent = np.min([each.bounds[1, :2] - each.bounds[0, :2] for each in fields], axis=0)
    step = np.minimum(reach_of_fade(fields[0]) / FINENESS, extent * SIZES[0] / MIN_NODES)
    # Of a patch of many balls the nodes are coarser.
    area = max(float(np.prod(each.bounds[1, :2] - each.bounds[0, :2])) for each in fields)
    step = np.maximum(step, np.sqrt(area / MAX_NODES))
    if tile is not None:
        step = np.minimum(step, tile / MIN_NODES)
        if area / float(step[0]) / float(step[1]) > 2 * MAX_NODES:
            raise InputError(
                f"tile: {tile.tolist()} is too small a part of the patch, {extent.tolist()}; give a larger one"
            )
        step = tile / np.ceil(tile / step * (1 - 1e-12))
    else:
        step = extent / np.ceil(extent / step * (1 - 1e-12))
    patches = tuple(_sampled(first, each, step) for each in fields)
    if tile is None:
        nodes = [_best_size(patches[0], axis) for axis in range(2)]
        tile = np.asarray(step * nodes)
    else:
        nodes = [round(size) for size in tile / step]
    width = [max(round(SHARE * count), REACH + 1) for count in nodes]
    for patch in patches:
        if any(size < count + 2 * (REACH + 1) for size, count in zip(patch.shape[:2], nodes, strict=True)):
            raise InputError(
                f"tile: {tile.tolist()} leaves too little of the patch, {extent.tolist()}; give a smaller one"
            )
    parts = (nodes[0], nodes[1]), (width[0], width[1]), first.variance, np.random.default_rng(seed)
    quilting = Quilting(patches, *parts)
    labels = quilting.run()
    spots = [quilting.spots[label] for label in range(len(quilting.spots))]
    lows = [each.bounds[0, :2] for each in fields]
    corners = np.array([lows[spot.patch] + step * [spot.i, spot.j] for spot in spots])
    return Quilt(tile, labels, np.array([spot.patch for spot in spots]), corners, quilting.energy(labels))


def _sampled(first: SampledPatch, patch: PUInterpolant, step: FloatArray) -> FloatArray:
    """Return the values of a patch at its nodes, cut off as those of the first one."""
    low, high = patch.bounds[:, :2]
    ticks = [a + s * np.arange(int((b - a) / s + 1e-9) + 1) for a, b, s in zip(low, high, step, strict=True)]
    sampled = SampledPatch(patch, step, first.rest, first.cut_off, first.variance)
    return np.asarray(sampled.sections(np.minimum(ticks[0], high[0]), np.minimum(ticks[1], high[1]), 0))


def _best_size(patch: FloatArray, axis: int) -> int:
    """Return the nodes of a tile along an axis: the distance, within `SIZES`, at which a patch differs least for it."""
    values = patch.swapaxes(0, axis)
    least, most = (int(share * (len(values) - 1)) for share in SIZES)
    apart = range(max(least, MIN_NODES), max(most, MIN_NODES) + 1)
    return min(apart, key=lambda count: float(((values[count:] - values[:-count]) ** 2).mean()) / count)
