"""The tree of boxes over the balls: its top in one thread, the branches side by side."""

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.resources.scratch import scratch_array
from o3dleaf.fitting.cover import ball_loops
from o3dleaf.fitting.cover.ball_loops import BoxTree
from o3dleaf.fitting.rbf.tail import IntArray

TOP_DEPTH = 6
"""Levels of the top: as many as 64 branches."""
MAX_DEPTH = 54
"""Levels of a branch: coinciding balls are not told apart by more."""


def build_tree(centers: FloatArray, radii: FloatArray, bounds: FloatArray) -> BoxTree:
    """Halve the box `bounds` (2, d) until few of the balls (M, d), (M,) reach into each part."""
    top: BoxTree = ball_loops.build_tree(centers, radii, bounds[0], bounds[1], np.arange(len(radii)), TOP_DEPTH)
    leaves, boxes = np.flatnonzero(top.axes < 0), _boxes(top, bounds)
    branches = [top] * len(leaves)

    def task(start: int, stop: int) -> None:
        for number in range(start, stop):
            leaf = leaves[number]
            low, high = boxes[leaf]
            candidates = top.images[top.starts[leaf] : top.stops[leaf]]
            branches[number] = ball_loops.build_tree(centers, radii, low, high, candidates, MAX_DEPTH)

    run_blocks(task, len(leaves), 1)
    return _grafted(top, leaves, branches)


def _boxes(tree: BoxTree, bounds: FloatArray) -> FloatArray:
    """Return the (K, 2, d) boxes of the nodes."""
    boxes = np.repeat(bounds[np.newaxis], len(tree.axes), axis=0)
    for node in np.flatnonzero(tree.axes >= 0):  # children come after their parent
        axis, below, above = tree.axes[node], tree.children[node], tree.children[node] + 1
        boxes[below] = boxes[above] = boxes[node]
        boxes[below, 1, axis] = boxes[above, 0, axis] = tree.splits[node]
    return boxes


def _grafted(top: BoxTree, leaves: IntArray, branches: list[BoxTree]) -> BoxTree:
    """Return the top with its leaves replaced: a branch's root takes the leaf's place, its other nodes are added.

    The list of branches is empty then: each of them is let go as soon as it is copied.
    """
    nodes, listed = len(top.axes), 0
    count = nodes + sum(len(branch.axes) - 1 for branch in branches)
    images = sum(len(branch.images) for branch in branches)
    whole = BoxTree(
        *(scratch_array((size,), part.dtype) for size, part in zip([count] * 5 + [images], top, strict=True))
    )
    for parts, part in zip(whole[:5], top[:5], strict=True):
        parts[:nodes] = part
    for leaf in leaves:
        branch = branches.pop(0)
        moved = branch._replace(
            children=np.where(branch.axes >= 0, branch.children + nodes - 1, -1),
            starts=branch.starts + listed,
            stops=branch.stops + listed,
        )
        last, ending = nodes + len(branch.axes) - 1, listed + len(branch.images)
        for parts, part in zip(whole[:5], moved[:5], strict=True):
            parts[leaf], parts[nodes:last] = part[0], part[1:]
        whole.images[listed:ending] = branch.images
        nodes, listed = last, ending
    return whole
