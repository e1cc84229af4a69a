"""The tree of boxes over the balls: its top in one thread, the branches side by side."""

from typing import cast

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.pu import ball_loops
from o3dleaf.fitting.rbf.tail import IntArray

Tree = tuple[IntArray, FloatArray, IntArray, IntArray, IntArray, IntArray]
"""Of each node: split axis (−1: leaf), split position, first of its two children, start and stop of its list of
balls, all nodes' lists after one another."""

TOP_DEPTH = 6
"""Levels of the top: as many as 64 branches."""
MOST_DEPTH = 54
"""Levels of a branch: coinciding balls are not told apart by more."""


def build_tree(centres: FloatArray, radii: FloatArray, bounds: FloatArray) -> Tree:
    """Halve the box `bounds` (2, d) until few of the balls (M, d), (M,) reach into each part."""
    top = ball_loops.build_tree(centres, radii, bounds[0], bounds[1], np.arange(len(radii)), TOP_DEPTH)
    leaves, boxes = np.flatnonzero(top[0] < 0), _boxes(top, bounds)
    branches: list[Tree] = [top] * len(leaves)

    def task(start: int, stop: int) -> None:
        for number in range(start, stop):
            leaf = leaves[number]
            low, high = boxes[leaf]
            candidates = top[5][top[3][leaf] : top[4][leaf]]
            branches[number] = ball_loops.build_tree(centres, radii, low, high, candidates, MOST_DEPTH)

    run_blocks(task, len(leaves), 1)
    return _grafted(top, leaves, branches)


def _boxes(tree: Tree, bounds: FloatArray) -> FloatArray:
    """Return the (K, 2, d) boxes of the nodes."""
    axes, splits, children = tree[:3]
    boxes = np.repeat(bounds[np.newaxis], len(axes), axis=0)
    for node in np.flatnonzero(axes >= 0):  # children come after their parent
        below, above = children[node], children[node] + 1
        boxes[below] = boxes[above] = boxes[node]
        boxes[below, 1, axes[node]] = boxes[above, 0, axes[node]] = splits[node]
    return boxes


def _grafted(top: Tree, leaves: IntArray, branches: list[Tree]) -> Tree:
    """Return the top with its leaves replaced: a branch's root takes the leaf's place, its other nodes are added."""
    axes, splits, children, starts, stops = ([part.copy()] for part in top[:5])
    lists: list[IntArray] = []
    nodes, listed = len(top[0]), 0
    for leaf, branch in zip(leaves, branches, strict=True):
        moved = np.where(branch[0] >= 0, branch[2] + nodes - 1, -1), branch[3] + listed, branch[4] + listed
        for whole, part in zip((axes, splits, children, starts, stops), (*branch[:2], *moved), strict=True):
            whole[0][leaf] = part[0]
            whole.append(part[1:])
        lists.append(branch[5])
        nodes, listed = nodes + len(branch[0]) - 1, listed + len(branch[5])
    return cast(Tree, tuple(np.concatenate(parts) for parts in (axes, splits, children, starts, stops, lists)))
