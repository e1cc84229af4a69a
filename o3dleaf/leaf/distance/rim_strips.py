"""The rim of the leaf: where the outline cuts it, a band of short flat strips, straight along up."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.distance.boxes import grow_tree
from o3dleaf.leaf.distance.projection import lift
from o3dleaf.leaf.distance.solid import Solid

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

BLOCK = 1 << 5
"""Pieces of the rim that a thread looks at together: half a megabyte."""
ROOT_STEPS = 4
"""Regula falsi steps towards the ends of a strip, from the neighbouring samples."""


def rim_pieces(polygon: shapely.Polygon, step: float) -> tuple[FloatArray, FloatArray]:
    """Return the middles (n, 2) and half edges (n, 2) of equal pieces of a polygon's edges, at most `step` long."""
    ring = shapely.get_coordinates(polygon.exterior)
    edges = np.diff(ring, axis=0)
    counts = np.maximum(np.ceil(np.linalg.norm(edges, axis=1) / step), 1).astype(np.int64)
    number = np.repeat(np.arange(len(edges)), counts)
    within = np.arange(len(number)) - np.repeat(np.cumsum(counts) - counts, counts)
    half = edges[number] / (2 * counts[number, np.newaxis])
    return ring[number] + (2 * within[:, np.newaxis] + 1) * half, half


def rim_strips(
    leaf: "MultiscaleLeaf", solid: Solid, step: float
) -> tuple[tuple[npt.NDArray[np.floating], ...], npt.NDArray[np.float32]]:
    """Return the rim's strips, as `search_loops.nearest_strips` wants them, and the tree over them."""
    middles, halves = rim_pieces(solid.outline, step)
    parts: list[tuple[npt.NDArray[np.floating], ...]] = [()] * -(-len(middles) // BLOCK)

    def task(start: int, stop: int) -> None:
        parts[start // BLOCK] = _strips(leaf, solid, middles[start:stop], halves[start:stop], step)

    run_blocks(task, len(middles), BLOCK)
    centres, edges, ups, ends = (np.concatenate(part) for part in zip(*parts, strict=True))

    def hulls(start: int, stop: int) -> tuple[FloatArray, FloatArray]:
        at, edge, up, z = (part[start:stop].astype(np.float64) for part in (centres, edges, ups, ends))
        tips = [at + s * edge + z[:, k : k + 1] * up for s in (-1, 1) for k in (0, 1)]
        return np.stack(tips, axis=1), np.stack([edge, up, np.cross(edge, up)], axis=1)

    return (centres, edges, ups, ends), grow_tree(len(centres), hulls)


def _strips(
    leaf: "MultiscaleLeaf", solid: Solid, middles: FloatArray, halves: FloatArray, step: float
) -> tuple[npt.NDArray[np.floating], ...]:
    """Return the strips over some pieces of the rim: one for each interval of heights that lies in the leaf."""
    low, high = leaf.texture.cell[:, 2] / leaf.scale
    heights = np.linspace(low - step, high + step, int(np.ceil((high - low) / step)) + 3)

    def field(piece: IntArray, z: FloatArray) -> FloatArray:
        return solid.values(leaf, np.column_stack([middles[piece], z]))

    count = len(heights)
    values = field(np.repeat(np.arange(len(middles)), count), np.tile(heights, len(middles))).reshape(-1, count)
    values[:, [0, -1]] = np.minimum(values[:, [0, -1]], -1e-300)
    piece, layer = np.nonzero((values[:, :-1] > 0) != (values[:, 1:] > 0))
    bracket = heights[layer], heights[layer + 1], values[piece, layer], values[piece, layer + 1]
    ends = _roots(lambda z: field(piece, z), *bracket).reshape(-1, 2)
    owner = piece[::2]
    at = lift(leaf.blade, np.column_stack([middles[owner], np.zeros(len(owner))]))
    along, across = halves[owner, :1], halves[owner, 1:]
    edges = along * at.columns[:, 0] + across * at.columns[:, 1]
    return at.world, edges.astype(np.float32), at.columns[:, 2].astype(np.float32), ends.astype(np.float32)


def _roots(
    field: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray, f_low: FloatArray, f_high: FloatArray
) -> FloatArray:
    """Return where a field changes its sign between `low` and `high`, by the Illinois variant of regula falsi."""
    a, b, fa, fb = low.copy(), high.copy(), f_low.copy(), f_high.copy()
    for _ in range(ROOT_STEPS):
        z = (a * fb - b * fa) / (fb - fa)
        f = field(z)
        crossed = (f > 0) != (fb > 0)
        a, fa = np.where(crossed, b, a), np.where(crossed, fb, fa / 2)
        b, fb = z, f
    return b
