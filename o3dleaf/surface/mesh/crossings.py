"""Self-intersections: which triangles meet others in more than a common corner or edge, decided exactly."""

from functools import partial
from typing import Any

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.mesh.bvh_loops import (
    LEAF_SIZE,
    Tree,
    bound_leaves,
    bound_nodes,
    box_triangles,
    cross_between,
    cross_within,
    split_level,
    view_triangles,
)
from o3dleaf.surface.mesh.topology import IndexArray, index_type

DOUBLINGS = 6
"""Triangles of a class of size differ by up to this many doublings: more widen a tree, fewer make more trees."""

BLOCK = 2**12
"""Leaves or triangles that one thread looks up at a time."""


def find_crossings(vertices: FloatArray, triangles: IntArray, *, block: int = BLOCK) -> BoolArray:
    """Return the (m,) triangles that meet another one in a point outside the corner or edge that they share.

    A mesh without any is a simplicial complex, so embedded. Touching counts: a corner that lies exactly on another
    triangle, or an edge along another's. Corners in the same place are shared, whatever their numbers. Of two
    triangles that share an edge, those count that lie on each other; of two that share a corner, those that meet
    again elsewhere; two on the same three places count. Triangles whose corners lie in a line are left out: they
    are degenerate. Signs of determinants decide, exactly (`predicate_loops`), so that moves and turns of the
    mesh that are exact change nothing, nor does the order of anything.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    block : int
        Leaves or triangles that one thread looks up at a time; the result does not depend on it.
    """
    many, crosses = len(triangles), np.zeros(len(triangles), dtype=bool)
    view, size = np.empty(many, dtype=np.int8), np.empty(many, dtype=np.int16)
    run_blocks(lambda i, j: view_triangles(vertices, triangles, DOUBLINGS, i, j, view, size), many, LEAF_SIZE * block)
    size[view < 0] = np.iinfo(np.int16).min
    classes = [each for each in np.unique(size) if each > np.iinfo(np.int16).min]
    if not classes:
        return crosses
    origin = vertices[triangles[0, 0]].copy()
    trees: list[Tree] = []
    for each in classes:
        rows = np.flatnonzero(size == each).astype(index_type(many))
        trees.append(_build_tree(vertices, triangles, origin, rows))
        _search(vertices, triangles, view, origin, trees, crosses, block=block)
    return crosses


def _search(
    vertices: FloatArray,
    triangles: IntArray,
    view: Any,
    origin: FloatArray,
    trees: list[Tree],
    crosses: BoolArray,
    *,
    block: int,
) -> None:
    """Mark what the triangles of the last tree meet, in it and in those before it."""
    last = trees[-1]

    def within(start: int, stop: int) -> None:
        cross_within(vertices, triangles, view, last, start, stop, crosses)

    run_blocks(within, 1 << last.depth, max(1, block // LEAF_SIZE))
    for other in trees[:-1]:
        # The fewer are looked up. If they are the larger ones, they leave out what their planes and sides miss; if they
        # are the smaller ones, they meet no more boxes each than the larger ones met among themselves.
        few, many = sorted((last, other), key=lambda tree: len(tree.rows))
        # Boxes are rounded to 2⁻²⁴ of a coordinate.
        slack = float(np.abs([few.nodes[1], many.nodes[1]]).max()) * 2.0**-20

        def between(start: int, stop: int, few: Tree = few, many: Tree = many, slack: float = slack) -> None:
            cross_between(vertices, triangles, view, origin, slack, few, start, stop, many, crosses)

        run_blocks(between, len(few.rows), block)


def _build_tree(vertices: FloatArray, triangles: IntArray, origin: FloatArray, rows: IndexArray) -> Tree:
    """Return the tree over some triangles, split until a leaf holds `LEAF_SIZE` at most."""
    many = len(rows)
    depth = max(0, int(np.ceil(np.log2(many / LEAF_SIZE))))
    boxes, key = np.empty((many, 6), dtype=np.float32), np.empty(many, dtype=np.float32)
    run_blocks(lambda i, j: box_triangles(vertices, triangles, origin, rows, i, j, boxes), many, LEAF_SIZE * BLOCK)
    order = np.arange(many, dtype=rows.dtype)
    for level in range(depth):
        split = partial(split_level, boxes, order, key, level)
        run_blocks(split, 1 << level, max(1, 1 << level >> 6))
    rows, boxes = rows[order], boxes[order]
    nodes = np.empty((2 << depth, 6), dtype=np.float32)
    nodes[0] = 0
    run_blocks(lambda i, j: bound_leaves(boxes, depth, i, j, nodes), 1 << depth, BLOCK)
    bound_nodes(nodes)
    return Tree(rows, boxes, nodes, depth)
