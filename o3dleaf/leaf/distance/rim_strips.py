"""The rim of the leaf: where the outline cuts it, a band of short flat strips, straight along up."""

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.blade.outline_area import sides_of
from o3dleaf.leaf.distance.boxes import grow_tree
from o3dleaf.leaf.distance.roots import MAX_STEPS, STEPS, find_roots
from o3dleaf.leaf.distance.solid import LeafSolid
from o3dleaf.leaf.distance.strip_loops import Strips
from o3dleaf.leaf.textured_blade import TexturedBlade

BLOCK = 1 << 5
"""Pieces of the rim that a thread looks at together: half a megabyte."""


def rim_pieces(polygon: shapely.Polygon, step: float) -> tuple[FloatArray, FloatArray]:
    """Return the middles (n, 2) and half edges (n, 2) of equal pieces, at most `step` long, of all its rings."""
    sides = sides_of(polygon)
    starts, edges = sides[:, :2], sides[:, 2:] - sides[:, :2]
    counts = np.maximum(np.ceil(np.linalg.norm(edges, axis=1) / step), 1).astype(np.int64)
    number = np.repeat(np.arange(len(edges)), counts)
    within = np.arange(len(number)) - np.repeat(np.cumsum(counts) - counts, counts)
    half = edges[number] / (2 * counts[number, np.newaxis])
    return starts[number] + (2 * within[:, np.newaxis] + 1) * half, half


def rim_strips(leaf: TexturedBlade, solid: LeafSolid, step: float) -> tuple[Strips, npt.NDArray[np.float32]]:
    """Return the strips of the rim and the tree over them."""
    middles, halves = rim_pieces(solid.outline, step)
    parts: list[Strips] = [None] * -(-len(middles) // BLOCK)  # type: ignore[list-item]

    def task(start: int, stop: int) -> None:
        parts[start // BLOCK] = _strips(leaf, solid, middles[start:stop], halves[start:stop], step)

    run_blocks(task, len(middles), BLOCK)
    strips = Strips(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def hulls(start: int, stop: int) -> tuple[FloatArray, FloatArray]:
        centers, edges, ups, ends = (part[start:stop].astype(np.float64) for part in strips)
        tips = [centers + s * edges + ends[:, k : k + 1] * ups for s in (-1, 1) for k in (0, 1)]
        return np.stack(tips, axis=1), np.stack([edges, ups, np.cross(edges, ups)], axis=1)

    return strips, grow_tree(len(strips.centers), hulls)


def _strips(leaf: TexturedBlade, solid: LeafSolid, middles: FloatArray, halves: FloatArray, step: float) -> Strips:
    """Return the strips over some pieces of the rim: one for each interval of heights that lies in the leaf."""
    low, high = leaf.heights
    heights = np.linspace(low - step, high + step, int(np.ceil((high - low) / step)) + 3)

    def field(piece: IntArray, z: FloatArray) -> FloatArray:
        return solid.values(leaf, np.column_stack([middles[piece], z]))

    count = len(heights)
    values = field(np.repeat(np.arange(len(middles)), count), np.tile(heights, len(middles))).reshape(-1, count)
    values[:, [0, -1]] = np.minimum(values[:, [0, -1]], -1e-300)
    piece, layer = np.nonzero((values[:, :-1] > 0) != (values[:, 1:] > 0))
    bracket = heights[layer], heights[layer + 1], values[piece, layer], values[piece, layer + 1]
    # Under lids the field bends.
    most = MAX_STEPS if leaf.hairs.removed.any() else STEPS
    ends = find_roots(lambda rows, z: field(piece[rows], z), *bracket, most=most).reshape(-1, 2)
    middle = piece[::2]
    lifted = leaf.blade.lift_with_jacobian(np.column_stack([middles[middle], np.zeros(len(middle))]))
    along, across = halves[middle, :1], halves[middle, 1:]
    edges = along * lifted.columns[:, 0] + across * lifted.columns[:, 1]
    # Heights of the strips are those of the world.
    thickness = np.linalg.norm(lifted.columns[:, 2], axis=1, keepdims=True)
    ups, ends = lifted.columns[:, 2] / thickness, ends * thickness
    return Strips(lifted.world, *(part.astype(np.float32) for part in (edges, ups, ends)))
