"""Some balls of a lattice's cover, for what is chosen by a sample of them: the cover itself grows with the volume."""

from collections import Counter

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.even_sample import even_rows
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.rbf.tail import IntArray

TOGETHER = 1 << 16
"""Tiles, in whole layers of them, that are looked at together."""


def sample_balls(  # noqa: PLR0917 - the arguments of `VoxelCover.fit` and `reaching`, and a number
    shape: tuple[int, ...],
    steps: FloatArray,
    most: int,
    overlap: float,
    box: FloatArray,
    origin: FloatArray,
    number: int,
) -> tuple[VoxelCover, VoxelCover]:
    """Return `number` of the balls of `VoxelCover.fit` that reach into a box (2, d), evenly, and one of the usual kind.

    That is one of the class that most of them have, of equal ones the first. A few layers of tiles are held at once.
    """

    def part(first: int, layers: int) -> VoxelCover:
        cover = VoxelCover.fit(shape, steps, most, overlap, layers=slice(first, first + layers))
        return cover.reaching(box[0], box[1], origin)

    one = VoxelCover.fit(shape, steps, most, overlap, layers=slice(1))
    layers, thick = max(1, TOGETHER // len(one.starts)), int(one.tile[0])
    firsts = range(0, -(-shape[0] // thick), layers)
    sizes, totals, usual = list[int](), Counter[tuple[int, ...]](), dict[tuple[int, ...], IntArray]()
    for first in firsts:
        cover = part(first, layers)
        sizes.append(len(cover.starts))
        for key, balls in zip(map(tuple, cover.keys.tolist()), np.bincount(cover.classes), strict=True):
            totals[key] += int(balls)
        known = zip(map(tuple, cover.keys.tolist()), np.unique(cover.classes, return_index=True)[1], strict=True)
        usual = {key: cover.starts[[ball]] for key, ball in known} | usual
    ends = np.cumsum(sizes)
    chosen = even_rows(int(ends[-1]), number)
    places = np.searchsorted(ends, chosen, side="right")
    starts = [
        part(firsts[place], layers).starts[chosen[places == place] - (ends[place] - sizes[place])]
        for place in np.unique(places)
    ]
    commonest = min(totals, key=lambda key: (-totals[key], key))
    sample, single = (
        one.with_tiles(each, np.zeros(len(each), dtype=np.int64), np.zeros(len(each), dtype=bool))
        for each in (np.concatenate(starts), usual[commonest])
    )
    return sample, single
