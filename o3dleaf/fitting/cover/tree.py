"""The tree of boxes over the balls: its top in one thread, the branches side by side."""

from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.resources.scratch import GrowingArray
from o3dleaf.fitting.cover import ball_loops
from o3dleaf.fitting.cover.ball_loops import BoxTree

TOP_DEPTH = 6
"""Levels of the top: as many as 64 branches."""
TOGETHER = 1 << 17
"""Balls of branches that are made before these are added, about: of all of them twice as much would be held."""
FEW = 1 << 12
"""Balls up to which all is made at once: to begin a branch and to add it takes a tenth of a millisecond."""
MAX_DEPTH = 54
"""Levels of a branch: coinciding balls are not told apart by more."""


def build_tree(centers: FloatArray, radii: FloatArray, bounds: FloatArray) -> BoxTree:
    """Halve the box `bounds` (2, d) until few of the balls (M, d), (M,) reach into each part."""
    if len(radii) <= FEW:
        depth = TOP_DEPTH + MAX_DEPTH
        return BoxTree(*ball_loops.build_tree(centers, radii, bounds[0], bounds[1], np.arange(len(radii)), depth))
    top: BoxTree = ball_loops.build_tree(centers, radii, bounds[0], bounds[1], np.arange(len(radii)), TOP_DEPTH)
    leaves, boxes = np.flatnonzero(top.axes < 0), _boxes(top, bounds)
    whole, roots = [GrowingArray(part.dtype) for part in top], list[list[Any]]()
    for growing, part in zip(whole[:5], top[:5], strict=True):
        growing.append(part)
    batch = np.cumsum((top.stops - top.starts)[leaves]) // TOGETHER
    for some in np.split(leaves, np.flatnonzero(np.diff(batch)) + 1):
        branches = [top] * len(some)

        def task(start: int, stop: int, some: npt.NDArray[np.int64] = some, branches: list[BoxTree] = branches) -> None:
            for number in range(start, stop):
                leaf = some[number]
                low, high = boxes[leaf]
                candidates = top.images[top.starts[leaf] : top.stops[leaf]]
                branches[number] = ball_loops.build_tree(centers, radii, low, high, candidates, MAX_DEPTH)

        run_blocks(task, len(branches), 1)
        roots += [_graft(branch, *whole) for branch in branches]
    tree = BoxTree(*(part.whole() for part in whole))
    for nodes, of_roots in zip(tree[:5], zip(*roots, strict=True), strict=True):
        nodes[leaves] = of_roots
    return tree


def _boxes(tree: BoxTree, bounds: FloatArray) -> FloatArray:
    """Return the (K, 2, d) boxes of the nodes."""
    boxes = np.repeat(bounds[np.newaxis], len(tree.axes), axis=0)
    for node in np.flatnonzero(tree.axes >= 0):  # children come after their parent
        axis, below, above = tree.axes[node], tree.children[node], tree.children[node] + 1
        boxes[below] = boxes[above] = boxes[node]
        boxes[below, 1, axis] = boxes[above, 0, axis] = tree.splits[node]
    return boxes


def _graft(branch: BoxTree, *whole: GrowingArray) -> list[Any]:
    """Add a branch to the arrays of a tree, but for its root: return that, to take the place of a leaf of the top."""
    nodes, images = whole[0].rows, whole[-1].rows
    moved = branch._replace(
        children=np.where(branch.axes >= 0, branch.children + nodes - 1, -1),
        starts=branch.starts + images,
        stops=branch.stops + images,
    )
    for each, part in zip(whole[:5], moved[:5], strict=True):
        each.append(part[1:])
    whole[-1].append(moved.images)
    return [part[0] for part in moved[:5]]
